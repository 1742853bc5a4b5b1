//! The driver of adaptive steps: every member has its own time and step, and when one is done its lane takes the next.

mod events;

use std::{ops::Range, sync::Arc};

use self::events::{HeldEnd, Looks};

use super::{
    adaptive_plan::{Assignment, Part, Status},
    fixed::expect,
    waypoints::{self, WAYPOINTS, WaypointSearch},
    workers::{self, GoOn, Workers},
};
use crate::{
    error::Error,
    events::watch::Stop as EventStop,
    group::AdaptiveBatch,
    stage::{Machine, Stop},
    step::{
        key::StepKind,
        pace::{Pace, length},
        series_pace::SIDE,
        tapes::Traced,
    },
};

pub use super::adaptive_plan::{AdaptiveRun, Arrays};

/// Attempts between two checks of the lanes. A lane that comes to a saved time waits for half of them, and for all of the next
/// ones but the first, its extra step; fewer attempts would take as much time for calls of the kernel.
const ATTEMPTS_BETWEEN_CHECKS: usize = 4;
/// The most of a series, and between two calls of the monitor.
const MOST_ATTEMPTS: usize = 16;
/// Numbers of a lane above which it is checked after every attempt, which may take long.
const LARGE_MEMBER_NUMBERS: usize = 1000;
/// Members of a small system below which a second thread costs more time than it saves.
const MIN_MEMBERS_FOR_THREADS: usize = 256;

/// Operations of a run, by lanes, that takes some tenths of a millisecond.
const MOST_OPERATIONS: usize = 1 << 21;

/// Runs all members. Returns false, having done nothing, if an attempt is not a single tape: the caller then supplies the
/// controllers' initial state. The monitor is as that of [`crate::run::fixed::run`].
pub fn run(plan: &AdaptiveRun, arrays: Arrays, monitor: &mut dyn FnMut(f64) -> bool) -> Result<bool, Error> {
    let b = plan.members;
    let traced = plan.model.traced()?;
    let (p, q) = (traced.shape.v, traced.shape.y);
    expect("v", p, plan.v.len())?;
    expect("y", q, plan.y.len())?;
    expect("saved_v", plan.at.len() * p * b, arrays.saved_v.len())?;
    expect("saved_y", plan.at.len() * q * b, arrays.saved_y.len())?;
    expect("state", (p + q) * b, arrays.state.len())?;
    let StepKind::Attempts { acceptance, .. } = &plan.model.key.how else { return Err(Error::NoEstimate) };
    let numbers = Pace::<f64>::NUMBERS + acceptance.numbers(p, q);
    expect("paces", numbers, plan.paces.len())?;
    expect("paces", numbers * b, arrays.paces.len())?;
    expect("status", b, arrays.status.len())?;
    if !arrays.attempt_log.is_empty() {
        expect("attempt_log", 2 * plan.at.len() * b, arrays.attempt_log.len())?;
    }
    if !arrays.waypoints.is_empty() {
        expect("waypoints", WAYPOINTS * (2 * (p + q) + numbers) * b, arrays.waypoints.len())?;
    }
    if plan.every > 0 {
        let kept = arrays.steps[0].len() / b.max(1);
        expect("accepted_steps", b, arrays.accepted_steps.len())?;
        for (rows, steps) in [1, p, q].into_iter().zip(&arrays.steps) {
            expect("steps", rows * kept * b, steps.len())?;
        }
    }
    for row in plan.model.spec.rows.iter().chain(&plan.v).chain(&plan.y).chain(&plan.paces).chain(&plan.at).chain(&plan.jumps) {
        if row.0.len() != 1 {
            expect("a row", b, row.0.len())?;
        }
    }

    plan.model.room(traced.shape, 1)?;
    let stop = Stop::default();
    let worker = || Worker::new(plan, &traced, &stop);
    let mine = worker()?;
    // A member that goes on from an event begins there.
    let begins = plan.begins || mine.looks.as_ref().is_some_and(|looks| looks.watch.changes());
    if begins && !mine.group.begins() {
        return Ok(false);
    }
    let lanes = mine.group.lanes();
    let threads = plan.machine.threads_for(b.div_ceil(lanes), lanes == 1 || b >= MIN_MEMBERS_FOR_THREADS);
    plan.model.room(traced.shape, threads)?;
    // Few shares, since lanes run empty at the end of each; but several, so that the others do not wait long for a slow one.
    let shares = if threads == 1 { 1 } else { b.div_ceil(lanes).min(threads * 8) };
    let shares: Vec<usize> = (0..shares).map(|i| b * (i + 1) / shares - b * i / shares).collect();
    let parts = arrays.parts(b, shares);
    let workers = Workers { threads, background: traced.is_long(lanes), total: b as f64, stop: Stop::clone(&stop) };
    workers::share(parts, &workers, monitor, mine, worker, Worker::part)?;
    Ok(true)
}

