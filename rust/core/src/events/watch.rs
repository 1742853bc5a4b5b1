//! The search for events in steps: changes of sign are counted, located and kept, and members stop at them.

use std::sync::{Arc, PoisonError};

use smallvec::smallvec;

use super::{
    found::Found,
    motion::{At, Event, Events, Motion, Numbers, States},
    search::{LEAST_SHARE, Looks, Part, is_no_time, located, located_alone, parted, sign},
};
use crate::step::watch::REACH;

/// Changes of sign that are located together.
const LOCATED_AT_ONCE: usize = 1 << 10;

/// A whole step of a member.
#[derive(Debug)]
pub(crate) struct Step {
    pub member: usize,
    /// Its number, or how many steps the member had taken before.
    pub number: i64,
    pub t: f64,
    pub h: f64,
    /// The time at its end, or at the end of the whole step if this is a part of one.
    pub t_end: f64,
    pub start: Numbers,
    pub end: Numbers,
    /// After and until which times events count, if not in all of it.
    pub window: Option<[f64; 2]>,
}

/// A step in which an event may occur, with its quantity at both ends.
pub(crate) struct Candidate {
    pub step: Arc<Step>,
    pub g: [f64; 2],
}

/// A step in which some events may occur: their numbers and quantities.
pub(crate) struct Candidates {
    pub step: Arc<Step>,
    pub events: Vec<(usize, [f64; 2])>,
}

/// Steps of a member that follow each other, in which an event may occur: from the state at the start of the first.
pub(crate) struct Noticed {
    pub member: usize,
    /// The number of the first step, and of the one before which they end.
    pub number: i64,
    pub until: i64,
    /// The time of step 0, and how long steps are.
    pub begin: f64,
    pub h: f64,
    pub start: Numbers,
    /// Each quantity one step before.
    pub before: Numbers,
}

impl Noticed {
    /// The time at the start of the step, or of one after it.
    fn time(&self, later: i64) -> f64 {
        self.begin + (self.number + later) as f64 * self.h
    }
}

/// Of rows of `each` numbers, those whose entry in `on` is true.
fn kept(numbers: &[f64], on: &[bool], each: usize) -> Vec<f64> {
    let some = numbers.chunks_exact(each.max(1)).zip(on).filter(|(_, on)| **on);
    some.flat_map(|(numbers, _)| numbers).copied().collect()
}

/// A part of a step in which a quantity changes its sign once.
#[derive(Clone)]
pub(super) struct Change {
    pub(super) step: Arc<Step>,
    pub(super) part: Part,
}

/// A located change.
#[derive(Clone)]
pub(super) struct Located {
    pub(super) step: Arc<Step>,
    pub(super) share: f64,
    pub(super) t: f64,
    pub(super) state: Numbers,
}

/// Where a member stops: in this step.
pub(crate) struct Stop {
    pub step: Arc<Step>,
    pub t: f64,
    pub state: Numbers,
    /// Whether it goes on from there.
    pub goes_on: bool,
    /// The states in which it was at rest before, and since when.
    pub rested: Vec<(f64, Numbers)>,
}

impl Stop {
    /// Where it ends.
    pub(super) fn at(step: Arc<Step>, t: f64, state: Numbers) -> Stop {
        Stop { step, t, state, goes_on: false, rested: Vec::new() }
    }
}

/// The events of some members, by one thread.
pub(crate) struct Watch<'a> {
    pub(crate) motion: Motion<'a>,
    pub(super) first: usize,
    pub(super) found: Found,
    /// Steps in which something may occur.
    noticed: Vec<Noticed>,
    /// For each event, candidates to locate later, with others, and changes of sign.
    candidates: Vec<Vec<Candidate>>,
    changes: Vec<Vec<Change>>,
}

/// The side of a quantity from which a member came to the event that then changed its state, where a step begins there; 0 if not.
pub(super) type Side = f64;
/// The slope, towards the side from which it came, that a quantity gets if it begins at zero with slope zero.
const LEAST_SLOPE: f64 = f64::MIN_POSITIVE;
/// A slope towards the other side counts as zero if it is less than this share of the slope at the end of the step: a bounce
/// without speed leaves such a slope.
const NO_SLOPE: f64 = 1.0 / (1u64 << 24) as f64;

