//! Every kernel at the machine's best CPU level (or the one that `STEPWELL_ISA` names), wide and narrow, in member-steps.
//!
//! `cargo bench -p stepwell-kernels -- 'canonical/false_euler'` times those whose name contains the words.

use std::time::Duration;

use criterion::{Criterion, Throughput};
use stepwell_core::{error::Error, group::Width, isa::Level};
use stepwell_kernels::{STEPS, kernels};

fn main() -> Result<(), Error> {
    let level = Level::choose()?;
    let mut criterion = Criterion::default()
        .warm_up_time(Duration::from_millis(50))
        .measurement_time(Duration::from_millis(200))
        .sample_size(20)
        .without_plots()
        .configure_from_args();
    for kernel in kernels() {
        for (width, name) in [(Width::Wide, "wide"), (Width::Narrow, "narrow")] {
            let Some(mut group) = kernel.group(level, width)? else { continue };
            let mut bench = criterion.benchmark_group(format!("{}/{}", kernel.name(), level.name()));
            bench.throughput(Throughput::Elements(group.lanes() as u64 * STEPS as u64));
            bench.bench_function(name, |b| b.iter(|| kernel.run(group.as_mut())));
            bench.finish();
        }
    }
    criterion.final_summary();
    Ok(())
}
