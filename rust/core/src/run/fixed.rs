//! The driver of fixed steps: shares members among threads, saves states, and finds which members diverged.

pub(super) mod events;

use std::{sync::Arc, time::Instant};

use self::events::{Looks, Stepped};

use super::{
    Model,
    columns::{Columns, cut},
    workers::{self, POLL, Workers},
};
use crate::{
    error::Error,
    events::{motion::Events, watch::Watch},
    group::{Group, lanes::Lanes},
    model::spec::Row,
    stage::{Clock, Machine, Stop},
    step::tapes::{Traceable, Traced},
    tape::real::Real,
};

/// A run to be made.
#[derive(Clone, Debug)]
pub struct FixedRun<'a> {
    /// The system and the method.
    pub model: Model<'a>,
    /// Time and step.
    pub clock: Clock,
    /// The instruction set and threads of hot loops.
    pub machine: Machine,
    /// Number of the first step.
    pub first: i64,
    /// Number of steps; 0 to record quantities of the given states only.
    pub steps: i64,
    /// Save every `every`-th step, the first state and the last; or the last alone.
    pub every: Option<i64>,
    /// The v slot at the first step, by rows; after them the blocks that the method keeps, if `carried`.
    pub v: Vec<Row<'a>>,
    /// The coordinates at the first step, by rows.
    pub y: Vec<Row<'a>>,
    /// How many members.
    pub members: usize,
    /// The v slot holds the carry already, and the blocks that the method keeps are known: do not start.
    pub carried: bool,
    /// How many members have parameters of their own; those of further members repeat them.
    pub own: usize,
    /// The events to look for.
    pub events: Option<&'a Events<'a>>,
}

impl FixedRun<'_> {
    /// Steps of all members.
    fn total(&self) -> f64 {
        self.members as f64 * self.steps as f64
    }
}

/// The output of a run: arrays of rows of one number per member.
#[derive(Debug)]
pub struct Arrays<'a, T = f64> {
    /// The saved v, one block per saved step.
    pub saved_v: &'a mut [T],
    /// The saved y.
    pub saved_y: &'a mut [T],
    /// The quantities recorded beside each saved state.
    pub recorded: &'a mut [T],
    /// The sums over the steps and the watched quantities, rows of one number per member; empty if not asked for.
    pub tally: &'a mut [T],
    /// The v slot at the end, and the blocks that the method keeps; empty if not asked for.
    pub carry: &'a mut [T],
    /// Per member, the number of the first step that is not finite, or −1; members that have one are not checked.
    pub first_bad: &'a mut [i64],
}

/// The step, counted from the first, after which a run saves its `i`-th state.
pub fn save(steps: i64, every: Option<i64>, i: usize) -> i64 {
    every.map_or(steps, |every| every.max(1).saturating_mul(i as i64).min(steps))
}

/// How many states a run keeps.
pub fn kept(steps: i64, every: Option<i64>) -> usize {
    every.map_or(1, |every| steps.div_euclid(every.max(1)) + i64::from(steps % every.max(1) != 0) + 1) as usize
}

/// The most steps between two checks of the clock and of whether all states are finite.
const DIVERGENCE_CHECK_INTERVAL: i64 = 1 << 16;
/// Operations until the first check, about, and steps at most: until then the time of an operation is not known. Interpreted,
/// this many take some milliseconds.
const OPERATIONS_TO_FIRST_CHECK: usize = 1 << 22;
const STEPS_TO_FIRST_CHECK: i64 = 1 << 14;
/// Numbers × steps between two later checks, at most.
const NUMBERS_BETWEEN_CHECKS: i64 = 1 << 23;
/// A group of more numbers than this is first checked after one step, to see how long that takes: the cost of a step of many
/// bodies grows faster than their numbers.
const LARGE_MEMBER_NUMBERS: i64 = 1 << 16;
/// If a member diverged between two checks, the steps between them are repeated with this many checks in between, and so on.
const RETRACE_INTERVALS: i64 = 16;
/// Numbers × steps below which a second thread costs more time than it saves.
pub const MIN_NUMBER_STEPS_FOR_THREADS: f64 = 3e6;