impl<'a> Watch<'a> {
    pub(crate) fn new(events: &'a Events<'a>) -> Self {
        let none = || events.events.iter().map(|_| Vec::new()).collect();
        Watch {
            motion: Motion::new(events),
            first: 0,
            found: Found::default(),
            noticed: Vec::new(),
            candidates: none(),
            changes: events.events.iter().map(|_| Vec::new()).collect(),
        }
    }

    /// Begins with the `members` members from `first` on.
    pub(crate) fn begin(&mut self, first: usize, members: usize) {
        self.first = first;
        self.found = Found::new(self.motion.events.events.len(), members);
    }

    /// Ends with these members.
    pub(crate) fn end(&mut self) {
        let noticed = std::mem::take(&mut self.noticed);
        let steps = self.made_again(noticed);
        self.take(steps);
        (0..self.changes.len()).for_each(|e| self.locate_waiting(e));
        let found = std::mem::take(&mut self.found);
        self.motion.events.found.lock().unwrap_or_else(PoisonError::into_inner).take(found, self.first);
    }

    /// Notes that a saved time changed the steps of a member.
    pub(crate) fn has_other_steps(&mut self, member: usize) {
        self.found.other_steps[member - self.first] = true;
    }

    /// Whether an event ends the run of a member.
    pub(crate) fn stops(&self) -> bool {
        self.motion.events.events.iter().any(|event| event.terminal > 0)
    }

    pub(super) fn count(&mut self, e: usize, member: usize) -> &mut i64 {
        let members = self.found.stopped_at.len();
        &mut self.found.counts[e * members + member - self.first]
    }

    /// Takes steps in which events may occur, in the order of time of each member, up to where a member stops.
    pub(crate) fn take(&mut self, steps: Vec<Candidates>) -> Vec<Stop> {
        let mut of_events: Vec<Vec<Candidate>> = self.candidates.iter().map(|_| Vec::new()).collect();
        for candidates in steps {
            for (e, g) in candidates.events {
                of_events[e].push(Candidate { step: Arc::clone(&candidates.step), g });
            }
        }
        if self.stops() {
            let changes = of_events.into_iter().enumerate().map(|(e, each)| self.within(e, each)).collect();
            return self.taken(changes);
        }
        for (e, each) in of_events.into_iter().enumerate() {
            self.candidates[e].extend(each);
            if self.candidates[e].len() >= LOCATED_AT_ONCE {
                self.locate_waiting(e);
            }
        }
        Vec::new()
    }

    /// Takes steps in which events may occur, from known starts; as `take`.
    pub(crate) fn notice(&mut self, noticed: Vec<Noticed>) -> Vec<Stop> {
        if self.stops() || self.noticed.len() + noticed.len() >= LOCATED_AT_ONCE {
            let all: Vec<_> = std::mem::take(&mut self.noticed).into_iter().chain(noticed).collect();
            let steps = self.made_again(all);
            return self.take(steps);
        }
        self.noticed.extend(noticed);
        Vec::new()
    }

    /// Makes steps again that were noticed; in the order of time of each member.
    fn made_again(&mut self, mut noticed: Vec<Noticed>) -> Vec<Candidates> {
        let (n, events) = (self.motion.events.numbers, self.motion.events.events.len());
        let (mut candidates, mut starts) = (Vec::new(), States::default());
        noticed.iter().for_each(|each| starts.push(each.member, each.time(0), &each.start));
        // Each quantity one step before, at the start and at the end of steps: by event.
        let mut before: Vec<Vec<f64>> = (0..events).map(|e| noticed.iter().map(|each| each.before[e]).collect()).collect();
        let mut now: Vec<Vec<f64>> = (0..events).map(|e| self.motion.quantity(e, &starts)).collect();
        while !noticed.is_empty() {
            let lengths: Vec<f64> = noticed.iter().map(|each| each.h).collect();
            let mut ends = self.motion.steps(&starts, &lengths);
            let next: Vec<Vec<f64>> = (0..events).map(|e| self.motion.quantity(e, &ends)).collect();
            for (i, each) in noticed.iter_mut().enumerate() {
                let times = [starts.t[i], each.time(1)];
                let of_run = self.motion.events;
                let may = |e: usize| of_run.may_occur(e, each.member, [before[e][i], now[e][i], next[e][i]], times);
                if (0..events).any(may) {
                    let [start, end] = [&starts, &ends].map(|states| Numbers::from_slice(&states.numbers[i * n..(i + 1) * n]));
                    let events = (0..events).filter(|e| may(*e)).map(|e| (e, [now[e][i], next[e][i]])).collect();
                    if start.iter().chain(&end).all(|x| x.is_finite()) {
                        let step = Step {
                            member: each.member,
                            number: each.number,
                            t: starts.t[i],
                            h: each.h,
                            t_end: times[1],
                            start,
                            end,
                            window: None,
                        };
                        candidates.push(Candidates { step: Arc::new(step), events });
                    }
                }
                each.number += 1;
                ends.t[i] = each.time(0);
            }
            (before, now, starts) = (now, next, ends);
            if noticed.iter().any(|each| each.number >= each.until) {
                let on: Vec<bool> = noticed.iter().map(|each| each.number < each.until).collect();
                let mut left = on.iter();
                noticed.retain(|_| left.next() == Some(&true));
                before.iter_mut().chain(&mut now).for_each(|of| *of = kept(of, &on, 1));
                starts = States {
                    members: noticed.iter().map(|each| each.member).collect(),
                    t: kept(&starts.t, &on, 1),
                    numbers: kept(&starts.numbers, &on, n),
                };
            }
        }
        candidates.sort_by_key(|each| (each.step.member, each.step.number));
        candidates
    }