/// Members in lanes, which are made once for runs that differ in their start alone.
pub struct Prepared {
    group: Option<Box<dyn AdaptiveBatch>>,
    /// A run that polls the monitor more often is too long to hold the lock.
    most_checks: usize,
}

impl Prepared {
    /// Prepares runs such as this one, by one thread; None if the caller must supply the controllers' initial state.
    pub fn new(plan: &AdaptiveRun) -> Result<Option<Self>, Error> {
        let traced = plan.model.traced()?;
        plan.model.room(traced.shape, 1)?;
        let machine = Machine { threads: 1, ..plan.machine };
        let group = plan.model.adaptive(&traced, machine, plan.members, plan.budget as f64, plan.extends)?;
        let most_checks = MOST_OPERATIONS / (traced.operations.1 * MOST_ATTEMPTS * group.lanes()).max(1);
        Ok((!plan.begins || group.begins()).then_some(Prepared { group: Some(group), most_checks }))
    }

    /// Takes other numbers for the same parameters; returns whether it could.
    pub fn renew(&mut self, spec: &super::Spec) -> bool {
        self.group.as_mut().is_some_and(|group| group.renew(spec))
    }

    /// Runs all members. Returns false if that takes long.
    pub fn run(&mut self, plan: &AdaptiveRun, arrays: Arrays) -> Result<bool, Error> {
        let Some(group) = self.group.take() else { return Ok(false) };
        let mut worker = Worker::of(plan, group);
        let mut left = self.most_checks;
        let mut go_on = |ended| {
            left = if ended == 0 { left.saturating_sub(1) } else { left };
            left > 0
        };
        let parts = arrays.parts(plan.members, vec![plan.members]);
        let made = parts.into_iter().try_for_each(|part| worker.part(part, &mut go_on));
        self.group = Some(worker.group);
        match made {
            Err(Error::Interrupted) => Ok(false),
            other => other.map(|()| true),
        }
    }
}

struct Worker<'a> {
    plan: &'a AdaptiveRun<'a>,
    group: Box<dyn AdaptiveBatch>,
    /// The rows of paces, where lanes stand side by side.
    places: Pace<usize>,
    waypoints: WaypointSearch,
    /// Room for the numbers of states within a step.
    sums: Vec<[f64; SIDE]>,
    /// The times to keep the state at, if they are those of all members, and some behind them that never come.
    times: Vec<f64>,
    /// The event search, if there are events.
    looks: Option<Looks<'a>>,
}

impl<'a> Worker<'a> {
    fn new(plan: &'a AdaptiveRun<'a>, traced: &Arc<Traced>, stop: &Stop) -> Result<Self, Error> {
        let threads = if plan.members == 1 { plan.machine.threads } else { 1 };
        let machine = Machine { threads, ..plan.machine };
        let mut group = plan.model.adaptive(traced, machine, plan.members, plan.budget as f64, plan.extends)?;
        group.set_stop_flag(stop);
        Ok(Worker::of(plan, group))
    }

    fn of(plan: &'a AdaptiveRun<'a>, group: Box<dyn AdaptiveBatch>) -> Self {
        let waypoints = WaypointSearch::new(plan.v.len() + plan.y.len());
        let looks = plan.events.map(|events| Looks::new(events, group.lanes()));
        let sums = vec![[0.0; SIDE]; plan.v.len() + plan.y.len()];
        let alike = group.has_sums() && plan.at.iter().all(|row| row.0.len() == 1);
        let times = plan.at.iter().map(|row| row.at(0)).chain([f64::INFINITY; SIDE]);
        let times = if alike { times.collect() } else { Vec::new() };
        let places = Pace::places(plan.v.len() + plan.y.len());
        Worker { plan, group, places, waypoints, sums, times, looks }
    }

