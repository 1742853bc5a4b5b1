//! A stage with the numbers of some members.

use std::sync::Arc;

use super::{
    clock::{Clock, Force},
    compiled::{CompiledStage, Numbers, STEPS_AT_ONCE, Stage, Unrolled},
};
use crate::{
    aligned::Aligned,
    isa::Level,
    kernel::{
        Kernel, Tile,
        runner::{KernelKind, Runner},
    },
    model::{
        spec::{Row, Spec},
        window::Window,
    },
    tape::{
        real::Real,
        reserved::BUDGET,
        split::{Entry, HOLD_SLACK, UniformSource},
    },
};

/// Tables of steps that are kept, in numbers: groups after the first find them there.
const MOST_ENTRIES: usize = 1 << 16;

/// A stage with its kernel and the parameters and inputs of some members: all that its hot loop reads.
pub struct PreparedStage<T: Real = f64> {
    compiled: Arc<CompiledStage<T>>,
    /// Numbers that all members have in common, in the order of [`Split::sources`].
    shared: Vec<T>,
    /// The shared numbers in the layout of the kernel for entries of steps, and whether that kernel is machine code.
    shared_pool: Vec<T>,
    shared_pool_for: Option<KernelKind>,
    /// The parts of a step of float32 that are computed in float64.
    clock: Option<ClockNumbers>,
    /// The uniforms of the hot loop.
    uniforms: Vec<T>,
    /// The uniforms in the layout of the kernel, and whether that kernel is machine code.
    pool: Aligned<T>,
    pool_for: Option<KernelKind>,
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
    /// A state with the states of unrolled steps behind it, and the pool of its kernel.
    unrolled: Aligned<T>,
    unrolled_pool: Aligned<T>,
    unrolled_pool_for: Option<KernelKind>,
}

/// Numbers of 64 bits for entries of a step of float32: those in common to all members, their layout for the kernel, times,
/// and the values that entries are made of.
#[derive(Default)]
struct ClockNumbers {
    shared: Vec<f64>,
    pool: Vec<f64>,
    pool_for: Option<KernelKind>,
    times: Vec<f64>,
    values: Vec<f64>,
    scratch: Vec<f64>,
}

impl<T: Real> PreparedStage<T> {
    /// Prepares a stage for `members` members. `budget` is the most attempts of a member, for those.
    pub fn new(stage: &Stage<T>, spec: &Spec, level: Level, members: usize, clock: &Clock, budget: f64) -> PreparedStage<T> {
        PreparedStage::with(stage, stage.compiled(level, members), spec, clock, budget)
    }

    /// Prepares a stage with a kernel that was chosen already.
    pub(crate) fn with(
        stage: &Stage<T>,
        compiled: Arc<CompiledStage<T>>,
        spec: &Spec,
        clock: &Clock,
        budget: f64,
    ) -> PreparedStage<T> {
        let (split, lanes) = (&stage.split, compiled.runner.lanes());
        let last = |input: u32| spec.tables[input as usize].samples.len() as f64 - 1.0;
        let before = |input: u32| spec.tables[..input as usize].iter().map(|table| table.samples.len()).sum::<usize>();
        let number = |source: &UniformSource| match *source {
            UniformSource::Step => clock.h,
            UniformSource::Param(BUDGET) => budget,
            UniformSource::Param(i) => spec.rows[i as usize].at(0),
            UniformSource::Start(input) => spec.tables[input as usize].start,
            UniformSource::Interval(input) => spec.tables[input as usize].interval,
            UniformSource::Last(input) => last(input),
            UniformSource::First(input) => (before(input) * lanes) as f64,
            UniformSource::Lanes => lanes as f64,
            UniformSource::Slack => HOLD_SLACK,
        };
        let wide: Vec<f64> = split.sources.iter().map(number).collect();
        let shared: Vec<T> = wide.iter().map(|number| T::of(*number)).collect();
        let mut uniforms = vec![T::default(); split.run.next.len()];
        let mut scratch = Vec::new();
        let tile = &mut Tile { state: &mut uniforms, rows: &[], pool: &shared, steps: 1, per_step: &[], held: &[] };
        compiled.run.run(tile, &mut scratch);
        let common = spec.tables.iter().map(|table| table.samples.iter().map(|row| T::of(row.at(0))).collect()).collect();
        PreparedStage {
            shared,
            shared_pool: Vec::new(),
            shared_pool_for: None,
            clock: compiled.clock.as_ref().map(|_| ClockNumbers { shared: wide, ..ClockNumbers::default() }),
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
            unrolled: Aligned::new(0),
            unrolled_pool: Aligned::new(0),
            unrolled_pool_for: None,
            compiled,
        }
    }

