//! The driver: many members, some threads, what to keep, and who diverged.

use std::{sync::Arc, thread, time::Instant};

use super::{
    Machine, Model,
    crew::{self, POLL},
    group::Group,
    stage::Clock,
};
use crate::{error::Error, spec::Row, trace::Traced};

/// A run to be made.
#[derive(Clone, Debug)]
pub struct Plan<'a> {
    /// What to step, and how.
    pub model: Model<'a>,
    /// Time and step.
    pub clock: Clock,
    /// What hot loops may use.
    pub machine: Machine,
    /// Number of the first step.
    pub first: i64,
    /// How many steps.
    pub steps: i64,
    /// Keep every so many steps, the first state and the last; or the last alone.
    pub every: Option<i64>,
    /// The v slot at the first step, by rows.
    pub v: Vec<Row<'a>>,
    /// The coordinates at the first step, by rows.
    pub y: Vec<Row<'a>>,
    /// How many members.
    pub members: usize,
    /// The v slot holds what the method carries already: do not start.
    pub carried: bool,
}

impl Plan<'_> {
    /// Steps of all members.
    fn total(&self) -> f64 {
        self.members as f64 * self.steps as f64
    }
}

/// What a run fills: arrays of rows of one number per member.
#[derive(Debug)]
pub struct Arrays<'a> {
    /// What is kept of v, one block per kept step.
    pub saved_v: &'a mut [f64],
    /// What is kept of y.
    pub saved_y: &'a mut [f64],
    /// What is recorded beside each kept state.
    pub recorded: &'a mut [f64],
    /// What the systems added up, one number per member; empty if nobody asks.
    pub tally: &'a mut [f64],
    /// The v slot at the end; empty if nobody asks.
    pub carry: &'a mut [f64],
    /// Per member, the number of the first step that is not finite, or −1; members that have one are not looked at.
    pub first_bad: &'a mut [i64],
}

/// Steps, counted from the first, at which a run keeps its state.
pub fn saves(steps: i64, every: Option<i64>) -> impl Iterator<Item = i64> {
    let step = every.unwrap_or(steps).max(1);
    let from = if every.is_some() { 0 } else { steps };
    let last = (every.is_some() && steps % step != 0).then_some(steps);
    (from..=steps).step_by(step as usize).chain(last)
}

/// Between two looks at whether everything is finite.
const LOOK: i64 = 1024;
/// About how many numbers to step between two looks at the clock; some milliseconds of the slowest system.
const PATIENCE: i64 = 1 << 20;
/// Numbers × steps below which a second thread costs more than it brings.
const WORTH_A_THREAD: f64 = 3e6;

/// One thread's share of the members, as slices of every row.
struct Part<'a> {
    first: usize,
    saved_v: Vec<&'a mut [f64]>,
    saved_y: Vec<&'a mut [f64]>,
    recorded: Vec<&'a mut [f64]>,
    tally: Vec<&'a mut [f64]>,
    carry: Vec<&'a mut [f64]>,
    first_bad: &'a mut [i64],
}

/// Cuts every row of `width` numbers at the same places: one list of row slices per share.
pub(crate) fn cut<'a, T>(data: &'a mut [T], width: usize, shares: &[usize]) -> Vec<Vec<&'a mut [T]>> {
    let rows = data.len().checked_div(width).unwrap_or(0);
    let mut parts: Vec<_> = shares.iter().map(|_| Vec::with_capacity(rows)).collect();
    for mut row in data.chunks_exact_mut(width.max(1)) {
        for (part, share) in parts.iter_mut().zip(shares) {
            let (mine, rest) = row.split_at_mut(*share);
            part.push(mine);
            row = rest;
        }
    }
    parts
}

pub(crate) fn expect(what: &'static str, expected: usize, got: usize) -> Result<(), Error> {
    if expected == got { Ok(()) } else { Err(Error::Shape { what, expected, got }) }
}