    fn part(&mut self, mut part: Part, go_on: GoOn) -> Result<(), Error> {
        if part.attempt_log.rows() > 0 {
            return self.attempt_log(part, go_on);
        }
        if let Some(looks) = &mut self.looks {
            looks.watch.begin(part.first, part.count);
        }
        let mut waiting = 0..part.count;
        let mut assignments: Vec<Option<Assignment>> = (0..self.group.lanes()).map(|_| None).collect();
        for (lane, assigned) in assignments.iter_mut().enumerate() {
            *assigned = waiting.next().map(|member| self.begin_member(&part, lane, member));
            if assigned.is_none() {
                // A lane without a member still needs parameters that are numbers; its pace never runs.
                self.assign_member(&part, lane, part.count - 1);
                let pace = self.group.pace(lane);
                self.group.set_pace(lane, pace.idle());
            }
        }
        // Which lanes have a step to try, so that nothing is to be done for them; and how many attempts were made since the
        // monitor was last asked.
        let (mut runs, mut unseen) = (vec![false; assignments.len()], 0);
        while assignments.iter().any(Option::is_some) {
            for (lane, assigned) in assignments.iter_mut().enumerate() {
                // An extra step whose error was not tolerated leaves a step to try.
                if runs[lane] && assigned.as_ref().is_some_and(|assigned| assigned.origin.is_none()) {
                    continue;
                }
                if assigned.as_mut().is_some_and(|assigned| self.go_within(&mut part, lane, assigned)) {
                    continue;
                }
                if let Some(taken) = assigned.take() {
                    *assigned = self.update_lane(&mut part, lane, taken, &mut waiting, go_on)?;
                }
            }
            // Lanes with sums do not stop at saved times but at the last one.
            let last = self.plan.at.len().saturating_sub(1);
            let is_within = self.group.has_sums() && assignments.iter().flatten().any(|assigned| assigned.next < last);
            let attempts = if self.looks.is_some() || is_within { 1 } else { self.attempts_before_check(&assignments) };
            if is_within {
                self.group.keep_starts();
            }
            if let Some(looks) = &mut self.looks {
                let first = part.first;
                looks.before(&*self.group, |lane| Some(first + assignments[lane].as_ref()?.member));
            }
            self.waypoints.attempt(&mut *self.group, &mut part, attempts, &mut assignments);
            if is_within {
                self.save_within(&mut part, &mut assignments);
            }
            if self.plan.every == 0 {
                self.group.find_running(self.plan.budget as f64, &mut runs);
            }
            if self.looks.is_some() {
                for (lane, assigned) in assignments.iter().enumerate().filter(|_| !self.plan.jumps.is_empty()) {
                    if let Some(assigned) = assigned.as_ref().filter(|assigned| assigned.origin.is_none()) {
                        self.cross(lane, part.first + assigned.member); // behind which a step with events ends
                    }
                }
                self.look(&part, &mut assignments);
                let stops = assignments.iter().map(|assigned| assigned.as_ref().is_some_and(|assigned| assigned.stop.is_some()));
                runs.iter_mut().zip(stops).for_each(|(runs, stops)| *runs &= !stops);
            }
            unseen += if self.is_large() { MOST_ATTEMPTS } else { attempts };
            if unseen >= MOST_ATTEMPTS {
                unseen = 0;
                if !go_on(0) {
                    return Err(Error::Interrupted);
                }
            }
        }
        if let Some(looks) = &mut self.looks {
            looks.watch.end();
        }
        Ok(())
    }

    /// The last time of a member.
    fn last(&self, member: usize) -> f64 {
        self.plan.at.last().map_or(f64::NAN, |row| row.at(member))
    }

    /// Whether an attempt of a member may take long.
    fn is_large(&self) -> bool {
        self.plan.v.len() + self.plan.y.len() > LARGE_MEMBER_NUMBERS
    }

    /// How many attempts are made before the next check of the lanes.
    fn attempts_before_check(&self, assignments: &[Option<Assignment>]) -> usize {
        if self.group.has_terms() {
            return if self.plan.every > 0 { 1 } else { self.attempts_by_series() };
        }
        // A member that makes an extra step makes only that before the next check.
        let (taken, extra) =
            assignments.iter().flatten().fold((0, 0), |(n, m), assigned| (n + 1, m + usize::from(assigned.origin.is_some())));
        let most = if self.is_large() || 2 * extra > taken { 1 } else { ATTEMPTS_BETWEEN_CHECKS };
        most.min(self.attempts_to_next_kept(assignments))
    }

    /// Attempts after which a member may have made a step that is kept.
    fn attempts_to_next_kept(&self, assignments: &[Option<Assignment>]) -> usize {
        let every = self.plan.every;
        if every == 0 {
            return usize::MAX;
        }
        let left = |(lane, assigned): (usize, &Option<Assignment>)| {
            assigned.as_ref().map(|_| every - self.group.pace(lane).accepted as i64 % every)
        };
        assignments.iter().enumerate().filter_map(left).min().unwrap_or(1) as usize
    }

    /// Keeps the state of a lane if it has made a step that is to be kept. Returns whether there is no room for another.
    fn keep_step(&self, part: &mut Part, lane: usize, assigned: &mut Assignment) -> bool {
        let every = self.plan.every;
        if every == 0 {
            return false;
        }
        let pace = self.group.pace(lane);
        let is_new = pace.accepted > assigned.accepted && pace.accepted as i64 % every == 0;
        assigned.accepted = pace.accepted;
        if is_new {
            let (row, member, state) = (assigned.accepted_steps, assigned.member, self.group.state(lane));
            let (v, y) = state.split_at(self.plan.v.len());
            for (rows, block) in part.steps.iter_mut().zip([&[pace.t], v, y]) {
                for (i, number) in block.iter().enumerate() {
                    rows.row(row * block.len() + i)[member] = *number;
                }
            }
            assigned.accepted_steps += 1;
            part.accepted_steps.row(0)[member] = assigned.accepted_steps as i64;
        }
        assigned.accepted_steps == part.steps[0].rows()
    }

