//! Prints, for each kernel and CPU level, how much faster a member is stepped in a wide group than alone in a narrow one.
//!
//! A kernel whose lane loop is no longer turned into vector instructions stands out: its time in a wide group is that of scalar
//! code. Give a part of a name to see only the kernels that contain it.

use std::{env, time::Instant};

use stepwell_core::{
    error::Error,
    group::{Group, Width},
    isa::Level,
};
use stepwell_kernels::{Kernel, STEPS, kernels};

/// Nanoseconds per step of the whole group: the best of several runs.
fn nanoseconds(kernel: &Kernel, group: &mut dyn Group) -> f64 {
    let mut best = f64::INFINITY;
    for _ in 0..100 {
        let start = Instant::now();
        kernel.run(group);
        best = best.min(start.elapsed().as_secs_f64());
    }
    best * 1e9 / STEPS as f64
}

fn main() -> Result<(), Error> {
    let part = env::args().nth(1).unwrap_or_default();
    println!("{:<50} {:<9} {:>12} {:>12} {:>8}", "kernel", "level", "alone, ns", "wide, ns", "ratio");
    for kernel in kernels().iter().filter(|k| k.name().contains(&part)) {
        for level in Level::available() {
            let (Some(mut narrow), Some(mut wide)) = (kernel.group(level, Width::Narrow)?, kernel.group(level, Width::Wide)?)
            else {
                continue;
            };
            let alone = nanoseconds(kernel, narrow.as_mut());
            let member = nanoseconds(kernel, wide.as_mut()) / wide.lanes() as f64;
            println!("{:<50} {:<9} {alone:>12.2} {member:>12.3} {:>8.1}", kernel.name(), level.name(), alone / member);
        }
    }
    Ok(())
}