    /// The parts of steps in which an event occurs.
    fn within(&mut self, e: usize, candidates: Vec<Candidate>) -> Vec<Change> {
        let (changes, _) = self.within_from(e, candidates, |_| 0.0);
        if changes.iter().all(|change| change.step.window.is_none()) {
            return changes;
        }
        let located = self.located(e, changes.clone());
        let counts = |one: &Located| one.step.window.is_none_or(|[since, until]| one.t > since && one.t <= until);
        changes.into_iter().zip(located).filter(|(_, one)| counts(one)).map(|(change, _)| change).collect()
    }

    /// As `within`, for members that came from these sides to the event at the start. Also returns those that return to it within
    /// roundings.
    pub(super) fn within_from(
        &mut self,
        e: usize,
        candidates: Vec<Candidate>,
        side: impl Fn(usize) -> Side,
    ) -> (Vec<Change>, Vec<usize>) {
        if self.motion.events.events[e].times.is_some() {
            return (candidates.into_iter().flat_map(|candidate| self.at_times(e, candidate.step)).collect(), Vec::new());
        }
        if candidates.is_empty() {
            return Default::default();
        }
        let slopes: [Numbers; 2] = if let [Candidate { step, .. }] = &candidates[..] {
            let start = At { member: step.member, t: step.t, state: &step.start };
            let end = At { t: step.t + step.h, state: &step.end, ..start };
            [start, end].map(|at| smallvec![self.motion.slope(e, at, step.h)])
        } else {
            let (mut starts, mut ends) = (States::default(), States::default());
            for Candidate { step, .. } in &candidates {
                starts.push(step.member, step.t, &step.start);
                ends.push(step.member, step.t + step.h, &step.end);
            }
            let lengths: Vec<f64> = candidates.iter().map(|each| each.step.h).collect();
            [&starts, &ends].map(|states| self.motion.slopes(e, states, &lengths).into())
        };
        let whole = |(of, each): (usize, &Candidate)| {
            let ([g, g_high], [slope, slope_high], side) = (each.g, [slopes[0][of], slopes[1][of]], side(of));
            let is_there = side != 0.0;
            let lies = slope == 0.0 || (slope * side < 0.0 && slope.abs() <= NO_SLOPE * slope_high.abs());
            let slope_low = if is_there && lies { side * LEAST_SLOPE } else { slope };
            let (g_low, state) = (if is_there { 0.0 } else { g }, each.step.end.clone());
            Part { of, low: 0.0, high: 1.0, g_low, g_high, slope_low, slope_high, state }
        };
        let parts = candidates.iter().enumerate().map(whole).collect();
        let motion = &mut self.motion;
        let (parts, stuck) = parted(parts, &mut |asked| {
            let (there, g) = trial(motion, e, asked, &|of| &candidates[of].step);
            let lengths: Vec<f64> = asked.iter().map(|(of, _)| candidates[*of].step.h).collect();
            let slopes = motion.slopes(e, &there, &lengths);
            Looks { g, slopes, states: there.numbers }
        });
        let direction = self.motion.events.events[e].direction;
        let counts = |part: &Part| direction == 0.0 || part.g_low * direction < 0.0;
        let change = |part: Part| Change { step: Arc::clone(&candidates[part.of].step), part };
        (parts.into_iter().filter(counts).map(change).collect(), stuck.into_iter().filter(|of| side(*of) != 0.0).collect())
    }