    /// How long rows are.
    pub fn lanes(&self) -> usize {
        self.compiled.runner.lanes()
    }

    /// Takes the parameters of the members from `first`; lanes past the `count`-th repeat the last.
    pub fn prepare(&mut self, stage: &Stage<T>, spec: &Spec, first: usize, count: usize) {
        self.take_common(stage, spec);
        let lanes = self.lanes();
        for (raw, param) in self.raw.chunks_exact_mut(lanes).zip(&stage.split.params) {
            spec.rows[*param as usize].fill(first, count, raw);
        }
        self.find_rows();
        self.take_samples(stage, spec, |row, to| row.fill(first, count, to));
    }

    /// Computes again what follows from parameters that all members have in common, where these are not what they were.
    pub(crate) fn take_common(&mut self, stage: &Stage<T>, spec: &Spec) {
        let mut differs = false;
        for (at, source) in stage.split.sources.iter().enumerate() {
            let UniformSource::Param(i) = *source else { continue };
            let Some(number) = spec.rows.get(i as usize).filter(|_| i != BUDGET).map(|row| row.at(0)) else { continue };
            if T::of(number).pattern() != self.shared[at].pattern() {
                (self.shared[at], differs) = (T::of(number), true);
            }
            if let Some(wide) = self.clock.as_mut().filter(|wide| wide.shared[at].to_bits() != number.to_bits()) {
                (wide.shared[at], wide.pool_for, differs) = (number, None, true);
            }
        }
        if differs {
            let state = &mut self.uniforms;
            let tile = &mut Tile { state, rows: &[], pool: &self.shared, steps: 1, per_step: &[], held: &[] };
            self.compiled.run.run(tile, &mut self.scratch);
            (self.pool_for, self.shared_pool_for, self.unrolled_pool_for) = (None, None, None);
            // No table is left that is of any step.
            self.tables.iter_mut().for_each(|(first, _)| *first = i64::MIN);
        }
    }

    /// Takes the force for the members that were prepared.
    pub(crate) fn set_force(&mut self, stage: &Stage<T>, force: &Force<T>, first: usize, count: usize) {
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
        if self.rows.is_empty() {
            return;
        }
        let (rows, shared) = (&mut self.rows, &self.shared);
        let tile = &mut Tile { state: rows, rows: &self.raw, pool: shared, steps: 1, per_step: &[], held: &[] };
        self.compiled.member.run(tile, &mut self.scratch);
    }

    /// Takes the parameters of a member into one lane.
    pub(crate) fn prepare_lane(&mut self, stage: &Stage<T>, spec: &Spec, lane: usize, member: usize) {
        let split = &stage.split;
        let raw: Vec<T> = split.params.iter().map(|param| T::of(spec.rows[*param as usize].at(member))).collect();
        let mut made = vec![T::default(); split.member.next.len()];
        let tile = &mut Tile { state: &mut made, rows: &raw, pool: &self.shared, steps: 1, per_step: &[], held: &[] };
        self.compiled.single.run(tile, &mut self.scratch);
        let lanes = self.lanes();
        for (row, number) in self.rows.chunks_exact_mut(lanes).zip(made) {
            row[lane] = number;
        }
        self.take_samples(stage, spec, |row, to| to[lane] = T::of(row.at(member)));
    }

