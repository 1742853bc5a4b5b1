//! A cut tape, ready to be run over tiles: the hot loop, and what is computed before it.

use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use super::aligned::Aligned;
use crate::{
    isa::Level,
    kernel::{
        Kernel, Tile,
        interpret::Interpreter,
        runner::{By, Runner},
        writer,
    },
    real::Real,
    spec::Spec,
    tape::split::{Body, Entry, Given, Split},
    trace::BUDGET,
    window::Window,
};

/// A cut tape with its kernels, which are made when they are first asked for and kept.
pub struct Stage<T: Real = f64> {
    /// The tape.
    pub split: Split,
    /// By the number of members that they are for.
    kits: Kits<T>,
    /// Those for rows of a length that something else has set.
    long: Kits<T>,
}

/// Kits, each for a level and a number.
type Kits<T> = Mutex<Vec<(Level, usize, Arc<Kit<T>>)>>;

/// What makes the steps of a stage, and what is computed before them, over rows of one length.
pub struct Kit<T: Real = f64> {
    /// The hot loop.
    pub runner: Runner<T>,
    /// Once a run.
    run: Interpreter,
    /// Once for each member.
    member: Interpreter,
    /// Once for each member that takes a lane by itself.
    single: Interpreter,
    /// Once for each step.
    step: Runner<T>,
    /// Once for each time that comes alone.
    moment: Runner<T>,
    /// Several steps at once; none where that does not pay.
    trail: OnceLock<Option<Trail<T>>>,
}

/// Several steps in one call that also return the states between, for a run that saves them all: see [`Body::trail`].
struct Trail<T: Real> {
    runner: Runner<T>,
    steps: usize,
}

/// The most operations of a trail, so that its code stays in the instruction cache.
const TRAIL_OPERATIONS: usize = 2000;
/// The most numbers that a trail returns: they must stay in the cache until they are copied to the saved states.
const TRAIL_NUMBERS: usize = 1 << 14;
/// The fewest and the most steps of a trail. They divide the number of steps of a table.
const TRAIL_STEPS: [usize; 2] = [4, 64];

impl<T: Real> Trail<T> {
    fn new(split: &Split, level: Level, lanes: usize, numbers: Numbers) -> Option<Trail<T>> {
        let [least, most] = TRAIL_STEPS;
        let shape = writer::choose_trail(&split.body, level, lanes);
        let vectors = shape.map_or(1, |shape| shape.layout().block_vectors);
        let shown = numbers.v + numbers.y;
        let by_code = TRAIL_OPERATIONS / ((split.body.work() + shown) * vectors).max(1);
        let steps = by_code.min(TRAIL_NUMBERS / (shown * lanes).max(1)).clamp(1, most);
        let steps = 1 << steps.ilog2();
        let body = || split.body.trail(steps, numbers.state, [numbers.v, numbers.y]);
        (steps >= least).then(|| Trail { runner: Runner::shaped(&body(), level, lanes, shape), steps })
    }
}

/// How many numbers a member's state has, and how many of them are v and y.
#[derive(Clone, Copy, Debug)]
pub struct Numbers {
    /// All of them.
    pub state: usize,
    /// Of the v slot, which come first.
    pub v: usize,
    /// Of y, which come next.
    pub y: usize,
}

impl<T: Real> Kit<T> {
    fn new(split: &Split, level: Level, runner: Runner<T>) -> Arc<Kit<T>> {
        Arc::new(Kit {
            run: Interpreter::new(&split.run, 1, Level::Baseline),
            member: Interpreter::new(&split.member, runner.lanes(), level),
            single: Interpreter::new(&split.member, 1, Level::Baseline),
            step: Runner::long(&split.step, level, STEPS_AT_ONCE as usize),
            moment: Runner::long(&split.step, Level::Baseline, 1),
            trail: OnceLock::new(),
            runner,
        })
    }
}

impl<T: Real> Stage<T> {
    /// Of a tape that was cut.
    pub fn new(split: Split) -> Stage<T> {
        Stage { split, kits: Mutex::default(), long: Mutex::default() }
    }

    /// Operations of all its bodies.
    pub fn size(&self) -> usize {
        let split = &self.split;
        [&split.run, &split.member, &split.step, &split.body].iter().map(|body| body.ops.len()).sum::<usize>()
    }

