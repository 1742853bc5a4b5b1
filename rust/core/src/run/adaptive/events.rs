//! Events of adaptive steps: quantities are checked after every attempt, in the lanes.

use std::sync::Arc;

use crate::{
    events::{
        course::Course,
        evaluation::Filled,
        motion::{Event, Events, States, Values, finite},
        search::bends,
        watch::{Candidates, Step, Stop, Watch},
    },
    group::AdaptiveBatch,
    step::pace::{Pace, length},
};

/// The quantity of an event in the lanes.
struct Quantity {
    value: Filled,
    slope: Option<Filled>,
    /// The quantity at the state and after the attempt before, NaN where not known; the slope at the state and at the one before.
    now: Vec<f64>,
    before: Vec<f64>,
    slopes: Vec<f64>,
    slopes_before: Vec<f64>,
}

/// The quantities of the lanes, and where these stood before an attempt.
pub(super) struct Looks<'a> {
    pub(super) watch: Watch<'a>,
    events: &'a Events<'a>,
    rates: Filled,
    quantities: Vec<Quantity>,
    /// Whether the quantities of a lane are not known, and until which time an earlier run had looked.
    fresh: Vec<bool>,
    since: Vec<f64>,
    /// The times, the lengths of the steps, the numbers of accepted and rejected attempts, and the states before an attempt.
    t: Vec<f64>,
    h: Vec<f64>,
    accepted: Vec<f64>,
    rejected: Vec<f64>,
    states: Vec<f64>,
    /// The lengths of steps over which slopes are.
    lengths: Vec<f64>,
    /// The lanes that have just made a step, with their members.
    made: Vec<(usize, usize)>,
    /// If events change states: the run of each lane's member, and the largest sizes of its groups before an attempt, in rows.
    courses: Vec<Option<Course>>,
    longest: Vec<f64>,
}

impl<'a> Looks<'a> {
    pub(super) fn new(events: &'a Events<'a>, lanes: usize) -> Self {
        let row = || vec![f64::NAN; lanes];
        let of = |values: &Values| Filled::of_lanes(&values.of, events.level, lanes);
        let quantity = |event: &Event| Quantity {
            value: of(&event.quantity),
            slope: event.slope.as_ref().map(of),
            now: row(),
            before: row(),
            slopes: row(),
            slopes_before: row(),
        };
        Looks {
            watch: Watch::new(events),
            events,
            rates: of(&events.rates),
            quantities: events.events.iter().map(quantity).collect(),
            fresh: vec![true; lanes],
            since: row(),
            t: row(),
            h: row(),
            accepted: row(),
            rejected: row(),
            states: Vec::new(),
            lengths: row(),
            made: Vec::new(),
            courses: (0..lanes).map(|_| None).collect(),
            longest: Vec::new(),
        }
    }

    /// Where events change the state of a lane's member: its run is from a time until another, and begins in this state; without
    /// one it goes on.
    pub(super) fn begin_course(&mut self, (lane, member): (usize, usize), [t, end]: [f64; 2], begins: Option<&Vec<f64>>) {
        if self.watch.changes() {
            let begin = if begins.is_some() { self.events.begin.at(member) } else { t };
            self.courses[lane] = Some(self.watch.course(member, [begin, end], begins.map(Vec::as_slice)));
        }
    }

    /// The member of a lane goes on in another state at this time. Returns the largest sizes of its groups in the part before.
    pub(super) fn go_on(&mut self, lane: usize, t: f64) -> Vec<f64> {
        if let Some(course) = &mut self.courses[lane] {
            course.start = t;
        }
        (self.fresh[lane], self.since[lane]) = (true, f64::NEG_INFINITY);
        self.longest.iter().skip(lane).step_by(self.t.len()).copied().collect()
    }

    /// Takes a member into a lane, which an earlier run checked up to the time `since`.
    pub(super) fn begin(&mut self, lane: usize, member: usize, since: f64) {
        for (quantity, event) in self.quantities.iter_mut().zip(&self.events.events) {
            quantity.value.prepare_lane(&event.quantity.parameters, lane, member);
            if let (Some(tile), Some(values)) = (&mut quantity.slope, &event.slope) {
                tile.prepare_lane(&values.parameters, lane, member);
            }
        }
        self.rates.prepare_lane(&self.events.rates.parameters, lane, member);
        (self.fresh[lane], self.since[lane]) = (true, since);
    }

    /// The quantities of all lanes.
    fn find_quantities(&mut self, group: &dyn AdaptiveBatch) {
        let (n, sign) = (self.events.numbers, self.events.sign);
        for Quantity { value, .. } in &mut self.quantities {
            fill(value.row(0), group.row(n), sign);
            (0..n).for_each(|i| fill(value.row(1 + i), group.row(i), 1.0));
            value.run();
        }
    }

