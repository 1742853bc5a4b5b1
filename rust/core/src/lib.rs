//! # stepwell-core
//!
//! Fixed-step integration of very large batches of small systems, bit for bit the same on every CPU level, thread count and
//! batch. Four roles and no fifth:
//!
//! * a **system** ([`system::System`]) is two blocks, velocities `v` and coordinates `y`, with an increment for each;
//! * a **stepper** ([`stepper::Stepper`]) is a method: one file in `steppers/`, one record, one `step`;
//! * a **group** ([`group::Group`]) is a handful of members stepped together: lanes of a tile ([`tile`]) or rows ([`rows`]);
//! * the **driver** ([`batch`]) splits a batch into groups and threads, keeps what was asked for and finds who diverged.
//!
//! [`table::group`] turns the names of a system and a method into a group.

pub mod abreast;
pub mod adaptive;
pub mod batch;
pub mod block;
pub mod control;
pub mod crew;
pub mod error;
pub mod group;
pub mod isa;
pub mod log;
pub mod matrix;
pub mod pace;
pub mod panels;
pub mod rows;
pub mod signal;
pub mod stepper;
pub mod system;
pub mod table;
pub mod tableau;
pub mod tile;
pub mod trig;
pub mod world;

/// The methods, one file each; `build.rs` lists the folder.
#[allow(missing_docs, reason = "each file documents its method in the record")]
pub mod steppers {
    include!(concat!(env!("OUT_DIR"), "/steppers.rs"));
}

/// The systems, one file each; `build.rs` lists the folder.
pub mod systems {
    include!(concat!(env!("OUT_DIR"), "/systems.rs"));
}
