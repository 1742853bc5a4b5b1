//! The driver of steps of chosen length: every member goes at its own pace, and a lane that is done takes the next member.

use std::{ops::Range, sync::Arc, thread};

use super::{
    Machine, Model,
    batch::{cut, expect},
    crew::{self, GoOn},
    paced::Paced,
};
use crate::{error::Error, pace::Pace, spec::Row, trace::Traced};

/// A run to be made.
#[derive(Clone, Debug)]
pub struct Plan<'a> {
    /// What to step, and how.
    pub model: Model<'a>,
    /// What hot loops may use.
    pub machine: Machine,
    /// Time of the start.
    pub t0: f64,
    /// Times to reach exactly and to keep the state at, ascending.
    pub at: &'a [f64],
    /// The step to try first.
    pub first: Row<'a>,
    /// Tolerated error of a step, relative to the length of a block.
    pub relative: Row<'a>,
    /// Tolerated error of a step beside the relative one.
    pub absolute: Row<'a>,
    /// The most attempts of a member.
    pub budget: i64,
    /// Velocities at the start, by rows.
    pub v: Vec<Row<'a>>,
    /// Coordinates at the start, by rows.
    pub y: Vec<Row<'a>>,
    /// How many members.
    pub members: usize,
}

/// How a member ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Status {
    /// At the last time.
    Ok = 0,
    /// Out of attempts.
    Budget = 2,
    /// A step no longer moves the time.
    Underflow = 3,
    /// As `Underflow`, because nothing finite came of any step.
    NotFinite = 4,
}

/// What a run fills: arrays of rows of one number per member.
#[derive(Debug)]
pub struct Arrays<'a> {
    /// The states at the asked times; NaN from where a member stopped.
    pub saved_v: &'a mut [f64],
    /// Likewise the coordinates.
    pub saved_y: &'a mut [f64],
    /// Two rows: the time that a member reached, and the step that it would try next.
    pub reached: &'a mut [f64],
    /// Three rows: accepted and rejected attempts, and the status.
    pub counts: &'a mut [i64],
}

/// Attempts between two looks at the lanes; of a large member a single one, which may take long.
const LOOK: usize = 16;
/// Numbers of a lane above which it is large.
const LARGE: usize = 1000;
/// Members below which a second thread costs more than it brings, for a small system.
const WORTH_A_THREAD: usize = 256;

struct Part<'a> {
    first: usize,
    count: usize,
    saved_v: Vec<&'a mut [f64]>,
    saved_y: Vec<&'a mut [f64]>,
    reached: Vec<&'a mut [f64]>,
    counts: Vec<&'a mut [i64]>,
}

/// Makes the run. The monitor is as that of [`crate::batch::run`].
pub fn run(plan: &Plan, arrays: Arrays, monitor: &mut dyn FnMut(f64) -> bool) -> Result<(), Error> {
    let b = plan.members;
    let traced = plan.model.traced()?;
    let (p, q) = (traced.shape.v, traced.shape.y);
    expect("v", p, plan.v.len())?;
    expect("y", q, plan.y.len())?;
    expect("saved_v", plan.at.len() * p * b, arrays.saved_v.len())?;
    expect("saved_y", plan.at.len() * q * b, arrays.saved_y.len())?;
    expect("reached", 2 * b, arrays.reached.len())?;
    expect("counts", 3 * b, arrays.counts.len())?;
    let several = [plan.first, plan.relative, plan.absolute];
    for row in plan.model.spec.rows.iter().chain(&plan.v).chain(&plan.y).chain(&several) {
        if row.0.len() != 1 {
            expect("a row", b, row.0.len())?;
        }
    }

    let mine = Worker::new(plan, &traced)?;
    let lanes = mine.group.lanes();
    let threads = match plan.machine.threads {
        0 if lanes > 1 && b < WORTH_A_THREAD => 1,
        0 => thread::available_parallelism().map_or(1, usize::from),
        n => n,
    };
    let threads = threads.min(b.div_ceil(lanes)).max(1);
    // Few shares, since lanes run empty at the end of each; but some, so that one that is late does not keep the others waiting.
    let shares = if threads == 1 { 1 } else { b.div_ceil(lanes).min(threads * 8) };
    let shares: Vec<usize> = (0..shares).map(|i| b * (i + 1) / shares - b * i / shares).collect();
    let mut counts = cut(arrays.counts, b, &shares).into_iter();
    let mut rows = [arrays.saved_v, arrays.saved_y, arrays.reached].map(|a| cut(a, b, &shares).into_iter());
    let mut parts = Vec::with_capacity(shares.len());
    let mut first = 0;
    for count in shares {
        let [saved_v, saved_y, reached] = rows.each_mut().map(|r| r.next().unwrap_or_default());
        parts.push(Part { first, count, saved_v, saved_y, reached, counts: counts.next().unwrap_or_default() });
        first += count;
    }
    let total = b as f64;
    crew::share(parts, threads, total, monitor, mine, || Worker::new(plan, &traced), Worker::part)
}

