//! # stepwell-core
//!
//! Fixed and adaptive steps of very large batches of small systems, bit for bit the same on every CPU level, thread count and
//! batch. Folders are layers, and each imports only from those before it (`tests/layers.rs`):
//!
//! * [`tape`]: a step is written once, over any kind of number; run once with symbols, it becomes a tape.
//! * [`kernel`]: the tape becomes machine code, which makes many steps of a tile of members.
//! * [`model`]: a **system** is two blocks, velocities `v` and coordinates `y`, with an increment for each; a **method** is a
//!   record and a step, recorded as a program over blocks; controls, forces and surfaces are around a system.
//! * [`stage`]: a tape that was cut by how often its values change, ready to be run.
//! * [`step`]: a model and a method become tapes.
//! * [`group`]: members stepped together.
//! * [`large`]: systems whose step is too long for a tape.
//! * [`events`]: changes of sign of quantities between the states of steps.
//! * [`run`]: the driver divides a batch among groups and threads, saves states and finds members that diverged.

pub use stepwell_base::{aligned, bodies, functions, isa};

pub mod error;
pub mod events;
pub mod group;
pub mod kernel;
pub mod large;
pub mod model;
pub mod run;
pub mod stage;
pub mod step;
pub mod tape;