    /// What makes its steps in a run of so many members.
    pub fn kit(&self, level: Level, members: usize) -> Arc<Kit<T>> {
        // Some more or fewer of many members are no reason for another tile.
        let members = if members > MANY_MEMBERS { usize::MAX } else { members };
        self.kept(&self.kits, level, members, |body| Runner::new(body, level, members))
    }

    /// What makes its steps over rows of so many lanes.
    pub fn kit_of(&self, level: Level, lanes: usize) -> Arc<Kit<T>> {
        self.kept(&self.long, level, lanes, |body| Runner::long(body, level, lanes))
    }

    /// What was made before for such a number, or what is made now.
    fn kept(&self, kits: &Kits<T>, level: Level, number: usize, make: impl Fn(&Body) -> Runner<T>) -> Arc<Kit<T>> {
        // A thread that panicked while it held the lock has left a list that is whole: entries are made before they are put in.
        let mut kits = kits.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, _, known)) = kits.iter().find(|(at, known, _)| (*at, *known) == (level, number)) {
            return Arc::clone(known);
        }
        let made = Kit::new(&self.split, level, make(&self.split.body));
        if kits.len() == MOST_KITS {
            kits.remove(0);
        }
        kits.push((level, number, Arc::clone(&made)));
        made
    }
}

/// Above so many members the best tile, of some hundreds, does not depend on their number.
const MANY_MEMBERS: usize = 1024;
/// Kernels of different lengths that are kept for a stage.
const MOST_KITS: usize = 16;

/// Time and step: t = `t0` + k·`h` at step k, never accumulated.
#[derive(Clone, Copy, Debug)]
pub struct Clock {
    /// Time of step 0.
    pub t0: f64,
    /// The step.
    pub h: f64,
}

impl Clock {
    /// The time of step `k`.
    #[inline]
    pub fn at(&self, k: i64) -> f64 {
        self.t0 + k as f64 * self.h
    }
}

/// A force from outside that changes between steps: rows of one number for each member.
#[derive(Clone, Copy, Debug)]
pub struct Force<'a, T = f64> {
    /// The rows, one for each number of v.
    pub numbers: &'a [T],
    /// How long a row is.
    pub members: usize,
    /// The number of the first row among all parameters.
    pub place: usize,
}

impl<T> Force<'_, T> {
    /// A row.
    pub fn row(&self, i: usize) -> &[T] {
        &self.numbers[i * self.members..][..self.members]
    }
}

/// Tables of steps that are kept, in numbers: groups after the first find them there.
const MOST_ENTRIES: usize = 1 << 16;

/// A stage with its kernel and the parameters and inputs of some members: all that its hot loop reads.
pub struct PreparedStage<T: Real = f64> {
    kit: Arc<Kit<T>>,
    /// What is the same for all members, in the order of [`Split::given`].
    given: Vec<T>,
    /// The same as the kernel for entries of steps wants them, and whether that kernel is machine code.
    given_pool: Vec<T>,
    given_for: Option<By>,
    /// The uniforms of the hot loop.
    uniforms: Vec<T>,
    /// The same as the kernel wants them, and whether that kernel is machine code.
    pool: Aligned<T>,
    pool_for: Option<By>,
    rows: Aligned<T>,
    held: Aligned<T>,
    /// Where in `held` the samples of each input begin.
    inputs: Vec<usize>,
    /// Samples that all members have in common.
    common: Vec<Vec<T>>,
    /// Tables of steps, by their first step.
    tables: Vec<(i64, Vec<u64>)>,
    /// How many of them are kept at most, and which makes place next.
    most_tables: usize,
    oldest: usize,
    /// The times of the steps of a table.
    times: Vec<T>,
    /// The entries of one time, and the values that entries are made of.
    moment: Vec<u64>,
    values: Vec<T>,
    raw: Vec<T>,
    scratch: Vec<T>,
    /// A state with a trail of states behind it, and the pool of its kernel.
    trail: Aligned<T>,
    trail_pool: Aligned<T>,
    trail_pool_for: Option<By>,
}

impl<T: Real> PreparedStage<T> {
    /// For a run of so many members. `budget` is the most attempts of a member, for those.
    pub fn new(stage: &Stage<T>, spec: &Spec, level: Level, members: usize, clock: &Clock, budget: f64) -> PreparedStage<T> {
        PreparedStage::with(stage, stage.kit(level, members), spec, clock, budget)
    }

