//! Machine code for x86-64, with AVX-512 or AVX2.
//!
//! [`instructions`] selects them for operations and says where their operands may be, [`encode`] has their bytes.

pub(super) mod encode;
mod instructions;
