//! Machine code for AArch64, with NEON: vectors of two numbers of 64 bits, or of four of 32.
//!
//! `instructions` selects them for operations, `encode` has their bytes.

#[allow(
    missing_docs,
    reason = "instructions and registers have the names of what they do; tests compare them with an assembler's"
)]
pub mod encode;
mod instructions;