    /// Makes attempts of all members one by one, keeping where they stand before the first and after each.
    fn attempt_log(&mut self, mut part: Part, go_on: GoOn) -> Result<(), Error> {
        let (lanes, rows) = (self.group.lanes(), self.plan.at.len());
        let of_time = self.plan.v.len() + self.plan.y.len() + Pace::<f64>::PLACES[0];
        for first in (0..part.count).step_by(lanes) {
            let last = part.count - 1;
            for lane in 0..lanes {
                self.begin_member(&part, lane, (first + lane).min(last)); // lanes without a member repeat the last
                let pace = self.group.pace(lane);
                self.group.set_pace(lane, Pace { target: f64::INFINITY, held: 0.0, ..pace });
            }
            for (row, ends) in self.plan.at.iter().enumerate() {
                self.note(&mut part, first, row);
                for lane in 0..lanes {
                    let end = ends.at(part.first + (first + lane).min(last));
                    if self.group.row(of_time).is_some_and(|times| times[lane] < end) {
                        continue;
                    }
                    let pace = self.group.pace(lane);
                    if pace.t >= end && pace.target > pace.t {
                        self.group.set_pace(lane, pace.idle());
                    }
                }
                let budget = self.plan.budget as f64;
                if row + 1 < rows && (0..lanes).any(|lane| self.group.pace(lane).runs(budget)) {
                    self.group.attempt(1);
                    for lane in (0..lanes).filter(|_| !self.plan.jumps.is_empty()) {
                        self.cross(lane, part.first + (first + lane).min(last));
                    }
                }
                if !go_on(0) {
                    return Err(Error::Interrupted);
                }
            }
            for (lane, member) in (first..part.count).enumerate().take(lanes) {
                let pace = self.group.pace(lane);
                self.end(&mut part, lane, &Assignment::of_log(member, rows), &pace, None);
            }
        }
        Ok(())
    }

    /// Logs the states of all lanes, the first of which has member `first`.
    fn note(&self, part: &mut Part, first: usize, row: usize) {
        let (p, q, rows) = (self.plan.v.len(), self.plan.y.len(), self.plan.at.len());
        let members = first..part.count.min(first + self.group.lanes());
        if self.group.row(0).is_none() {
            for (lane, member) in members.enumerate() {
                let pace = self.group.pace(lane);
                part.attempt_log.row(row)[member] = pace.t;
                part.attempt_log.row(rows + row)[member] = length(pace.t, pace.h, pace.wall);
                self.save(part, lane, &Assignment::of_log(member, row));
            }
            return;
        }
        let copy = |number: usize, to: &mut [f64]| {
            let from = self.group.row(number).unwrap_or_default();
            to[members.clone()].copy_from_slice(&from[..members.len()]);
        };
        (0..p).for_each(|i| copy(i, part.saved_v.row(row * p + i)));
        (0..q).for_each(|i| copy(p + i, part.saved_y.row(row * q + i)));
        for (i, place) in Pace::<f64>::PLACES.into_iter().enumerate() {
            copy(p + q + place, part.attempt_log.row(i * rows + row));
        }
        if !self.plan.jumps.is_empty() {
            for (lane, member) in members.clone().enumerate() {
                let pace = self.group.pace(lane);
                part.attempt_log.row(rows + row)[member] = length(pace.t, pace.h, pace.wall);
            }
        }
    }

    /// Brings a lane whose member has come to a wall behind it; returns whether it did.
    fn cross(&mut self, lane: usize, member: usize) -> bool {
        let pace = self.group.pace(lane);
        if pace.t < pace.wall {
            return false;
        }
        let Some(after) = self.behind(member, pace.t) else { return false };
        self.group.set_pace(lane, pace.crossed(after, self.wall(member, after), self.group.is_series()));
        true
    }

    /// The next time at which a step of a member from t must end.
    fn wall(&self, member: usize, t: f64) -> f64 {
        let before = &self.plan.jumps[..self.plan.jumps.len() / 2];
        before.get(before.partition_point(|row| row.at(member) <= t)).map_or(f64::INFINITY, |row| row.at(member))
    }

    /// The time just after the last jump of a member before which a step may have ended; none without one.
    fn behind(&self, member: usize, t: f64) -> Option<f64> {
        let (before, after) = self.plan.jumps.split_at(self.plan.jumps.len() / 2);
        let last = before.partition_point(|row| row.at(member) <= t).checked_sub(1)?;
        after.get(last).map(|row| row.at(member))
    }

    /// How many attempts are made before the next check, by the number of steps that are left to the next saved times. A single
    /// lane makes half of them. Of many lanes, each waits for half of the attempts when it is there, and a check costs about a
    /// fourth of an attempt: the sum is least for the root of half of the steps that a lane has left in the mean.
    fn attempts_by_series(&self) -> usize {
        let left = self.group.steps_left() / 2.0;
        let attempts = if self.group.lanes() > 1 { left.sqrt() } else { left };
        (attempts as usize).clamp(1, MOST_ATTEMPTS)
    }

