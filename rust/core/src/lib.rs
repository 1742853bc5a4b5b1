//! # stepwell-core
//!
//! Fixed and adaptive steps of very large batches of small systems, bit for bit the same on every CPU level, thread count and batch. A step
//! is written once, over any kind of number ([`number`]); run once with symbols, it becomes a tape ([`tape`]), and the tape becomes
//! machine code ([`kernel`]).
//!
//! * a **system** ([`system::System`], `systems/`) is two blocks, velocities `v` and coordinates `y`, with an increment for each;
//! * a **method** ([`method::Record`], `steppers/`) is a record and a step, recorded as a [`program`] over blocks;
//! * a **kernel** ([`kernel::Kernel`]) makes many steps of a tile of members;
//! * the **driver** ([`run`]) divides a batch among tiles and threads, saves states and finds members that diverged.
//!
//! [`trace`] goes from names to tapes; [`large`] steps systems whose step is too long for a tape.

pub use stepwell_base::{bodies, functions, isa};

pub mod contact;
pub mod controls;
pub mod elimination;
pub mod error;
pub mod kernel;
pub mod large;
pub mod method;
pub mod number;
pub mod pace;
pub mod program;
pub mod real;
pub mod run;
pub mod series;
pub mod series_pace;
pub mod signal;
pub mod spec;
pub mod system;
pub mod tableau;
pub mod tape;
pub mod trace;
pub mod watch;
pub mod window;

/// The methods, one file each; `build.rs` lists the folder.
#[allow(missing_docs, reason = "each file documents its method in the record")]
pub mod steppers {
    include!(concat!(env!("OUT_DIR"), "/steppers.rs"));
}

/// The systems, one file each; `build.rs` lists the folder.
pub mod systems {
    include!(concat!(env!("OUT_DIR"), "/systems.rs"));
}
