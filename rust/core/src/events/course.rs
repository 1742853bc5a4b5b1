//! Events that change the state of a member with adaptive steps: `_Resetting` in `runs/events/adaptive.py`, which says why, for
//! one member at a time. Such an event ends a part of its run; the next begins there as a run does.

use std::sync::Arc;

use smallvec::smallvec;

use super::{
    motion::{At, Numbers},
    resets::{Instant, LARGEST_RATIO, MOST_IN_A_STEP, Memory, NO_TIME, Resting, SETTLED, larger},
    search::{LEAST_SHARE, Part, sign},
    watch::{Candidate, Candidates, Change, Located, Step, Stop, Watch},
};

/// See `runs/events/adaptive.py` for these.
const LEFT_OF_SERIES: f64 = 1.0 / (1u64 << 20) as f64;
const NO_FLIGHT: f64 = 1.0 / (1u64 << 44) as f64;
const RECENT: f64 = 1.0 / (1u64 << 10) as f64;
const SHARE_OF_RUN: f64 = 1.0 / (1u64 << 10) as f64;
const LOOKS: u32 = 1 << 10;

/// A member's run.
#[derive(Debug)]
pub(crate) struct Course {
    pub memory: Memory,
    /// Where the run begins and ends.
    begin: f64,
    end: f64,
    /// Where the part begins, its state there, the length of the part before, and the ratio of that to the one before.
    pub start: f64,
    state: Numbers,
    flight: f64,
    ratio: f64,
    /// When the count of recent changes began, and that count.
    recent: f64,
    changes: usize,
}

impl Course {
    /// Whether a step from this time is searched, whatever the quantity of an event is.
    pub(crate) fn is_special(&self, e: usize, t: f64) -> bool {
        t == self.start && self.memory.at[e] != 0.0
    }
}

