//! Events that change the state of a member: `runs/events/resets.py`, which says why, for one member at a time.

use std::sync::Arc;

use smallvec::smallvec;

use super::{
    evaluation::FEW,
    found::Rest,
    motion::{At, Events, Numbers, States, Truths},
    search::{LEAST_SHARE, Part, is_no_time, located_alone, sign},
    watch::{Candidate, Change, Located, Side, Step, Stop, Watch},
};

/// See `runs/events/resets.py` for these.
pub(super) const MOST_IN_A_STEP: usize = 1000;
pub(super) const SETTLED: f64 = 1.0 / (1u64 << 30) as f64;
pub(super) const LARGEST_RATIO: f64 = 1.0 - 1.0 / (1u64 << 20) as f64;
const LEAST_LEFT: f64 = 1.0 / (1u64 << 36) as f64;
/// 2⁻¹⁰⁰.
pub(super) const NO_TIME: f64 = f64::from_bits((1023 - 100) << 52);
const AT: f64 = 8.0;
const MOST_AT_ONCE: usize = 100;
const FURTHER: f64 = 1.0 / (1u64 << 10) as f64;

/// State of the event search for a member between its steps; lists have an entry for each event.
#[derive(Clone, Debug)]
pub(crate) struct Memory {
    pub member: usize,
    /// The side from which it came to an event at which it is since that changed its state; 0 for others.
    pub(super) at: Numbers,
    /// Whether the event leads it back to where it is.
    pub(super) led_back: Truths,
    /// Whether it has been there for a step or more, with the quantity at zero.
    pub(super) lain: Truths,
    /// Each quantity at the state, and one step before; NaN where that is not known.
    pub now: Numbers,
    pub before: Numbers,
    /// Where it is at rest.
    pub(super) rest: Option<Resting>,
    /// It does not go on, in this state.
    pub ended: bool,
    circle: Truths,
    pub(super) often_since: f64,
}

/// An event at which a member is at rest, and since when.
#[derive(Clone, Copy, Debug)]
pub(super) struct Resting {
    pub event: usize,
    pub since: f64,
}

impl Memory {
    pub(crate) fn new(member: usize, events: usize) -> Memory {
        Memory {
            member,
            at: smallvec![0.0; events],
            led_back: smallvec![false; events],
            lain: smallvec![false; events],
            now: smallvec![f64::NAN; events],
            before: smallvec![f64::NAN; events],
            rest: None,
            ended: false,
            circle: smallvec![false; events],
            often_since: f64::NAN,
        }
    }

    /// Whether its next steps must be checked, whatever the quantities are.
    pub(crate) fn is_special(&self) -> bool {
        self.rest.is_some() || self.at.iter().any(|side| *side != 0.0)
    }

    /// Whether it begins where an event changed its state, or holds it.
    pub(crate) fn is_fresh(&self) -> bool {
        (0..self.at.len()).any(|e| self.at[e] != 0.0 && (self.led_back[e] || !self.lain[e]))
    }

    /// Whether it is at rest.
    pub(crate) fn rests(&self) -> bool {
        self.rest.is_some()
    }

    /// Goes on to the end of a step, where the quantity of an event is `g`. It may have left the event at which it lay.
    pub(crate) fn goes_on(&mut self, e: usize, g: f64) {
        if self.lain[e] && g != 0.0 {
            (self.at[e], self.lain[e]) = (0.0, false);
        }
        (self.before[e], self.now[e]) = (self.now[e], g);
    }

    /// The report on a member at rest, and since when it is at rest.
    pub(crate) fn said(&self) -> Option<(Rest, f64)> {
        let Resting { event, since } = self.rest?;
        let (led_back, often_since, circle) = (self.led_back[event], self.often_since, self.circle.to_vec());
        Some((Rest { member: self.member as i64, event: event as i64, led_back, often_since, circle }, since))
    }
}

