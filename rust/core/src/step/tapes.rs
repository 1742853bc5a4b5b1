//! The tapes of a step and its properties, each found on first use and kept.

use std::sync::{
    Arc, LazyLock, OnceLock,
    atomic::{AtomicU64, Ordering::Relaxed},
};

use super::{
    attempts::TriedRows,
    cache::Cache,
    key::{StepKind, TapeKey},
    leaves::own_times,
    properties::{
        MAX_IMPLICIT_OPERATIONS, MAX_IMPLICIT_TAPE_OPERATIONS, MAX_TAPE_OPERATIONS, MAX_UNKNOWNS, Operations, has_derivatives,
        has_series, has_splitting, operations, recorded, shape,
    },
    trace::{trace_begin, trace_by_terms, trace_extension, trace_judged, trace_record, trace_slot, trace_step},
    watch,
};
use crate::{
    error::Error,
    model::{
        around::{self, controls, sampled},
        methods::method,
        system::Shape,
    },
    stage::Stage,
    tape::{
        Counts, Id, Tape,
        fuse::fuse,
        real::{Precision, Real},
    },
};

/// The tapes of a step.
pub struct Tapes<T: Real = f64> {
    /// One step, or one attempt, of the whole state. Attempts by a series return its coefficients behind the state.
    pub step: Stage<T>,
    /// An attempt by known coefficients, which stand behind the state: for saved states, and for a held step when it is taken.
    /// Not where operations are fused, for the attempt may fuse those that made the coefficients.
    pub by_terms: Option<Stage<T>>,
    /// Whether steps are those of a series.
    pub is_series: bool,
    /// Whether a saved state within such an attempt is the sum of the series alone.
    pub sums: bool,
    /// The second part of an attempt of float32, which is of float64, and where the rows of both parts are; `step` is the first.
    pub(crate) judged: Option<(Stage, TriedRows)>,
    /// Of attempts: the pace behind the state, as it is at the start: see `Pace::begun`. Its operations are never fused.
    pub begin: Option<Stage<T>>,
    /// Turns velocities into what the method carries.
    pub start: Option<Stage<T>>,
    /// Turns what the method carries into velocities.
    pub finish: Option<Stage<T>>,
    /// A step that also returns the velocities before it, after the next state, for a run that saves all of them; None if the
    /// state has them already.
    pub step_with_velocities: Option<Stage<T>>,
    /// The recorded numbers, behind v and y.
    pub record: Option<Stage<T>>,
    /// Operations of a step before equal ones were merged, but for those that a method does to blocks.
    pub written: Counts,
    /// The cost of a step with a series, in evaluations of the rates, by the operations; 0 without one.
    pub series_evaluations: usize,
}

/// The properties and tapes of a step. Expensive ones are found on first use.
pub struct Traced {
    key: TapeKey,
    /// Its number among all of this process: no two have the same.
    pub number: u64,
    /// How large the blocks are.
    pub shape: Shape,
    /// How many numbers of the state stand behind v and y: those that the method keeps, and those that a sampled controller
    /// remembers.
    pub kept: usize,
    /// How many of these a sampled controller remembers; they come last.
    pub memory: usize,
    /// How many stand behind these: a sum over the steps, the tally, if the system has one; what is watched.
    pub tally: usize,
    /// How many numbers are recorded.
    pub recorded: usize,
    /// Whether the method has a carry instead of v between steps.
    pub carries: bool,
    /// Whether steps are made by derivatives on one tape, however long.
    pub series: bool,
    /// Whether equations are solved over rows, but where a tape for many steps pays.
    pub solves_rows: bool,
    /// Approximate numbers of operations of the rates and of a step.
    pub operations: (usize, usize),
    tapes: OnceLock<Arc<Tapes>>,
    /// The tapes for numbers of 32 bits.
    singles: OnceLock<Arc<Tapes<f32>>>,
    extension: OnceLock<Arc<Stage>>,
}