/// Numbers that groups step.
pub trait Steppable: Traceable {
    /// A group for a run of `members` members, and of `steps` steps of members in all.
    fn group(
        model: &Model,
        traced: &Traced,
        machine: Machine,
        members: usize,
        clock: &Clock,
        steps: f64,
    ) -> Result<Box<dyn Group<Self>>, Error>;

    /// Makes `steps` steps from the k-th on and looks for events in them. A method of the number, so that it is compiled once.
    fn look(looks: &mut Looks, on: &mut Stepped<Self>, k: i64, steps: i64);
}

impl Steppable for f64 {
    fn group(
        model: &Model,
        traced: &Traced,
        machine: Machine,
        members: usize,
        clock: &Clock,
        steps: f64,
    ) -> Result<Box<dyn Group>, Error> {
        model.group(traced, machine, members, clock, steps)
    }

    fn look(looks: &mut Looks, on: &mut Stepped<f64>, k: i64, steps: i64) {
        looks.advance(on, k, steps);
    }
}

impl Steppable for f32 {
    fn group(
        model: &Model,
        traced: &Traced,
        machine: Machine,
        members: usize,
        clock: &Clock,
        _steps: f64,
    ) -> Result<Box<dyn Group<f32>>, Error> {
        Ok(Box::new(Lanes::<f32>::new(traced, &model.spec, machine.level, members, clock)?))
    }

    fn look(looks: &mut Looks, on: &mut Stepped<f32>, k: i64, steps: i64) {
        looks.advance(on, k, steps);
    }
}

/// One thread's share of the members, as slices of every row.
struct Part<'a, T> {
    first: usize,
    count: usize,
    saved_v: Columns<'a, T>,
    saved_y: Columns<'a, T>,
    recorded: Columns<'a, T>,
    tally: Columns<'a, T>,
    carry: Columns<'a, T>,
    first_bad: &'a mut [i64],
}

pub(crate) fn expect(what: &'static str, expected: usize, got: usize) -> Result<(), Error> {
    if expected == got { Ok(()) } else { Err(Error::Shape { what, expected, got }) }
}

/// Makes the run. The monitor is called on the caller's thread some dozens of times a second with the fraction that is done;
/// when it returns false, the run ends soon.
pub fn run<T: Steppable>(plan: &FixedRun, arrays: Arrays<T>, monitor: &mut dyn FnMut(f64) -> bool) -> Result<(), Error> {
    let b = plan.members;
    let traced = plan.model.traced()?;
    let (p, q) = (traced.shape.v, traced.shape.y);
    let kept = kept(plan.steps, plan.every);
    let kept_numbers = traced.kept;
    expect("v", p + if plan.carried { kept_numbers } else { traced.memory }, plan.v.len())?;
    expect("y", q, plan.y.len())?;
    if plan.steps > 0 {
        expect("saved_v", kept * p * b, arrays.saved_v.len())?;
        expect("saved_y", kept * q * b, arrays.saved_y.len())?;
    }
    expect("recorded", kept * traced.recorded * b, arrays.recorded.len())?;
    if !arrays.tally.is_empty() {
        expect("tally", traced.tally * b, arrays.tally.len())?;
    }
    if !arrays.carry.is_empty() {
        expect("carry", (p + kept_numbers) * b, arrays.carry.len())?;
    }
    expect("first_bad", b, arrays.first_bad.len())?;
    let rows = [("a parameter", plan.own, &plan.model.spec.rows), ("a row of v", b, &plan.v), ("a row of y", b, &plan.y)];
    for (what, members, rows) in rows {
        for row in rows {
            if row.0.len() != 1 {
                expect(what, members, row.0.len())?;
            }
        }
    }

    let total = plan.total();
    let lanes = plan.model.lanes::<T>(&traced, plan.machine, b, total)?;
    let groups = b.div_ceil(lanes);
    let work = (p + q) as f64 * b as f64 * plan.steps as f64;
    let threads = plan.machine.threads_for(groups, work >= MIN_NUMBER_STEPS_FOR_THREADS);
    plan.model.room(traced.shape, threads)?;
    // A single group may use all threads; it decides whether they are worthwhile.
    let machine = Machine { threads: if groups == 1 { plan.machine.threads } else { 1 }, ..plan.machine };
    // Several shares per thread, so that the others do not wait long for a slow one.
    let shares = if threads == 1 { 1 } else { groups.min(threads * 4) };
    let shares: Vec<usize> = (0..shares)
        .map(|i| {
            let edge = |i: usize| (groups * i / shares * lanes).min(b);
            edge(i + 1) - edge(i)
        })
        .collect();

    let Arrays { saved_v, saved_y, recorded, tally, carry, first_bad } = arrays;
    let numbers = [saved_v, saved_y, recorded, tally, carry].map(|array| cut(array, b, &shares).into_iter());
    let [mut saved_v, mut saved_y, mut recorded, mut tally, mut carry] = numbers;
    let mut first = 0;
    let mut left = first_bad;
    let mut parts = Vec::with_capacity(shares.len());
    for count in shares {
        let numbers = [&mut saved_v, &mut saved_y, &mut recorded, &mut tally, &mut carry].map(Iterator::next);
        let (first_bad, later) = std::mem::take(&mut left).split_at_mut(count);
        if let [Some(saved_v), Some(saved_y), Some(recorded), Some(tally), Some(carry)] = numbers {
            parts.push(Part { first, count, saved_v, saved_y, recorded, tally, carry, first_bad });
        }
        (first, left) = (first + count, later);
    }

    let workers = Workers { threads, background: traced.is_long(lanes), total, stop: Stop::default() };
    let worker = || Worker::new(plan, &traced, machine, &workers.stop);
    workers::share(parts, &workers, monitor, worker(), || Ok(worker()), Worker::part)
}