/// A member after an instant at which events occurred.
pub(super) struct After {
    pub state: Numbers,
    pub at: Numbers,
    /// The last event that changed the state.
    pub event: Option<usize>,
    pub stops: bool,
    pub circles: bool,
}

/// The end of a stretch: its share, infinite if nothing ends it, and the time.
struct Ahead {
    share: f64,
    t: f64,
    after: After,
    /// Each quantity where it ends.
    g_end: Numbers,
    /// The event that holds the member.
    returns: Option<usize>,
}

/// An instant of a member, and what occurs at it: for each event the side just before, whether it occurs, and the largest size
/// of its quantity at the ends of the step.
pub(super) struct Instant {
    pub at: Located,
    pub side: Numbers,
    pub due: Truths,
    pub size: Numbers,
}

/// Where a member stops within a step.
enum Arrived {
    AtEnd(Numbers),
    Stops(f64, Numbers),
    Rests(usize, f64, Numbers),
}

/// As NumPy's, which returns NaN if one is.
pub(super) fn larger(a: f64, b: f64) -> f64 {
    if a.is_nan() || a > b { a } else { b }
}

/// Steps of some members from the state at step `k` on, and what events do to them.
pub(crate) struct Followed<'m> {
    pub memory: &'m mut Memory,
    /// The state, then that at the end.
    pub state: Numbers,
    /// The first step after which a number is not finite.
    pub first_bad: Option<i64>,
    /// Where it stopped.
    pub stop: Option<Stop>,
}

/// Results of a step: the members' states at the end, and each member's quantities.
#[derive(Default)]
struct Made {
    ends: Vec<f64>,
    next: Vec<f64>,
}

