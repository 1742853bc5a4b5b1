//! Run-time CPU dispatch. The `unsafe` code of the project is here, in `fused`, and in `memory` and `pages` of the kernels.
//!
//! A wheel is built for the oldest CPU of its platform. Loops that are not written at run time, such as those of the interpreter,
//! are therefore compiled once per CPU level, and the level is chosen when a run begins. No level contracts to FMA by itself or
//! reorders, so all give the same bits.

use std::{ffi::OsStr, fmt};

/// `STEPWELL_KERNELS` names a level that is unknown or that this machine does not have.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UnknownLevel {
    /// The name.
    pub name: String,
    /// The names of the levels that this machine has.
    pub known: String,
}

impl fmt::Display for UnknownLevel {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let UnknownLevel { name, known } = self;
        write!(f, "{KERNELS}={name:?} names no kernels of this machine; it has {known}")
    }
}

impl std::error::Error for UnknownLevel {}

/// Forces the kernels: `interpret`, or a level whose machine code is written.
const KERNELS: &str = "STEPWELL_KERNELS";

/// The instruction sets of hot loops, in ascending order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Level {
    /// The baseline of the platform (SSE2 on x86-64, NEON on AArch64), without machine code that is written at run time.
    Baseline,
    /// 128-bit vectors of AArch64, which every such CPU has.
    Neon,
    /// 256-bit vectors.
    Avx2,
    /// 512-bit vectors.
    Avx512,
}

/// A hot loop. `run` must be `#[inline(always)]`, all the way down, or it is compiled for the baseline.
pub trait Task {
    /// Runs the loop.
    fn run(self);
}

impl Level {
    /// Every level, ascending.
    pub const ALL: [Level; 4] = [Level::Baseline, Level::Neon, Level::Avx2, Level::Avx512];

    /// Its name, which `STEPWELL_KERNELS` takes.
    pub fn name(self) -> &'static str {
        match self {
            Level::Baseline => "interpret",
            Level::Neon => "neon",
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
            Level::Neon => false,
            // CPUs with the one have the other, except for a few models.
            Level::Avx2 => is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma"),
            Level::Avx512 => {
                is_x86_feature_detected!("avx512f")
                    && is_x86_feature_detected!("avx512vl")
                    && is_x86_feature_detected!("avx512dq")
                    && is_x86_feature_detected!("avx512bw")
            }
        }
    }

    /// Whether this machine has it. Every AArch64 has NEON.
    #[cfg(not(target_arch = "x86_64"))]
    pub fn here(self) -> bool {
        self == Level::Baseline || self == Level::Neon && cfg!(target_arch = "aarch64")
    }

    /// The level whose instructions the interpreter's own loops use: of `Baseline`, which says that no machine code is written,
    /// the best that this machine has.
    pub fn of_loops(self) -> Level {
        match self {
            Level::Baseline => Level::available().pop().unwrap_or(self),
            written => written,
        }
    }

    /// The levels that this machine has, ascending.
    pub fn available() -> Vec<Level> {
        Level::ALL.into_iter().filter(|l| l.here()).collect()
    }

    /// The level whose kernels `STEPWELL_KERNELS` names, or else the best of this machine.
    pub fn choose() -> Result<Level, UnknownLevel> {
        Level::named(std::env::var_os(KERNELS).as_deref())
    }

    /// The level of a name; without a name, or with an empty one, the best of this machine.
    pub fn named(name: Option<&OsStr>) -> Result<Level, UnknownLevel> {
        let available = Level::available();
        let Some(name) = name.filter(|name| !name.is_empty()) else {
            return Ok(available.last().copied().unwrap_or(Level::Baseline));
        };
        available.iter().copied().find(|level| name == level.name()).ok_or_else(|| {
            let known = available.iter().map(|level| level.name()).collect::<Vec<_>>().join(", ");
            UnknownLevel { name: name.to_string_lossy().into_owned(), known }
        })
    }
}

/// A level as a type, so that hot loops are compiled for it. A value is the proof that this machine has the level.
pub trait Isa: Copy + Send + Sync + 'static {
    /// Whether a fused multiply-add is an instruction.
    const FUSES: bool;
    /// The proof, if this machine has the level.
    fn detect() -> Option<Self>;
    /// Runs the task with the instructions of this level.
    fn run(self, task: impl Task);
}

/// The instruction set that every CPU of the platform has.
#[derive(Clone, Copy)]
pub struct Baseline;

impl Isa for Baseline {
    const FUSES: bool = cfg!(any(target_arch = "aarch64", target_feature = "fma"));

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
    #[target_feature(enable = "avx2,fma")]
    fn avx2(task: impl Task) {
        task.run();
    }

    #[inline(never)]
    #[target_feature(enable = "avx512f,avx512vl,avx512dq,avx512bw")]
    fn avx512(task: impl Task) {
        task.run();
    }

    impl Isa for Avx2 {
        const FUSES: bool = true;

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
        const FUSES: bool = true;

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
#[macro_export]
macro_rules! with_isa {
    ($level:expr, |$isa:ident| $make:expr) => {
        $crate::with_isa!($level, |$isa| $make, $make)
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
pub use with_isa;
