//! Systems whose step is too long for a tape: many bodies, long chains, large matrices.
//!
//! A step of them would be a tape of hundreds of thousands of operations. So the program of the method
//! ([`crate::model::program`]) is executed over blocks that are long rows ([`schedule`], `executor`), and calls the rates of the
//! system ([`rates::Rates`]). There are two kinds of these:
//!
//! - [`tapes`]: the rates are tapes of their own, over rows of lanes, a lane for each of several members.
//! - kernels written by hand, for one member at a time, whose numbers lie side by side: `bodies`, `chain`, `linear`,
//!   `springs`. [`hand_written`] says which system has which.
//!
//! Neither knows of the methods, and no method knows of them.

pub mod adaptive;
pub mod blocks;
mod bodies;
mod chain;
mod contact;
mod control;
pub(crate) mod executor;
pub(crate) mod force;
pub mod group;
pub mod hand_written;
mod inputs;
mod linear;
pub mod matrix;
mod panels;
pub mod rates;
pub mod schedule;
pub mod solving;
mod springs;
pub mod tapes;
