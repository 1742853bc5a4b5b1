//! The methods, one file each; `build.rs` lists the folder.
#![allow(missing_docs, reason = "each file documents its method in the record")]

include!(concat!(env!("OUT_DIR"), "/steppers.rs"));