    /// With a kernel that was chosen already.
    pub fn with(stage: &Stage<T>, kit: Arc<Kit<T>>, spec: &Spec, clock: &Clock, budget: f64) -> PreparedStage<T> {
        let (split, lanes) = (&stage.split, kit.runner.lanes());
        let last = |input: u32| spec.tables[input as usize].samples.len() as f64 - 1.0;
        let before = |input: u32| spec.tables[..input as usize].iter().map(|table| table.samples.len()).sum::<usize>();
        let number = |given: &Given| match *given {
            Given::Step => clock.h,
            Given::Param(BUDGET) => budget,
            Given::Param(i) => spec.rows[i as usize].at(0),
            Given::Start(input) => spec.tables[input as usize].start,
            Given::Interval(input) => spec.tables[input as usize].interval,
            Given::Last(input) => last(input),
            Given::First(input) => (before(input) * lanes) as f64,
            Given::Lanes => lanes as f64,
        };
        let given: Vec<T> = split.given.iter().map(|given| T::of(number(given))).collect();
        let mut uniforms = vec![T::default(); split.run.next.len()];
        let mut scratch = Vec::new();
        let tile = &mut Tile { state: &mut uniforms, rows: &[], pool: &given, steps: 1, per_step: &[], held: &[] };
        kit.run.run(tile, &mut scratch);
        let common = spec.tables.iter().map(|table| table.samples.iter().map(|row| T::of(row.at(0))).collect()).collect();
        PreparedStage {
            given,
            given_pool: Vec::new(),
            given_for: None,
            uniforms,
            pool: Aligned::new(0),
            pool_for: None,
            rows: Aligned::new(split.member.next.len() * lanes),
            held: Aligned::new(0),
            inputs: Vec::new(),
            common,
            tables: Vec::new(),
            most_tables: (MOST_ENTRIES / (STEPS_AT_ONCE as usize * split.entries.len()).max(1)).max(1),
            oldest: 0,
            times: Vec::new(),
            moment: Vec::new(),
            values: Vec::new(),
            raw: vec![T::default(); split.params.len() * lanes],
            scratch,
            trail: Aligned::new(0),
            trail_pool: Aligned::new(0),
            trail_pool_for: None,
            kit,
        }
    }

    /// How long rows are.
    pub fn lanes(&self) -> usize {
        self.kit.runner.lanes()
    }

    /// Takes the parameters of the members from `first`; lanes past the `count`-th repeat the last.
    pub fn prepare(&mut self, stage: &Stage<T>, spec: &Spec, first: usize, count: usize) {
        let lanes = self.lanes();
        for (raw, param) in self.raw.chunks_exact_mut(lanes).zip(&stage.split.params) {
            spec.rows[*param as usize].fill(first, count, raw);
        }
        self.find_rows();
        self.take_samples(stage, spec, |row, to| row.fill(first, count, to));
    }

    /// Takes the force for the members that were prepared.
    pub fn set_force(&mut self, stage: &Stage<T>, force: &Force<T>, first: usize, count: usize) {
        let (lanes, rows) = (self.lanes(), force.numbers.len() / force.members);
        for (raw, param) in self.raw.chunks_exact_mut(lanes).zip(&stage.split.params) {
            if let Some(i) = (*param as usize).checked_sub(force.place).filter(|i| *i < rows) {
                let row = &force.row(i)[first..first + count];
                raw[..count].copy_from_slice(row);
                raw[count..].fill(row[count - 1]);
            }
        }
        self.find_rows();
    }

    /// Computes what is constant for each member from its parameters.
    fn find_rows(&mut self) {
        let (rows, given) = (&mut self.rows, &self.given);
        let tile = &mut Tile { state: rows, rows: &self.raw, pool: given, steps: 1, per_step: &[], held: &[] };
        self.kit.member.run(tile, &mut self.scratch);
    }

