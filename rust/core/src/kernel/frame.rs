//! The arguments of a kernel's code, and the memory that it may access.

use crate::tape::split::Body;

/// The arguments of a kernel: the start of each memory area. The writers know this layout.
#[repr(C)]
pub(super) struct Arguments {
    pub state: *mut u8,
    pub rows: *const u8,
    pub pool: *const u8,
    pub per_step: *const u64,
    pub held: *const u8,
    pub scratch: *mut u8,
    pub steps: u64,
    /// How the caller rounds, and how numbers are rounded here: to nearest, subnormal numbers as they are, no traps.
    pub rounding: [u32; 2],
}

/// The place of each argument, in bytes.
#[allow(missing_docs, reason = "they have the names of what is there")]
pub(super) mod place {
    use super::Arguments;
    use std::mem::offset_of;

    pub(crate) const STATE: i32 = offset_of!(Arguments, state) as i32;
    pub(crate) const ROWS: i32 = offset_of!(Arguments, rows) as i32;
    pub(crate) const POOL: i32 = offset_of!(Arguments, pool) as i32;
    pub(crate) const PER_STEP: i32 = offset_of!(Arguments, per_step) as i32;
    pub(crate) const HELD: i32 = offset_of!(Arguments, held) as i32;
    pub(crate) const SCRATCH: i32 = offset_of!(Arguments, scratch) as i32;
    pub(crate) const STEPS: i32 = offset_of!(Arguments, steps) as i32;
    pub(crate) const ROUNDING: i32 = offset_of!(Arguments, rounding) as i32;
}

/// The memory that the code of a kernel may access, in numbers.
#[derive(Clone, Debug)]
pub struct Frame {
    /// The sizes of a tile, and which entries of the table of the steps are places of rows.
    pub body: Body,
    /// How long rows are.
    pub lanes: usize,
    /// The size of the pool.
    pub pool: usize,
    /// Size of the spill area, which begins at a multiple of 64 bytes.
    pub scratch: usize,
    /// Whether the pool is copied to where none of the vectors read from it lies across two lines of the cache.
    pub aligned_pool: bool,
}

impl Frame {
    /// The frame of a body. Of its operations only those that name places matter.
    pub(crate) fn new(body: &Body, lanes: usize) -> Frame {
        let ops = body.ops.iter().copied().filter(|op| matches!(op, crate::tape::Op::Held(_))).collect();
        Frame { body: Body { ops, ..body.clone() }, lanes, pool: 0, scratch: 0, aligned_pool: false }
    }
}