/// Who is in a lane: a member of the part, and which of the asked times is next.
#[derive(Clone, Copy)]
struct Seat {
    member: usize,
    next: usize,
}

struct Worker<'a> {
    plan: &'a Plan<'a>,
    group: Box<dyn Paced>,
}

impl<'a> Worker<'a> {
    fn new(plan: &'a Plan<'a>, traced: &Arc<Traced>) -> Result<Self, Error> {
        let threads = if plan.members == 1 { plan.machine.threads } else { 1 };
        let machine = Machine { threads, ..plan.machine };
        Ok(Worker { plan, group: plan.model.paced(traced, machine, plan.members, plan.budget as f64)? })
    }

    fn part(&mut self, mut part: Part, go_on: GoOn) -> Result<(), Error> {
        let mut waiting = 0..part.count;
        let mut seats: Vec<Option<Seat>> = vec![None; self.group.lanes()];
        for (lane, seat) in seats.iter_mut().enumerate() {
            // A lane that nobody takes still needs parameters that are numbers; its pace never runs.
            self.sit(&part, lane, part.count - 1);
            *seat = waiting.next().map(|member| self.sit(&part, lane, member));
        }
        while seats.iter().any(Option::is_some) {
            for (lane, seat) in seats.iter_mut().enumerate() {
                if let Some(taken) = *seat {
                    *seat = self.tend(&mut part, lane, taken, &mut waiting, go_on)?;
                }
            }
            let numbers = self.plan.v.len() + self.plan.y.len();
            self.group.attempt(if numbers > LARGE { 1 } else { LOOK });
            if !go_on(0) {
                return Err(Error::Interrupted);
            }
        }
        Ok(())
    }

    /// A member takes a lane, at the start.
    fn sit(&mut self, part: &Part, lane: usize, member: usize) -> Seat {
        let (plan, at) = (self.plan, part.first + member);
        self.group.prepare_lane(&plan.model.spec, lane, at);
        let state: Vec<f64> = plan.v.iter().chain(&plan.y).map(|row| row.at(at)).collect();
        self.group.sit(lane, &state);
        let (first, relative, absolute) = (plan.first.at(at), plan.relative.at(at), plan.absolute.at(at));
        self.group.set_pace(lane, Pace::new(plan.t0, first, relative, absolute));
        Seat { member, next: 0 }
    }

    /// Brings a lane to where it has something to do: keeps what it has reached, sets its next time, ends its member and seats the
    /// next. None if there is nobody left.
    fn tend(
        &mut self,
        part: &mut Part,
        lane: usize,
        mut seat: Seat,
        waiting: &mut Range<usize>,
        go_on: GoOn,
    ) -> Result<Option<Seat>, Error> {
        let plan = self.plan;
        loop {
            let mut pace = self.group.pace(lane);
            while let Some(&target) = plan.at.get(seat.next) {
                pace.target = target;
                if pace.t < target {
                    break;
                }
                self.keep(part, lane, seat);
                seat.next += 1;
            }
            if seat.next < plan.at.len() && pace.runs(plan.budget as f64) {
                self.group.set_pace(lane, pace);
                return Ok(Some(seat));
            }
            self.end(part, seat, &pace);
            if !go_on(1) {
                return Err(Error::Interrupted);
            }
            let Some(member) = waiting.next() else {
                self.group.set_pace(lane, Pace { target: pace.t, ..pace }); // nothing runs in an empty lane
                return Ok(None);
            };
            seat = self.sit(part, lane, member);
        }
    }

    /// Notes how a member ended.
    fn end(&self, part: &mut Part, seat: Seat, pace: &Pace<f64>) {
        let times = self.plan.at.len();
        let status = if seat.next == times {
            Status::Ok
        } else if pace.accepted + pace.rejected >= self.plan.budget as f64 {
            Status::Budget
        } else if pace.error < f64::INFINITY {
            Status::Underflow
        } else {
            Status::NotFinite
        };
        for rows in [&mut part.saved_v, &mut part.saved_y] {
            let block = rows.len() / times.max(1);
            for row in &mut rows[seat.next * block..] {
                row[seat.member] = f64::NAN;
            }
        }
        for (row, number) in part.reached.iter_mut().zip([pace.t, pace.h]) {
            row[seat.member] = number;
        }
        for (row, number) in part.counts.iter_mut().zip([pace.accepted as i64, pace.rejected as i64, status as i64]) {
            row[seat.member] = number;
        }
    }

    fn keep(&self, part: &mut Part, lane: usize, seat: Seat) {
        let state = self.group.state(lane);
        let (v, y) = state.split_at(self.plan.v.len());
        for (rows, block) in [(&mut part.saved_v, v), (&mut part.saved_y, y)] {
            for (row, number) in rows[seat.next * block.len()..].iter_mut().zip(block) {
                row[seat.member] = *number;
            }
        }
    }
}