    /// Takes the parameters of a member into one lane.
    pub fn prepare_lane(&mut self, stage: &Stage<T>, spec: &Spec, lane: usize, member: usize) {
        let split = &stage.split;
        let raw: Vec<T> = split.params.iter().map(|param| T::of(spec.rows[*param as usize].at(member))).collect();
        let mut made = vec![T::default(); split.member.next.len()];
        let tile = &mut Tile { state: &mut made, rows: &raw, pool: &self.given, steps: 1, per_step: &[], held: &[] };
        self.kit.single.run(tile, &mut self.scratch);
        let lanes = self.lanes();
        for (row, number) in self.rows.chunks_exact_mut(lanes).zip(made) {
            row[lane] = number;
        }
        self.take_samples(stage, spec, |row, to| to[lane] = T::of(row.at(member)));
    }

    /// Fills the rows of samples of inputs of which members have their own.
    fn take_samples(&mut self, stage: &Stage<T>, spec: &Spec, take: impl Fn(&crate::spec::Row, &mut [T])) {
        let lanes = self.lanes();
        let of_members =
            stage.split.entries.iter().any(|entry| matches!(entry, Entry::Row(_))) || stage.split.given.contains(&Given::Lanes);
        if !of_members {
            return;
        }
        if self.inputs.is_empty() {
            let mut rows = 0;
            for table in &spec.tables {
                self.inputs.push(rows * lanes);
                rows += table.samples.len();
            }
            self.held = Aligned::new(rows * lanes);
        }
        let rows = spec.tables.iter().flat_map(|table| &table.samples);
        for (to, row) in self.held.chunks_exact_mut(lanes).zip(rows) {
            take(row, to);
        }
    }

    /// Compiles now what would be compiled later, when it pays, and keeps one table of steps only, as real-time loops need no more.
    pub fn compile_now(&mut self) {
        self.kit.runner.write();
        self.most_tables = 1;
    }

    /// So many steps of a state from step `k`.
    pub fn advance(&mut self, stage: &Stage<T>, clock: &Clock, k: i64, n: usize, state: &mut [T]) {
        if stage.split.entries.is_empty() {
            self.steps(n, &[], state);
            return;
        }
        let (mut k, until) = (k, k + n as i64);
        while k < until {
            let first = k.div_euclid(STEPS_AT_ONCE) * STEPS_AT_ONCE;
            let n = (until - k).min(first + STEPS_AT_ONCE - k);
            let at = self.table(stage, clock, first);
            let table = std::mem::take(&mut self.tables[at].1);
            self.steps(n as usize, &table[(k - first) as usize * stage.split.entries.len()..], state);
            self.tables[at].1 = table;
            k += n;
        }
    }

    /// How many steps a trail has; none if there is no trail.
    pub fn trail(&self, stage: &Stage<T>, level: Level, numbers: Numbers) -> usize {
        let make = || Trail::new(&stage.split, level, self.lanes(), numbers);
        self.kit.trail.get_or_init(make).as_ref().map_or(0, |trail| trail.steps)
    }

    /// Makes the steps of a trail from step `k`, a multiple of their number. Returns the velocities before each step, then the
    /// coordinates before each step.
    pub fn advance_on_trail(&mut self, stage: &Stage<T>, clock: &Clock, k: i64, state: &mut [T]) -> &[T] {
        let kit = Arc::clone(&self.kit);
        let Some(Some(trail)) = kit.trail.get() else { return &[] };
        let numbers = state.len();
        if self.trail.is_empty() {
            self.trail = Aligned::new(trail.runner.body().next.len() * self.lanes());
        }
        let (entries, mut table) = (stage.split.entries.len(), Vec::new());
        let mut from = (0, 0);
        if entries > 0 {
            let first = k.div_euclid(STEPS_AT_ONCE) * STEPS_AT_ONCE;
            let at = self.table(stage, clock, first);
            table = std::mem::take(&mut self.tables[at].1);
            from = (at, (k - first) as usize * entries);
        }
        let (kernel, by) = trail.runner.kernel(1);
        if self.trail_pool_for != Some(by) {
            self.trail_pool = Aligned::from(&kernel.pool(&self.uniforms));
            self.trail_pool_for = Some(by);
        }
        self.trail[..numbers].copy_from_slice(state);
        let (rows, pool, held) = (&self.rows, &self.trail_pool, &self.held);
        let per_step = &table[from.1..];
        kernel.run(&mut Tile { state: &mut self.trail, rows, pool, steps: 1, per_step, held }, &mut self.scratch);
        state.copy_from_slice(&self.trail[..numbers]);
        if entries > 0 {
            self.tables[from.0].1 = table;
        }
        &self.trail[numbers..]
    }