/// Makes the run. The monitor is called on the caller's thread some dozens of times a second with the share that is done;
/// when it answers no, the run ends soon.
pub fn run(plan: &Plan, arrays: Arrays, monitor: &mut dyn FnMut(f64) -> bool) -> Result<(), Error> {
    let b = plan.members;
    let traced = plan.model.traced()?;
    let (p, q) = (traced.shape.v, traced.shape.y);
    let kept = saves(plan.steps, plan.every).count();
    expect("v", p, plan.v.len())?;
    expect("y", q, plan.y.len())?;
    expect("saved_v", kept * p * b, arrays.saved_v.len())?;
    expect("saved_y", kept * q * b, arrays.saved_y.len())?;
    expect("recorded", kept * traced.recorded * b, arrays.recorded.len())?;
    if !arrays.tally.is_empty() {
        expect("tally", b, arrays.tally.len())?;
    }
    if !arrays.carry.is_empty() {
        expect("carry", p * b, arrays.carry.len())?;
    }
    expect("first_bad", b, arrays.first_bad.len())?;
    for (what, rows) in [("a parameter", &plan.model.spec.rows), ("a row of v", &plan.v), ("a row of y", &plan.y)] {
        for row in rows {
            if row.0.len() != 1 {
                expect(what, b, row.0.len())?;
            }
        }
    }

    let total = plan.total();
    let lanes = plan.model.lanes(&traced, plan.machine, b, total)?;
    let groups = b.div_ceil(lanes);
    let work = (p + q) as f64 * b as f64 * plan.steps as f64;
    let threads = match plan.machine.threads {
        0 if work < WORTH_A_THREAD => 1,
        0 => thread::available_parallelism().map_or(1, usize::from),
        n => n,
    };
    let threads = threads.min(groups).max(1);
    // A group alone may have all threads for itself; it knows whether they pay.
    let machine = Machine { threads: if groups == 1 { plan.machine.threads } else { 1 }, ..plan.machine };
    // Several shares a thread, so that one that is late does not keep the others waiting.
    let shares = if threads == 1 { 1 } else { groups.min(threads * 4) };
    let shares: Vec<usize> = (0..shares)
        .map(|i| {
            let edge = |i: usize| (groups * i / shares * lanes).min(b);
            edge(i + 1) - edge(i)
        })
        .collect();

    let mut first = 0;
    let mut parts = Vec::with_capacity(shares.len());
    let numbers = [arrays.saved_v, arrays.saved_y, arrays.recorded, arrays.tally, arrays.carry].map(|a| cut(a, b, &shares));
    let [mut saved_v, mut saved_y, mut recorded, mut tally, mut carry] = numbers.map(Vec::into_iter);
    let next = |of: &mut std::vec::IntoIter<_>| of.next().unwrap_or_default();
    for first_bad in cut(arrays.first_bad, b, &shares) {
        let (saved_v, saved_y) = (next(&mut saved_v), next(&mut saved_y));
        let (recorded, tally, carry) = (next(&mut recorded), next(&mut tally), next(&mut carry));
        if let Some(first_bad) = first_bad.into_iter().next() {
            let count = first_bad.len();
            parts.push(Part { first, saved_v, saved_y, recorded, tally, carry, first_bad });
            first += count;
        }
    }

    let worker = || Worker::new(plan, &traced, machine);
    crew::share(parts, threads, total, monitor, worker(), || Ok(worker()), Worker::part)
}

/// Both slots and the tally when everybody was last looked at.
#[derive(Default)]
struct Good {
    v: Vec<f64>,
    y: Vec<f64>,
    tally: Vec<f64>,
}

/// One thread's groups, and where it stands.
struct Worker<'a> {
    plan: &'a Plan<'a>,
    traced: &'a Arc<Traced>,
    machine: Machine,
    /// For as many members as there are, and for those that fill no group of these, with their number.
    full: Option<Box<dyn Group>>,
    rest: Option<(usize, Box<dyn Group>)>,
    good: Good,
}

impl<'a> Worker<'a> {
    fn new(plan: &'a Plan<'a>, traced: &'a Arc<Traced>, machine: Machine) -> Self {
        Worker { plan, traced, machine, full: None, rest: None, good: Good::default() }
    }

