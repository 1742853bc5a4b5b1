//! Machine code for AArch64, on any machine: its words against an assembler's, and what it computes, under an emulator, against
//! the interpreter, bit for bit.
//!
//! On a machine with an AArch64, `tests/kernels` does the same as for all CPUs.
#![allow(clippy::unwrap_used, reason = "a test that fails may panic")]

mod emulated;
#[path = "../kernels/inputs.rs"]
mod inputs;
mod listing;
mod mistakes;
#[path = "../kernels/random.rs"]
mod random;
mod words;

use std::{io::Write, process::Command};

/// Whether there is such a program.
fn has(program: &str) -> bool {
    Command::new(program).arg("--version").output().is_ok_and(|out| out.status.success())
}

/// Says why a test is skipped, even if it passes.
#[allow(clippy::explicit_write, reason = "what `eprintln` writes would be captured")]
fn skipped(why: &str) {
    writeln!(std::io::stderr(), "skipped: {why}").unwrap();
}