/// State at the last check, to return to; and scratch buffers.
#[derive(Default)]
struct Good<T> {
    /// The slots at the last check.
    v: Vec<T>,
    y: Vec<T>,
    /// The blocks that the method keeps, and the sums over the steps, at the last check.
    kept: Vec<T>,
    tally: Vec<T>,
    /// The carry, while the v slot holds velocities.
    carried: Vec<T>,
    /// The recorded quantities of a state.
    recorded: Vec<T>,
    /// The state before unrolled steps.
    before: Vec<T>,
}

/// One thread's groups, and where it stands.
struct Worker<'a, T: Real> {
    plan: &'a FixedRun<'a>,
    traced: &'a Arc<Traced>,
    machine: Machine,
    /// Groups of as many members as fit, and for the rest that fills no such group, with its number of members.
    full: Option<Box<dyn Group<T>>>,
    rest: Option<(usize, Box<dyn Group<T>>)>,
    good: Good<T>,
    watch: Option<Watch<'a>>,
    stop: &'a Stop,
}

impl<'a, T: Steppable> Worker<'a, T> {
    fn new(plan: &'a FixedRun<'a>, traced: &'a Arc<Traced>, machine: Machine, stop: &'a Stop) -> Self {
        let watch = plan.events.map(Watch::new);
        Worker { plan, traced, machine, full: None, rest: None, good: Good::default(), watch, stop }
    }

    /// The group for the `left` members that are left, of as many lanes as fit if not all are taken at once.
    fn group(&mut self, left: usize, lanes: usize) -> Result<&mut dyn Group<T>, Error> {
        let make = |members| -> Result<Box<dyn Group<T>>, Error> {
            let mut group = T::group(&self.plan.model, self.traced, self.machine, members, &self.plan.clock, self.plan.total())?;
            group.set_stop_flag(self.stop);
            Ok(group)
        };
        if left >= lanes {
            let full = match self.full.take() {
                Some(full) => full,
                None => make(self.plan.members)?,
            };
            return Ok(self.full.insert(full).as_mut());
        }
        let rest = match self.rest.take() {
            Some((members, rest)) if members == left => rest,
            _ => make(left)?,
        };
        Ok(self.rest.insert((left, rest)).1.as_mut())
    }

