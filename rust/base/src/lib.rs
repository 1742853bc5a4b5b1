//! # stepwell-base
//!
//! What the core is built on and what seldom changes, apart so that a new method or system is built in seconds: numbers and functions of
//! them, CPU levels, and the one kernel that is compiled ahead of time for each of them and takes a minute, the forces of many bodies.

pub mod aligned;
pub mod bodies;
pub mod forces;
pub mod functions;
pub mod isa;
pub mod number;