    /// One step of a state at a time.
    #[inline]
    pub fn advance_at(&mut self, stage: &Stage<T>, t: f64, state: &mut [T]) {
        self.advance_over(stage, t, [t, t, 1.0], state);
    }

    /// The same, where inputs are looked up over a window.
    pub fn advance_over(&mut self, stage: &Stage<T>, t: f64, [from, to, length]: Window<f64>, state: &mut [T]) {
        if stage.split.entries.is_empty() {
            self.steps(1, &[], state);
            return;
        }
        let mut table = std::mem::take(&mut self.moment);
        let kit = Arc::clone(&self.kit);
        self.fill(stage, &kit.moment, &[t, from, to, length].map(T::of), 1, &mut table);
        self.steps(1, &table, state);
        self.moment = table;
    }

    #[inline]
    fn steps(&mut self, steps: usize, per_step: &[u64], state: &mut [T]) {
        let (kernel, by) = self.kit.runner.kernel(steps);
        if self.pool_for != Some(by) {
            self.pool = Aligned::from(&kernel.pool(&self.uniforms));
            self.pool_for = Some(by);
        }
        let tile = &mut Tile { state, rows: &self.rows, pool: &self.pool, steps, per_step, held: &self.held };
        kernel.run(tile, &mut self.scratch);
    }

    /// The table of [`STEPS_AT_ONCE`] steps from step `first`, by its place among those that are kept.
    fn table(&mut self, stage: &Stage<T>, clock: &Clock, first: i64) -> usize {
        if let Some(at) = self.tables.iter().position(|(from, _)| *from == first) {
            return at;
        }
        let at = if self.tables.len() < self.most_tables {
            self.tables.push((first, Vec::new()));
            self.tables.len() - 1
        } else {
            self.oldest = (self.oldest + 1) % self.most_tables;
            self.tables[self.oldest].0 = first;
            self.oldest
        };
        // What is there already is filled anew: a step of a world allocates nothing.
        let (mut times, mut table) = (std::mem::take(&mut self.times), std::mem::take(&mut self.tables[at].1));
        times.clear();
        times.extend((first..first + STEPS_AT_ONCE).map(|k| T::of(clock.at(k))));
        let kit = Arc::clone(&self.kit);
        self.fill(stage, &kit.step, &times, times.len(), &mut table);
        (self.times, self.tables[at].1) = (times, table);
        at
    }

    /// The entries of steps at these times, as many as the interpreter has lanes. Behind one time there may be its window.
    fn fill(&mut self, stage: &Stage<T>, step: &Runner<T>, times: &[T], steps: usize, table: &mut Vec<u64>) {
        let (entries, lanes) = (&stage.split.entries, self.lanes());
        self.values.resize(entries.len() * steps, T::default()); // all of them are by anew
        let (kernel, by) = step.kernel(1);
        if self.given_for != Some(by) {
            (self.given_pool, self.given_for) = (kernel.pool(&self.given), Some(by));
        }
        let (values, pool) = (&mut self.values, &self.given_pool);
        let tile = &mut Tile { state: values, rows: times, pool, steps: 1, per_step: &[], held: &[] };
        kernel.run(tile, &mut self.scratch);
        table.resize(entries.len() * steps, 0);
        for (e, (entry, values)) in entries.iter().zip(self.values.chunks_exact(steps)).enumerate() {
            let places = table[e..].iter_mut().step_by(entries.len());
            let each = places.zip(values);
            match *entry {
                Entry::Value => each.for_each(|(place, value)| *place = value.pattern()),
                Entry::Sample(input) => {
                    let samples = &self.common[input as usize];
                    each.for_each(|(place, value)| *place = samples[value.wide() as usize].pattern());
                }
                Entry::Row(input) => {
                    let first = self.inputs[input as usize];
                    each.for_each(|(place, value)| *place = (first + value.wide() as usize * lanes) as u64);
                }
            }
        }
    }
}

/// Steps of a table, which begins at a multiple of them: they are the lanes in which it is computed.
const STEPS_AT_ONCE: i64 = 256;