    /// Puts a member into a lane, which steps it from now on.
    fn begin_member(&mut self, part: &Part, lane: usize, member: usize) -> Assignment {
        let assigned = self.assign_member(part, lane, member);
        if self.plan.begins {
            self.group.begin(&self.plan.model.spec, lane, part.first + member);
        }
        assigned
    }

    /// Puts a member into a lane, at its start.
    fn assign_member(&mut self, part: &Part, lane: usize, member: usize) -> Assignment {
        let (plan, at) = (self.plan, part.first + member);
        self.group.prepare_lane(&plan.model.spec, lane, at);
        let state: Vec<f64> = plan.v.iter().chain(&plan.y).map(|row| row.at(at)).collect();
        self.group.set_state(lane, &state);
        let pace = Pace::of(std::array::from_fn(|i| plan.paces[i].at(at)));
        let scales: Vec<f64> = plan.paces[Pace::<f64>::NUMBERS..].iter().map(|row| row.at(at)).collect();
        self.group.set_scales(lane, &scales);
        self.waypoints.expect_after(pace.accepted);
        if let Some(looks) = &mut self.looks {
            // An earlier run checked a held step up to its last time.
            looks.begin(lane, at, if pace.held > 0.0 { pace.target } else { f64::NEG_INFINITY });
            let end = plan.at.last().map_or(f64::NAN, |row| row.at(at));
            looks.begin_course((lane, at), [pace.t, end], plan.begins.then_some(&state));
        }
        self.group.set_pace(lane, Pace { target: pace.t, wall: self.wall(at, pace.t), ..pace });
        Assignment {
            accepted: pace.accepted,
            held_before: pace.held > 0.0,
            passed: pace.accepted as u64,
            ..Assignment::of_log(member, 0)
        }
    }

    /// Brings a lane to its next attempt: saves the states that it has reached and sets its next time, or ends its member and
    /// assigns the next. None if no member is left.
    fn update_lane(
        &mut self,
        part: &mut Part,
        lane: usize,
        mut assigned: Assignment,
        waiting: &mut Range<usize>,
        go_on: GoOn,
    ) -> Result<Option<Assignment>, Error> {
        let (plan, budget) = (self.plan, self.plan.budget as f64);
        loop {
            if let Some(stop) = assigned.stop.take() {
                self.end_at(part, lane, &mut assigned, &stop);
                if stop.goes_on {
                    continue;
                }
                match self.next_member(part, lane, waiting, go_on)? {
                    Some(next) => assigned = next,
                    None => return Ok(None),
                }
            }
            let is_full = self.keep_step(part, lane, &mut assigned);
            if let Some((origin, rejected)) = assigned.origin.take() {
                // An extra step whose error was not tolerated did not change the state; the run has gone on with shorter steps.
                if self.group.pace(lane).rejected <= rejected {
                    let state = self.group.state(lane);
                    self.group.set_state(lane, &origin);
                    let member = part.first + assigned.member;
                    let (next, last) = (plan.at.get(assigned.next).map(|row| row.at(member)), self.last(member));
                    if self.group.has_sums() && !assigned.by_steps && next.is_some_and(|next| next < last) {
                        // Those before the last time, now that a step to there has seen nothing that the held one missed.
                        self.group.keep_starts();
                        self.save_sums(part, lane, &mut assigned, last);
                    }
                    self.write(part, &assigned, &state);
                    assigned.next += 1;
                } else {
                    assigned.by_steps = false;
                    let member = part.first + assigned.member;
                    self.looks.iter_mut().for_each(|looks| looks.watch.has_other_steps(member));
                }
            }
            if !plan.jumps.is_empty() {
                self.cross(lane, part.first + assigned.member);
            }
            let mut pace = self.group.pace(lane);
            while let Some(target) = plan.at.get(assigned.next) {
                pace.target = target.at(part.first + assigned.member);
                let target = pace.target;
                if pace.t < target {
                    break;
                }
                self.save(part, lane, &assigned);
                assigned.next += 1;
            }
            if !is_full && assigned.next < plan.at.len() && self.group.has_terms() && pace.held > 0.0 {
                if std::mem::take(&mut assigned.held_before) {
                    self.group.set_pace(lane, pace);
                    return Ok(Some(assigned));
                }
                self.go_by_terms(part, lane, &mut assigned, pace);
                continue;
            }
            if !is_full && assigned.next < plan.at.len() {
                if self.group.has_sums() {
                    let last = self.last(part.first + assigned.member);
                    let before = if plan.is_part { f64::INFINITY } else { last };
                    let mut is_within = pace.target < before && pace.holds();
                    if is_within && !assigned.by_steps {
                        self.group.keep_starts();
                        assigned.by_steps = self.group.changes_within(lane);
                        // If the last time is within, the step to there comes first.
                        if !assigned.by_steps && pace.reach().0 <= before {
                            self.save_sums(part, lane, &mut assigned, pace.reach().0);
                            if assigned.next == plan.at.len() {
                                continue;
                            }
                        }
                        is_within = assigned.by_steps;
                    }
                    assigned.by_steps &= is_within || pace.held <= 0.0;
                    if !assigned.by_steps {
                        pace.target = last;
                    }
                }
                if pace.holds() {
                    pace.extra = pace.target - pace.t;
                    assigned.origin = Some((self.group.state(lane), pace.rejected));
                } else {
                    pace.held = 0.0;
                }
                if pace.extra > 0.0 || pace.runs(budget) {
                    self.group.set_pace(lane, pace);
                    return Ok(Some(assigned));
                }
            }
            match self.stop_in_held(part, lane, &assigned, &pace) {
                Some(stop) => {
                    self.end_at(part, lane, &mut assigned, &stop);
                    if stop.goes_on {
                        continue;
                    }
                }
                None => self.end(part, lane, &assigned, &pace, is_full.then_some(Status::Full)),
            }
            match self.next_member(part, lane, waiting, go_on)? {
                Some(next) => assigned = next,
                None => return Ok(None),
            }
        }
    }

