//! Memory with code that can be run, as each system allows it.
//!
//! A system may refuse (hardened ones do): then there is no kernel, and the interpreter is used.

pub(super) use system::Executable;

/// Pages that are writable first and executable then, never both.
#[cfg(not(target_os = "macos"))]
mod system {
    use super::synchronise;

    #[derive(Debug)]
    pub(crate) struct Executable(memmap2::Mmap);

    impl Executable {
        /// A copy of the code. None if the system has no memory left or does not allow executable pages.
        pub(crate) fn new(code: &[u8]) -> Option<Executable> {
            let mut map = memmap2::MmapMut::map_anon(code.len()).ok()?;
            map.copy_from_slice(code);
            let map = map.make_exec().ok()?;
            synchronise(&map);
            Some(Executable(map))
        }

        pub(crate) fn code(&self) -> &[u8] {
            &self.0
        }
    }
}

/// Pages that were mapped for machine code, with `MAP_JIT`.
///
/// A process with the hardened runtime may write code only there, and only with the entitlement `allow-jit`: without it the
/// mapping is refused, and there is no kernel. Pages that become executable by `mprotect` are no second way: the system does not
/// refuse them, it kills the process when it runs them. On Apple silicon such pages are writable or executable, which each thread
/// chooses for itself, and a thread starts with executable ones. Source: Apple, "Porting just-in-time compilers to Apple
/// silicon".
#[cfg(target_os = "macos")]
#[allow(unsafe_code, reason = "maps pages for machine code")]
mod system {
    use super::synchronise;
    use std::{ptr, slice};

    #[derive(Debug)]
    pub(crate) struct Executable {
        start: *mut u8,
        length: usize,
    }

    // SAFETY: nothing writes to the pages once `new` has returned.
    unsafe impl Send for Executable {}
    // SAFETY: as above.
    unsafe impl Sync for Executable {}

    /// Lets this thread write to the pages, or run them.
    fn writable(writable: bool) {
        // On Intel the pages are both, and before macOS 11 there is no such function.
        #[cfg(target_arch = "aarch64")]
        // SAFETY: every Apple silicon has it. What else this thread could run from such pages is not run while they are writable.
        unsafe {
            libc::pthread_jit_write_protect_np(i32::from(!writable));
        }
        #[cfg(not(target_arch = "aarch64"))]
        let _ = writable;
    }

    impl Executable {
        /// A copy of the code. None if the system has no memory left or does not allow executable pages.
        pub(crate) fn new(code: &[u8]) -> Option<Executable> {
            let rights = libc::PROT_READ | libc::PROT_WRITE | libc::PROT_EXEC;
            let flags = libc::MAP_PRIVATE | libc::MAP_ANON | libc::MAP_JIT;
            // SAFETY: asks for new pages, as many as the code needs: the system rounds up, to 16 KiB on Apple silicon.
            let start = unsafe { libc::mmap(ptr::null_mut(), code.len(), rights, flags, -1, 0) };
            if start == libc::MAP_FAILED {
                return None;
            }
            let pages = Executable { start: start.cast(), length: code.len() };
            writable(true);
            // SAFETY: the pages are new, at least so long, and this thread may write to them.
            unsafe { ptr::copy_nonoverlapping(code.as_ptr(), pages.start, code.len()) };
            writable(false);
            synchronise(pages.code());
            Some(pages)
        }

        pub(crate) fn code(&self) -> &[u8] {
            // SAFETY: mapped in `new`, where all of it was written, and until `self` is dropped.
            unsafe { slice::from_raw_parts(self.start, self.length) }
        }
    }

    impl Drop for Executable {
        fn drop(&mut self) {
            // SAFETY: mapped in `new`, and no borrow of it is left. If it fails, the pages stay, which does no harm.
            unsafe { libc::munmap(self.start.cast(), self.length) };
        }
    }
}

/// Tells the CPU that there are new instructions: caches of data and of instructions need not know of each other.
#[cfg(not(target_arch = "aarch64"))]
fn synchronise(_code: &[u8]) {}

/// Tells the CPU that there are new instructions: its caches of data and of instructions do not know of each other.
#[cfg(all(target_arch = "aarch64", target_os = "macos"))]
#[allow(unsafe_code, reason = "caches have instructions of their own")]
fn synchronise(code: &[u8]) {
    unsafe extern "C" {
        fn sys_icache_invalidate(start: *const libc::c_void, length: usize);
    }
    // SAFETY: changes nothing but what is in which cache.
    unsafe { sys_icache_invalidate(code.as_ptr().cast(), code.len()) };
}

/// Tells the CPU that there are new instructions: its caches of data and of instructions do not know of each other.
#[cfg(all(target_arch = "aarch64", windows))]
#[allow(unsafe_code, reason = "caches have instructions of their own")]
fn synchronise(code: &[u8]) {
    use std::ffi::c_void;
    #[link(name = "kernel32")]
    unsafe extern "system" {
        fn GetCurrentProcess() -> *mut c_void;
        fn FlushInstructionCache(process: *mut c_void, start: *const c_void, length: usize) -> i32;
    }
    // SAFETY: changes nothing but what is in which cache.
    unsafe { FlushInstructionCache(GetCurrentProcess(), code.as_ptr().cast(), code.len()) };
}

/// Tells the CPU that there are new instructions: its caches of data and of instructions do not know of each other.
#[cfg(all(target_arch = "aarch64", not(any(target_os = "macos", windows))))]
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