impl Watch<'_> {
    /// The run of a member from a time to an end, and from a state; without one it goes on, and its first part is that of an
    /// earlier run.
    pub(crate) fn course(&mut self, member: usize, [begin, end]: [f64; 2], state: Option<&[f64]>) -> Course {
        let mut memory = Memory::new(member, self.events());
        if let Some(state) = state {
            self.begin_member(&mut memory, begin, SHARE_OF_RUN * (end - begin), state, false);
        }
        let (start, flight, ratio) = (if state.is_some() { begin } else { f64::NAN }, f64::NAN, f64::NAN);
        let state = state.map_or_else(|| smallvec![f64::NAN; self.motion.events.numbers], Numbers::from_slice);
        Course { memory, begin, end, start, state, flight, ratio, recent: begin, changes: 0 }
    }

    /// Takes a step of a member in which events may occur. Returns where it stops, or goes on in another state.
    pub(crate) fn take_with_changes(&mut self, course: &mut Course, candidates: Candidates) -> Option<Stop> {
        let (member, step) = (course.memory.member, candidates.step);
        let mut changes: Vec<Vec<Change>> = (0..self.events()).map(|_| Vec::new()).collect();
        for (e, g) in candidates.events {
            changes[e] = self.of_part(course, e, &step, g);
        }
        if !(0..changes.len()).any(|e| (0..changes[e].len()).any(|more| self.ends(e, member, more))) {
            for (e, of_event) in changes.into_iter().enumerate() {
                of_event.into_iter().for_each(|change| self.put_off(e, change));
            }
            return None;
        }
        let mut found: Vec<(Vec<Located>, Vec<Change>)> = Vec::new();
        let (mut here, mut size): (Option<Located>, _) = (None, Numbers::new());
        for (e, of_event) in changes.into_iter().enumerate() {
            let located = self.located(e, of_event.clone());
            let first = (0..located.len()).find(|more| self.ends(e, member, *more)).map(|more| &located[more]);
            if let Some(first) = first.filter(|first| here.as_ref().is_none_or(|here| first.share < here.share)) {
                here = Some(first.clone());
            }
            let largest = |most, change: &Change| larger(most, larger(change.part.g_low.abs(), change.part.g_high.abs()));
            size.push(of_event.iter().fold(0.0, largest));
            found.push((located, of_event));
        }
        let here = here?;
        let share = here.share;
        let instant = self.instant(here, &found, size);
        for (e, (located, _)) in found.into_iter().enumerate() {
            located.into_iter().filter(|one| one.share < share).for_each(|one| self.note(e, one));
        }
        let mut rested = Vec::new();
        let mut stop = self.arrive(course, instant, &mut rested);
        while let Some(instant) = self.wakes_later(course, &mut stop) {
            stop = self.arrive(course, instant, &mut rested);
        }
        if course.memory.rest.is_some() {
            self.end_member(&course.memory);
        }
        stop.rested = rested;
        Some(stop)
    }

    /// Takes a member through an instant. Returns where it goes on, or stops; if it is at rest there, its state is noted.
    fn arrive(&mut self, course: &mut Course, instant: Instant, rested: &mut Vec<(f64, Numbers)>) -> Stop {
        let (step, t, share) = (Arc::clone(&instant.at.step), instant.at.t, instant.at.share);
        let lies = course.memory.at.clone();
        let after = self.happen(&mut course.memory, step.h, instant, &lies);
        let returned = lies.iter().zip(&after.at).any(|(before, after)| *before != 0.0 && *after != 0.0);
        let (flight, since) = (if returned { t - course.start } else { f64::NAN }, t - course.begin);
        let ratio = flight / course.flight;
        let rest_of_series = if ratio < 1.0 { ratio / (1.0 - ratio) } else { 0.0 };
        let is_settled = (ratio - course.ratio).abs() <= SETTLED && ratio <= LARGEST_RATIO;
        let is_settled = is_settled && flight * rest_of_series <= LEFT_OF_SERIES * since;
        let in_no_time = flight <= NO_FLIGHT * since || share <= LEAST_SHARE;
        let is_anew = t - course.recent > RECENT * since;
        (course.recent, course.changes) = if is_anew { (t, 0) } else { (course.recent, course.changes + 1) };
        let is_often = course.changes > MOST_IN_A_STEP && !(is_settled || in_no_time || after.circles);
        if is_often {
            course.memory.often_since = course.recent;
        }
        let rests = (is_settled || in_no_time || after.circles || is_often) && !after.stops;
        let mut state = after.state;
        if is_settled {
            let both = state.iter_mut().zip(&course.state);
            both.for_each(|(now, earlier)| *now += (*now - earlier) * rest_of_series);
        }
        (course.flight, course.ratio, course.start) = (flight, ratio, t);
        course.state.clone_from(&state);
        course.memory.at = after.at;
        let limit = if is_settled { t + flight * rest_of_series } else { t };
        let mut stop = Stop { step, t, state, goes_on: true, rested: Vec::new() };
        if after.stops {
            (stop.t, stop.goes_on) = (limit.min(course.end), false);
            self.found.stopped_at[course.memory.member - self.first] = stop.t;
        } else if let (true, Some(event)) = (rests, after.event) {
            (stop.t, stop.goes_on) = (limit.min(course.end), false);
            course.memory.rest = Some(Resting { event, since: stop.t });
            rested.push((t, stop.state.clone()));
        }
        stop
    }

    /// The parts of a step in which an event changes its sign, and that at its start if the member returns there in no time.
    fn of_part(&mut self, course: &mut Course, e: usize, step: &Arc<Step>, g: [f64; 2]) -> Vec<Change> {
        let (memory, begins, is_zero) = (&mut course.memory, step.t == course.start, g[0] == 0.0);
        let side = if begins || is_zero { memory.at[e] } else { 0.0 };
        let lies = is_zero && (!begins || memory.lain[e]);
        let start = At { member: memory.member, t: step.t, state: &step.start };
        let (parts, stuck) = self.within_from(e, vec![Candidate { step: Arc::clone(step), g }], |_| side);
        let is_held = side != 0.0
            && (!stuck.is_empty() || memory.led_back[e] || (lies && self.leads_back((e, side), step.h, start, start.state)));
        let is_soon = |change: &Change| begins && memory.at[e] != 0.0 && change.part.high <= NO_TIME;
        let (mut there, parts): (Vec<Change>, Vec<Change>) = parts.into_iter().partition(is_soon);
        if !is_held && !there.is_empty() && !self.bounces((e, side), step.h, start) {
            (memory.at[e], there) = (0.0, Vec::new());
        }
        if is_held {
            let (low, high, [g_low, g_high], [slope_low, slope_high]) = (0.0, 1.0, g, [0.0; 2]);
            let part = Part { of: 0, low, high, g_low, g_high, slope_low, slope_high, state: Numbers::new() };
            there.insert(0, Change { step: Arc::clone(step), part });
        }
        for change in &mut there {
            (change.part.low, change.part.high, change.part.g_low) = (0.0, LEAST_SHARE, memory.at[e]);
            change.part.state.clone_from(&step.start);
        }
        there.extend(parts);
        if step.window.is_none() {
            return there;
        }
        let located = self.located(e, there.clone());
        let counts = |one: &Located| one.step.window.is_none_or(|[since, until]| one.t > since && one.t <= until);
        there.into_iter().zip(located).filter(|(_, one)| counts(one)).map(|(change, _)| change).collect()
    }

    /// Goes on with a member at rest when the event that holds it lets it go, before the end of its run, as far as some times,
    /// evenly apart, show. Or returns the instant at which it meets another event, whose time is known, before.
    fn wakes_later(&mut self, course: &mut Course, stop: &mut Stop) -> Option<Instant> {
        let Course { memory, end, state, .. } = course;
        let (Resting { event: e, since: begin }, member, h) = (memory.rest?, memory.member, stop.step.h);
        if !memory.led_back[e] && !self.motion.events.has_times() {
            return None;
        }
        let nexts: Vec<Option<f64>> = (0..self.events()).map(|e| self.motion.events.next(e, member, begin)).collect();
        let known = nexts.iter().flatten().copied().fold(f64::INFINITY, f64::min);
        let until = end.min(known);
        let mut times: Vec<f64> =
            (1..=LOOKS).map(|look| begin + (until - begin) * (f64::from(look) / f64::from(LOOKS))).collect();
        if let Some(jumps) = &self.motion.events.jumps {
            times.extend(jumps.within(member, begin, until).map(f64::next_up));
            times.sort_by(f64::total_cmp);
        }
        if let Some(first) = times.iter().position(|t| !self.holds(memory, e, h, At { member, t: *t, state })) {
            let last = first.checked_sub(1).map_or(begin, |last| times[last]);
            let within = times[first] - last;
            let share = self.let_go(memory, e, within, h, At { member, t: last, state });
            (memory.led_back[e], memory.lain[e], memory.rest) = (false, false, None);
            course.start = last + share * within;
            (stop.t, stop.goes_on, course.flight) = (course.start, true, f64::NAN);
            return None;
        }
        if known > *end {
            return None;
        }
        memory.rest = None;
        let side = (0..nexts.len()).map(|e| sign(self.motion.g(e, At { member, t: known, state }))).collect();
        let due = nexts.iter().map(|next| *next == Some(known)).collect();
        let at = Located { step: Arc::clone(&stop.step), share: 1.0, t: known, state: state.clone() };
        Some(Instant { at, side, due, size: smallvec![0.0; nexts.len()] })
    }
}
