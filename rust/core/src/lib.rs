//! # stepwell-core

pub use stepwell_base::{functions, isa};

pub mod controls;
pub mod error;
pub mod kernel;
pub mod large;
pub mod method;
pub mod number;
pub mod pace;
pub mod program;
pub mod run;
pub mod signal;
pub mod spec;
pub mod system;
pub mod tableau;
pub mod tape;
pub mod trace;

/// The methods, one file each; `build.rs` lists the folder.
#[allow(missing_docs, reason = "each file documents its method in the record")]
pub mod steppers {
    include!(concat!(env!("OUT_DIR"), "/steppers.rs"));
}

/// The systems, one file each; `build.rs` lists the folder.
pub mod systems {
    include!(concat!(env!("OUT_DIR"), "/systems.rs"));
}
