//! The effects of a kernel on the process: pages, and where they are not to be had.

#![allow(unsafe_code, reason = "asks the system for what a test needs")]

use crate::{oscillator, written};
use std::{env, process::Command};
use stepwell_core::kernel::Kernel;

/// How numbers are rounded.
#[allow(deprecated, reason = "there is no other way to get it")]
fn rounding() -> u64 {
    // SAFETY: reads a register of this thread.
    #[cfg(target_arch = "x86_64")]
    unsafe {
        u64::from(std::arch::x86_64::_mm_getcsr())
    }
    // SAFETY: reads a register of this thread.
    #[cfg(target_arch = "aarch64")]
    unsafe {
        let bits;
        std::arch::asm!("mrs {}, fpcr", out(reg) bits);
        bits
    }
}

#[allow(deprecated, reason = "there is no other way to set it")]
fn set_rounding(bits: u64) {
    // SAFETY: the caller runs nothing that depends on it but what is tested.
    #[cfg(target_arch = "x86_64")]
    unsafe {
        std::arch::x86_64::_mm_setcsr(bits as u32);
    }
    // SAFETY: as above.
    #[cfg(target_arch = "aarch64")]
    unsafe {
        std::arch::asm!("msr fpcr, {}", in(reg) bits);
    }
}

/// Runs with rounding upwards and small numbers taken for zero, and tells how is rounded afterwards.
pub(crate) fn with_other_rounding<T>(f: impl FnOnce() -> T) -> (T, u64) {
    let before = rounding();
    set_rounding(before | crate::OTHER_ROUNDING);
    let made = f();
    let after = rounding();
    set_rounding(before);
    (made, after)
}

/// How many pieces of memory are executable, and how many of these writable, too.
#[cfg(target_os = "linux")]
fn executable() -> [usize; 2] {
    let maps = std::fs::read_to_string("/proc/self/maps").expect("maps");
    let rights =
        |wanted| maps.lines().filter(|line| line.split(' ').nth(1).is_some_and(|rights| rights.contains(wanted))).count();
    [rights("x"), rights("wx")]
}

#[cfg(windows)]
fn executable() -> [usize; 2] {
    const EXECUTABLE: u32 = 0xF0;
    const WRITABLE_TOO: u32 = 0xC0;
    let rights = windows::rights();
    [EXECUTABLE, WRITABLE_TOO].map(|wanted| rights.iter().filter(|rights| *rights & wanted != 0).count())
}

/// Other tests write kernels meanwhile, so this one has a process of its own, as the next.
#[cfg(any(target_os = "linux", windows))]
#[test]
fn pages_are_given_back_and_never_writable_and_executable() {
    if env::var_os("STEPWELL_TEST_PAGES").is_none() {
        return again("process::pages_are_given_back_and_never_writable_and_executable", "STEPWELL_TEST_PAGES");
    }
    let before = executable();
    for _ in 0..1000 {
        drop(written(&oscillator()));
    }
    assert_eq!(executable(), before);
    let kernels: Vec<_> = (0..20).map(|_| written(&oscillator())).collect();
    let [executable_now, writable_too] = executable();
    assert!(executable_now > before[0], "{} kernels are nowhere", kernels.len());
    assert_eq!(writable_too, before[1]);
    drop(kernels);
    assert_eq!(executable(), before);
}

/// Forbids this process to make pages executable; returns whether that has an effect.
#[cfg(target_os = "linux")]
fn forbid_code() -> bool {
    const PR_SET_MDWE: i32 = 65;
    const REFUSE_EXEC_GAIN: u64 = 1;
    // SAFETY: it takes rights from this process, which is there for this test only.
    unsafe { libc::prctl(PR_SET_MDWE, REFUSE_EXEC_GAIN, 0u64, 0u64, 0u64) == 0 }
}

#[cfg(windows)]
use windows::forbid_code;

#[cfg(any(target_os = "linux", windows))]
#[test]
fn where_pages_cannot_be_made_executable_there_is_no_kernel() {
    use stepwell_core::kernel::writer::{Shape, write};
    if env::var_os("STEPWELL_TEST_MDWE").is_none() {
        return again("process::where_pages_cannot_be_made_executable_there_is_no_kernel", "STEPWELL_TEST_MDWE");
    }
    let before = written(&oscillator());
    if !forbid_code() {
        println!("this system forbids no code: Linux before 6.3, and Wine 8.0, which says yes and does nothing");
        return;
    }
    let (level, width) = *crate::widths().last().expect("machine code");
    assert!(
        write(&oscillator(), Shape { level, bytes: 8, width, block_vectors: 1, interleaved: 1, blocks: 1, resident: true })
            .is_none()
    );
    // What was there before goes on.
    let inputs = crate::Inputs::<f64>::new(&mut crate::Random(1), &oscillator(), crate::Kernel::<f64>::lanes(&before), 3);
    inputs.run(&before, &mut Vec::new());
    println!("refused, as it should be");
}

/// After a fork both processes have the kernel.
#[cfg(target_os = "linux")]
#[test]
fn a_child_process_runs_the_kernels_of_its_parent() {
    let kernel = written(&oscillator());
    let inputs = crate::Inputs::<f64>::new(&mut crate::Random(2), &oscillator(), crate::Kernel::<f64>::lanes(&kernel), 100);
    let want = inputs.run(&kernel, &mut Vec::new());
    let (mut scratch, mut state) = (vec![0.0; 1000], inputs.state.clone());
    let pool = kernel.pool(&inputs.uniforms);
    // SAFETY: the child allocates nothing, runs the kernel and leaves.
    unsafe {
        let child = libc::fork();
        if child == 0 {
            let (rows, per_step, held) = (&inputs.rows[..], &inputs.per_step[..], &inputs.held[..]);
            let mut tile =
                stepwell_core::kernel::Tile { state: &mut state, rows, pool: &pool, steps: inputs.steps, per_step, held };
            kernel.run(&mut tile, &mut scratch);
            let same = state.iter().zip(&want).all(|(a, b)| crate::same(*a, *b));
            libc::_exit(if same { 0 } else { 1 });
        }
        let mut status = 0;
        assert_eq!(libc::waitpid(child, &raw mut status, 0), child);
        assert!(libc::WIFEXITED(status) && libc::WEXITSTATUS(status) == 0);
    }
}

