//! Run-time CPU dispatch, and the only `unsafe` of the project.
//!
//! A wheel is built for the oldest CPU of its platform. Each hot loop is therefore compiled once per CPU level, and the best
//! level that the machine has is chosen when a run begins. No level contracts to FMA or reorders, so all give the same bits.

use crate::error::Error;

/// What the hot loop may use, in ascending order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Level {
    /// What every CPU of the platform has (SSE2 on x86-64, NEON on AArch64).
    Baseline,
    /// 256-bit vectors.
    Avx2,
    /// 512-bit vectors.
    Avx512,
}

/// A hot loop. `run` must be `#[inline(always)]`, all the way down, or it is compiled for the baseline.
pub trait Task {
    /// Does it.
    fn run(self);
}

impl Level {
    /// Every level, ascending.
    pub const ALL: [Level; 3] = [Level::Baseline, Level::Avx2, Level::Avx512];

    /// The name that `STEPWELL_ISA` takes.
    pub fn name(self) -> &'static str {
        match self {
            Level::Baseline => "baseline",
            Level::Avx2 => "avx2",
            Level::Avx512 => "avx512",
        }
    }

    /// Whether this machine has it.
    #[cfg(target_arch = "x86_64")]
    #[inline]
    pub fn here(self) -> bool {
        match self {
            Level::Baseline => true,
            Level::Avx2 => is_x86_feature_detected!("avx2"),
            Level::Avx512 => {
                is_x86_feature_detected!("avx512f")
                    && is_x86_feature_detected!("avx512vl")
                    && is_x86_feature_detected!("avx512dq")
                    && is_x86_feature_detected!("avx512bw")
            }
        }
    }

    /// Whether this machine has it.
    #[cfg(not(target_arch = "x86_64"))]
    pub fn here(self) -> bool {
        self == Level::Baseline
    }

    /// The levels that this machine has, ascending.
    pub fn available() -> Vec<Level> {
        Level::ALL.into_iter().filter(|l| l.here()).collect()
    }

    /// The level that `STEPWELL_ISA` forces, or else the best that this machine has.
    pub fn choose() -> Result<Level, Error> {
        let available = Level::available();
        let best = available.last().copied().unwrap_or(Level::Baseline);
        let Some(given) = std::env::var_os("STEPWELL_ISA").filter(|v| !v.is_empty()) else {
            return Ok(best);
        };
        let wanted = available.iter().copied().find(|l| given == l.name());
        wanted.ok_or_else(|| Error::Isa {
            given: given.to_string_lossy().into_owned(),
            known: available.iter().map(|l| l.name()).collect::<Vec<_>>().join(", "),
        })
    }
}

/// A level as a type, so that hot loops are compiled for it. A value is the proof that this machine has the level.
pub trait Isa: Copy + Send + Sync + 'static {
    /// The proof, if this machine has the level.
    fn detect() -> Option<Self>;
    /// Runs the task with the instructions of this level.
    fn run(self, task: impl Task);
}

/// What every CPU of the platform has.
#[derive(Clone, Copy)]
pub struct Baseline;

impl Isa for Baseline {
    fn detect() -> Option<Self> {
        Some(Baseline)
    }

    #[inline]
    fn run(self, task: impl Task) {
        baseline(task);
    }
}

/// Never inlined: a hot loop stands once in the core, not once for each place that may run it.
#[inline(never)]
fn baseline(task: impl Task) {
    task.run();
}

#[cfg(target_arch = "x86_64")]
mod x86 {
    use super::{Isa, Level, Task};

    /// 256-bit vectors.
    #[derive(Clone, Copy)]
    pub struct Avx2(());
    /// 512-bit vectors.
    #[derive(Clone, Copy)]
    pub struct Avx512(());

    #[inline(never)]
    #[target_feature(enable = "avx2")]
    fn avx2(task: impl Task) {
        task.run();
    }

    #[inline(never)]
    #[target_feature(enable = "avx512f,avx512vl,avx512dq,avx512bw")]
    fn avx512(task: impl Task) {
        task.run();
    }

    impl Isa for Avx2 {
        #[inline]
        fn detect() -> Option<Self> {
            Level::Avx2.here().then_some(Avx2(()))
        }

        #[inline]
        #[allow(unsafe_code, reason = "calls a function that is compiled for more than the baseline")]
        fn run(self, task: impl Task) {
            // SAFETY: `self` can be made by `detect` only, so this machine has AVX2.
            unsafe { avx2(task) }
        }
    }

    impl Isa for Avx512 {
        #[inline]
        fn detect() -> Option<Self> {
            Level::Avx512.here().then_some(Avx512(()))
        }

        #[inline]
        #[allow(unsafe_code, reason = "calls a function that is compiled for more than the baseline")]
        fn run(self, task: impl Task) {
            // SAFETY: `self` can be made by `detect` only, so this machine has AVX-512 F, VL, DQ and BW.
            unsafe { avx512(task) }
        }
    }
}

#[cfg(target_arch = "x86_64")]
pub use x86::{Avx2, Avx512};
#[cfg(not(target_arch = "x86_64"))]
pub use {Baseline as Avx2, Baseline as Avx512};

/// Makes something with the proof of a level: one expression for AVX-512 and one below it, or one for all.
macro_rules! with_isa {
    ($level:expr, |$isa:ident| $make:expr) => {
        $crate::isa::with_isa!($level, |$isa| $make, $make)
    };
    ($level:expr, |$isa:ident| $wide:expr, $below:expr) => {{
        use $crate::isa::{Avx2, Avx512, Baseline, Isa, Level};
        if $level == Level::Avx512
            && let Some($isa) = Avx512::detect()
        {
            $wide
        } else if $level == Level::Avx2
            && let Some($isa) = Avx2::detect()
        {
            $below
        } else {
            let $isa = Baseline;
            $below
        }
    }};
}
pub(crate) use with_isa;
