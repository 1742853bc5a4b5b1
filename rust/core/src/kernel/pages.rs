//! Pages of machine code. All unsafe code of the kernels is in this file.
//!
//! A page is writable first and executable then, never both. A system may refuse to make it executable (hardened ones do); then there
//! is no kernel, and the interpreter is used.

use super::{Tile, check};
use crate::tape::split::Body;

/// What a kernel is called with: the start of each thing it may touch. The layout is known to the writers.
#[repr(C)]
struct Arguments {
    state: *mut f64,
    rows: *const f64,
    pool: *const f64,
    per_step: *const u64,
    held: *const f64,
    scratch: *mut f64,
    steps: u64,
    /// How the caller rounds, and how numbers are rounded here: to nearest, subnormal numbers as they are, no traps.
    rounding: [u32; 2],
}

/// The place of each argument, in bytes.
#[allow(missing_docs, reason = "they have the names of what is there")]
pub(super) mod place {
    use super::Arguments;
    use std::mem::offset_of;

    pub const STATE: i32 = offset_of!(Arguments, state) as i32;
    pub const ROWS: i32 = offset_of!(Arguments, rows) as i32;
    pub const POOL: i32 = offset_of!(Arguments, pool) as i32;
    pub const PER_STEP: i32 = offset_of!(Arguments, per_step) as i32;
    pub const HELD: i32 = offset_of!(Arguments, held) as i32;
    pub const SCRATCH: i32 = offset_of!(Arguments, scratch) as i32;
    pub const STEPS: i32 = offset_of!(Arguments, steps) as i32;
    pub const ROUNDING: i32 = offset_of!(Arguments, rounding) as i32;
}

/// The rounding that Rust and C start with.
const TO_NEAREST: u32 = 0x1F80;

/// What the code of a kernel may touch, in numbers.
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
    /// A pool that is read by whole vectors of so many numbers is copied to where no vector lies across two lines of the cache.
    pub aligned_pool: bool,
}

impl Frame {
    /// For a body. Of its operations only those that name places matter.
    pub fn new(body: &Body, lanes: usize) -> Frame {
        let ops = body.ops.iter().copied().filter(|op| matches!(op, crate::tape::Op::Held(_))).collect();
        Frame { body: Body { ops, ..body.clone() }, lanes, pool: 0, scratch: 0, aligned_pool: false }
    }
}

/// Code that can be run.
#[derive(Debug)]
pub struct Pages {
    map: memmap2::Mmap,
    frame: Frame,
}

impl Pages {
    /// Code that was written for a frame. It must not access anything outside the frame, and must return: the writers ensure that, and
    /// the tests check it. None if the system has no memory left or does not allow executable pages.
    pub(super) fn new(code: &[u8], frame: Frame) -> Option<Pages> {
        let mut map = memmap2::MmapMut::map_anon(code.len()).ok()?;
        map.copy_from_slice(code);
        Some(Pages { map: map.make_exec().ok()?, frame })
    }

    /// Whether the system allows executable pages, found by trying one.
    pub(super) fn allowed() -> bool {
        memmap2::MmapMut::map_anon(1).and_then(memmap2::MmapMut::make_exec).is_ok()
    }

    /// The code.
    pub fn code(&self) -> &[u8] {
        &self.map
    }

    /// What it may touch.
    pub fn frame(&self) -> &Frame {
        &self.frame
    }

    /// Runs it.
    ///
    /// # Panics
    ///
    /// If the tile is smaller than its frame says.
    #[allow(unsafe_code, reason = "calls what was written at run time")]
    pub fn run(&self, tile: &mut Tile, scratch: &mut Vec<f64>) {
        let frame = &self.frame;
        check(&frame.body, frame.lanes, tile);
        assert!(tile.pool.len() >= frame.pool, "pool");
        if tile.steps == 0 {
            return;
        }
        let copied = if frame.aligned_pool && !(tile.pool.as_ptr() as usize).is_multiple_of(32) { frame.pool } else { 0 };
        // The vector's start is a multiple of 8 bytes, so that at most 7 numbers are before the next multiple of 64.
        let enough = frame.scratch + copied + 7;
        if scratch.len() < enough {
            scratch.resize(enough, 0.0);
        }
        let start = (scratch.as_ptr() as usize).wrapping_neg() % 64 / 8;
        let (own, pool) = scratch[start..].split_at_mut(frame.scratch);
        pool[..copied].copy_from_slice(&tile.pool[..copied]);
        let mut arguments = Arguments {
            state: tile.state.as_mut_ptr(),
            rows: tile.rows.as_ptr(),
            pool: if copied > 0 { pool.as_ptr() } else { tile.pool.as_ptr() },
            per_step: tile.per_step.as_ptr(),
            held: tile.held.as_ptr(),
            scratch: own.as_mut_ptr(),
            steps: tile.steps as u64,
            rounding: [0, TO_NEAREST],
        };
        // SAFETY: the map holds a whole function of this signature from its first byte on, and stays until `self` is dropped. It
        // writes to the state, to `own` and to the first number of `rounding` only, and reads besides them the rows, the pool, the
        // table of the steps and the rows held that it names: inside what was asserted above. Nobody else uses the state or `own`
        // meanwhile, both are borrowed exclusively. It keeps the registers that its convention asks to keep.
        unsafe {
            let function: extern "sysv64" fn(*mut Arguments) = std::mem::transmute(self.map.as_ptr());
            function(&raw mut arguments);
        }
    }
}