impl TapeKey {
    /// The properties of the step, with its tapes, built on first use.
    pub fn traced(&self) -> Result<Arc<Traced>, Error> {
        static CACHE: LazyLock<Cache<TapeKey, Traced>> = LazyLock::new(Cache::default);
        CACHE.find(self, || {
            let shape = shape(&self.signature, &self.how)?;
            let Operations { rates, step, equations } = operations(&self.signature, &self.how, shape)?;
            let operations = (rates, step);
            let own_times = own_times(&self.signature);
            let (mut series, mut solves_rows) = (has_series(&self.how)?, false);
            let has_mass = self.signature.equations.as_ref().is_some_and(|equations| equations.mass.is_some());
            if !series && has_derivatives(&self.how)? {
                let is_one = self.fused
                    || own_times
                    || self.precision == Precision::Single
                    || around::is_one_tape(&self.signature)
                    || has_mass;
                series = is_one || step <= MAX_IMPLICIT_TAPE_OPERATIONS;
                solves_rows = !series;
                let long = if series { step } else { equations };
                let unknowns = shape.v + shape.y;
                if long > MAX_IMPLICIT_OPERATIONS || unknowns > MAX_UNKNOWNS {
                    let (most, most_unknowns) = (MAX_IMPLICIT_OPERATIONS, MAX_UNKNOWNS);
                    return Err(Error::TooLongToSolve { operations: long, most, unknowns, most_unknowns });
                }
            } else if series && operations.1 > MAX_TAPE_OPERATIONS {
                return Err(Error::TooLongForSeries { operations: operations.1, most: MAX_TAPE_OPERATIONS });
            }
            if !series && has_splitting(&self.signature, &self.how)? {
                series = true;
                if operations.1 > MAX_TAPE_OPERATIONS {
                    return Err(Error::TooLongToSplit { operations: operations.1, most: MAX_TAPE_OPERATIONS });
                }
            }
            if self.fused && !series && operations.1 > MAX_TAPE_OPERATIONS {
                return Err(Error::TooLongToFuse { operations: operations.1, most: MAX_TAPE_OPERATIONS });
            }
            if own_times && operations.1 > MAX_TAPE_OPERATIONS {
                return Err(Error::TooLongForTimes { operations: operations.1, most: MAX_TAPE_OPERATIONS });
            }
            if self.precision == Precision::Single {
                self.fits_single(operations.1)?;
            }
            let (mut tally, mut kept, mut memory, mut carries) = (0, 0, 0, false);
            if let StepKind::Method { name, .. } = &self.how {
                watch::check(&self.signature, shape)?;
                tally = usize::from(controls::is_given(&self.signature)) + watch::numbers(&self.signature);
                let method = method(name)?;
                memory = sampled::numbers(&self.signature);
                (kept, carries) = (method.kept_numbers(shape) + memory, method.carries);
            }
            if let StepKind::Attempts { name, .. } = &self.how {
                around::only_fixed(&self.signature)?;
                method(name)?.error_order.ok_or(Error::NoEstimate)?;
            }
            static FOUND: AtomicU64 = AtomicU64::new(0);
            let traced = Traced {
                number: FOUND.fetch_add(1, Relaxed),
                shape,
                kept,
                memory,
                tally,
                carries,
                series,
                solves_rows,
                recorded: recorded(&self.signature, &self.record)?,
                operations,
                tapes: OnceLock::new(),
                singles: OnceLock::new(),
                extension: OnceLock::new(),
                key: self.clone(),
            };
            let is_one = series || own_times || self.fused || matches!(self.how, StepKind::Step(_));
            let is_in_parts = !is_one && operations.1 > MAX_TAPE_OPERATIONS;
            Ok((traced, if is_in_parts { SIZE_IN_PARTS } else { operations.1.min(MAX_TAPE_OPERATIONS) }))
        })
    }
}

/// Operations as which the cache counts a step that is not one tape.
const SIZE_IN_PARTS: usize = 16_000;

/// Operations of a step from which on it may take so long that Ctrl-C must be answered within it.
const LONG_STEP_OPERATIONS: usize = 1 << 24;

impl Traced {
    /// Whether a step of `members` members may take long.
    pub(crate) fn is_long(&self, members: usize) -> bool {
        self.operations.1.saturating_mul(members) >= LONG_STEP_OPERATIONS
    }

    /// Steps of `members` members that have `operations` operations; one or more.
    pub(crate) fn steps_of(&self, members: usize, operations: usize) -> i64 {
        (operations / self.operations.1.saturating_mul(members).max(1)).max(1) as i64
    }

    /// Its key.
    pub(crate) fn key(&self) -> &TapeKey {
        &self.key
    }

    /// The tapes of all that a run needs.
    pub fn tapes(&self) -> Result<Arc<Tapes>, Error> {
        self.tapes_of()
    }

    /// The tape of the continuous extension of an attempt; few runs need it.
    pub(crate) fn extension(&self) -> Result<Arc<Stage>, Error> {
        if let Some(known) = self.extension.get() {
            return Ok(Arc::clone(known));
        }
        let (tape, next) = trace_extension(Tape::default(), &self.key.signature, &self.key.how)?;
        let traced = if self.key.fused { fuse(&tape, &next) } else { (tape, next) };
        let stage = Arc::new(Stage::cut(&self.key.signature, &traced));
        Ok(Arc::clone(self.extension.get_or_init(|| stage)))
    }