    /// The slopes of these lanes over steps of the present lengths.
    fn find_slopes(&mut self, group: &dyn AdaptiveBatch, lanes: &[(usize, usize)]) {
        let (n, sign) = (self.events.numbers, self.events.sign);
        let in_lanes = !self.events.rates.of.has_samples();
        if in_lanes {
            fill(self.rates.row(0), group.row(n), 1.0);
            fill(self.rates.row(1), Some(&self.h), 1.0);
            (0..n).for_each(|i| fill(self.rates.row(2 + i), group.row(i), 1.0));
            self.rates.run();
        }
        let width = self.h.len();
        for (e, quantity) in self.quantities.iter_mut().enumerate() {
            quantity.slopes_before.copy_from_slice(&quantity.slopes);
            let Some(tile) = quantity.slope.as_mut().filter(|_| in_lanes) else {
                let mut at = States::default();
                for (lane, member) in lanes {
                    let state: Vec<f64> = (0..n).map(|i| group.row(i).map_or(f64::NAN, |row| row[*lane])).collect();
                    at.push(*member, group.row(n).map_or(f64::NAN, |row| row[*lane]), &state);
                }
                let lengths: Vec<f64> = lanes.iter().map(|(lane, _)| self.h[*lane]).collect();
                for ((lane, _), slope) in lanes.iter().zip(self.watch.motion.slopes(e, &at, &lengths)) {
                    quantity.slopes[*lane] = slope;
                }
                continue;
            };
            fill(tile.row(0), group.row(n), sign);
            (0..n).for_each(|i| fill(tile.row(1 + i), group.row(i), 1.0));
            fill(tile.row(n + 1), Some(&self.h), sign);
            for i in 0..n {
                fill(tile.row(n + 2 + i), Some(&self.rates.values[i * width..(i + 1) * width]), 1.0);
            }
            tile.run();
            for (lane, _) in lanes {
                quantity.slopes[*lane] = finite(tile.values[*lane]);
            }
        }
    }

    /// Notes where the lanes stand before an attempt.
    pub(super) fn before(&mut self, group: &dyn AdaptiveBatch, member: impl Fn(usize) -> Option<usize>) {
        let n = self.events.numbers;
        let places = Pace::of(std::array::from_fn(|i| (n + i) as f64));
        let row = |place: f64| group.row(place as usize).unwrap_or_default();
        let wall = row(places.wall);
        fill(&mut self.t, Some(row(places.t)), 1.0);
        for (lane, h) in self.h.iter_mut().enumerate() {
            *h = length(self.t[lane], row(places.h)[lane], wall[lane]);
        }
        fill(&mut self.accepted, Some(row(places.accepted)), 1.0);
        fill(&mut self.rejected, Some(row(places.rejected)), 1.0);
        self.states.clear();
        (0..n).for_each(|i| self.states.extend_from_slice(group.row(i).unwrap_or_default()));
        if self.watch.changes() {
            let first = n + Pace::<f64>::NUMBERS;
            self.longest.clear();
            (first..first + self.events.groups).for_each(|i| self.longest.extend_from_slice(group.row(i).unwrap_or_default()));
        }
        if !self.fresh.contains(&true) {
            return;
        }
        let is_fresh = |lane: usize| member(lane).filter(|_| self.fresh[lane]).map(|member| (lane, member));
        let fresh: Vec<_> = (0..self.fresh.len()).filter_map(is_fresh).collect();
        if fresh.is_empty() {
            return;
        }
        self.find_quantities(group);
        self.find_slopes(group, &fresh);
        for (lane, _) in fresh {
            for quantity in &mut self.quantities {
                (quantity.now[lane], quantity.before[lane]) = (quantity.value.values[lane], f64::NAN);
            }
            (self.fresh[lane], self.lengths[lane]) = (false, self.h[lane]);
        }
    }

