//! A cut tape with its kernels.

use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use crate::{
    isa::Level,
    kernel::{interpret::Interpreter, runner::Runner, writer},
    model::spec::Signature,
    tape::{
        Id, Tape,
        real::Real,
        reserved::BUDGET,
        split::{Body, Split, split_with_times},
    },
};

/// A cut tape with its kernels, which are made when they are first asked for and kept.
pub struct Stage<T: Real = f64> {
    /// The tape.
    pub split: Split,
    /// Kernels by the number of members that they are for.
    compiled: CompiledStages<T>,
    /// Kernels for rows of a given length.
    long: CompiledStages<T>,
}

/// Kernels, each for a level and a number.
type CompiledStages<T> = Mutex<Vec<(Level, usize, Arc<CompiledStage<T>>)>>;

/// The kernels of a stage, with the interpreters for values computed before its steps, over rows of one length.
pub(crate) struct CompiledStage<T: Real = f64> {
    /// The hot loop.
    pub runner: Runner<T>,
    /// Computes values once a run.
    pub(super) run: Interpreter,
    /// Computes values once for each member.
    pub(super) member: Interpreter,
    /// Computes values once for each member that takes a lane by itself.
    pub(super) single: Interpreter,
    /// Computes values once for each step.
    pub(super) step: Runner<T>,
    /// Computes in float64, once for each step of float32.
    pub(super) clock: Option<Runner<f64>>,
    /// Computes values for a single time.
    pub(super) moment: Runner<T>,
    /// Makes several steps at once; none where that does not pay.
    pub(super) unrolled: OnceLock<Option<Unrolled<T>>>,
}

/// Several steps in one call that also return the states between, for a run that saves them all: see [`Body::unrolled`].
pub(super) struct Unrolled<T: Real> {
    pub(super) runner: Runner<T>,
    pub(super) steps: usize,
}

/// The most operations of unrolled steps, so that its code stays in the instruction cache.
const UNROLLED_OPERATIONS: usize = 2000;
/// The most numbers that unrolled steps return: they must stay in the cache until they are copied to the saved states.
const UNROLLED_NUMBERS: usize = 1 << 14;
/// The fewest and the most steps that are unrolled. They divide the number of steps of a table.
const UNROLLED_STEPS: [usize; 2] = [4, 64];

impl<T: Real> Unrolled<T> {
    pub(super) fn new(split: &Split, level: Level, lanes: usize, numbers: Numbers) -> Option<Unrolled<T>> {
        let [least, most] = UNROLLED_STEPS;
        let shape = writer::choose_unrolled(&split.body, level, lanes);
        let vectors = shape.map_or(1, |shape| shape.layout().block_vectors);
        let shown = numbers.v + numbers.y;
        let by_code = UNROLLED_OPERATIONS / ((split.body.work() + shown) * vectors).max(1);
        let steps = by_code.min(UNROLLED_NUMBERS / (shown * lanes).max(1)).clamp(1, most);
        let steps = 1 << steps.ilog2();
        let body = || split.body.unrolled(steps, numbers.state, [numbers.v, numbers.y]);
        (steps >= least).then(|| Unrolled { runner: Runner::shaped(&body(), level, lanes, shape), steps })
    }
}

/// How many numbers a member's state has, and how many of them are v and y.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Numbers {
    /// All numbers of the state.
    pub state: usize,
    /// Numbers of the v slot, which come first.
    pub v: usize,
    /// Numbers of y, which come next.
    pub y: usize,
}

impl<T: Real> CompiledStage<T> {
    fn new(split: &Split, level: Level, runner: Runner<T>) -> Arc<CompiledStage<T>> {
        Arc::new(CompiledStage {
            run: Interpreter::new(&split.run, 1, Level::Baseline),
            member: Interpreter::new(&split.member, runner.lanes(), level),
            single: Interpreter::new(&split.member, 1, Level::Baseline),
            step: Runner::long(&split.step, level, STEPS_AT_ONCE as usize),
            clock: (!split.clock.next.is_empty()).then(|| Runner::long(&split.clock, level, STEPS_AT_ONCE as usize)),
            moment: Runner::long(&split.step, level, 1),
            unrolled: OnceLock::new(),
            runner,
        })
    }
}

impl<T: Real> Stage<T> {
    /// The stage of a tape that was cut.
    pub fn new(split: Split) -> Stage<T> {
        Stage { split, compiled: Mutex::default(), long: Mutex::default() }
    }

    /// The stage of a tape and its results, cut by what members of such a system have in common.
    pub(crate) fn cut(signature: &Signature, (tape, next): &(Tape, Vec<Id>)) -> Stage<T> {
        let of_times = |table: u32| signature.tables.get(table as usize).is_some_and(|(name, _)| name.ends_with(".times"));
        let shared = |i: u32| i == BUDGET || signature.is_common(i);
        Stage::new(split_with_times(tape, next, &shared, &|table| signature.is_common_table(table), &of_times))
    }

    /// Operations of all its bodies.
    pub(crate) fn size(&self) -> usize {
        let split = &self.split;
        [&split.run, &split.member, &split.step, &split.clock, &split.body].iter().map(|body| body.ops.len()).sum::<usize>()
    }

    /// The kernels for a run of `members` members.
    pub(crate) fn compiled(&self, level: Level, members: usize) -> Arc<CompiledStage<T>> {
        // Some more or fewer of many members are no reason for another tile.
        let members = if members > MANY_MEMBERS { usize::MAX } else { members };
        self.find(&self.compiled, level, members, |body| Runner::new(body, level, members))
    }

    /// The kernels over rows of `lanes` lanes.
    pub(crate) fn compiled_for_lanes(&self, level: Level, lanes: usize) -> Arc<CompiledStage<T>> {
        self.find(&self.long, level, lanes, |body| Runner::long(body, level, lanes))
    }

    /// The kernels for a number of members or lanes, built on first use.
    fn find(
        &self,
        compiled: &CompiledStages<T>,
        level: Level,
        number: usize,
        make: impl Fn(&Body) -> Runner<T>,
    ) -> Arc<CompiledStage<T>> {
        // A thread that panicked while it held the lock has left a list that is whole: entries are made before they are put in.
        let mut compiled = compiled.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, _, known)) = compiled.iter().find(|(at, known, _)| (*at, *known) == (level, number)) {
            return Arc::clone(known);
        }
        let made = CompiledStage::new(&self.split, level, make(&self.split.body));
        if compiled.len() == MOST_COMPILED {
            compiled.remove(0);
        }
        compiled.push((level, number, Arc::clone(&made)));
        made
    }
}

/// Above this many members the best tile, of some hundreds, does not depend on their number.
const MANY_MEMBERS: usize = 1024;
/// Kernels of different lengths that are kept for a stage.
const MOST_COMPILED: usize = 16;

/// Steps of a table, which begins at a multiple of them: they are the lanes in which it is computed.
pub(super) const STEPS_AT_ONCE: i64 = 256;