    /// Puts the next member into a lane, if one is left.
    fn next_member(
        &mut self,
        part: &Part,
        lane: usize,
        waiting: &mut Range<usize>,
        go_on: GoOn,
    ) -> Result<Option<Assignment>, Error> {
        if !go_on(1) {
            return Err(Error::Interrupted);
        }
        if let Some(member) = waiting.next() {
            return Ok(Some(self.begin_member(part, lane, member)));
        }
        let pace = self.group.pace(lane);
        self.group.set_pace(lane, pace.idle()); // nothing runs in an empty lane
        Ok(None)
    }

    /// In a held step with known coefficients, saves the state at the next time within it, or takes the step.
    fn go_by_terms(&mut self, part: &mut Part, lane: usize, assigned: &mut Assignment, mut pace: Pace<f64>) {
        let (spec, member) = (&self.plan.model.spec, part.first + assigned.member);
        if !pace.holds() {
            self.group.set_pace(lane, Pace { held: 0.0, ..pace });
            self.group.attempt_alone(spec, lane, member);
            let accepted = self.group.pace(lane).accepted;
            waypoints::keep_lane(&*self.group, part, lane, assigned, accepted as u64);
            self.waypoints.expect_after(accepted);
            return;
        }
        if self.group.has_sums() {
            self.group.keep_starts();
            self.group.set_pace(lane, Pace { target: self.last(member), ..pace });
            let saved = self.save_sums(part, lane, assigned, pace.reach().0);
            self.count_extra(lane, saved);
            return;
        }
        pace.extra = pace.target - pace.t;
        let origin = self.group.state(lane);
        self.group.set_pace(lane, pace);
        self.group.attempt_alone(spec, lane, member);
        self.save(part, lane, assigned);
        assigned.next += 1;
        self.group.set_state(lane, &origin);
    }

    /// At the start of a lane's held step, saves the state of the extra step that it has made, and sets the next one, or lets the
    /// held step be taken. Does what [`Self::update_lane`] does, and moves nothing else. Returns false where that has more to do.
    fn go_within(&mut self, part: &mut Part, lane: usize, assigned: &mut Assignment) -> bool {
        let (p, n, made) = (self.plan.v.len(), self.plan.v.len() + self.plan.y.len(), assigned.origin.is_some());
        let Pace { t, h, target: until, extra, held, wall, rejected, .. } = self.places;
        let at = |place: usize| self.group.row(place).map_or(f64::NAN, |row| row[lane]);
        let next = assigned.next + usize::from(made);
        let Some(target) = self.plan.at.get(next).map(|row| row.at(part.first + assigned.member)) else { return false };
        let (t, rejected, is_held) = (at(t), at(rejected), at(held) > 0.0);
        let is_next = assigned.origin.as_ref().map_or(at(until) == target, |(_, before)| rejected <= *before);
        let holds = target < (t + at(h)).min(at(wall));
        let is_within = self.group.has_sums() && assigned.next + usize::from(!self.plan.is_part) < self.plan.at.len();
        let is_other = assigned.stop.is_some() || self.plan.every > 0 || self.group.has_terms() || is_within;
        if !is_next || !is_held || is_other || self.group.row_mut(until).is_none() {
            return false;
        }
        if let Some((origin, _)) = &assigned.origin {
            for (i, start) in origin.iter().enumerate() {
                let Some(row) = self.group.row_mut(i) else { return false };
                let saved = if i < p {
                    part.saved_v.row(assigned.next * p + i)
                } else {
                    part.saved_y.row(assigned.next * (n - p) + i - p)
                };
                saved[assigned.member] = std::mem::replace(&mut row[lane], *start);
            }
        } else {
            assigned.origin = Some((self.group.state(lane), rejected));
        }
        let set = if holds { (extra, target - t) } else { (held, 0.0) };
        for (place, number) in [(until, target), set] {
            self.group.row_mut(place).into_iter().for_each(|row| row[lane] = number);
        }
        if !holds {
            assigned.origin = None;
        }
        assigned.next = next;
        true
    }

