//! The driver: shares members among threads, saves states, finds divergence. It does not depend on the systems that it steps.

pub mod adaptive;
mod adaptive_plan;
mod columns;
pub(crate) mod compiled;
pub mod fixed;
pub mod stages;
mod waypoints;
mod workers;
pub mod world;

use std::sync::Arc;

use crate::{
    error::Error,
    group::{AdaptiveBatch, Group, adaptive_lanes::AdaptiveLanes, lanes::Lanes, single_lanes::SingleLanes},
    large::{
        adaptive::LargeAdaptive,
        blocks::Schedules,
        force,
        group::LargeGroup,
        hand_written::{HandWrittenRates, kernel_of, single},
        matrix::Matrix,
        rates::{Rates, RatesRequest},
        solving::with_equations,
        tapes::{self, RateTapes, TapeRates},
    },
    model::{
        around::{self, controls},
        spec::Spec,
        system::Shape,
    },
    stage::{Clock, Machine},
    step::{
        MAX_TAPE_OPERATIONS,
        key::{StepKind, TapeKey},
        own_times,
        tapes::{Traceable, Traced},
    },
    tape::real::Precision,
};

/// The system to step and the way to step it.
#[derive(Clone, Debug)]
pub struct Model<'a> {
    /// The system with its numbers.
    pub spec: Spec<'a>,
    /// The key of its tapes.
    pub key: TapeKey,
}

impl Model<'_> {
    /// An error if there is no memory for what each of `threads` threads keeps beside the results. This is checked before the
    /// run, because an allocation that fails in the middle would abort the process.
    pub(crate) fn room(&self, shape: Shape, threads: usize) -> Result<(), Error> {
        let samples = self.spec.tables.iter().map(|table| table.samples.len()).sum::<usize>();
        let parameters = (self.spec.rows.len() + samples).saturating_mul(BYTES_PER_PARAMETER);
        let bytes = (shape.v + shape.y).saturating_mul(BYTES_PER_NUMBER).saturating_add(parameters).saturating_mul(threads);
        let has_room = bytes < UNCHECKED_BYTES || Vec::<u8>::new().try_reserve_exact(bytes).is_ok();
        if has_room { Ok(()) } else { Err(Error::Memory { bytes }) }
    }

    /// Its tapes.
    pub fn traced(&self) -> Result<Arc<Traced>, Error> {
        self.key.traced()
    }

    /// The way in which `members` members are stepped, if `steps` steps of members are to be made in all.
    fn way(&self, traced: &Traced, machine: Machine, members: usize, steps: f64) -> StepStrategy {
        let (rates, step) = traced.operations;
        let single = members == 1;
        // Operations are fused on the tape of the whole step, friction needs the state at its start, and only there have members
        // times of their own. Not everything around a system is known over rows.
        let own_times = own_times(&self.key.signature);
        let is_single = self.key.precision == Precision::Single;
        let is_given = matches!(self.key.how, StepKind::Step(_));
        let as_one = is_single || own_times || self.key.fused || traced.series || is_given;
        if as_one || around::is_one_tape(&self.key.signature) {
            return StepStrategy::Tape;
        }
        if let StepKind::Matrix { .. } = &self.key.how {
            // Kernels for one member fill whole vectors with it, so a few members one by one are as fast as a vector of them.
            return if rates >= if members <= MAX_SEQUENTIAL_MEMBERS { SINGLE_MATRIX_OPERATIONS } else { MATRIX_OPERATIONS } {
                StepStrategy::Matrix
            } else {
                StepStrategy::Tape
            };
        }
        let long = kernel_of(&self.key.signature.system);
        let is_paced = matches!(self.key.how, StepKind::Attempts { .. });
        let attempts = if is_paced { ATTEMPTS * members as f64 } else { steps };
        if traced.solves_rows && step <= MAX_TAPE_OPERATIONS && attempts >= MIN_SOLUTIONS {
            return StepStrategy::Tape;
        }
        // Of a batch with adaptive steps a tape alone steps several members at once.
        let is_soon_large = long.is_some() && !is_paced;
        let large = step > if is_soon_large { HAND_WRITTEN_OPERATIONS } else { MAX_TAPE_OPERATIONS } || traced.solves_rows;
        // Tapes of rates must first be traced and compiled, which takes time, unless that was done before.
        let pays = || {
            steps * (step / rates.max(1)) as f64 > (MIN_EVALUATIONS_PER_OPERATION * rates) as f64
                || RateTapes::are_known(&self.key)
        };
        let is_long = |long: HandWrittenRates| rates >= long.from.0 || step >= long.from.1;
        match long {
            Some(long) if single && is_long(long) => StepStrategy::HandWrittenRates(long),
            Some(long)
                if large && (rates >= long.from_batch || members <= MAX_SEQUENTIAL_MEMBERS && is_long(long) || !pays()) =>
            {
                StepStrategy::HandWrittenRates(long)
            }
            _ if large => StepStrategy::Rates(if single { 1 } else { tapes::lanes(machine.level) }),
            _ => StepStrategy::Tape,
        }
    }

    /// Members that a group steps together in a run of `members` members and `steps` steps of members in all.
    pub fn lanes<T: Traceable>(&self, traced: &Traced, machine: Machine, members: usize, steps: f64) -> Result<usize, Error> {
        Ok(match self.way(traced, machine, members, steps) {
            StepStrategy::Tape => traced.tapes_of::<T>()?.step.compiled(machine.level, members).runner.lanes(),
            StepStrategy::Rates(lanes) => lanes,
            StepStrategy::HandWrittenRates(_) | StepStrategy::Matrix => 1,
        })
    }

    fn asked(&self, traced: &Traced, machine: Machine, h: f64) -> RatesRequest<'_> {
        let attempts = matches!(self.key.how, StepKind::Attempts { .. });
        RatesRequest { signature: &self.key.signature, shape: traced.shape, record: &self.key.record, machine, h, attempts }
    }

    /// A group that steps the model, in a run of `members` members and `steps` steps of members in all.
    pub(crate) fn group(
        &self,
        traced: &Traced,
        machine: Machine,
        members: usize,
        clock: &Clock,
        steps: f64,
    ) -> Result<Box<dyn Group>, Error> {
        let (spec, shape, level) = (&self.spec, traced.shape, machine.level);
        let rates: Box<dyn Rates> = match self.way(traced, machine, members, steps) {
            StepStrategy::Tape => return Ok(Box::new(Lanes::new(traced, spec, level, members, clock)?)),
            StepStrategy::Matrix => return Ok(Box::new(Matrix::new(spec, shape, &self.key.how, level, clock))),
            StepStrategy::HandWrittenRates(long) => single(long, &self.asked(traced, machine, clock.h)),
            StepStrategy::Rates(lanes) => Box::new(TapeRates::new(RateTapes::of(&self.key)?, spec, level, lanes, clock)),
        };
        let rates = with_equations(rates, &self.key, spec, shape, level, clock)?;
        let schedules = Schedules::of(&self.key.how, rates.traits(), traced.shape)?;
        Ok(Box::new(LargeGroup::new(schedules, rates, shape, traced.recorded, level, clock)))
    }

    /// A batch of members with adaptive steps.
    pub(crate) fn adaptive(
        &self,
        traced: &Traced,
        machine: Machine,
        members: usize,
        budget: f64,
        extends: bool,
    ) -> Result<Box<dyn AdaptiveBatch>, Error> {
        let (spec, level) = (&self.spec, machine.level);
        let signature = &self.key.signature;
        let rates: Box<dyn Rates> = match self.way(traced, machine, members, 0.0) {
            StepStrategy::Tape if self.key.precision == Precision::Single => {
                return Ok(Box::new(SingleLanes::new(traced, spec, level, members, budget)?));
            }
            StepStrategy::Tape | StepStrategy::Matrix => {
                return Ok(Box::new(AdaptiveLanes::new(traced, spec, level, members, budget, extends)?));
            }
            // Tapes of rates are scaled to a step of 1, and what a control pushes depends on the step.
            _ if signature.equations.as_ref().is_some_and(|equations| equations.reads_step()) => {
                return Err(Error::ControlTooLong);
            }
            StepStrategy::Rates(_) if controls::pushes(signature) => match kernel_of(&signature.system) {
                Some(long) => single(long, &self.asked(traced, machine, Clock::NONE.h)),
                None => return Err(Error::ControlTooLong),
            },
            // Rates are asked for at one time, so a large member goes alone.
            way => match (way, self.way(traced, machine, 1, 0.0)) {
                (StepStrategy::HandWrittenRates(long), _) | (_, StepStrategy::HandWrittenRates(long)) => {
                    single(long, &self.asked(traced, machine, Clock::NONE.h))
                }
                _ => {
                    let rates = Box::new(TapeRates::new(RateTapes::of(&self.key)?, spec, level, 1, &Clock::NONE));
                    force::wrap(rates, &self.asked(traced, machine, Clock::NONE.h))
                }
            },
        };
        let rates = with_equations(rates, &self.key, spec, traced.shape, level, &Clock::NONE)?;
        let schedules = Schedules::of(&self.key.how, rates.traits(), traced.shape)?;
        Ok(Box::new(LargeAdaptive::new(schedules, rates, traced, level, budget, extends)?))
    }
}