    /// The known times of an event in a step, as parts without a length.
    fn at_times(&mut self, e: usize, step: Arc<Step>) -> Vec<Change> {
        let Events { events, way, .. } = self.motion.events;
        let Event { times: Some(times), direction, .. } = &events[e] else { return Vec::new() };
        let (mut changes, mut key) = (Vec::new(), way * step.t);
        loop {
            let [next, g_low] = times.after(step.member, key);
            if next > way * step.t_end || next == f64::INFINITY {
                return changes;
            }
            key = next;
            if g_low * direction > 0.0 {
                continue;
            }
            let (t, start) = (way * key, At { member: step.member, t: step.t, state: &step.start });
            let (share, state) = if t == step.t_end {
                (1.0, step.end.clone())
            } else {
                let is_start = is_no_time(step.t, t);
                let state = if is_start { step.start.clone() } else { self.motion.step(start, t - step.t).into() };
                ((t - step.t) / step.h, state)
            };
            let part = Part { of: 0, low: share, high: share, g_low, g_high: -g_low, slope_low: 0.0, slope_high: 0.0, state };
            changes.push(Change { step: Arc::clone(&step), part });
        }
    }

    /// Locates changes of sign.
    pub(super) fn located(&mut self, e: usize, changes: Vec<Change>) -> Vec<Located> {
        if let Some(times) = &self.motion.events.events[e].times {
            let way = self.motion.events.way;
            let at = |Change { step, part }| {
                let step: Arc<Step> = step;
                let t = way * times.nearest(step.member, way * (step.t + part.high * step.h));
                Located { step, share: part.high, t, state: part.state }
            };
            return changes.into_iter().map(at).collect();
        }
        let (steps, mut parts): (Vec<_>, Vec<_>) = changes.into_iter().map(|change| (change.step, change.part)).unzip();
        let motion = &mut self.motion;
        let shares = if let ([step], [part]) = (&steps[..], &mut parts[..]) {
            let (member, state) = (step.member, &step.start);
            vec![located_alone(part, |share| {
                let h = share * step.h;
                let there: Numbers = motion.step(At { member, t: step.t, state }, h).into();
                (motion.g(e, At { member, t: step.t + h, state: &there }), there)
            })]
        } else {
            located(&mut parts, &mut |asked| {
                let (there, g) = trial(motion, e, asked, &|i| &steps[i]);
                (g, there.numbers)
            })
        };
        let made = steps.into_iter().zip(parts).zip(shares);
        made.map(|((step, part), share)| {
            let t = step.t + if share > LEAST_SHARE { share } else { 0.0 } * step.h;
            Located { step, share, t, state: part.state }
        })
        .collect()
    }

    /// Counts and keeps these, up to where members stop.
    fn taken(&mut self, changes: Vec<Vec<Change>>) -> Vec<Stop> {
        // The step in which a member stops; later ones do not count.
        let mut last: Vec<(usize, i64)> = Vec::new();
        for (e, each) in changes.iter().enumerate() {
            let terminal = self.motion.events.events[e].terminal;
            let (mut member, mut number) = (usize::MAX, 0);
            for change in each {
                let step = &change.step;
                number = if step.member == member { number + 1 } else { *self.count(e, step.member) + 1 };
                member = step.member;
                if terminal > 0 && number >= terminal {
                    match last.iter_mut().find(|(stopped, _)| *stopped == member) {
                        Some((_, at)) => *at = step.number.min(*at),
                        None => last.push((member, step.number)),
                    }
                }
            }
        }
        let stops_in = |member: usize| last.iter().find(|(stopped, _)| *stopped == member).map_or(i64::MAX, |(_, at)| *at);
        let mut in_last: Vec<Vec<Change>> = Vec::new();
        for (e, each) in changes.into_iter().enumerate() {
            let (now, before): (Vec<_>, Vec<_>) = each
                .into_iter()
                .filter(|change| change.step.number <= stops_in(change.step.member))
                .partition(|change| change.step.number == stops_in(change.step.member));
            before.into_iter().for_each(|change| self.put_off(e, change));
            in_last.push(now);
        }
        if last.is_empty() { Vec::new() } else { self.stopped(in_last) }
    }