    fn part(&mut self, mut part: Part<T>, go_on: &mut dyn FnMut(u64) -> bool) -> Result<(), Error> {
        let (plan, carries, members) = (self.plan, self.traced.carries, part.count);
        let lanes = plan.model.lanes::<T>(self.traced, self.machine, plan.members, plan.total())?;
        let first_piece = self.traced.steps_of(lanes, OPERATIONS_TO_FIRST_CHECK).min(STEPS_TO_FIRST_CHECK);
        let mut from = 0;
        let mut watch = self.watch.take();
        if let Some(watch) = &mut watch {
            watch.begin(part.first, members);
        }
        while from < members {
            let mut good = std::mem::take(&mut self.good);
            let group = self.group(members - from, lanes)?;
            let count = (members - from).min(group.lanes());
            let (part, checked) = (&mut part, plan.first);
            let notices = plan.model.key.signature.watched.is_some() && !group.tally().is_empty();
            let members = part.first + from..part.first + from + count;
            let looks = watch.as_mut().map(|watch| Looks::new(watch, notices, group.lanes(), members.start, members.len()));
            let mut job = Job { plan, carries, first_piece, group, part, from, count, good: &mut good, checked, looks };
            let ran = job.run(go_on);
            self.good = good;
            if !ran {
                return Err(Error::Interrupted);
            }
            from += count;
        }
        if let Some(watch) = &mut watch {
            watch.end();
        }
        self.watch = watch;
        Ok(())
    }
}

/// How many steps are made between two checks, now and at most, and when the last one was.
struct Checks {
    piece: i64,
    longest: i64,
    began: Instant,
}

/// One group's run.
struct Job<'a, 'b, 'w, 'e, T: Real> {
    plan: &'a FixedRun<'a>,
    /// The event search, if there are events.
    looks: Option<Looks<'w, 'e>>,
    /// The v slot holds something else than v between steps: finish before keeping it.
    carries: bool,
    /// How many steps until the first check.
    first_piece: i64,
    group: &'a mut dyn Group<T>,
    part: &'a mut Part<'b, T>,
    from: usize,
    count: usize,
    good: &'a mut Good<T>,
    /// The step of the state that is remembered there.
    checked: i64,
}

/// Copies the rows of a group into those from the `at`-th on, as far as there are any.
#[inline]
fn put<T: Copy>(rows: &mut Columns<T>, at: usize, from: usize, count: usize, slot: &[T], lanes: usize) {
    let all = (slot.len() / lanes).min(rows.rows().saturating_sub(at));
    if all == 0 {
        return;
    }
    if let Some(whole) = rows.whole(at, all) {
        if whole.len() == slot.len() {
            whole.copy_from_slice(slot);
        } else {
            let rows = whole.chunks_exact_mut(whole.len() / all);
            rows.zip(slot.chunks_exact(lanes)).for_each(|(row, slot)| row[from..from + count].copy_from_slice(&slot[..count]));
        }
        return;
    }
    for (i, slot) in (at..rows.rows()).zip(slot.chunks_exact(lanes)) {
        match (rows.row(i), slot) {
            // A call that copies one number takes longer than the number.
            (row, [number]) => row[from] = *number,
            (row, slot) => row[from..from + count].copy_from_slice(&slot[..count]),
        }
    }
}

