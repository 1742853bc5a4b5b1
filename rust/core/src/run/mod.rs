//! The driver: shares members among threads, saves states, finds divergence. It does not depend on the systems that it steps.

pub use stepwell_base::aligned;
pub mod adaptive;
pub mod batch;
pub mod chosen;
mod columns;
pub mod compiled;
pub mod group;
pub mod stage;
pub mod workers;
pub mod world;

use std::{
    sync::{Arc, OnceLock},
    thread,
};

use self::{
    adaptive::{AdaptiveBatch, AdaptiveLanes, NO_CLOCK},
    group::{Group, Lanes},
    stage::Clock,
};
use crate::{
    controls,
    error::Error,
    isa::Level,
    large::{
        self, Asked, Long, MAX_TAPE_OPERATIONS, Rates,
        adaptive::LargeAdaptive,
        group::LargeGroup,
        matrix::Matrix,
        tapes::{self, TapeRates},
    },
    real::Precision,
    spec::Spec,
    system,
    trace::{BEGINS, How, Scene, Traceable, Traced},
};

/// The system to step and the way to step it.
#[derive(Clone, Debug)]
pub struct Model<'a> {
    /// The system with its numbers.
    pub spec: Spec<'a>,
    /// What its tapes are made for.
    pub scene: Scene,
}

/// What hot loops may use.
#[derive(Clone, Copy, Debug)]
pub struct Machine {
    /// Which kernels.
    pub level: Level,
    /// How many threads the forces of one large system may use; zero for as many as there are.
    pub threads: usize,
}

impl Machine {
    /// How many threads to use for work that can be divided into so many parts, if more than one are worthwhile.
    pub fn threads_for(self, parts: usize, worthwhile: bool) -> usize {
        /// The operating system reads files to tell it, which takes as long as a short run, so it is asked once.
        static AVAILABLE: OnceLock<usize> = OnceLock::new();
        let threads = match self.threads {
            0 if !worthwhile || parts <= 1 => 1,
            0 => *AVAILABLE.get_or_init(|| thread::available_parallelism().map_or(1, usize::from)),
            given => given,
        };
        threads.min(parts).max(1)
    }
}