    /// Counts `steps` extra steps of a lane.
    fn count_extra(&mut self, lane: usize, steps: usize) {
        match self.group.row_mut(self.places.extra_steps) {
            Some(row) => row[lane] += steps as f64,
            None => {
                let pace = self.group.pace(lane);
                self.group.set_pace(lane, Pace { extra_steps: pace.extra_steps + steps as f64, ..pace });
            }
        }
    }

    /// Saves the states of a lane at times within a step whose start was kept, as sums of its coefficients. Returns how many.
    fn save_sums(&mut self, part: &mut Part, lane: usize, assigned: &mut Assignment, end: f64) -> usize {
        let (plan, member, first) = (self.plan, part.first + assigned.member, assigned.next);
        let mut states = std::mem::take(&mut self.sums);
        loop {
            // Numbers that were just written one by one are read late as one vector, so times of all members stand side by side.
            let own: [f64; SIDE];
            let times = match self.times.get(assigned.next..).and_then(<[f64]>::first_chunk::<SIDE>) {
                Some(times) => times,
                None => {
                    own = std::array::from_fn(|i| plan.at.get(assigned.next + i).map_or(f64::INFINITY, |row| row.at(member)));
                    &own
                }
            };
            let count = times.iter().filter(|time| **time < end).count();
            self.group.sum_terms(lane, times, &mut states);
            let (v, y) = states.split_at(plan.v.len());
            for (rows, block) in [(&mut part.saved_v, v), (&mut part.saved_y, y)] {
                rows.put(assigned.member, assigned.next * block.len(), count, block.as_flattened(), SIDE);
            }
            assigned.next += count;
            if count < SIDE {
                break;
            }
        }
        self.sums = states;
        assigned.next - first
    }

    /// Saves the states within the steps that lanes have just made, and at their ends.
    fn save_within(&mut self, part: &mut Part, assignments: &mut [Option<Assignment>]) {
        let ends: Vec<f64> = match self.group.row(self.places.t) {
            Some(row) => row.to_vec(),
            None => (0..assignments.len()).map(|lane| self.group.pace(lane).t).collect(),
        };
        for ((lane, assigned), end) in assignments.iter_mut().enumerate().zip(ends) {
            let Some(assigned) = assigned.as_mut().filter(|assigned| assigned.origin.is_none()) else { continue };
            let member = part.first + assigned.member;
            if let Some(target) = self.plan.at.get(assigned.next).map(|row| row.at(member)).filter(|target| *target < end) {
                if self.group.changes_within(lane) {
                    self.group.restore(lane); // the step is made again, and held
                    let pace = self.group.pace(lane);
                    self.group.set_pace(lane, Pace { target, ..pace });
                    assigned.by_steps = true;
                    continue;
                }
                let saved = self.save_sums(part, lane, assigned, end);
                // As if the step had been held, and of a series its states had been made by extra steps.
                self.count_extra(lane, if self.group.has_terms() { saved + 1 } else { 1 });
            }
            while self.plan.at.get(assigned.next).is_some_and(|row| row.at(member) <= end) {
                self.save(part, lane, assigned);
                assigned.next += 1;
            }
        }
    }

    /// Notes how a member ended.
    fn end(&self, part: &mut Part, lane: usize, assigned: &Assignment, pace: &Pace<f64>, status: Option<Status>) {
        let times = self.plan.at.len();
        let status = if assigned.next == times {
            Status::Ok
        } else if let Some(status) = status {
            status
        } else if pace.accepted + pace.rejected >= self.plan.budget as f64 {
            Status::Budget
        } else if pace.error < f64::INFINITY {
            Status::Underflow
        } else {
            Status::NotFinite
        };
        for rows in [&mut part.saved_v, &mut part.saved_y] {
            let block = rows.rows() / times.max(1);
            for row in assigned.next * block..rows.rows() {
                rows.row(row)[assigned.member] = f64::NAN;
            }
        }
        for (row, number) in self.group.state(lane).into_iter().enumerate() {
            part.state.row(row)[assigned.member] = number;
        }
        for (row, number) in pace.numbers().into_iter().chain(self.group.scales(lane)).enumerate() {
            part.paces.row(row)[assigned.member] = number;
        }
        for row in 0..part.status.rows() {
            part.status.row(row)[assigned.member] = status as i64;
        }
    }

    fn save(&self, part: &mut Part, lane: usize, assigned: &Assignment) {
        self.write(part, assigned, &self.group.state(lane));
    }

    fn write(&self, part: &mut Part, assigned: &Assignment, state: &[f64]) {
        let (v, y) = state.split_at(self.plan.v.len());
        for (rows, block) in [(&mut part.saved_v, v), (&mut part.saved_y, y)] {
            for (i, number) in block.iter().enumerate() {
                rows.row(assigned.next * block.len() + i)[assigned.member] = *number;
            }
        }
    }

