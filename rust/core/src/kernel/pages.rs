//! Kernels in memory, and their call. All unsafe code of the kernels is in this file and in `memory`.

use super::{
    Tile, check,
    frame::{Arguments, Frame},
    memory::Executable,
};
use crate::tape::real::Real;

/// The rounding that Rust and C start with.
const TO_NEAREST: u32 = 0x1F80;

/// How kernels are called. On x86-64 as Unix calls, on Windows, too: the code is the same everywhere, and the compiler saves what
/// only Windows wants kept (xmm6 to xmm15, rsi, rdi) where it calls a kernel.
#[cfg(target_arch = "x86_64")]
type Function = extern "sysv64" fn(*mut Arguments);
#[cfg(not(target_arch = "x86_64"))]
type Function = extern "C" fn(*mut Arguments);

/// Code that can be run.
#[derive(Debug)]
pub(crate) struct Pages {
    memory: Executable,
    frame: Frame,
}

impl Pages {
    /// Code that was written for a frame, for this CPU. It must not access anything outside the frame, and must return: the
    /// writers ensure that, and the tests check it. None if the system has no memory left or does not allow executable pages.
    pub(super) fn new(code: &[u8], frame: Frame) -> Option<Pages> {
        Some(Pages { memory: Executable::new(code)?, frame })
    }

    /// Whether the system allows executable pages, found by trying one.
    pub(super) fn allowed() -> bool {
        Executable::new(&[0]).is_some()
    }

    /// The code.
    pub(crate) fn code(&self) -> &[u8] {
        self.memory.code()
    }

    /// The memory that the code may access.
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
        // SAFETY: the memory holds a whole function of this signature from its first byte on, and stays until `self` is dropped.
        // It writes to the state, to `own` and to the first number of `rounding` only, and reads besides them the rows, the pool,
        // the table of the steps and the rows held that it names: inside what was asserted above. Nobody else uses the state or
        // `own` meanwhile, both are borrowed exclusively. It keeps the registers that its convention asks to keep.
        unsafe {
            let function: Function = std::mem::transmute(self.memory.code().as_ptr());
            function(&raw mut arguments);
        }
    }
}
