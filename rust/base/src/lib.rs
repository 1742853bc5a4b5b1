//! # stepwell-base
//!
//! The parts on which the core builds and which seldom change. They are a crate of their own so that a new method or system is
//! built in seconds: numbers and functions of them, CPU levels, and the forces of many bodies, a kernel that is compiled ahead of
//! time for each level, which takes a minute.

pub mod aligned;
pub mod bodies;
pub mod forces;
pub mod functions;
#[cfg(all(windows, target_env = "gnu"))]
mod fused;
pub mod isa;
pub mod massless;
pub mod number;