impl<T: Steppable> Job<'_, '_, '_, '_, T> {
    /// Whether it ran to its end.
    fn run(&mut self, go_on: &mut dyn FnMut(u64) -> bool) -> bool {
        let (plan, lanes) = (self.plan, self.group.lanes());
        self.group.prepare(&plan.model.spec, self.part.first + self.from, self.count);
        let (v, y) = self.group.slots_mut();
        let (first, count) = (self.part.first + self.from, self.count);
        let fill = |rows: &[Row], slot: &mut [T]| {
            rows.iter().zip(slot.chunks_exact_mut(lanes)).for_each(|(row, slot)| row.fill(first, count, slot));
        };
        let (of_v, mut kept_rows) = plan.v.split_at(v.len() / lanes);
        fill(of_v, v);
        fill(&plan.y, y);
        let numbers = (v.len() + y.len()).max(1) as i64;
        if plan.carried {
            for block in self.group.kept_mut() {
                let (rows, others) = kept_rows.split_at(block.len() / lanes);
                fill(rows, block);
                kept_rows = others;
            }
        } else {
            if let Some(block) = self.group.kept_mut().last_mut() {
                let first = block.len() - kept_rows.len() * lanes;
                fill(kept_rows, &mut block[first..]);
            }
            self.group.start(plan.first);
        }
        self.remember(plan.first);

        let mut k = plan.first;
        let longest = (NUMBERS_BETWEEN_CHECKS / numbers).clamp(1, DIVERGENCE_CHECK_INTERVAL);
        let first = if numbers > LARGE_MEMBER_NUMBERS { 1 } else { self.first_piece };
        let mut checks = Checks { piece: first, longest, began: Instant::now() };
        // A run that keeps every state makes several steps at once where it can.
        let keeps_all = plan.every == Some(1) && self.group.recorded() == 0 && self.looks.is_none();
        let unrolled = if keeps_all { self.group.unrolled(&plan.model.spec, self.part.first + self.from, self.count) } else { 0 };
        let mut i = 0;
        while i < kept(plan.steps, plan.every) {
            let until = plan.first + save(plan.steps, plan.every, i);
            while k < until {
                let n = (until - k).min(self.checked + checks.piece - k);
                self.advance(k, n);
                k += n;
                if !self.check_if_due(k, &mut checks, go_on) {
                    return false;
                }
            }
            let room = (self.checked + checks.piece).min(plan.first + plan.steps) - k;
            let steps = unrolled as i64;
            if unrolled == 0 || steps > room || k % steps != 0 || !self.save_unrolled(i, k, unrolled) {
                self.save(i, k);
                i += 1;
                continue;
            }
            (i, k) = (i + unrolled, k + steps);
            if !self.check_if_due(k, &mut checks, go_on) {
                return false;
            }
        }
        let left = k - self.checked;
        if left > 0 && self.is_suspect() {
            self.retrace(k);
        }
        if left > 0 && !go_on((left * self.count as i64) as u64) {
            return false;
        }
        let mut at = 0;
        for block in std::iter::once(self.group.slots().0).chain(self.group.kept()) {
            put(&mut self.part.carry, at, self.from, self.count, block, lanes);
            at += block.len() / lanes;
        }
        put(&mut self.part.tally, 0, self.from, self.count, self.group.tally(), lanes);
        if let Some(mut looks) = self.looks.take() {
            looks.end();
            self.write_stops(&looks);
        }
        true
    }

    /// Writes the states that events gave to members, and of those that stopped, for all later saved states, too.
    fn write_stops(&mut self, looks: &Looks) {
        let plan = self.plan;
        for (lane, given) in looks.given().iter().enumerate() {
            for ([from, until], state) in given {
                let column = self.from + lane;
                let step = |i: &usize| plan.first + save(plan.steps, plan.every, *i);
                let first = (from - plan.first).max(0) / plan.every.unwrap_or(1).max(1);
                let first = if plan.every.is_some() { first as usize } else { 0 };
                for i in (first..kept(plan.steps, plan.every)).take_while(|i| step(i) < *until).filter(|i| step(i) >= *from) {
                    self.write(i, column, state);
                }
                if *until == i64::MAX {
                    self.part.first_bad[column] = -1;
                    self.forget_carry(column);
                }
            }
        }
        for (lane, stop) in looks.stops().iter().enumerate() {
            let Some(stop) = stop else { continue };
            let column = self.from + lane;
            self.part.first_bad[column] = -1;
            for i in 0..kept(plan.steps, plan.every) {
                if save(plan.steps, plan.every, i) <= stop.step.number - plan.first {
                    continue;
                }
                self.write(i, column, &stop.state);
            }
            self.forget_carry(column);
        }
    }

    /// Writes a saved state of a member.
    fn write(&mut self, i: usize, column: usize, state: &[f64]) {
        let (p, q) = self.rows();
        let (v, y) = state.split_at(p);
        v.iter().enumerate().for_each(|(row, x)| self.part.saved_v.row(i * p + row)[column] = T::of(*x));
        y.iter().enumerate().for_each(|(row, x)| self.part.saved_y.row(i * q + row)[column] = T::of(*x));
    }

    /// Marks the carry of a member as unknown: it ended at an event.
    fn forget_carry(&mut self, column: usize) {
        (0..self.part.carry.rows()).for_each(|row| self.part.carry.row(row)[column] = T::of(f64::NAN));
    }

    /// Makes steps.
    fn advance(&mut self, k: i64, n: i64) {
        match self.looks.take() {
            None => self.group.advance(k, n),
            Some(mut looks) => {
                let (from, count) = (self.from, self.count);
                let mut on = Stepped {
                    carries: self.carries || !self.group.kept().is_empty(),
                    spec: Some(&self.plan.model.spec),
                    first: self.part.first + from,
                    count,
                    h: self.plan.clock.h,
                    first_bad: &mut self.part.first_bad[from..from + count],
                    carried: self.plan.carried,
                    begin: [&self.plan.v, &self.plan.y],
                    group: &mut *self.group,
                };
                T::look(&mut looks, &mut on, k, n);
                self.looks = Some(looks);
            }
        }
    }