    /// The group for so many members that are left, of so many lanes as fit if not all are taken at once.
    fn group(&mut self, left: usize, lanes: usize) -> Result<&mut dyn Group, Error> {
        let make = |members| self.plan.model.group(self.traced, self.machine, members, &self.plan.clock, self.plan.total());
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

    fn part(&mut self, mut part: Part, go_on: &mut dyn FnMut(u64) -> bool) -> Result<(), Error> {
        let (plan, carries, members) = (self.plan, self.traced.carries, part.first_bad.len());
        let lanes = plan.model.lanes(self.traced, self.machine, plan.members, plan.total())?;
        let mut from = 0;
        while from < members {
            let mut good = std::mem::take(&mut self.good);
            let group = self.group(members - from, lanes)?;
            let count = (members - from).min(group.lanes());
            let mut job = Job { plan, carries, group, part: &mut part, from, count, good: &mut good };
            let ran = job.run(go_on);
            self.good = good;
            if !ran {
                return Err(Error::Interrupted);
            }
            from += count;
        }
        Ok(())
    }
}

/// One group's run.
struct Job<'a, 'b> {
    plan: &'a Plan<'a>,
    /// The v slot holds something else than v between steps: finish before keeping it.
    carries: bool,
    group: &'a mut dyn Group,
    part: &'a mut Part<'b>,
    from: usize,
    count: usize,
    good: &'a mut Good,
}

/// Copies the rows of a group into row slices.
fn put(rows: &mut [&mut [f64]], from: usize, count: usize, slot: &[f64], lanes: usize) {
    for (row, slot) in rows.iter_mut().zip(slot.chunks_exact(lanes)) {
        row[from..from + count].copy_from_slice(&slot[..count]);
    }
}

impl Job<'_, '_> {
    /// Whether it ran to its end.
    fn run(&mut self, go_on: &mut dyn FnMut(u64) -> bool) -> bool {
        let (plan, lanes) = (self.plan, self.group.lanes());
        self.group.prepare(&plan.model.spec, self.part.first + self.from, self.count);
        let (v, y) = self.group.slots_mut();
        for (rows, slot) in [(&plan.v, &mut *v), (&plan.y, &mut *y)] {
            for (row, slot) in rows.iter().zip(slot.chunks_exact_mut(lanes)) {
                row.fill(self.part.first + self.from, self.count, slot);
            }
        }
        let at_once = (PATIENCE / (v.len() + y.len()).max(1) as i64).clamp(1, LOOK);
        if !plan.carried {
            self.group.start(plan.first);
        }
        self.remember();

        let (mut k, mut looked, mut told) = (plan.first, plan.first, plan.first);
        // A step of many bodies costs more than their numbers tell: whoever is large begins with one and shows how long it takes.
        let mut piece = if at_once < LOOK { 1 } else { at_once };
        for (i, save) in saves(plan.steps, plan.every).enumerate() {
            let until = plan.first + save;
            while k < until {
                let n = (until - k).min(looked + at_once - k).min(piece);
                let began = Instant::now();
                self.group.advance(k, n);
                k += n;
                piece = if began.elapsed() > POLL { (n / 2).max(1) } else { at_once.min(2 * piece) };
                if k - looked == at_once {
                    self.look(looked, k);
                    looked = k;
                }
                if k == looked || piece < LOOK {
                    if !go_on(((k - told) * self.count as i64) as u64) {
                        return false;
                    }
                    told = k;
                }
            }
            self.save(i, k);
        }
        if k > looked {
            self.look(looked, k);
        }
        if k > told && !go_on(((k - told) * self.count as i64) as u64) {
            return false;
        }
        put(&mut self.part.carry, self.from, self.count, self.group.slots().0, lanes);
        put(&mut self.part.tally, self.from, self.count, self.group.tally(), lanes);
        true
    }

    fn save(&mut self, i: usize, k: i64) {
        let lanes = self.group.lanes();
        let (p, q) = (self.plan.v.len(), self.plan.y.len());
        let carried = self.carries.then(|| self.group.slots().0.to_vec());
        if carried.is_some() {
            self.group.finish(k);
        }
        let (v, y) = self.group.slots();
        put(&mut self.part.saved_v[i * p..(i + 1) * p], self.from, self.count, v, lanes);
        put(&mut self.part.saved_y[i * q..(i + 1) * q], self.from, self.count, y, lanes);
        let recorded = self.group.recorded();
        if recorded > 0 {
            let mut rows = vec![0.0; recorded * lanes];
            self.group.record(&mut rows);
            put(&mut self.part.recorded[i * recorded..(i + 1) * recorded], self.from, self.count, &rows, lanes);
        }
        if let Some(carried) = carried {
            self.group.slots_mut().0.copy_from_slice(&carried);
        }
    }

    /// Keeps the present state to come back to.
    fn remember(&mut self) {
        let (v, y) = self.group.slots();
        for (good, now) in [(&mut self.good.v, v), (&mut self.good.y, y), (&mut self.good.tally, self.group.tally())] {
            good.clear();
            good.extend_from_slice(now);
        }
    }

    /// Whether a member that was finite so far no longer is; infinities and NaN stay, so looking now and then is enough.
    fn newly_bad(&self) -> bool {
        let (v, y) = self.group.slots();
        let finite = |x: &f64| x.is_finite();
        if v.iter().all(finite) && y.iter().all(finite) {
            return false;
        }
        (0..self.count).any(|l| self.is_new(l))
    }

    fn is_new(&self, l: usize) -> bool {
        let lanes = self.group.lanes();
        let (v, y) = self.group.slots();
        let bad = |slot: &[f64]| slot.iter().skip(l).step_by(lanes).any(|x| !x.is_finite());
        self.part.first_bad[self.from + l] < 0 && (bad(v) || bad(y))
    }

    /// If somebody diverged since the last look, goes back to it and steps again, one by one, to see who and when.
    fn look(&mut self, looked: i64, k: i64) {
        if self.newly_bad() {
            let (v, y) = self.group.slots_mut();
            v.copy_from_slice(&self.good.v);
            y.copy_from_slice(&self.good.y);
            self.group.tally_mut().copy_from_slice(&self.good.tally);
            for at in looked..k {
                self.group.advance(at, 1);
                for l in 0..self.count {
                    if self.is_new(l) {
                        self.part.first_bad[self.from + l] = at + 1;
                    }
                }
            }
        }
        self.remember();
    }
}