    /// The tapes of all that a run needs, for numbers of the key's precision.
    pub(crate) fn tapes_of<T: Traceable>(&self) -> Result<Arc<Tapes<T>>, Error> {
        let known = T::known(self);
        if let Some(tapes) = known.get() {
            return Ok(Arc::clone(tapes));
        }
        let tapes = Arc::new(self.key.trace()?);
        Ok(Arc::clone(known.get_or_init(|| tapes)))
    }
}

/// Numbers whose tapes are kept.
pub trait Traceable: Real {
    /// The place of the tapes in the step's properties.
    fn known(traced: &Traced) -> &OnceLock<Arc<Tapes<Self>>>;
}

impl Traceable for f64 {
    fn known(traced: &Traced) -> &OnceLock<Arc<Tapes<f64>>> {
        &traced.tapes
    }
}

impl Traceable for f32 {
    fn known(traced: &Traced) -> &OnceLock<Arc<Tapes<f32>>> {
        &traced.singles
    }
}

impl TapeKey {
    /// An error if a step of `operations` operations cannot be computed with numbers of 32 bits.
    fn fits_single(&self, operations: usize) -> Result<(), Error> {
        if operations > MAX_TAPE_OPERATIONS {
            return Err(Error::TooLongForSingle { operations, most: MAX_TAPE_OPERATIONS });
        }
        let of = match &self.how {
            _ if self.signature.watched.is_some() => "events",
            _ if has_series(&self.how)? => "the series of a solution",
            _ => return Ok(()),
        };
        Err(Error::NotSingle { of })
    }

    /// Traces all that a run needs, anew.
    pub(crate) fn trace<T: Real>(&self) -> Result<Tapes<T>, Error> {
        debug_assert!(T::PRECISION == self.precision, "the tapes of a step have its precision");
        let new = || Tape::new(T::PRECISION);
        let steps = trace_step(new(), &self.signature, &self.how)?;
        let fused = |tape: Tape, next: Vec<Id>| if self.fused { fuse(&tape, &next) } else { (tape, next) };
        let (mut start, mut finish) = (None, None);
        if let StepKind::Method { name, choice } = &self.how {
            let method = method(name)?;
            for (slot, program) in [(&mut start, method.start(*choice)), (&mut finish, method.finish(*choice))] {
                if let Some(program) = program {
                    let (tape, next) = trace_slot(new(), &self.signature, &method, program)?;
                    *slot = Some(fused(tape, next));
                }
            }
        }
        let single = T::PRECISION == Precision::Single;
        let mut judged = None;
        if single && matches!(self.how, StepKind::Attempts { .. }) {
            let (tape, next, rows) = trace_judged(Tape::default(), &self.signature, &self.how)?;
            judged = Some((Stage::cut(&self.signature, &(tape, next)), rows));
        }
        let begin = match &self.how {
            StepKind::Attempts { .. } if !single => {
                Some(Stage::cut(&self.signature, &trace_begin(new(), &self.signature, &self.how)?))
            }
            _ => None,
        };
        let mut quantities = None;
        if !self.record.is_empty() {
            quantities = Some(Stage::cut(&self.signature, &trace_record(new(), &self.signature, &self.record)?));
        }
        let written = steps.tape.written(steps.next.iter().copied());
        let series_evaluations = steps.tape.series_evaluations();
        let (mut next, mut by_terms, mut sums) = (steps.next, None, false);
        let is_series = !steps.terms.is_empty();
        if is_series && !self.fused {
            let (tape, by, projects) = trace_by_terms(new(), &self.signature, &self.how, steps.shape, steps.terms.len())?;
            (by_terms, sums) = (Some(Stage::cut(&self.signature, &(tape, by))), !projects);
            next.extend(steps.terms);
        }
        let step = fused(steps.tape, next);
        let step_with_velocities = finish.as_ref().map(|(tape, velocities): &(Tape, Vec<Id>)| {
            let (mut both, mut next) = step.clone();
            let place = both.take_over(tape);
            next.extend(velocities[..steps.shape.v].iter().map(|id| place[*id as usize]));
            (both, next)
        });
        let [start, finish, step_with_velocities] =
            [start, finish, step_with_velocities].map(|made| made.map(|made| Stage::cut(&self.signature, &made)));
        let step = Stage::cut(&self.signature, &step);
        Ok(Tapes {
            step,
            by_terms,
            is_series,
            sums,
            judged,
            begin,
            start,
            finish,
            step_with_velocities,
            record: quantities,
            written,
            series_evaluations,
        })
    }
}