    /// Stops members at the first terminal event of these steps, where all occur that are due at that instant.
    fn stopped(&mut self, in_last: Vec<Vec<Change>>) -> Vec<Stop> {
        let of_parts: Vec<Vec<[f64; 2]>> =
            in_last.iter().map(|each| each.iter().map(|change| [change.part.low, change.part.g_low]).collect()).collect();
        let located: Vec<Vec<Located>> = in_last.into_iter().enumerate().map(|(e, each)| self.located(e, each)).collect();
        let mut ends: Vec<Located> = Vec::new();
        for (e, each) in located.iter().enumerate() {
            let terminal = self.motion.events.events[e].terminal;
            let (mut member, mut number) = (usize::MAX, 0);
            for one in each {
                number = if one.step.member == member { number + 1 } else { *self.count(e, one.step.member) + 1 };
                member = one.step.member;
                if terminal == 0 || number != terminal.max(*self.count(e, member) + 1) {
                    continue;
                }
                match ends.iter_mut().find(|end| end.step.member == member) {
                    Some(end) if one.share < end.share => *end = one.clone(),
                    Some(_) => {}
                    None => ends.push(one.clone()),
                }
            }
        }
        let mut at = States::default();
        ends.iter().for_each(|end| at.push(end.step.member, end.t, &end.state));
        for (e, each) in located.into_iter().enumerate() {
            let now = self.motion.quantity(e, &at);
            for (end, g) in ends.iter().zip(now) {
                let mine = each.iter().zip(&of_parts[e]).filter(|(one, _)| one.step.member == end.step.member);
                let mut around = mine.filter(|(one, [low, _])| self.is_around(e, end, one, *low));
                // The first part around the instant says from which side it came.
                let occurs = |one: &Located, came: f64| one.share == end.share || came * sign(g) <= 0.0 || self.is_timed(e);
                let due = around.next().is_some_and(|(one, [_, came])| occurs(one, sign(*came)));
                for one in each.iter().filter(|one| one.step.member == end.step.member && one.share < end.share) {
                    self.note(e, one.clone()); // later ones are not in the run
                }
                if due {
                    self.note(e, end.clone());
                }
            }
        }
        for end in &ends {
            self.found.stopped_at[end.step.member - self.first] = end.t;
        }
        ends.into_iter().map(|Located { step, t, state, .. }| Stop::at(step, t, state)).collect()
    }

    /// Whether the times of an event are known.
    pub(super) fn is_timed(&self, e: usize) -> bool {
        self.motion.events.events[e].times.is_some()
    }

    /// Whether an instant is in a part that begins at `low` and ends where its event is located.
    pub(super) fn is_around(&self, e: usize, at: &Located, one: &Located, low: f64) -> bool {
        let way = self.motion.events.way;
        (if self.is_timed(e) { one.t * way <= at.t * way } else { low <= at.share }) && at.share <= one.share
    }

    /// Counts one, and keeps it if it is among the first.
    pub(super) fn note(&mut self, e: usize, one: Located) {
        let count = self.count(e, one.step.member);
        *count += 1;
        if *count <= self.motion.events.events[e].most {
            self.keep(e, one);
        }
    }

    /// Counts a change that ends nothing, and locates it later if it is among the first.
    pub(super) fn put_off(&mut self, e: usize, change: Change) {
        let count = self.count(e, change.step.member);
        *count += 1;
        if *count <= self.motion.events.events[e].most {
            self.changes[e].push(change);
        }
        if self.changes[e].len() >= LOCATED_AT_ONCE {
            self.locate_waiting(e);
        }
    }

    fn keep(&mut self, e: usize, one: Located) {
        let kept = &mut self.found.occurrences[e];
        kept.member.push(one.step.member as i64);
        kept.step.push(one.step.number);
        kept.share.push(one.share);
        kept.t.push(one.t);
        kept.states.extend(one.state);
    }

    /// Locates what waits.
    fn locate_waiting(&mut self, e: usize) {
        let candidates = std::mem::take(&mut self.candidates[e]);
        let mut changes = std::mem::take(&mut self.changes[e]);
        for change in self.within(e, candidates) {
            let count = self.count(e, change.step.member);
            *count += 1;
            if *count <= self.motion.events.events[e].most {
                changes.push(change);
            }
        }
        for one in self.located(e, changes) {
            self.keep(e, one);
        }
    }
}