/// The most bytes that a thread keeps for each number of a state, including the sixteen stages of Verner's 9(8).
const BYTES_PER_NUMBER: usize = 192;
/// The most bytes that a thread keeps for each parameter or sample.
const BYTES_PER_PARAMETER: usize = 32;
/// Less memory than this is not checked.
const UNCHECKED_BYTES: usize = 1 << 24;

/// How a group is stepped.
#[derive(Clone, Copy)]
enum StepStrategy {
    /// One tape for the whole step.
    Tape,
    /// Tapes for the rates, with this many lanes.
    Rates(usize),
    /// A kernel that is written by hand, for a single member.
    HandWrittenRates(HandWrittenRates),
    /// A large matrix.
    Matrix,
}

/// Operations of a step of several members from which on, where there is a kernel that is written by hand, it is that or tapes of
/// the rates: as fast as one tape, and sooner there.
const HAND_WRITTEN_OPERATIONS: usize = 4000;
/// A tape that solves many equations takes some microseconds an operation to trace and to write, and a third of a nanosecond less
/// in a step than solving over rows: it is worth it from this many steps of members on.
const MIN_SOLUTIONS: f64 = 20_000.0;
/// Attempts that are expected of a member with adaptive steps.
const ATTEMPTS: f64 = 300.0;
/// Operations of the matrix form from which on a hand-written kernel is faster than a tape, for a single member.
const SINGLE_MATRIX_OPERATIONS: usize = 2 * 9 * 9;
/// Likewise for several members, one by one.
const MATRIX_OPERATIONS: usize = 2 * 24 * 24;
/// Tapes of rates are worth compiling from this many evaluations, by all members together, for each of their operations on.
const MIN_EVALUATIONS_PER_OPERATION: usize = 1;
/// Up to this many members of a large system are as fast one by one as side by side.
const MAX_SEQUENTIAL_MEMBERS: usize = 4;