impl Model<'_> {
    /// An error if there is no memory for what so many threads keep of a system beside the results. This is checked before the run,
    /// because an allocation that fails in the middle would abort the process.
    pub fn room(&self, shape: system::Shape, threads: usize) -> Result<(), Error> {
        let samples = self.spec.tables.iter().map(|table| table.samples.len()).sum::<usize>();
        let given = (self.spec.rows.len() + samples).saturating_mul(BYTES_PER_PARAMETER);
        let bytes = (shape.v + shape.y).saturating_mul(BYTES_PER_NUMBER).saturating_add(given).saturating_mul(threads);
        let has_room = bytes < UNCHECKED_BYTES || Vec::<u8>::new().try_reserve_exact(bytes).is_ok();
        if has_room { Ok(()) } else { Err(Error::Memory { bytes }) }
    }

    /// Its tapes.
    pub fn traced(&self) -> Result<Arc<Traced>, Error> {
        self.scene.traced()
    }

    /// How so many members are stepped, if `steps` steps of members are to be made in all.
    fn way(&self, traced: &Traced, machine: Machine, members: usize, steps: f64) -> Way {
        let (rates, step) = traced.operations;
        let single = members == 1;
        // Operations are fused on the tape of the whole step, friction needs the state at its start, and only there have members times of
        // their own.
        let own_times = self.scene.given.count(BEGINS) > 0;
        let is_single = self.scene.precision == Precision::Single;
        let is_given = matches!(self.scene.how, How::Step(_));
        let as_one = is_single || own_times || self.scene.fused || traced.series || is_given;
        if as_one || controls::friction::is_given(&self.scene.given) {
            return Way::Tape;
        }
        if let How::Matrix { .. } = &self.scene.how {
            // Kernels for one member fill whole vectors with it, so a few members one by one are as fast as a vector of them.
            return if rates >= if members <= MAX_SEQUENTIAL_MEMBERS { SINGLE_MATRIX_OPERATIONS } else { MATRIX_OPERATIONS } {
                Way::Matrix
            } else {
                Way::Tape
            };
        }
        let long = system::kind(&self.scene.given.system).and_then(|kind| kind.long);
        let large = step > MAX_TAPE_OPERATIONS;
        // Tapes of rates must first be traced and compiled, which takes time, unless that was done before.
        let pays = || steps * (step / rates.max(1)) as f64 > (MIN_EVALUATIONS_PER_OPERATION * rates) as f64 || traced.is_rated();
        let is_long = |long: Long| rates >= long.from.0 || step >= long.from.1;
        match long {
            Some(long) if single && is_long(long) => Way::Long(long),
            Some(long)
                if large && (rates >= long.from_batch || members <= MAX_SEQUENTIAL_MEMBERS && is_long(long) || !pays()) =>
            {
                Way::Long(long)
            }
            _ if large => Way::Rates(if single { 1 } else { tapes::lanes(machine.level) }),
            _ => Way::Tape,
        }
    }

    /// How many members a group steps together in a run of so many, and of so many steps of members in all.
    pub fn lanes<T: Traceable>(&self, traced: &Traced, machine: Machine, members: usize, steps: f64) -> Result<usize, Error> {
        Ok(match self.way(traced, machine, members, steps) {
            Way::Tape => traced.tapes_of::<T>()?.step.kit(machine.level, members).runner.lanes(),
            Way::Rates(lanes) => lanes,
            Way::Long(_) | Way::Matrix => 1,
        })
    }

    fn asked(&self, traced: &Traced, machine: Machine, h: f64) -> Asked<'_> {
        let attempts = matches!(self.scene.how, How::Attempts { .. });
        Asked { given: &self.scene.given, shape: traced.shape, record: &self.scene.record, machine, h, attempts }
    }

    /// A group that steps it, in a run of so many members and of so many steps of members in all.
    pub fn group(
        &self,
        traced: &Traced,
        machine: Machine,
        members: usize,
        clock: &Clock,
        steps: f64,
    ) -> Result<Box<dyn Group>, Error> {
        let (spec, shape, level) = (&self.spec, traced.shape, machine.level);
        let rates: Box<dyn Rates> = match self.way(traced, machine, members, steps) {
            Way::Tape => return Ok(Box::new(Lanes::new(traced, spec, level, members, clock)?)),
            Way::Matrix => return Ok(Box::new(Matrix::new(spec, shape, &self.scene.how, level, clock))),
            Way::Long(long) => large::single(long, &self.asked(traced, machine, clock.h)),
            Way::Rates(lanes) => Box::new(TapeRates::new(traced.rated()?, spec, level, lanes, clock)),
        };
        let courses = traced.courses(rates.facts())?;
        Ok(Box::new(LargeGroup::new(courses, rates, shape, traced.recorded, level, clock)))
    }

    /// A batch of members with adaptive steps.
    pub fn adaptive(
        &self,
        traced: &Traced,
        machine: Machine,
        members: usize,
        budget: f64,
    ) -> Result<Box<dyn AdaptiveBatch>, Error> {
        let (spec, level) = (&self.spec, machine.level);
        let given = &self.scene.given;
        let rates: Box<dyn Rates> = match self.way(traced, machine, members, 0.0) {
            Way::Tape | Way::Matrix => return Ok(Box::new(AdaptiveLanes::new(traced, spec, level, members, budget)?)),
            // Tapes of rates are scaled to a step of 1, and what a control pushes depends on the step.
            _ if given.equations.as_ref().is_some_and(|equations| equations.reads_step()) => return Err(Error::ControlTooLong),
            Way::Rates(_) if controls::pushes(given) => match system::kind(&given.system).and_then(|kind| kind.long) {
                Some(long) => large::single(long, &self.asked(traced, machine, NO_CLOCK.h)),
                None => return Err(Error::ControlTooLong),
            },
            // Rates are asked for at one time, so a large member goes alone.
            way => match (way, self.way(traced, machine, 1, 0.0)) {
                (Way::Long(long), _) | (_, Way::Long(long)) => large::single(long, &self.asked(traced, machine, NO_CLOCK.h)),
                _ => Box::new(TapeRates::new(traced.rated()?, spec, level, 1, &NO_CLOCK)),
            },
        };
        let courses = traced.courses(rates.facts())?;
        Ok(Box::new(LargeAdaptive::new(courses, rates, traced, level, budget)?))
    }
}

/// The most bytes that a thread keeps for each number of a state, including the stages of DOP853.
const BYTES_PER_NUMBER: usize = 160;
/// The most bytes that a thread keeps for each parameter or sample.
const BYTES_PER_PARAMETER: usize = 32;
/// Less memory than this is not checked.
const UNCHECKED_BYTES: usize = 1 << 24;

/// How a group is stepped.
#[derive(Clone, Copy)]
enum Way {
    /// One tape for the whole step.
    Tape,
    /// Tapes for the rates, with so many lanes.
    Rates(usize),
    /// A kernel that is written by hand, for a single member.
    Long(Long),
    /// A large matrix.
    Matrix,
}

/// Operations of the matrix form from which on a hand-written kernel is faster than a tape, for a single member.
const SINGLE_MATRIX_OPERATIONS: usize = 2 * 9 * 9;
/// The same for several members, one by one.
const MATRIX_OPERATIONS: usize = 2 * 24 * 24;
/// Tapes of rates are worth compiling from so many evaluations, by all members together, for each of their operations on.
const MIN_EVALUATIONS_PER_OPERATION: usize = 1;
/// Up to so many members of a large system are as fast one by one as side by side.
const MAX_SEQUENTIAL_MEMBERS: usize = 4;