    /// Checks at step `k` which members diverged, if a check is due; false if the run is to end.
    fn check_if_due(&mut self, k: i64, checks: &mut Checks, go_on: &mut dyn FnMut(u64) -> bool) -> bool {
        let done = k - self.checked;
        if done < checks.piece {
            return true;
        }
        self.check(k);
        let now = Instant::now();
        checks.piece = if now - checks.began > POLL { (checks.piece / 2).max(1) } else { checks.longest.min(4 * checks.piece) };
        checks.began = now;
        go_on((done * self.count as i64) as u64)
    }

    /// How many numbers of a member each slot has.
    fn rows(&self) -> (usize, usize) {
        let (lanes, (v, y)) = (self.group.lanes(), self.group.slots());
        (v.len() / lanes, y.len() / lanes)
    }

    fn save(&mut self, i: usize, k: i64) {
        let lanes = self.group.lanes();
        let (p, q) = self.rows();
        self.finish(k);
        let (v, y) = self.group.slots();
        put(&mut self.part.saved_v, i * p, self.from, self.count, v, lanes);
        put(&mut self.part.saved_y, i * q, self.from, self.count, y, lanes);
        let recorded = self.group.recorded();
        if recorded > 0 {
            let rows = &mut self.good.recorded;
            rows.resize(recorded * lanes, T::default());
            self.group.record(rows);
            put(&mut self.part.recorded, i * recorded, self.from, self.count, rows, lanes);
        }
        let is_followed = self.looks.as_ref().is_some_and(|looks| looks.changes());
        let diverged = self.carries && !is_followed && self.any_new(T::INFINITY);
        self.unfinish();
        if diverged {
            self.retrace(k);
            self.note_velocities(k);
        }
    }

    /// Makes the unrolled steps from step `k`, and saves the states before each; the first is the `i`-th saved state. If a
    /// velocity that is computed from the carry is not finite, the old state is restored and nothing is saved, and false is
    /// returned: then the steps are made one by one, to find which member diverged and at which step.
    fn save_unrolled(&mut self, i: usize, k: i64, steps: usize) -> bool {
        let lanes = self.group.lanes();
        let (p, q) = self.rows();
        let (from, count) = (self.from, self.count);
        if self.carries {
            let ((v, y), tally) = (self.group.slots(), self.group.tally());
            self.good.before.clear();
            [v, y, tally].iter().for_each(|slot| self.good.before.extend_from_slice(slot));
        }
        let (v, y) = self.group.advance_unrolled(k).split_at(steps * p * lanes);
        let first_bad = &self.part.first_bad[from..from + count];
        let is_new = |row: &[T]| row.iter().zip(first_bad).any(|(x, first_bad)| *first_bad < 0 && !x.is_below(T::INFINITY));
        if self.carries && !all_below(v, T::INFINITY) && v.chunks_exact(lanes).any(is_new) {
            let (v, y) = self.group.slots_mut();
            let (old_v, others) = self.good.before.split_at(v.len());
            let (old_y, old_tally) = others.split_at(y.len());
            v.copy_from_slice(old_v);
            y.copy_from_slice(old_y);
            self.group.tally_mut().copy_from_slice(old_tally);
            return false;
        }
        put(&mut self.part.saved_v, i * p, from, count, v, lanes);
        put(&mut self.part.saved_y, i * q, from, count, y, lanes);
        true
    }

    /// From now on the v slot holds velocities, until `unfinish`.
    fn finish(&mut self, k: i64) {
        if self.carries {
            keep(&mut self.good.carried, self.group.slots().0);
            self.group.finish(k);
        }
    }

    fn unfinish(&mut self) {
        if self.carries {
            self.group.slots_mut().0.copy_from_slice(&self.good.carried);
        }
    }

