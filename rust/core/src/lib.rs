//! # stepwell-core

pub mod error;
pub mod functions;
pub mod isa;
pub mod kernel;
pub mod number;
pub mod tape;
