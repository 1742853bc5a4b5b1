//! Pages of machine code. All unsafe code of the kernels is in this file.
//!
//! A page is writable first and executable then, never both. A system may refuse to make it executable (hardened ones do); then
//! there is no kernel, and the interpreter is used.

use super::{
    Tile, check,
    frame::{Arguments, Frame},
};
use crate::tape::real::Real;

/// The rounding that Rust and C start with.
const TO_NEAREST: u32 = 0x1F80;

/// How kernels are called.
#[cfg(target_arch = "x86_64")]
type Function = extern "sysv64" fn(*mut Arguments);
#[cfg(not(target_arch = "x86_64"))]
type Function = extern "C" fn(*mut Arguments);

/// Tells the CPU that there are new instructions: its caches of data and of instructions do not know of each other.
#[cfg(target_arch = "aarch64")]
#[allow(unsafe_code, reason = "caches have instructions of their own")]
fn synchronise(code: &[u8]) {
    use std::arch::asm;
    // SAFETY: these instructions are allowed to every program, and change nothing but what is in which cache.
    unsafe {
        let sizes: u64;
        asm!("mrs {}, ctr_el0", out(reg) sizes, options(nomem, nostack, preserves_flags));
        // The shortest lines that any cache has, each as a power of two in words of four bytes.
        let lines = |power: u64| {
            (code.as_ptr_range().start as usize & !((4 << power) - 1)..code.as_ptr_range().end as usize).step_by(4 << power)
        };
        for line in lines(sizes >> 16 & 15) {
            asm!("dc cvau, {}", in(reg) line, options(nostack, preserves_flags));
        }
        asm!("dsb ish", options(nostack, preserves_flags));
        for line in lines(sizes & 15) {
            asm!("ic ivau, {}", in(reg) line, options(nostack, preserves_flags));
        }
        asm!("dsb ish", "isb", options(nostack, preserves_flags));
    }
}

/// Code that can be run.
#[derive(Debug)]
pub(crate) struct Pages {
    map: memmap2::Mmap,
    frame: Frame,
}

impl Pages {
    /// Code that was written for a frame, for this CPU. It must not access anything outside the frame, and must return: the
    /// writers ensure that, and the tests check it. None if the system has no memory left or does not allow executable pages.
    pub(super) fn new(code: &[u8], frame: Frame) -> Option<Pages> {
        let mut map = memmap2::MmapMut::map_anon(code.len()).ok()?;
        map.copy_from_slice(code);
        let map = map.make_exec().ok()?;
        #[cfg(target_arch = "aarch64")]
        synchronise(&map);
        Some(Pages { map, frame })
    }

    /// Whether the system allows executable pages, found by trying one.
    pub(super) fn allowed() -> bool {
        memmap2::MmapMut::map_anon(1).and_then(memmap2::MmapMut::make_exec).is_ok()
    }

    /// The code.
    pub(crate) fn code(&self) -> &[u8] {
        &self.map
    }

    /// What it may touch.
    pub(crate) fn frame(&self) -> &Frame {
        &self.frame
    }

    /// Runs it.
    ///
    /// # Panics
    ///
    /// If the tile is smaller than its frame says.
    #[allow(unsafe_code, reason = "calls what was written at run time")]
    pub(crate) fn run<T: Real>(&self, tile: &mut Tile<T>, scratch: &mut Vec<T>) {
        let frame = &self.frame;
        check(&frame.body, frame.lanes, tile);
        assert!(tile.pool.len() >= frame.pool, "pool");
        if tile.steps == 0 {
            return;
        }
        let copied = if frame.aligned_pool && !(tile.pool.as_ptr() as usize).is_multiple_of(32) { frame.pool } else { 0 };
        // The vector's start is a multiple of a number's size, so that fewer numbers than 64 bytes have are before the next
        // multiple of 64.
        let enough = frame.scratch + copied + 64 / size_of::<T>() - 1;
        if scratch.len() < enough {
            scratch.resize(enough, T::default());
        }
        let start = (scratch.as_ptr() as usize).wrapping_neg() % 64 / size_of::<T>();
        let (own, pool) = scratch[start..].split_at_mut(frame.scratch);
        pool[..copied].copy_from_slice(&tile.pool[..copied]);
        let mut arguments = Arguments {
            state: tile.state.as_mut_ptr().cast(),
            rows: tile.rows.as_ptr().cast(),
            pool: if copied > 0 { pool.as_ptr().cast() } else { tile.pool.as_ptr().cast() },
            per_step: tile.per_step.as_ptr(),
            held: tile.held.as_ptr().cast(),
            scratch: own.as_mut_ptr().cast(),
            steps: tile.steps as u64,
            rounding: [0, TO_NEAREST],
        };
        // SAFETY: the map holds a whole function of this signature from its first byte on, and stays until `self` is dropped. It
        // writes to the state, to `own` and to the first number of `rounding` only, and reads besides them the rows, the pool,
        // the table of the steps and the rows held that it names: inside what was asserted above. Nobody else uses the state or
        // `own` meanwhile, both are borrowed exclusively. It keeps the registers that its convention asks to keep.
        unsafe {
            let function: Function = std::mem::transmute(self.map.as_ptr());
            function(&raw mut arguments);
        }
    }
}
