//! What a kernel does to the process: pages, and where they are not to be had.

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

#[cfg(target_os = "linux")]
fn executable_mappings() -> usize {
    let maps = std::fs::read_to_string("/proc/self/maps").expect("maps");
    maps.lines().filter(|line| line.split_whitespace().nth(1).is_some_and(|rights| rights.contains('x'))).count()
}

#[cfg(target_os = "linux")]
fn writable_and_executable_mappings() -> usize {
    let maps = std::fs::read_to_string("/proc/self/maps").expect("maps");
    maps.lines().filter(|line| line.split_whitespace().nth(1).is_some_and(|rights| rights.contains("wx"))).count()
}

/// Other tests write kernels meanwhile, so this one has a process of its own, as the next.
#[cfg(target_os = "linux")]
#[test]
fn pages_are_given_back_and_never_writable_and_executable() {
    if env::var_os("STEPWELL_TEST_PAGES").is_none() {
        return again("process::pages_are_given_back_and_never_writable_and_executable", "STEPWELL_TEST_PAGES");
    }
    let before = executable_mappings();
    for _ in 0..1000 {
        drop(written(&oscillator()));
    }
    assert_eq!(executable_mappings(), before);
    let kernels: Vec<_> = (0..20).map(|_| written(&oscillator())).collect();
    assert!(executable_mappings() > before, "{} kernels are nowhere", kernels.len());
    assert_eq!(writable_and_executable_mappings(), 0);
    drop(kernels);
    assert_eq!(executable_mappings(), before);
}

#[cfg(target_os = "linux")]
#[test]
fn where_pages_cannot_be_made_executable_there_is_no_kernel() {
    use stepwell_core::kernel::writer::{Shape, write};
    if env::var_os("STEPWELL_TEST_MDWE").is_none() {
        return again("process::where_pages_cannot_be_made_executable_there_is_no_kernel", "STEPWELL_TEST_MDWE");
    }
    let before = written(&oscillator());
    const PR_SET_MDWE: i32 = 65;
    const REFUSE_EXEC_GAIN: u64 = 1;
    // SAFETY: it takes rights from this process, which is there for this test only.
    if unsafe { libc::prctl(PR_SET_MDWE, REFUSE_EXEC_GAIN, 0u64, 0u64, 0u64) } != 0 {
        println!("this system has no PR_SET_MDWE");
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

/// Runs one test in a process of its own.
fn again(test: &str, variable: &str) {
    let this = env::current_exe().expect("this program");
    let out = Command::new(this).args(["--exact", test, "--nocapture"]).env(variable, "1").output().expect("started");
    assert!(out.status.success(), "{}{}", String::from_utf8_lossy(&out.stdout), String::from_utf8_lossy(&out.stderr));
}