/// Changes of sign of one quantity: members, and for each time, length of the step, both shares of it between which the change
/// is, quantities there, and states of the step's start and of the part's end, one after the other.
#[derive(Debug)]
pub struct Brackets<'c> {
    /// The members.
    pub members: &'c [i64],
    /// Time, length, both shares and both quantities.
    pub numbers: &'c [f64],
    /// The states of the step's start and of the part's end.
    pub states: &'c [f64],
}

/// Locates changes of sign. Returns their shares of the steps, and the states there.
pub fn locate(events: &Events, e: usize, brackets: &Brackets) -> (Vec<f64>, Vec<f64>) {
    let n = events.numbers;
    let each = brackets.members.iter().zip(brackets.numbers.chunks_exact(6)).zip(brackets.states.chunks_exact((2 * n).max(1)));
    let changes = each.map(|((member, numbers), states)| {
        let (start, end) = states.split_at(n);
        let (t, h, [low, high, g_low, g_high]) = (numbers[0], numbers[1], [2, 3, 4, 5].map(|i| numbers[i]));
        let (slope_low, slope_high, state) = (0.0, 0.0, end.into());
        let (member, t_end, start) = (*member as usize, t + h, start.into());
        let step = Step { member, number: 0, t, h, t_end, start, end: Numbers::new(), window: None };
        Change { step: Arc::new(step), part: Part { of: 0, low, high, g_low, g_high, slope_low, slope_high, state } }
    });
    let located = Watch::new(events).located(e, changes.collect());
    let states = located.iter().flat_map(|one| one.state.iter().copied()).collect();
    (located.iter().map(|one| one.share).collect(), states)
}

/// The states at shares of steps, and the quantity of an event there.
fn trial<'s>(
    motion: &mut Motion,
    e: usize,
    asked: &[(usize, f64)],
    step_of: &dyn Fn(usize) -> &'s Arc<Step>,
) -> (States, Vec<f64>) {
    let mut from = States::default();
    let mut lengths = Vec::with_capacity(asked.len());
    for (of, share) in asked {
        let step = step_of(*of);
        from.push(step.member, step.t, &step.start);
        lengths.push(share * step.h);
    }
    let there = motion.steps(&from, &lengths);
    let g = motion.quantity(e, &there);
    (there, g)
}

impl Events<'_> {
    /// The first time of an event after this one, infinite or none where it is not known, in the order of the motion.
    pub(crate) fn next(&self, e: usize, member: usize, t: f64) -> Option<f64> {
        Some(self.events[e].times.as_ref()?.after(member, self.way * t)[0])
    }

    /// Whether an event may occur in a step between these times, by its times or by its quantity one step before and at both
    /// ends.
    pub(crate) fn may_occur(&self, e: usize, member: usize, [before, g, g_end]: [f64; 3], [t, t_end]: [f64; 2]) -> bool {
        self.next(e, member, t).map_or_else(|| may_change(before, g, g_end), |next| next <= self.way * t_end)
    }

    /// Whether the times of an event are known before.
    pub(crate) fn has_times(&self) -> bool {
        self.events.iter().any(|event| event.times.is_some())
    }

    /// Whether an event occurs between these times, as is known before.
    pub(crate) fn comes(&self, member: usize, t: f64, t_end: f64) -> bool {
        (0..self.events.len()).any(|e| self.next(e, member, t).is_some_and(|next| next <= self.way * t_end))
    }
}

/// Whether one of several quantities may change its sign, each a row: one step before, and at both ends of a step.
pub(crate) fn any_may_change([before, now, next]: [&[f64]; 3]) -> bool {
    let all = before.iter().zip(now).zip(next);
    all.fold(false, |any, ((before, now), next)| any | may_change(*before, *now, *next))
}

/// Whether g may change its sign between two states, once or twice: see `reference/events.py`.
#[inline(always)]
fn may_change(before: f64, g: f64, next: f64) -> bool {
    let bend = ((next - g) - (g - before)).abs();
    let bend = if before.is_nan() { f64::INFINITY } else { REACH * bend };
    let (size, last) = (next.abs(), g.abs());
    let is_near = !size.is_nan() && !last.is_nan() && ((size <= bend) | (last <= bend));
    is_near | ((next > 0.0) != (g > 0.0))
}