    /// Keeps the state of step `k` to come back to.
    fn remember(&mut self, k: i64) {
        let (v, y) = self.group.slots();
        for (good, now) in [(&mut self.good.v, v), (&mut self.good.y, y), (&mut self.good.tally, self.group.tally())] {
            keep(good, now);
        }
        self.good.kept.clear();
        self.group.kept().iter().for_each(|block| self.good.kept.extend_from_slice(block));
        self.checked = k;
    }

    /// Whether a member that was finite so far has a number in its slots that is not below this size.
    fn any_new(&self, size: T) -> bool {
        let (v, y) = self.group.slots();
        // Members are searched one by one only if some number is not below.
        !(all_below(v, size) && all_below(y, size)) && (0..self.count).any(|l| self.is_new(l, size))
    }

    fn is_new(&self, l: usize, size: T) -> bool {
        let lanes = self.group.lanes();
        let (v, y) = self.group.slots();
        let all_below = |slot: &[T]| slot.iter().skip(l).step_by(lanes).all(|x| x.is_below(size));
        self.part.first_bad[self.from + l] < 0 && !(all_below(v) && all_below(y))
    }

    /// Infinities and NaN persist in the slots, so it is enough to check at intervals. Velocities that are computed from a
    /// method's carry may be infinite and later finite again, but only if its numbers are [`Real::HUGE`].
    /// Where events change states, states are checked as these happen.
    fn is_suspect(&self) -> bool {
        if self.looks.as_ref().is_some_and(|looks| looks.changes()) {
            return false;
        }
        let most = if self.carries { huge(self.plan.clock.h) } else { T::INFINITY };
        self.any_new(most)
    }

    fn check(&mut self, k: i64) {
        if self.is_suspect() {
            self.retrace(k);
        } else {
            self.remember(k);
        }
    }

    /// Finds which members diverged since the last check and at which step, and checks step `k`, in whose state the group is.
    fn retrace(&mut self, k: i64) {
        let steps = k - self.checked;
        if steps == 1 {
            // Where rates are not finite of a state that is, as a root of a negative number, the velocity is not finite one step
            // before the carry.
            if self.carries && self.checked > self.plan.first {
                self.go_back();
                self.note_velocities(self.checked);
                self.group.advance(self.checked, 1);
            }
            self.note(k);
            self.note_velocities(k);
            return self.remember(k);
        }
        // Back to the last check, and on in shorter pieces.
        self.go_back();
        let piece = (steps as u64).div_ceil(RETRACE_INTERVALS as u64) as i64;
        let mut at = self.checked;
        while at < k {
            let n = piece.min(k - at);
            self.group.advance(at, n);
            at += n;
            self.check(at);
        }
    }

    /// Back to the state that is kept.
    fn go_back(&mut self) {
        let (v, y) = self.group.slots_mut();
        v.copy_from_slice(&self.good.v);
        y.copy_from_slice(&self.good.y);
        self.group.tally_mut().copy_from_slice(&self.good.tally);
        let mut rest = self.good.kept.as_slice();
        for block in self.group.kept_mut() {
            let (good, others) = rest.split_at(block.len());
            block.copy_from_slice(good);
            rest = others;
        }
    }

    /// Notes the members with a velocity that is not finite after step `k`, in whose state the group is, if it is computed from a
    /// carry. Of the state at the start nothing is said: no step has been made.
    fn note_velocities(&mut self, k: i64) {
        if self.carries && k > self.plan.first {
            self.finish(k);
            self.note(k);
            self.unfinish();
        }
    }

    /// Notes the members with a number in the slots that is not finite after step `k`.
    fn note(&mut self, k: i64) {
        for l in 0..self.count {
            if self.is_new(l, T::INFINITY) {
                self.part.first_bad[self.from + l] = k;
            }
        }
    }
}

/// From this size of what a method carries on, the velocities that are computed from it may be infinite.
pub(crate) fn huge<T: Real>(h: f64) -> T {
    T::of(T::HUGE.wide() * h.abs().min(1.0))
}

/// Whether all numbers are smaller. All numbers of a chunk are compared, which is vector code.
pub(crate) fn all_below<T: Real>(numbers: &[T], size: T) -> bool {
    numbers.chunks(64).all(|chunk| chunk.iter().fold(true, |all, x| all & x.is_below(size)))
}

fn keep<T: Copy>(to: &mut Vec<T>, numbers: &[T]) {
    to.clear();
    to.extend_from_slice(numbers);
}