    /// Looks for events in the steps that lanes have just made.
    fn look(&mut self, part: &Part, assignments: &mut [Option<Assignment>]) {
        let Some(mut looks) = self.looks.take() else { return };
        let member = |lane: usize| {
            let assigned: Option<&Assignment> = assignments.get(lane)?.as_ref();
            assigned.filter(|assigned| assigned.origin.is_none()).map(|assigned| part.first + assigned.member)
        };
        let stops = looks.after(&*self.group, member, |member| self.last(member));
        for (lane, stop) in stops {
            if let Some(assigned) = &mut assignments[lane] {
                assigned.stop = Some(stop);
            }
        }
        self.looks = Some(looks);
    }

    /// Where a member stops in the step that it holds at its end.
    fn stop_in_held(&mut self, part: &Part, lane: usize, assigned: &Assignment, pace: &Pace<f64>) -> Option<EventStop> {
        let member = part.first + assigned.member;
        if assigned.next < self.plan.at.len() || pace.held <= 0.0 {
            return None;
        }
        let (repeats, is_series) = (self.looks.as_ref()?.watch.motion.events.repeats, self.group.is_series());
        let (mut h, mut t) = (length(pace.t, pace.h, pace.wall), pace.wall.min(pace.t + pace.h));
        let end = (is_series || !repeats).then(|| self.end_of_held(lane, member, pace));
        if let Some((following, _)) = end.as_ref().filter(|_| is_series) {
            (h, t) = (following.h, following.t);
        }
        let t = if t < pace.wall { t } else { self.behind(member, t).unwrap_or(t) };
        let h = if is_series { length(t, h, self.wall(member, t)) } else { h };
        let state = end.map(|(_, state)| state);
        let last = self.last(member);
        self.looks.as_mut()?.held(&*self.group, lane, member, pace, (HeldEnd { h, t, state }, last))
    }

    /// Where a lane stands at the end of a held step, and the state there; it is left as it is. The step that follows is as long
    /// as the held one of a series is.
    fn end_of_held(&mut self, lane: usize, member: usize, pace: &Pace<f64>) -> (Pace<f64>, Vec<f64>) {
        let (start, scales) = (self.group.state(lane), self.group.scales(lane));
        self.group.set_pace(lane, Pace { held: 0.0, extra: 0.0, target: f64::INFINITY, ..*pace });
        self.group.attempt_alone(&self.plan.model.spec, lane, member);
        let end = (self.group.pace(lane), self.group.state(lane));
        self.group.set_state(lane, &start);
        self.group.set_scales(lane, &scales);
        self.group.set_pace(lane, *pace);
        end
    }

    /// Ends a member where an event stopped it: in that state, also at all later times. Or it goes on from there, as a run
    /// begins.
    fn end_at(&mut self, part: &mut Part, lane: usize, assigned: &mut Assignment, stop: &EventStop) {
        let (member, times) = (part.first + assigned.member, self.plan.at.len());
        let all = stop.rested.iter().map(|(since, state)| (*since, state)).chain([(stop.t, &stop.state)]);
        for (since, state) in all {
            for (i, _) in self.plan.at.iter().enumerate().filter(|(_, at)| at.at(member) >= since) {
                assigned.next = i;
                self.write(part, assigned, state);
            }
        }
        let accepted = (stop.step.number + 1) as f64;
        let mut pace = Pace { t: stop.t, accepted, work: f64::NAN, ..self.group.pace(lane) };
        if stop.goes_on {
            // Just after a jump at that time.
            pace.t = self.behind(member, stop.t).map_or(stop.t, |after| after.max(stop.t));
            assigned.next = self.plan.at.iter().position(|at| at.at(member) >= stop.t).unwrap_or(times);
            self.group.set_state(lane, &stop.state);
            self.group.set_pace(lane, pace.again());
            if self.group.is_series() {
                let mut scales = self.group.scales(lane);
                let first = scales.len() - stop.state.len();
                scales[first..].fill(0.0); // no more digits of this state are known
                self.group.set_scales(lane, &scales);
            }
            self.group.begin(&self.plan.model.spec, lane, member);
            let mut scales = self.group.scales(lane);
            let before = self.looks.as_mut().map(|looks| looks.go_on(lane, pace.t)).unwrap_or_default();
            scales.iter_mut().zip(before).for_each(|(size, before)| *size = size.max(before));
            self.group.set_scales(lane, &scales);
            let begun = self.group.pace(lane);
            self.group.set_pace(lane, Pace { wall: self.wall(member, pace.t), ..begun });
            return;
        }
        assigned.next = times;
        self.end(part, lane, assigned, &pace, None);
        for (row, number) in stop.state.iter().enumerate() {
            part.state.row(row)[assigned.member] = *number;
        }
    }
}