    /// Looks for events in the steps that lanes have made since; `end` is where a member ends.
    pub(super) fn after(
        &mut self,
        group: &dyn AdaptiveBatch,
        member: impl Fn(usize) -> Option<usize>,
        end: impl Fn(usize) -> f64,
    ) -> Vec<(usize, Stop)> {
        let n = self.events.numbers;
        let places = Pace::of(std::array::from_fn(|i| (n + i) as f64));
        let row = |place: f64| group.row(place as usize).unwrap_or_default();
        let mut made = std::mem::take(&mut self.made);
        made.clear();
        for lane in 0..self.t.len() {
            let Some(member) = member(lane) else { continue };
            if row(places.accepted)[lane] > self.accepted[lane] {
                made.push((lane, member));
            } else if row(places.rejected)[lane] > self.rejected[lane] {
                self.quantities.iter_mut().for_each(|quantity| quantity.before[lane] = quantity.now[lane]);
            }
        }
        let mut candidates = Vec::new();
        if group.is_series() {
            // How long a step of a series is follows from its coefficients, which the attempt finds.
            let [t, h, wall] = [places.t, places.h, places.wall].map(row);
            made.iter().for_each(|(lane, _)| self.h[*lane] = length(t[*lane], h[*lane], wall[*lane]));
        }
        if !made.is_empty() {
            self.find_quantities(group);
            self.find_slopes(group, &made);
        }
        for (lane, member) in made.iter().copied() {
            let mut events = Vec::new();
            let stretched = self.h[lane] / self.lengths[lane];
            self.lengths[lane] = self.h[lane];
            for (e, quantity) in self.quantities.iter_mut().enumerate() {
                let (before, g, next) = (quantity.before[lane], quantity.now[lane], quantity.value.values[lane]);
                let slopes = [quantity.slopes_before[lane] * stretched, quantity.slopes[lane]];
                let is_special = self.courses[lane].as_ref().is_some_and(|course| course.is_special(e, self.t[lane]));
                let times = [self.t[lane], row(places.t)[lane]];
                if self.events.may_occur(e, member, [before, g, next], times) || bends([g, next], slopes) || is_special {
                    events.push((e, [g, next]));
                }
                (quantity.before[lane], quantity.now[lane]) = (g, next);
            }
            if events.is_empty() {
                continue;
            }
            let start = self.states.iter().skip(lane).step_by(self.t.len()).copied().collect();
            let state = (0..n).map(|i| row(i as f64)[lane]).collect();
            let window = self.window(lane, row(places.t)[lane], end(member));
            let number = self.accepted[lane] as i64;
            let (t, t_end) = (self.t[lane], row(places.t)[lane]);
            let step = Step { member, number, t, h: self.h[lane], t_end, start, end: state, window };
            candidates.push((lane, Candidates { step: Arc::new(step), events }));
        }
        self.made = made;
        self.take(candidates)
    }

    /// Between which times events count of a step that goes beyond the end, or began before this run; none of others.
    fn window(&self, lane: usize, t: f64, end: f64) -> Option<[f64; 2]> {
        (t > end || self.t[lane] < self.since[lane]).then_some([self.since[lane], end])
    }

    fn take(&mut self, candidates: Vec<(usize, Candidates)>) -> Vec<(usize, Stop)> {
        if candidates.is_empty() {
            return Vec::new();
        }
        if self.watch.changes() {
            let (watch, courses) = (&mut self.watch, &mut self.courses);
            let stop =
                |(lane, candidates): (usize, _)| Some((lane, watch.take_with_changes(courses[lane].as_mut()?, candidates)?));
            return candidates.into_iter().filter_map(stop).collect();
        }
        let (lanes, candidates): (Vec<usize>, Vec<Candidates>) = candidates.into_iter().unzip();
        let members: Vec<usize> = candidates.iter().map(|each| each.step.member).collect();
        let lane_of = |member: usize| members.iter().position(|each| *each == member).map_or(0, |i| lanes[i]);
        self.watch.take(candidates).into_iter().map(|stop| (lane_of(stop.step.member), stop)).collect()
    }

    /// Looks for events in a step that a lane holds, which ends at `t_end` and is in the run only to its end.
    pub(super) fn held(
        &mut self,
        group: &dyn AdaptiveBatch,
        lane: usize,
        member: usize,
        pace: &Pace<f64>,
        (step_end, end): (HeldEnd, f64),
    ) -> Option<Stop> {
        let (start, HeldEnd { h, t: t_end, state }) = (group.state(lane), step_end);
        let mut from = States::default();
        from.push(member, pace.t, &start);
        let motion = &mut self.watch.motion;
        let mut there = States { t: vec![t_end], ..motion.steps(&from, &[h]) };
        if let Some(state) = state {
            there.numbers = state;
        }
        let mut events = Vec::new();
        for (e, quantity) in self.quantities.iter().enumerate() {
            let [g, next] = [&from, &there].map(|at| motion.quantity(e, at)[0]);
            let slopes = [&from, &there].map(|at| motion.slopes(e, at, &[h])[0]);
            let before = if self.fresh[lane] { f64::NAN } else { quantity.before[lane] };
            let is_special = self.courses[lane].as_ref().is_some_and(|course| course.is_special(e, pace.t));
            let times = [pace.t, t_end];
            if self.events.may_occur(e, member, [before, g, next], times) || bends([g, next], slopes) || is_special {
                events.push((e, [g, next]));
            }
        }
        if events.is_empty() {
            return None;
        }
        let window = Some([self.since[lane], end]);
        let number = pace.accepted as i64;
        let step = Step { member, number, t: pace.t, h, t_end, start: start.into(), end: there.numbers.into(), window };
        self.take(vec![(lane, Candidates { step: Arc::new(step), events })]).pop().map(|(_, stop)| stop)
    }
}

/// The end of a step that a lane holds.
pub(super) struct HeldEnd {
    pub h: f64,
    pub t: f64,
    /// The state there, if it is another than that of a trial.
    pub state: Option<Vec<f64>>,
}

/// Copies a row, times a sign.
fn fill(to: &mut [f64], from: Option<&[f64]>, sign: f64) {
    to.iter_mut().zip(from.unwrap_or_default()).for_each(|(to, from)| *to = sign * from);
}