    /// Fills the rows of samples of inputs that differ between members.
    fn take_samples(&mut self, stage: &Stage<T>, spec: &Spec, take: impl Fn(&Row, &mut [T])) {
        let lanes = self.lanes();
        let of_members = stage.split.entries.iter().any(|entry| matches!(entry, Entry::Row(_)))
            || stage.split.sources.contains(&UniformSource::Lanes);
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

    /// Compiles now instead of when it pays, and keeps one table of steps only, as real-time loops need no more.
    pub(crate) fn compile_now(&mut self) {
        self.compiled.runner.write();
        if !self.compiled.step.body().ops.is_empty() {
            self.compiled.step.write();
        }
        self.most_tables = 1;
    }

    /// Makes `n` steps of a state from step `k`.
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

    /// How many steps are unrolled; 0 if none are.
    pub(crate) fn unrolled(&self, stage: &Stage<T>, level: Level, numbers: Numbers) -> usize {
        let make = || Unrolled::new(&stage.split, level, self.lanes(), numbers);
        self.compiled.unrolled.get_or_init(make).as_ref().map_or(0, |unrolled| unrolled.steps)
    }

    /// Makes the unrolled steps from step `k`, a multiple of their number. Returns the velocities before each step, then the
    /// coordinates before each step.
    pub(crate) fn advance_unrolled(&mut self, stage: &Stage<T>, clock: &Clock, k: i64, state: &mut [T]) -> &[T] {
        let compiled = Arc::clone(&self.compiled);
        let Some(Some(unrolled)) = compiled.unrolled.get() else { return &[] };
        let numbers = state.len();
        if self.unrolled.is_empty() {
            self.unrolled = Aligned::new(unrolled.runner.body().next.len() * self.lanes());
        }
        let (entries, mut table) = (stage.split.entries.len(), Vec::new());
        let mut from = (0, 0);
        if entries > 0 {
            let first = k.div_euclid(STEPS_AT_ONCE) * STEPS_AT_ONCE;
            let at = self.table(stage, clock, first);
            table = std::mem::take(&mut self.tables[at].1);
            from = (at, (k - first) as usize * entries);
        }
        let (kernel, by) = unrolled.runner.kernel(1);
        if self.unrolled_pool_for != Some(by) {
            self.unrolled_pool = Aligned::from(&kernel.pool(&self.uniforms));
            self.unrolled_pool_for = Some(by);
        }
        self.unrolled[..numbers].copy_from_slice(state);
        let (rows, pool, held) = (&self.rows, &self.unrolled_pool, &self.held);
        let per_step = &table[from.1..];
        kernel.run(&mut Tile { state: &mut self.unrolled, rows, pool, steps: 1, per_step, held }, &mut self.scratch);
        state.copy_from_slice(&self.unrolled[..numbers]);
        if entries > 0 {
            self.tables[from.0].1 = table;
        }
        &self.unrolled[numbers..]
    }

    /// One step of a state at a time.
    #[inline]
    pub(crate) fn advance_at(&mut self, stage: &Stage<T>, t: f64, state: &mut [T]) {
        self.advance_over(stage, t, [t, t, 1.0], state);
    }

    /// One step of a state at a time, with inputs averaged over a window.
    pub(crate) fn advance_over(&mut self, stage: &Stage<T>, t: f64, [from, to, length]: Window<f64>, state: &mut [T]) {
        if stage.split.entries.is_empty() {
            self.steps(1, &[], state);
            return;
        }
        let mut table = std::mem::take(&mut self.moment);
        let compiled = Arc::clone(&self.compiled);
        self.fill(stage, &compiled.moment, &[t, from, to, length].map(T::of), 1, &mut table);
        self.steps(1, &table, state);
        self.moment = table;
    }

    #[inline]
    fn steps(&mut self, steps: usize, per_step: &[u64], state: &mut [T]) {
        let (kernel, by) = self.compiled.runner.kernel(steps);
        if self.pool_for != Some(by) {
            let pool = kernel.pool(&self.uniforms);
            if self.pool.len() == pool.len() {
                self.pool.copy_from_slice(&pool);
            } else {
                self.pool = Aligned::from(&pool);
            }
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
        if let Some(wide) = &mut self.clock {
            wide.times.clear();
            wide.times.extend((first..first + STEPS_AT_ONCE).map(|k| clock.at(k)));
        }
        let compiled = Arc::clone(&self.compiled);
        self.fill(stage, &compiled.step, &times, times.len(), &mut table);
        (self.times, self.tables[at].1) = (times, table);
        at
    }

    /// The entries of steps at these times, as many as the interpreter has lanes. Behind one time there may be its window.
    fn fill(&mut self, stage: &Stage<T>, step: &Runner<T>, times: &[T], steps: usize, table: &mut Vec<u64>) {
        let (entries, lanes) = (&stage.split.entries, self.lanes());
        self.values.resize(stage.split.step.next.len() * steps, T::default()); // all overwritten below
        let (kernel, by) = step.kernel(1);
        if self.shared_pool_for != Some(by) {
            (self.shared_pool, self.shared_pool_for) = (kernel.pool(&self.shared), Some(by));
        }
        let (values, pool) = (&mut self.values, &self.shared_pool);
        let tile = &mut Tile { state: values, rows: times, pool, steps: 1, per_step: &[], held: &[] };
        kernel.run(tile, &mut self.scratch);
        table.resize(entries.len() * steps, 0);
        let of_step = stage.split.step.next.len();
        for (e, (entry, values)) in entries.iter().zip(self.values.chunks_exact(steps)).enumerate() {
            let places = table[e..].iter_mut().step_by(entries.len());
            enter(*entry, places, values, &self.common, &self.inputs, lanes);
        }
        if let (Some(wide), Some(runner)) = (&mut self.clock, &self.compiled.clock) {
            wide.values.resize(stage.split.clock.next.len() * steps, 0.0);
            let (kernel, by) = runner.kernel(1);
            if wide.pool_for != Some(by) {
                (wide.pool, wide.pool_for) = (kernel.pool(&wide.shared), Some(by));
            }
            let ClockNumbers { values, times, pool, scratch, .. } = wide;
            kernel.run(&mut Tile { state: values, rows: times, pool, steps: 1, per_step: &[], held: &[] }, scratch);
            for (e, (entry, values)) in entries[of_step..].iter().zip(wide.values.chunks_exact(steps)).enumerate() {
                let places = table[of_step + e..].iter_mut().step_by(entries.len());
                enter(*entry, places, values, &self.common, &self.inputs, lanes);
            }
        }
    }
}

/// Writes an entry of some steps: a value in the precision of the lanes, or what holds the sample of that number.
fn enter<'a, T: Real, N: Real>(
    entry: Entry,
    places: impl Iterator<Item = &'a mut u64>,
    values: &[N],
    common: &[Vec<T>],
    inputs: &[usize],
    lanes: usize,
) {
    let each = places.zip(values);
    match entry {
        Entry::Value if N::PRECISION == T::PRECISION => each.for_each(|(place, value)| *place = value.pattern()),
        Entry::Value => each.for_each(|(place, value)| *place = T::of(value.wide()).pattern()),
        Entry::Sample(input) => {
            let samples = &common[input as usize];
            each.for_each(|(place, value)| *place = samples[value.wide() as usize].pattern());
        }
        Entry::Row(input) => {
            let first = inputs[input as usize];
            each.for_each(|(place, value)| *place = (first + value.wide() as usize * lanes) as u64);
        }
    }
}