/// Questions to Windows.
#[cfg(windows)]
mod windows {
    use std::ffi::c_void;

    /// MEMORY_BASIC_INFORMATION.
    #[repr(C)]
    #[derive(Default)]
    struct Region {
        start: usize,
        allocation: usize,
        first_rights: u32,
        partition: u16,
        size: usize,
        state: u32,
        rights: u32,
        kind: u32,
    }

    unsafe extern "system" {
        fn VirtualQuery(at: usize, region: *mut Region, size: usize) -> usize;
        fn VirtualAlloc(at: usize, size: usize, kind: u32, rights: u32) -> *mut c_void;
        fn SetProcessMitigationPolicy(policy: i32, flags: *const u32, size: usize) -> i32;
    }

    /// The rights of each piece of memory that is there.
    pub(super) fn rights() -> Vec<u32> {
        const COMMITTED: u32 = 0x1000;
        let (mut at, mut region, mut rights) = (0, Region::default(), Vec::new());
        // SAFETY: it writes the region, whose length it is given.
        while unsafe { VirtualQuery(at, &raw mut region, size_of::<Region>()) } != 0 {
            rights.extend((region.state == COMMITTED).then_some(region.rights));
            at = region.start + region.size;
        }
        rights
    }

    /// Forbids this process any code that comes from no file; returns whether that has an effect.
    pub(super) fn forbid_code() -> bool {
        const DYNAMIC_CODE: i32 = 2;
        const RESERVED_AND_COMMITTED: u32 = 0x3000;
        const ALL: u32 = 0x40;
        // SAFETY: it takes rights from this process, which is there for this test only, and then asks for one page.
        unsafe {
            SetProcessMitigationPolicy(DYNAMIC_CODE, &raw const PROHIBITED, 4) != 0
                && VirtualAlloc(0, 4096, RESERVED_AND_COMMITTED, ALL).is_null()
        }
    }

    static PROHIBITED: u32 = 1;
}

/// Windows keeps xmm6 to xmm15, rsi and rdi for the caller, and kernels use all of them: who calls a kernel saves them.
#[cfg(all(windows, target_arch = "x86_64"))]
#[test]
fn a_caller_on_windows_finds_its_registers_as_they_were() {
    use crate::{Inputs, Random, code, random};
    use std::arch::asm;

    extern "C" fn call(run: *mut &mut dyn FnMut()) {
        // SAFETY: it is what is passed below.
        unsafe { (*run)() }
    }
    let random = &mut Random(11);
    let body = random::body(random, 300, 20);
    let kernel = written(&body);
    let used = code::vectors(&kernel);
    assert!((6..16).all(|register| used.contains(&register)), "{used:?}");
    let inputs = Inputs::<f64>::new(random, &body, Kernel::<f64>::lanes(&kernel), 3);
    let mut run: &mut dyn FnMut() = &mut || drop(inputs.run(&kernel, &mut Vec::new()));
    let kept: [u64; 20] = std::array::from_fn(|i| 0x0123_4567_89AB_CDEF ^ (i as u64) << 8);
    let mut after = kept;
    let (mut rsi, mut rdi) = (3u64, 4u64);
    // SAFETY: a call as Windows asks for it, between loads and stores of `after`, whose address is in a register of the caller.
    unsafe {
        asm!(
            "movups xmm6, [r12]", "movups xmm7, [r12+16]", "movups xmm8, [r12+32]", "movups xmm9, [r12+48]",
            "movups xmm10, [r12+64]", "movups xmm11, [r12+80]", "movups xmm12, [r12+96]", "movups xmm13, [r12+112]",
            "movups xmm14, [r12+128]", "movups xmm15, [r12+144]",
            "sub rsp, 32", "call {call}", "add rsp, 32",
            "movups [r12], xmm6", "movups [r12+16], xmm7", "movups [r12+32], xmm8", "movups [r12+48], xmm9",
            "movups [r12+64], xmm10", "movups [r12+80], xmm11", "movups [r12+96], xmm12", "movups [r12+112], xmm13",
            "movups [r12+128], xmm14", "movups [r12+144], xmm15",
            call = sym call, in("r12") after.as_mut_ptr(), in("rcx") &raw mut run, inout("rsi") rsi, inout("rdi") rdi,
            out("xmm6") _, out("xmm7") _, out("xmm8") _, out("xmm9") _, out("xmm10") _, out("xmm11") _, out("xmm12") _,
            out("xmm13") _, out("xmm14") _, out("xmm15") _, clobber_abi("win64"),
        );
    }
    assert_eq!((after, rsi, rdi), (kept, 3, 4));
}

/// Runs one test in a process of its own.
fn again(test: &str, variable: &str) {
    let this = env::current_exe().expect("this program");
    let out = Command::new(this).args(["--exact", test, "--nocapture"]).env(variable, "1").output().expect("started");
    assert!(out.status.success(), "{}{}", String::from_utf8_lossy(&out.stdout), String::from_utf8_lossy(&out.stderr));
}