impl Watch<'_> {
    pub(super) fn changes_state(&self, e: usize) -> bool {
        self.motion.events.events[e].then.is_some()
    }

    /// Whether an event changes the state.
    pub(crate) fn changes(&self) -> bool {
        (0..self.events()).any(|e| self.changes_state(e))
    }

    pub(crate) fn events(&self) -> usize {
        self.motion.events.events.len()
    }

    /// Whether the next occurrence, or the `more`-th after it, ends a member's run or changes its state.
    pub(super) fn ends(&mut self, e: usize, member: usize, more: usize) -> bool {
        let terminal = self.motion.events.events[e].terminal;
        self.changes_state(e) || (terminal > 0 && *self.count(e, member) + 1 + more as i64 >= terminal)
    }

    /// Treats a member that begins at an event with a direction as if it had changed its state, unless the run goes on.
    pub(crate) fn begin_member(&mut self, memory: &mut Memory, t: f64, h: f64, state: &[f64], goes_on: bool) {
        let g = self.all_g(At { member: memory.member, t, state });
        if goes_on {
            memory.now = g;
        } else {
            self.begin_again(memory, t, h, (state, &g), [true, true]);
        }
    }

    /// As `begin_member`, for a member of a world with known quantities: whether it begins, and was moved since the last call.
    pub(crate) fn begin_again(
        &mut self,
        memory: &mut Memory,
        t: f64,
        h: f64,
        (state, g): (&[f64], &[f64]),
        [begins, moved]: [bool; 2],
    ) {
        let at = At { member: memory.member, t, state };
        for (e, g) in g.iter().copied().enumerate() {
            let (changed, direction) = (begins || g != memory.now[e], self.motion.events.events[e].direction);
            memory.now[e] = g;
            if moved {
                memory.before[e] = f64::NAN;
            }
            if !self.changes_state(e) {
                continue;
            }
            if changed {
                memory.at[e] = if g == 0.0 { 0.0 - direction } else { 0.0 };
            }
            if (begins || moved) && (memory.at[e] != 0.0 || (changed && g == 0.0)) {
                let new = self.motion.changed(e, at);
                let mut side = memory.at[e];
                if direction == 0.0 && side == 0.0 {
                    side = 0.0 - sign(self.motion.slope(e, At { state: &new, ..at }, h));
                }
                memory.led_back[e] = self.leads_back((e, side), h, At { state: &new, ..at }, state);
                if memory.led_back[e] {
                    memory.at[e] = side;
                }
            }
            memory.lain[e] &= !changed;
        }
        if moved {
            (memory.rest, memory.ended) = (None, false);
        }
    }

    /// Whether an event holds a member where it is: at a new state, which was old before.
    pub(super) fn leads_back(&mut self, (e, side): (usize, Side), h: f64, new: At, old: &[f64]) -> bool {
        if side == 0.0 {
            return false;
        }
        let change = self.motion.change(new, h);
        let mut each = old.iter().zip(new.state).zip(change);
        if !each.all(|((before, after), change)| (after - before).abs() <= LEAST_LEFT * (after.abs() + change.abs())) {
            return false;
        }
        let (t, state, back) = self.further(e, h, new);
        let [further, back] = [&state, &back].map(|state| At { t, state, ..new });
        let [g, g_further, g_back] = [new, further, back].map(|at| self.motion.g(e, at));
        let across = side * (g - g_further);
        across > 0.0 && side * (g_back - g_further) >= 0.5 * across
    }

    /// Whether an event turns a member back, or holds it, that begins at it, at rest, and is pushed across it.
    pub(super) fn bounces(&mut self, (e, side): (usize, Side), h: f64, at: At) -> bool {
        let (t, _, back) = self.further(e, h, at);
        side * self.motion.slope(e, At { t, state: &back, ..at }, h) >= 0.0
    }

    /// A little later: the time, the state there by the rates here, and that which an event makes of it.
    fn further(&mut self, e: usize, h: f64, at: At) -> (f64, Numbers, Numbers) {
        let (t, change) = (at.t + FURTHER * h, self.motion.change(at, h));
        let state: Numbers = at.state.iter().zip(change).map(|(x, change)| x + FURTHER * change).collect();
        let back = self.motion.changed(e, At { t, state: &state, ..at });
        (t, state, back)
    }

    /// Whether the event at which a member is at rest would hold it at this time.
    pub(super) fn holds(&mut self, memory: &Memory, e: usize, h: f64, at: At) -> bool {
        !memory.led_back[e] || self.leads_back((e, memory.at[e]), h, at, at.state)
    }

    /// After which share of a time the event lets a member at rest go; infinite where it does not by its end.
    pub(super) fn let_go(&mut self, memory: &Memory, e: usize, within: f64, h: f64, at: At) -> f64 {
        if self.holds(memory, e, h, At { t: at.t + within, ..at }) {
            return f64::INFINITY;
        }
        let mut part =
            Part { of: 0, low: 0.0, high: 1.0, g_low: -1.0, g_high: 1.0, slope_low: 0.0, slope_high: 0.0, state: Numbers::new() };
        located_alone(&mut part, |share| {
            let holds = self.holds(memory, e, h, At { t: at.t + share * within, ..at });
            (if holds { -1.0 } else { 1.0 }, Numbers::new())
        })
    }

    /// An instant, with what occurs at it: of changes that are located at it or later in a part around it, the first says from
    /// which side the quantity comes.
    pub(super) fn instant(&mut self, at: Located, found: &[(Vec<Located>, Vec<Change>)], size: Numbers) -> Instant {
        let (mut side, mut due) = (Numbers::new(), smallvec![false; found.len()]);
        let here = At { member: at.step.member, t: at.t, state: &at.state };
        for (e, (occurs, changes)) in found.iter().enumerate() {
            side.push(sign(self.motion.g(e, here)));
            let mut around = occurs.iter().zip(changes).filter(|(one, of)| self.is_around(e, &at, one, of.part.low));
            if let Some((one, of)) = around.next() {
                let came = sign(of.part.g_low);
                due[e] = one.share == at.share || came * side[e] <= 0.0 || self.is_timed(e);
                side[e] = came;
            }
        }
        Instant { at, side, due, size }
    }

    /// Events that are due at an instant, in the order of the list, and those that they set off.
    pub(super) fn happen(&mut self, memory: &mut Memory, h: f64, instant: Instant, lies: &[Side]) -> After {
        let Instant { at, mut side, mut due, size } = instant;
        let (member, events, t) = (memory.member, self.events(), at.t);
        let mut state = at.state.clone();
        let (mut stops, mut event, mut came, mut acted) =
            (false, None, Numbers::from_elem(0.0, events), Truths::from_elem(false, events));
        let mut g = self.all_g(At { member, t, state: &state });
        let held: Numbers = (0..events).map(|e| if memory.led_back[e] { g[e] } else { 0.0 }).collect();
        let counts = |e: usize| !due[e] && (g[e] == 0.0 || held[e] != 0.0);
        let lies: Numbers = (0..events).map(|e| if counts(e) { lies[e] } else { 0.0 }).collect();
        side.iter_mut().zip(&lies).filter(|(_, lies)| **lies != 0.0).for_each(|(side, lies)| *side = *lies);
        let near = |e: usize| larger(if due[e] { AT * g[e].abs() } else { 0.0 }, LEAST_LEFT * size[e]);
        // Members are at no event that comes by the time.
        let near: Numbers = (0..events).map(|e| if self.is_timed(e) { -1.0 } else { near(e) }).collect();
        for _ in 0..MOST_AT_ONCE {
            if due.contains(&true) {
                acted.fill(false);
            }
            for e in 0..events {
                if !std::mem::take(&mut due[e]) {
                    continue;
                }
                acted[e] = true;
                let ends = self.ends(e, member, 0);
                if at.share > LEAST_SHARE {
                    self.note(e, Located { state: state.clone(), ..at.clone() });
                }
                if !self.changes_state(e) {
                    side[e] = sign(g[e]);
                    stops |= ends;
                    continue;
                }
                if stops {
                    continue;
                }
                state = self.motion.changed(e, At { member, t, state: &state });
                (event, came[e]) = (Some(e), side[e]);
                for other in 0..events {
                    let (last, now) = (g[other], self.motion.g(other, At { member, t, state: &state }));
                    let mut new_side = if now == 0.0 { side[other] } else { sign(now) };
                    if other == e {
                        new_side = if now.abs() <= near[e] { 0.0 } else { new_side };
                    } else {
                        let direction = self.motion.events.events[other].direction;
                        let crosses = side[other] * now < 0.0 || (now == 0.0 && last != 0.0 && side[other] != 0.0);
                        due[other] |= crosses && side[other] * direction <= 0.0;
                        new_side = if due[other] { side[other] } else { new_side };
                    }
                    (g[other], side[other]) = (now, new_side);
                }
            }
            if !due.contains(&true) {
                break;
            }
        }
        let here = |e: usize| {
            if came[e] == 0.0 {
                if g[e] == held[e] { lies[e] } else { 0.0 }
            } else if g[e].abs() <= near[e] {
                came[e]
            } else {
                0.0
            }
        };
        let here: Numbers = (0..events).map(here).collect();
        for e in 0..events {
            memory.lain[e] = here[e] != 0.0 && came[e] == 0.0 && g[e] == 0.0;
            if came[e] != 0.0 {
                memory.led_back[e] = self.leads_back((e, here[e]), h, At { member, t, state: &state }, &at.state);
            }
        }
        let circles = due.contains(&true) && !stops;
        if circles {
            memory.circle.copy_from_slice(&acted);
            memory.led_back.fill(false);
        }
        After { state, at: here, event, stops, circles }
    }

    /// Notes what happens up to the first end of a stretch. `whole` is the length of its step, `way` the direction of time.
    fn ahead(&mut self, memory: &mut Memory, stretch: &Arc<Step>, at: &mut [Side], (whole, way): (f64, f64)) -> Ahead {
        let (member, h) = (memory.member, way * whole);
        let (mut share, mut returns) = (f64::INFINITY, None);
        let (mut found, mut size, mut g_ends) = (Vec::new(), Numbers::new(), Numbers::new());
        let (start, end) =
            (At { member, t: stretch.t, state: &stretch.start }, At { member, t: stretch.t + stretch.h, state: &stretch.end });
        for (e, side) in at.iter_mut().enumerate() {
            let (g, g_end, changes_state) = (self.motion.g(e, start), self.motion.g(e, end), self.changes_state(e));
            let is_looked_at = !(*side != 0.0 && stretch.h.abs() < LEAST_LEFT * whole);
            if changes_state {
                *side = if memory.lain[e] && g != 0.0 { 0.0 } else { *side };
                if memory.lain[e] && *side != 0.0 {
                    memory.led_back[e] |= self.leads_back((e, *side), h, start, start.state);
                }
            }
            let candidates = if is_looked_at { vec![Candidate { step: Arc::clone(stretch), g: [g, g_end] }] } else { vec![] };
            let (changes, stuck) = self.within_from(e, candidates, |_| *side);
            if changes_state && (!stuck.is_empty() || (*side != 0.0 && memory.led_back[e])) {
                returns = Some(e);
            }
            let mut occurs: Vec<(Located, Change)> = self.located(e, changes.clone()).into_iter().zip(changes).collect();
            let in_no_time = |(one, _): &(Located, Change)| way * (one.t - stretch.t) <= NO_TIME * whole;
            if changes_state && *side != 0.0 && returns != Some(e) && occurs.iter().any(in_no_time) {
                if self.bounces((e, *side), h, start) {
                    returns = Some(e);
                } else {
                    *side = 0.0;
                    occurs.retain(|each| !in_no_time(each));
                }
            }
            let (occurs, changes): (Vec<Located>, Vec<Change>) = occurs.into_iter().unzip();
            size.push(larger(g.abs(), g_end.abs()));
            g_ends.push(g_end);
            for (more, one) in occurs.iter().enumerate() {
                if self.ends(e, member, more) {
                    share = share.min(one.share);
                }
            }
            found.push((occurs, changes));
        }
        let wakes = self.wakes_in(memory, stretch, at, h, returns, &mut found);
        if let Some(first) = wakes {
            (share, returns) = (first, None);
        }
        if returns.is_some() {
            share = f64::NEG_INFINITY; // nothing happens before
        }
        let mut here = Located { step: Arc::clone(stretch), share, t: stretch.t, state: stretch.start.clone() };
        for (e, (occurs, _)) in found.iter().enumerate() {
            for one in occurs {
                if one.share == share {
                    here.t = one.t;
                    if wakes.is_none() {
                        here.state.clone_from(&one.state);
                    }
                } else if one.share < share {
                    self.note(e, one.clone());
                }
            }
        }
        let t = here.t;
        let instant = self.instant(here, &found, size);
        let after = self.happen(memory, h, instant, at);
        let share = if returns.is_some() { f64::INFINITY } else { share };
        Ahead { share, t, after, g_end: g_ends, returns }
    }

    /// The share of a step at which a member that an event holds meets another at a known time; nothing else happens to it
    /// before.
    fn wakes_in(
        &mut self,
        memory: &mut Memory,
        stretch: &Step,
        at: &[Side],
        h: f64,
        returns: Option<usize>,
        found: &mut [(Vec<Located>, Vec<Change>)],
    ) -> Option<f64> {
        let held = returns?;
        let timed = found.iter().enumerate().filter(|(e, _)| self.is_timed(*e)).filter_map(|(_, (occurs, _))| occurs.first());
        let (first, when) = timed.map(|one| (one.share, one.t)).min_by(|a, b| a.0.total_cmp(&b.0))?;
        memory.at.copy_from_slice(at);
        let start = At { member: memory.member, t: stretch.t, state: &stretch.start };
        if self.let_go(memory, held, when - stretch.t, h, start) < f64::INFINITY {
            return None;
        }
        for (_, of_event) in found.iter_mut().enumerate().filter(|(e, _)| !self.is_timed(*e)) {
            *of_event = Default::default();
        }
        Some(first)
    }

    /// Makes one step of a member again, with its events.
    fn through(&mut self, memory: &mut Memory, mut stretch: Arc<Step>) -> Arrived {
        let (end, whole, way) = (stretch.t + stretch.h, stretch.h.abs(), if stretch.h < 0.0 { -1.0 } else { 1.0 });
        let (mut flight, mut ratio) = (f64::NAN, f64::NAN);
        let mut at = std::mem::replace(&mut memory.at, smallvec![0.0; self.events()]);
        for resets in 0..=MOST_IN_A_STEP {
            let mut ahead = self.ahead(memory, &stretch, &mut at, (whole, way));
            let ends = ahead.share < f64::INFINITY;
            let goes_on_by_event = ends && !ahead.after.stops && !ahead.after.circles;
            let returned = at.iter().zip(&ahead.after.at).any(|(before, after)| *before != 0.0 && *after != 0.0);
            let last = std::mem::replace(&mut flight, if returned { ahead.t - stretch.t } else { f64::NAN });
            let before = std::mem::replace(&mut ratio, flight / last);
            let rest_of_series = ratio / (1.0 - ratio);
            let limit = ahead.t + flight * rest_of_series;
            let is_settled = (ratio - before).abs() <= SETTLED && ratio <= LARGEST_RATIO && way * limit < way * end;
            if is_settled && ahead.returns.is_none() && goes_on_by_event {
                ahead.returns = ahead.after.event;
                let both = ahead.after.state.iter().zip(&stretch.start);
                let start = both.map(|(now, earlier)| now + (now - earlier) * rest_of_series).collect();
                stretch = Arc::new(Step { t: limit, start, end: stretch.end.clone(), ..*stretch });
            }
            if resets == MOST_IN_A_STEP && goes_on_by_event && ahead.returns.is_none() {
                ahead.returns = ahead.after.event;
                memory.often_since = end - way * whole;
            }
            let is_free = resets < MOST_IN_A_STEP && self.is_free(memory, &stretch, &at, way * whole, &mut ahead);
            if is_free {
                (flight, ratio) = (f64::NAN, f64::NAN);
            } else if let Some(e) = ahead.returns {
                memory.at = at;
                return Arrived::Rests(e, stretch.t, stretch.start.clone());
            } else if ahead.after.circles {
                return Arrived::Rests(ahead.after.event.unwrap_or(0), ahead.t, ahead.after.state);
            } else if ahead.after.stops {
                return Arrived::Stops(ahead.t, ahead.after.state);
            } else if !ends {
                if stretch.h.abs() < LEAST_LEFT * whole {
                    let falls = at.iter().zip(&ahead.g_end).any(|(side, g)| side * g < 0.0);
                    memory.at = at;
                    return Arrived::AtEnd(if falls { stretch.start.clone() } else { stretch.end.clone() });
                } else {
                    for (e, side) in at.into_iter().enumerate() {
                        memory.lain[e] = side != 0.0 && ahead.g_end[e] == 0.0;
                        memory.at[e] = if memory.lain[e] { side } else { 0.0 };
                    }
                }
                return Arrived::AtEnd(stretch.end.clone());
            }
            let h = if is_no_time(ahead.t, end) { 0.0 } else { way * larger(way * (end - ahead.t), 0.0) };
            let start = ahead.after.state;
            // Where nothing is left of a step, a method may divide by its length.
            let stretch_end = if h == 0.0 {
                start.clone()
            } else {
                self.motion.step(At { member: memory.member, t: ahead.t, state: &start }, h).into()
            };
            stretch = Arc::new(Step { t: ahead.t, h, start, end: stretch_end, ..*stretch });
            at = ahead.after.at;
        }
        Arrived::AtEnd(stretch.end.clone())
    }

    /// Whether an event that holds a member lets it go within a stretch. It goes on from there, in the same state.
    fn is_free(&mut self, memory: &mut Memory, stretch: &Step, at: &[Side], h: f64, ahead: &mut Ahead) -> bool {
        let Some(e) = ahead.returns else { return false };
        memory.at.copy_from_slice(at);
        let lies = !memory.led_back[e] && memory.lain[e];
        memory.led_back[e] |= lies; // where the motion across begins within the stretch
        let mut share = self.let_go(memory, e, stretch.h, h, At { member: memory.member, t: stretch.t, state: &stretch.start });
        if lies {
            memory.led_back[e] = share.is_infinite();
            share = f64::INFINITY;
        }
        if share == f64::INFINITY {
            return false;
        }
        (memory.led_back[e], memory.lain[e]) = (false, false);
        ahead.t = stretch.t + share * stretch.h;
        ahead.after.at.copy_from_slice(at);
        ahead.after.state.copy_from_slice(&stretch.start);
        true
    }

    /// Makes steps of members, from one number to another, with all that events do to them.
    pub(crate) fn follow(&mut self, followed: &mut [Followed], from: i64, until: i64, h: f64) {
        let (n, events, of_run) = (self.motion.events.numbers, self.events(), self.motion.events);
        let (mut moving, mut made) = (Vec::new(), Made::default());
        for number in from..until {
            moving.clear();
            for (i, each) in followed.iter_mut().enumerate() {
                if !each.memory.ended && each.stop.is_none() && self.wakes(each, number, h) {
                    moving.push(i);
                }
            }
            self.make(&moving, followed, (number, h), &mut made);
            for (place, i) in moving.iter().enumerate() {
                let (end, next) = (&made.ends[place * n..(place + 1) * n], &made.next[place * events..(place + 1) * events]);
                let each = &mut followed[*i];
                let is_finite = each.state.iter().chain(end).all(|x| x.is_finite());
                if !is_finite || each.first_bad.is_some() {
                    each.first_bad.get_or_insert(number + 1);
                    each.state.copy_from_slice(end);
                    continue;
                }
                let memory = &mut *each.memory;
                let member = memory.member;
                let [t, t_end] = [number, number + 1].map(|number| of_run.begin.at(member) + number as f64 * h);
                let may = |e: usize| of_run.may_occur(e, member, [memory.before[e], memory.now[e], next[e]], [t, t_end]);
                if memory.is_fresh() || (0..events).any(may) {
                    let start = std::mem::replace(&mut each.state, end.into());
                    let whole = Step { member, number, t, h, t_end, start, end: end.into(), window: None };
                    self.look(each, whole, next);
                    continue;
                }
                each.state.copy_from_slice(end);
                next.iter().enumerate().for_each(|(e, g)| memory.goes_on(e, *g));
            }
        }
    }

    /// Makes a step of some members.
    fn make(&mut self, moving: &[usize], followed: &[Followed], (number, h): (i64, f64), made: &mut Made) {
        let (n, events) = (self.motion.events.numbers, self.events());
        made.ends.clear();
        made.next.clear();
        if moving.len() < FEW {
            for i in moving {
                let Followed { memory, state, .. } = &followed[*i];
                let start = At { member: memory.member, t: self.time(memory.member, number, h), state };
                made.ends.extend_from_slice(self.motion.step(start, h));
                let (t, state) = (self.time(memory.member, number + 1, h), &made.ends[made.ends.len() - n..]);
                made.next.extend((0..events).map(|e| self.motion.g(e, At { t, state, ..start })));
            }
            return;
        }
        let mut starts = States::default();
        for i in moving {
            let Followed { memory, state, .. } = &followed[*i];
            starts.push(memory.member, self.time(memory.member, number, h), state);
        }
        let mut ends = self.motion.steps(&starts, &vec![h; moving.len()]);
        for (t, member) in ends.t.iter_mut().zip(&starts.members) {
            *t = self.time(*member, number + 1, h);
        }
        made.next.resize(moving.len() * events, 0.0);
        for e in 0..events {
            let all = self.motion.quantity(e, &ends);
            made.next.iter_mut().skip(e).step_by(events).zip(all).for_each(|(to, g)| *to = g);
        }
        made.ends = ends.numbers;
    }

    /// Whether a member goes on in a step; one at rest does where the event no longer holds it at the end.
    pub(crate) fn wakes(&mut self, each: &mut Followed, number: i64, h: f64) -> bool {
        let Some(rest) = each.memory.rest else { return true };
        let member = each.memory.member;
        let [t, t_end] = [number, number + 1].map(|number| self.time(member, number, h));
        let comes = self.motion.events.comes(member, t, t_end);
        if self.holds(each.memory, rest.event, h, At { member, t: t_end, state: &each.state }) && !comes {
            return false;
        }
        each.memory.rest = None;
        each.memory.now = self.all_g(At { member, t, state: &each.state });
        true
    }

    /// The quantities of all events.
    fn all_g(&mut self, at: At) -> Numbers {
        (0..self.events()).map(|e| self.motion.g(e, at)).collect()
    }

    fn time(&self, member: usize, number: i64, h: f64) -> f64 {
        let events: &Events = self.motion.events;
        events.begin.at(member) + number as f64 * h
    }

    /// Looks for events in a step of a member, whose quantities at the end are `next`. Returns whether its state is then another.
    pub(crate) fn look(&mut self, each: &mut Followed, whole: Step, next: &[f64]) -> bool {
        let (step, memory) = (Arc::new(whole), &mut *each.memory);
        let member = memory.member;
        let start = At { member, t: step.t, state: &step.start };
        let mut is_at_event = memory.is_fresh();
        let mut changes: Vec<(usize, Vec<Change>)> = Vec::new();
        for (e, next) in next.iter().copied().enumerate() {
            let g = memory.now[e];
            if is_at_event || !self.motion.events.may_occur(e, member, [memory.before[e], g, next], [step.t, step.t_end]) {
                continue;
            }
            let lies = memory.lain[e] && g == 0.0;
            let side = if lies { memory.at[e] } else { 0.0 };
            let (of_event, stuck) = self.within_from(e, vec![Candidate { step: Arc::clone(&step), g: [g, next] }], |_| side);
            let is_held = side != 0.0 && (!stuck.is_empty() || self.leads_back((e, side), step.h, start, start.state));
            is_at_event |= is_held || (0..of_event.len()).any(|more| self.ends(e, member, more));
            changes.push((e, of_event));
        }
        if !is_at_event {
            for (e, of_event) in changes {
                of_event.into_iter().for_each(|change| self.put_off(e, change));
            }
            next.iter().enumerate().for_each(|(e, g)| memory.goes_on(e, *g));
            return false;
        }
        let end = self.time(member, step.number + 1, step.h);
        let stretch = Step { h: end - step.t, start: step.start.clone(), end: step.end.clone(), ..*step };
        let arrived = self.through(memory, Arc::new(stretch));
        let (state, stops_at) = match arrived {
            Arrived::AtEnd(state) => (state, None),
            Arrived::Stops(t, state) => (state, Some(t)),
            Arrived::Rests(event, since, state) => {
                memory.rest = Some(Resting { event, since });
                memory.ended = !memory.led_back[event] && !self.motion.events.has_times();
                (state, None)
            }
        };
        if let Some(t) = stops_at {
            self.found.stopped_at[member - self.first] = t;
            each.stop = Some(Stop::at(step, t, state.clone()));
        }
        memory.before.fill(f64::NAN);
        memory.now = self.all_g(At { member, t: end, state: &state });
        each.state = state;
        true
    }

    /// Notes where a member is at rest at the end of the run.
    pub(crate) fn end_member(&mut self, memory: &Memory) {
        if let Some((rest, since)) = memory.said() {
            self.found.stopped_at[memory.member - self.first] = since;
            self.found.rests.push(rest);
        }
    }
}
