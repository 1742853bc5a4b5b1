//! Events of fixed steps: the states after all steps of a group are checked, some steps at a time.

use std::{ops::Range, sync::Arc};

use crate::{
    events::{
        any_may_change,
        evaluation::Filled,
        motion::{Event, Events, Numbers},
        resets::{Followed, Memory},
        watch::{Candidates, Noticed, Step, Stop, Watch},
    },
    group::Group,
    model::spec::{Row, Spec},
    tape::real::{Precision, Real},
};

/// Steps that are made at a time: their states stay in a cache.
const STEPS_AT_ONCE: i64 = 64;

/// Steps that are made at a time, at least and at most, where all lanes go on from the first step in which one is changed.
const MADE_AT_ONCE: [i64; 2] = [4, 256];

/// Steps that are made at a time, at first and at least and at most, where the steps notice what may occur; and the most of all
/// members of a group, beside which reading the flags takes little time.
const NOTICED_AT_FIRST: i64 = 16;
const NOTICED_AT_ONCE: [i64; 2] = [4, 64];
const NOTICED_OF_GROUP: i64 = 1 << 11;
/// If more than one step per this many members would be repeated, half as many are made at a time; if less than a fourth of that,
/// twice as many.
const FEWER_AGAIN: usize = 2;

/// The quantities of a group while it is stepped.
pub struct Looks<'w, 'a> {
    watch: &'w mut Watch<'a>,
    /// The tile of each event.
    tiles: Vec<Filled>,
    /// The quantity of each event at the state, and one step before; NaN where that is not known.
    now: Vec<Vec<f64>>,
    before: Vec<Vec<f64>>,
    /// The states before each of some steps and after the last, v before y, in rows of lanes.
    states: Vec<f64>,
    carried: Vec<f64>,
    /// The quantities in these states.
    values: Vec<f64>,
    /// The carry in place of v, and the blocks that the method keeps, in each of these states, if events change some.
    slots: Vec<f64>,
    /// States that events gave to members, of a method that carries something else than v: from one step on until before another.
    given: Vec<Vec<([i64; 2], Numbers)>>,
    /// Whether the quantities of the present state are known.
    begun: bool,
    /// Whether the steps themselves notice whether an event may occur, and how many of these are made at a time.
    notices: bool,
    together: i64,
    /// Where members stopped.
    stops: Vec<Option<Stop>>,
    /// The search state of each member, if events change states.
    memories: Vec<Memory>,
    /// Whether all lanes are checked together after each step.
    in_lanes: bool,
}

/// The event search of a world between its calls.
#[derive(Debug, Default)]
pub struct Between {
    members: usize,
    /// v and y at the end of the last call, by rows.
    left: [Vec<f64>; 2],
    /// For each event each member's quantity one step before; NaN where that is not known.
    before: Vec<Vec<f64>>,
    /// If events change states: the search state of each member, by groups, and the states of those at rest.
    memories: Vec<Vec<Memory>>,
    rest: Vec<Option<Numbers>>,
}

impl Between {
    /// Whether the caller moved each member of a group since the last call; the members' states are in these rows.
    fn moved(&self, state: [&[f64]; 2], members: Range<usize>) -> Vec<bool> {
        let mut moved = vec![false; members.len()];
        for (now, left) in state.iter().zip(&self.left) {
            for (now, left) in now.chunks_exact(self.members).zip(left.chunks_exact(self.members)) {
                let both = now[members.clone()].iter().zip(&left[members.clone()]);
                moved.iter_mut().zip(both).for_each(|(moved, (now, left))| *moved |= now != left);
            }
        }
        moved
    }

    /// Begins a call of a world in such groups, whose state is in these rows. Whether it is the first one.
    pub(in crate::run) fn begin(&mut self, watch: &Watch, groups: &[usize], state: [&[f64]; 2]) -> bool {
        let members = groups.iter().sum::<usize>();
        let (events, begins) = (watch.events(), self.members != members);
        if begins {
            let remembered = if watch.changes() { members } else { 0 };
            *self = Between {
                members,
                left: state.map(<[f64]>::to_vec),
                before: vec![vec![f64::NAN; members]; events],
                memories: vec![(0..remembered).map(|member| Memory::new(member, events)).collect()],
                rest: vec![None; remembered],
            };
        }
        if watch.changes() && !self.memories.iter().map(Vec::len).eq(groups.iter().copied()) {
            let mut all = std::mem::take(&mut self.memories).into_iter().flatten();
            self.memories = groups.iter().map(|count| all.by_ref().take(*count).collect()).collect();
        }
        begins
    }

    /// Ends a call with this state, into which the states that events gave are written.
    pub(in crate::run) fn end(&mut self, state: [&[f64]; 2]) {
        self.left.iter_mut().zip(state).for_each(|(left, now)| {
            left.clear();
            left.extend_from_slice(now);
        });
    }
}

impl<'w, 'a> Looks<'w, 'a> {
    /// A search for the `count` members from `first` on.
    pub(super) fn new(watch: &'w mut Watch<'a>, notices: bool, lanes: usize, first: usize, count: usize) -> Self {
        let (events, remembered) = (watch.events(), if watch.changes() { count } else { 0 });
        let memories = (first..first + remembered).map(|member| Memory::new(member, events)).collect();
        let in_lanes = !watch.motion.events.repeats;
        Looks { in_lanes, ..Looks::with(watch, notices, lanes, (first, count), memories) }
    }

    /// A search with the members' search states.
    fn with(
        watch: &'w mut Watch<'a>,
        notices: bool,
        lanes: usize,
        (first, count): (usize, usize),
        memories: Vec<Memory>,
    ) -> Self {
        let mut tiles = watch.motion.in_lanes(lanes);
        for (tile, Event { quantity, .. }) in tiles.iter_mut().zip(&watch.motion.events.events) {
            tile.prepare(&quantity.parameters, first, count);
        }
        let rows = || vec![vec![f64::NAN; lanes]; tiles.len()];
        let (now, before) = (rows(), rows());
        let stops = (0..count).map(|_| None).collect();
        Looks {
            watch,
            now,
            before,
            tiles,
            states: Vec::new(),
            carried: Vec::new(),
            slots: Vec::new(),
            values: Vec::new(),
            given: memories.iter().map(|_| Vec::new()).collect(),
            begun: false,
            notices,
            together: NOTICED_AT_FIRST,
            stops,
            memories,
            in_lanes: false,
        }
    }

    /// For members of a world, whose last call ended at step `k`: searches go on for those that stand where they stood. `state`
    /// are v and y of all members, by rows; `begins` if there was no call before.
    pub(in crate::run) fn again(
        watch: &'w mut Watch<'a>,
        between: &mut Between,
        on: &mut Stepped<f64>,
        k: i64,
        (state, begins, group): ([&[f64]; 2], bool, usize),
    ) -> Self {
        let (lanes, range) = (on.group.lanes(), on.first..on.first + on.count);
        let memories = between.memories.get_mut(group).map(std::mem::take).unwrap_or_default();
        let mut looks = Looks::with(watch, false, lanes, (on.first, on.count), memories);
        looks.in_lanes = true;
        let moved = between.moved(state, range.clone());
        for (before, all) in looks.before.iter_mut().zip(&between.before) {
            let known = all[range.clone()].iter().zip(&moved).map(|(before, moved)| if *moved { f64::NAN } else { *before });
            before.iter_mut().zip(known).for_each(|(before, known)| *before = known);
        }
        if !looks.changes() {
            return looks;
        }
        for row in state.into_iter().flat_map(|block| block.chunks_exact(between.members)) {
            looks.states.extend_from_slice(&row[range.clone()]);
            looks.states.resize(looks.states.len() + lanes - on.count, row[range.end - 1]);
        }
        looks.find_quantities(on, k, 0);
        for (lane, moved) in moved.into_iter().enumerate() {
            let g = looks.values_of(lanes, lane, 0);
            let (memory, t) = (&mut looks.memories[lane], looks.watch.motion.events.begin.at(on.first + lane) + k as f64 * on.h);
            if begins || moved || g != memory.now {
                let state: Numbers = looks.states.iter().skip(lane).step_by(lanes).copied().collect();
                looks.watch.begin_again(memory, t, on.h, (&state, &g), [begins, moved]);
            }
            if !begins && let Some(rest) = between.rest[on.first + lane].take().filter(|_| memory.rests()) {
                looks.given[lane].push(([k, i64::MAX], rest));
            }
        }
        looks.begun = true;
        looks
    }

    /// Ends a call of a world at step `k`: returns the members to which events gave states then, with these.
    pub(in crate::run) fn pause(
        mut self,
        between: &mut Between,
        on: &mut Stepped<f64>,
        (k, group): (i64, usize),
    ) -> Vec<(usize, Numbers)> {
        for (before, all) in self.before.iter().zip(&mut between.before) {
            all[on.first..on.first + on.count].copy_from_slice(&before[..on.count]);
        }
        let mut states = Vec::new();
        for (lane, memory) in self.memories.iter().enumerate() {
            let of_step = self.given[lane].iter().rfind(|([from, until], _)| *from <= k && k < *until);
            if let Some((_, state)) = of_step {
                between.rest[on.first + lane] = Some(state.clone()).filter(|_| memory.rests());
                states.push((lane, state.clone()));
            }
        }
        if on.carries && !states.is_empty() {
            self.states.clear();
            self.slots.clear();
            self.keep_state(on, k);
            self.begin_anew(on, k, 0, states.clone());
        }
        states.iter_mut().for_each(|(lane, _)| *lane += on.first);
        if let Some(known) = between.memories.get_mut(group) {
            *known = self.memories;
        }
        states
    }
}

/// Fills a tile of a quantity with a time, so long after those of step 0, and a state, by rows of lanes.
fn fill<T: Real>(tile: &mut Filled, (on, events): (&Stepped<T>, &Events), state: &[f64], since: f64) {
    tile.row(0).iter_mut().enumerate().for_each(|(lane, t)| {
        *t = events.sign * (events.begin.at(on.first + lane.min(on.count - 1)) + since);
    });
    for (i, numbers) in state.chunks_exact(on.group.lanes()).enumerate() {
        tile.row(1 + i).iter_mut().zip(numbers).for_each(|(x, number)| *x = *number); // there may be no such row
    }
}

/// Whether an event occurs at a known time within `n` steps of a member, from the k-th on.
fn comes(events: &Events, member: usize, (k, n, h): (i64, i64, f64)) -> bool {
    let [t, t_end] = [k, k + n].map(|number| events.begin.at(member) + number as f64 * h);
    events.comes(member, t, t_end)
}

/// A step of a lane in which an event may occur: its number among those that were made together, and the quantity at both ends.
struct Seen {
    lane: usize,
    row: usize,
    event: usize,
    g: [f64; 2],
}

/// Members that are stepped together, and how.
pub struct Stepped<'s, T: Real> {
    pub(in crate::run) group: &'s mut dyn Group<T>,
    /// The v slot holds something else than v between steps, or the method keeps more than v and y.
    pub(in crate::run) carries: bool,
    /// None where steps are made one by one.
    pub(in crate::run) spec: Option<&'s Spec<'s>>,
    pub(in crate::run) first: usize,
    pub(in crate::run) count: usize,
    pub(in crate::run) h: f64,
    /// The first step of each that is not finite, or −1.
    pub(in crate::run) first_bad: &'s mut [i64],
    /// The run goes on from an earlier one.
    pub(in crate::run) carried: bool,
    /// The states at the start of the run, by rows; of a world, which begins by itself, none.
    pub(in crate::run) begin: [&'s [Row<'s>]; 2],
}

impl<T: Real> Stepped<'_, T> {
    /// How many numbers of a member each slot has.
    fn rows(&self) -> (usize, usize) {
        let (lanes, (v, y)) = (self.group.lanes(), self.group.slots());
        (v.len() / lanes, y.len() / lanes)
    }
}

/// Numbers behind others, with 64 bits.
fn add<T: Real>(to: &mut Vec<f64>, numbers: &[T]) {
    to.extend(numbers.iter().map(|x| x.wide()));
}

/// Numbers that were such ones, in their place.
fn put<T: Real>(to: &mut [T], numbers: &[f64]) {
    to.iter_mut().zip(numbers).for_each(|(to, x)| *to = T::of(*x));
}

impl Looks<'_, '_> {
    /// Where members stopped.
    pub(super) fn stops(&self) -> &[Option<Stop>] {
        &self.stops
    }

    /// States that events gave to members, of a method that carries something else than v: from one step on until before another.
    pub(super) fn given(&self) -> &[Vec<([i64; 2], Numbers)>] {
        &self.given
    }

    /// Whether events change states: then steps cannot be made again without them.
    pub(super) fn changes(&self) -> bool {
        !self.memories.is_empty()
    }

    /// Ends the run of these members.
    pub(super) fn end(&mut self) {
        self.memories.iter().for_each(|memory| self.watch.end_member(memory));
    }

    /// Makes steps, and looks for events in them.
    pub(in crate::run) fn advance<T: Real>(&mut self, on: &mut Stepped<T>, mut k: i64, steps: i64) {
        let until = k + steps;
        let repeats = T::PRECISION == Precision::Double && !self.in_lanes;
        if self.changes() && (on.carries || !repeats) {
            return self.advance_together(on, k, until);
        }
        if self.changes() {
            return self.advance_with_changes(on, k, until);
        }
        while k < until && self.stops.iter().any(Option::is_none) {
            let noticing = repeats && self.notices && self.begun;
            let most = if noticing {
                self.together
            } else if self.notices {
                1
            } else {
                STEPS_AT_ONCE
            };
            let n = (until - k).min(most);
            if noticing {
                self.make_and_notice(on, k, n);
            } else {
                self.make_steps(on, k, n);
                self.look(on, k, n as usize);
                self.begin_to_notice(on);
            }
            k += n;
        }
    }

    /// Starts the noticing with the quantities at the present state and one step before.
    fn begin_to_notice<T: Real>(&mut self, on: &mut Stepped<T>) {
        if !self.notices {
            return;
        }
        let (lanes, tally) = (on.group.lanes(), on.group.tally_mut());
        let first = tally.len() - (2 * self.now.len() + 1) * lanes;
        for (rows, (before, now)) in tally[first..].chunks_exact_mut(2 * lanes).zip(self.before.iter().zip(&self.now)) {
            rows.iter_mut().zip(before.iter().chain(now)).for_each(|(to, number)| *to = T::of(*number));
        }
    }

    /// Whether a member goes on.
    fn goes_on(&self) -> bool {
        self.memories.iter().zip(&self.stops).any(|(memory, stop)| !memory.ended && stop.is_none())
    }

    /// Makes steps with events that change states, of a world or a method that carries something else than v: all lanes go on
    /// from the end of the first step in which one is changed, where what that one carries begins anew.
    fn advance_together<T: Real>(&mut self, on: &mut Stepped<T>, mut k: i64, until: i64) {
        let (h, (p, _)) = (on.h, on.rows());
        while k < until && self.goes_on() {
            let n = (until - k).min(self.together) as usize;
            self.make_steps(on, k, n as i64);
            if !self.begun {
                for memory in &mut self.memories {
                    let state: Numbers = on.begin[0][..p].iter().chain(on.begin[1]).map(|row| row.at(memory.member)).collect();
                    let t = self.watch.motion.events.begin.at(memory.member) + k as f64 * h;
                    self.watch.begin_member(memory, t, h, &state, on.carried);
                }
                self.begun = true;
            }
            self.find_quantities(on, k, n);
            let (mut made, mut changed) = (n, Vec::new());
            // Where nothing happens in any lane, the members' search states are updated later.
            let (mut is_fresh, mut is_behind) = (true, false);
            for row in 0..n {
                self.wake(on, k + row as i64, &mut changed);
                if changed.is_empty() && row > 0 && !is_fresh && self.is_quiet(row, n) {
                    is_behind = true;
                    continue;
                }
                if std::mem::take(&mut is_behind) {
                    self.catch_up(row, &changed);
                }
                if !changed.is_empty() {
                    made = row;
                    break;
                }
                let (block, numbers) = (self.states.len() / (n + 1), |sum: bool, x: &f64| sum & x.is_finite());
                let are_finite = self.states[row * block..(row + 2) * block].iter().fold(true, numbers);
                for lane in 0..on.count {
                    if are_finite && self.passes(on, k + row as i64, row, lane) {
                        continue;
                    }
                    self.look_at(on, [k, row as i64, until], lane, &mut changed);
                }
                if !changed.is_empty() {
                    made = row + 1;
                    break;
                }
                is_fresh = self.memories.iter().any(Memory::is_fresh);
            }
            if is_behind {
                self.catch_up(made, &[]);
            }
            let [least, most] = MADE_AT_ONCE;
            self.together = if changed.is_empty() { (self.together * 2).min(most) } else { (self.together / 2).max(least) };
            k += made as i64;
            self.begin_anew(on, k, made, changed);
        }
    }

    /// The quantity of an event in all lanes, in one of the states that are kept.
    fn row_of(&self, row: usize, e: usize) -> &[f64] {
        let (lanes, events) = (self.now[e].len(), self.tiles.len());
        &self.values[(row * events + e) * lanes..][..lanes]
    }

    /// Whether no event may occur in step `row` of `steps` steps, which is not the first, in any lane; all numbers are finite.
    fn is_quiet(&self, row: usize, steps: usize) -> bool {
        let block = self.states.len() / (steps + 1);
        let may = |e: usize| any_may_change([row - 1, row, row + 1].map(|row| self.row_of(row, e)));
        let are_finite = self.states[row * block..(row + 2) * block].iter().fold(true, |all, x| all & x.is_finite());
        are_finite && !self.watch.motion.events.has_times() && !(0..self.tiles.len()).any(may)
    }

    /// Updates the members' search states, but of those that are at rest or were woken, to one of the states that are kept, not
    /// the first, before which nothing happened to them.
    fn catch_up(&mut self, row: usize, woken: &[(usize, Numbers)]) {
        for lane in 0..self.memories.len() {
            if self.memories[lane].rests() || woken.iter().any(|(other, _)| *other == lane) {
                continue;
            }
            for e in 0..self.tiles.len() {
                let [before, now] = [row - 1, row].map(|row| self.row_of(row, e)[lane]);
                (self.memories[lane].before[e], self.memories[lane].now[e]) = (before, now);
            }
        }
    }

    /// The quantities of all members in the states before each of some steps and after the last, by states, events and lanes.
    fn find_quantities<T: Real>(&mut self, on: &Stepped<T>, k: i64, steps: usize) {
        let (lanes, events) = (on.group.lanes(), self.watch.motion.events);
        let block = self.states.len() / (steps + 1);
        self.values.clear();
        for (row, state) in self.states.chunks_exact(block.max(1)).enumerate() {
            for tile in &mut self.tiles {
                fill(tile, (on, events), state, (k + row as i64) as f64 * on.h);
                tile.run();
                self.values.extend_from_slice(&tile.values[..lanes]);
            }
        }
    }

    /// The quantities of a member in one of these states.
    fn values_of(&self, lanes: usize, lane: usize, row: usize) -> Numbers {
        let events = self.tiles.len();
        self.values[row * events * lanes..(row + 1) * events * lanes].iter().skip(lane).step_by(lanes).copied().collect()
    }

    /// Members at rest that their events let go in a step.
    fn wake<T: Real>(&mut self, on: &Stepped<T>, number: i64, changed: &mut Vec<(usize, Numbers)>) {
        for (lane, memory) in self.memories.iter_mut().enumerate() {
            let Some(([_, until], state)) = self.given[lane].last_mut().filter(|_| memory.rests() && !memory.ended) else {
                continue;
            };
            let mut each = Followed { memory, state: state.clone(), first_bad: None, stop: None };
            if self.watch.wakes(&mut each, number, on.h) {
                *until = number + 1;
                changed.push((lane, each.state));
            }
        }
    }

    /// Whether no event may occur in a step of a lane, whose numbers are all finite; then its quantities go on.
    fn passes<T: Real>(&mut self, on: &Stepped<T>, number: i64, row: usize, lane: usize) -> bool {
        let (lanes, events) = (on.group.lanes(), self.tiles.len());
        let (memory, of_run) = (&mut self.memories[lane], self.watch.motion.events);
        if self.stops[lane].is_some() || memory.rests() || memory.is_fresh() || on.first_bad[lane] >= 0 {
            return false;
        }
        let [t, t_end] = [number, number + 1].map(|number| of_run.begin.at(memory.member) + number as f64 * on.h);
        let g = |row: usize, e: usize| self.values[(row * events + e) * lanes + lane];
        if (0..events).any(|e| of_run.may_occur(e, memory.member, [memory.before[e], g(row, e), g(row + 1, e)], [t, t_end])) {
            return false;
        }
        for e in 0..events {
            memory.now[e] = g(row, e);
            memory.goes_on(e, g(row + 1, e));
        }
        true
    }

    /// Looks for events in a step of a lane, the `row`-th after the `k`-th, and notes the state that they give its member. After
    /// `until` steps it may be saved.
    fn look_at<T: Real>(
        &mut self,
        on: &mut Stepped<T>,
        [k, row, until]: [i64; 3],
        lane: usize,
        changed: &mut Vec<(usize, Numbers)>,
    ) {
        let (lanes, number, of_run, row) = (on.group.lanes(), k + row, self.watch.motion.events, row as usize);
        let (g, next) = (self.values_of(lanes, lane, row), self.values_of(lanes, lane, row + 1));
        let memory = &mut self.memories[lane];
        if self.stops[lane].is_some() || memory.rests() || on.first_bad[lane] >= 0 {
            return;
        }
        let (p, q) = on.rows();
        let block = (p + q) * lanes;
        let state = |row: usize| -> Numbers {
            self.states[row * block..(row + 1) * block].iter().skip(lane).step_by(lanes).copied().collect()
        };
        let (start, end, member) = (state(row), state(row + 1), memory.member);
        if start.iter().chain(&end).any(|x| !x.is_finite()) {
            on.first_bad[lane] = number + 1;
            return;
        }
        if self.passes(on, number, row, lane) {
            return;
        }
        let memory = &mut self.memories[lane];
        memory.now = g;
        let [t, t_end] = [number, number + 1].map(|number| of_run.begin.at(member) + number as f64 * on.h);
        let whole = Step { member, number, t, h: on.h, t_end, start, end: end.clone(), window: None };
        let mut each = Followed { memory, state: end, first_bad: None, stop: None };
        if self.watch.look(&mut each, whole, &next) {
            let Followed { memory, state, stop, .. } = each;
            if memory.rests() || number + 1 == until {
                let until = if memory.rests() { i64::MAX } else { until + 1 };
                self.given[lane].push(([number + 1, until], state.clone()));
            }
            self.stops[lane] = stop;
            changed.push((lane, state));
        }
    }

    /// Brings lanes back to where they were after `made` of the steps, at step `k`, some of them in another state.
    fn begin_anew<T: Real>(&mut self, on: &mut Stepped<T>, k: i64, made: usize, changed: Vec<(usize, Numbers)>) {
        if changed.is_empty() {
            return;
        }
        let (lanes, (p, q)) = (on.group.lanes(), on.rows());
        let (block, carries) = ((p + q) * lanes, on.carries);
        let (old_v, old_y) = self.states[made * block..(made + 1) * block].split_at(p * lanes);
        let (v, y) = on.group.slots_mut();
        if !carries {
            put(v, old_v);
        }
        put(y, old_y);
        for (lane, state) in &changed {
            let slots = v.iter_mut().skip(*lane).step_by(lanes).chain(y.iter_mut().skip(*lane).step_by(lanes));
            slots.zip(state).for_each(|(to, x)| *to = T::of(*x));
        }
        if !carries {
            return;
        }
        on.group.start(k);
        let of_state = self.slots.len() / (self.states.len() / block);
        let mut carried = &self.slots[made * of_state..(made + 1) * of_state];
        let mut restore = |slot: &mut [T]| {
            let (mine, others) = carried.split_at(slot.len());
            carried = others;
            for lane in (0..lanes).filter(|lane| !changed.iter().any(|(other, _)| other == lane)) {
                slot.iter_mut()
                    .skip(lane)
                    .step_by(lanes)
                    .zip(mine.iter().skip(lane).step_by(lanes))
                    .for_each(|(to, x)| *to = T::of(*x));
            }
        };
        restore(on.group.slots_mut().0);
        on.group.kept_mut().into_iter().for_each(restore);
    }

    /// Makes steps with events that change states: those of members at which nothing happens in the lanes, all others again.
    fn advance_with_changes<T: Real>(&mut self, on: &mut Stepped<T>, mut k: i64, until: i64) {
        let (lanes, events, h) = (on.group.lanes(), self.now.len(), on.h);
        while k < until && self.goes_on() {
            let n = (until - k).min(if self.begun { self.together } else { 1 });
            self.states.clear();
            let (v, y) = on.group.slots();
            add(&mut self.states, v);
            add(&mut self.states, y);
            let state_of = |states: &[f64], lane: usize| states.iter().skip(lane).step_by(lanes).copied().collect();
            if !self.begun {
                for (lane, memory) in self.memories.iter_mut().enumerate() {
                    let state: Numbers = state_of(&self.states, lane);
                    let t = self.watch.motion.events.begin.at(memory.member) + k as f64 * h;
                    self.watch.begin_member(memory, t, h, &state, on.carried);
                }
                self.remember(on, 0..on.count);
                self.begun = true;
            }
            // Before and after: the quantities that the steps notice with.
            let (first_row, rows) = (on.group.tally().len().saturating_sub((2 * events + 1) * lanes), 2 * events * lanes);
            let mut noticed = Vec::new();
            if self.notices {
                let tally = on.group.tally_mut();
                tally[first_row + rows..].fill(T::default());
                add(&mut noticed, &tally[first_row..first_row + rows]);
                on.group.advance(k, n);
            }
            let (v, y) = on.group.slots();
            let is_finite =
                |lane: usize| [v, y].iter().all(|slot| slot.iter().skip(lane).step_by(lanes).all(|x| x.is_below(T::INFINITY)));
            let may =
                |lane: usize| !self.notices || on.group.tally()[first_row + rows + lane] != T::default() || !is_finite(lane);
            let has_times = self.watch.motion.events.has_times();
            let is_followed = |lane: &usize| {
                let (is_bad, memory) = (self.notices && on.first_bad[*lane] >= 0, &self.memories[*lane]);
                let is_due = || may(*lane) || (has_times && comes(self.watch.motion.events, memory.member, (k, n, h)));
                self.stops[*lane].is_none() && !is_bad && (memory.is_special() || is_due())
            };
            let places: Vec<usize> = (0..on.count).filter(is_followed).collect();
            self.choose_together(places.len() * n as usize, on);
            let mut left = places.iter().peekable();
            let mut followed = Vec::with_capacity(places.len());
            for (lane, memory) in self.memories.iter_mut().enumerate() {
                if left.next_if_eq(&&lane).is_none() {
                    continue;
                }
                if self.notices {
                    let number = |row: usize| noticed[row * lanes + lane];
                    memory.before.iter_mut().enumerate().for_each(|(e, before)| *before = number(2 * e));
                    memory.now.iter_mut().enumerate().for_each(|(e, now)| *now = number(2 * e + 1));
                }
                let first_bad = Some(on.first_bad[lane]).filter(|step| *step >= 0);
                followed.push(Followed { memory, state: state_of(&self.states, lane), first_bad, stop: None });
            }
            self.watch.follow(&mut followed, k, k + n, h);
            let results: Vec<_> = followed.into_iter().map(|each| (each.state, each.first_bad, each.stop)).collect();
            for (lane, (state, first_bad, stop)) in places.iter().zip(results) {
                let (v, y) = on.group.slots_mut();
                let slots = v.iter_mut().skip(*lane).step_by(lanes).chain(y.iter_mut().skip(*lane).step_by(lanes));
                slots.zip(state).for_each(|(to, x)| *to = T::of(x));
                on.first_bad[*lane] = first_bad.unwrap_or(-1);
                self.stops[*lane] = stop;
            }
            self.remember(on, places.into_iter());
            k += n;
        }
    }

    /// Chooses how many steps are made together, after `again` steps of members have to be repeated.
    fn choose_together<T: Real>(&mut self, again: usize, on: &Stepped<T>) {
        let [least, most] = NOTICED_AT_ONCE;
        if again * FEWER_AGAIN > on.count {
            self.together = (self.together / 2).max(least);
        } else if 4 * again * FEWER_AGAIN < on.count {
            self.together = (self.together * 2).min((NOTICED_OF_GROUP / on.group.lanes() as i64).clamp(least, most));
        }
    }

    /// Continues the noticing in these lanes with the remembered quantities.
    fn remember<T: Real>(&self, on: &mut Stepped<T>, places: impl Iterator<Item = usize>) {
        if !self.notices {
            return;
        }
        let lanes = on.group.lanes();
        let tally = on.group.tally_mut();
        let first = tally.len() - (2 * self.now.len() + 1) * lanes;
        for lane in places {
            let memory = &self.memories[lane];
            for (e, (before, now)) in memory.before.iter().zip(&memory.now).enumerate() {
                tally[first + 2 * e * lanes + lane] = T::of(*before);
                tally[first + (2 * e + 1) * lanes + lane] = T::of(*now);
            }
        }
    }

    /// Makes steps that notice whether an event may occur in them.
    fn make_and_notice<T: Real>(&mut self, on: &mut Stepped<T>, k: i64, n: i64) {
        let lanes = on.group.lanes();
        let rows = 2 * self.now.len() * lanes;
        let tally = on.group.tally_mut();
        let first_row = tally.len() - lanes - rows;
        tally[first_row + rows..].fill(T::default());
        self.states.clear();
        add(&mut self.states, &tally[first_row..first_row + rows]);
        let (v, y) = on.group.slots();
        add(&mut self.states, v);
        add(&mut self.states, y);
        on.group.advance(k, n);
        let (first, h, events) = (on.first, on.h, self.watch.motion.events);
        let (may, has_times) = (&on.group.tally()[first_row + rows..], events.has_times());
        let is_flagged = |lane: &usize| may[*lane] != T::default() || (has_times && comes(events, first + lane, (k, n, h)));
        let flagged: Vec<usize> = (0..on.count).filter(is_flagged).collect();
        self.choose_together(flagged.len() * n as usize, on);
        let mut noticed = Vec::new();
        for lane in flagged {
            if self.stops[lane].is_some() || on.first_bad[lane] >= 0 {
                continue;
            }
            let numbers =
                |from: usize, every: usize| self.states[from * lanes..].iter().skip(lane).step_by(every * lanes).copied();
            let (member, events_of_step) = (first + lane, self.now.len());
            noticed.push(Noticed {
                member,
                number: k,
                begin: events.begin.at(member),
                h,
                before: numbers(0, 2).take(events_of_step).collect(),
                start: numbers(2 * events_of_step, 1).collect(),
                until: k + n,
            });
        }
        for stop in self.watch.notice(noticed) {
            let lane = stop.step.member - first;
            self.stops[lane] = Some(stop);
        }
    }

    /// Makes steps and keeps the states before each and after the last.
    fn make_steps<T: Real>(&mut self, on: &mut Stepped<T>, k: i64, n: i64) {
        self.states.clear();
        self.slots.clear();
        let spec = on.spec.filter(|_| !self.changes());
        let unrolled = spec.map_or(0, |spec| on.group.unrolled(spec, on.first, on.count));
        let (mut at, lanes) = (k, on.group.lanes());
        let (p, q) = on.rows();
        while at < k + n {
            let steps = unrolled as i64;
            if unrolled > 0 && at % steps == 0 && at + steps <= k + n {
                let (v, y) = on.group.advance_unrolled(at).split_at(unrolled * p * lanes);
                for step in 0..unrolled {
                    add(&mut self.states, &v[step * p * lanes..(step + 1) * p * lanes]);
                    add(&mut self.states, &y[step * q * lanes..(step + 1) * q * lanes]);
                }
                at += steps;
            } else {
                self.keep_state(on, at);
                on.group.advance(at, 1);
                at += 1;
            }
        }
        self.keep_state(on, k + n);
    }

    fn keep_state<T: Real>(&mut self, on: &mut Stepped<T>, k: i64) {
        if on.carries {
            self.carried.clear();
            add(&mut self.carried, on.group.slots().0);
            if self.changes() {
                self.slots.extend_from_slice(&self.carried);
                on.group.kept().into_iter().for_each(|block| add(&mut self.slots, block));
            }
            on.group.finish(k);
        }
        let (v, y) = on.group.slots();
        add(&mut self.states, v);
        add(&mut self.states, y);
        if on.carries {
            put(on.group.slots_mut().0, &self.carried);
        }
    }

    /// Looks for events in the steps that were made.
    fn look<T: Real>(&mut self, on: &mut Stepped<T>, k: i64, steps: usize) {
        let lanes = on.group.lanes();
        let (p, q) = on.rows();
        let block = (p + q) * lanes;
        let (first, h, events) = (on.first, on.h, self.watch.motion.events);
        let mut seen = Vec::new();
        for row in 0..=steps {
            let [before_it, since] = [row as i64 - 1, row as i64].map(|row| (k + row) as f64 * h);
            for (event, tile) in self.tiles.iter_mut().enumerate() {
                if row == 0 && self.begun {
                    continue;
                }
                fill(tile, (on, events), &self.states[row * block..(row + 1) * block], since);
                tile.run();
                let (now, before) = (&mut self.now[event], &mut self.before[event]);
                let g = &tile.values[..lanes];
                let may = |lane: &usize| {
                    let (member, quantities) = (first + lane.min(&(on.count - 1)), [before[*lane], now[*lane], g[*lane]]);
                    let begin = events.begin.at(member);
                    events.may_occur(event, member, quantities, [begin + before_it, begin + since])
                };
                let is_timed = events.events[event].times.is_some();
                if row > 0 && (is_timed || any_may_change([before, now, g])) {
                    let flagged = (0..on.count).filter(may);
                    seen.extend(flagged.map(|lane| Seen { lane, row: row - 1, event, g: [now[lane], g[lane]] }));
                }
                if row > 0 {
                    before.copy_from_slice(now);
                }
                now.copy_from_slice(g);
            }
        }
        self.begun = true;
        if seen.is_empty() {
            return;
        }
        seen.sort_by_key(|each| (each.lane, each.row));
        let state = |lane: usize, row: usize| -> Numbers {
            self.states[row * block..(row + 1) * block].iter().skip(lane).step_by(lanes).copied().collect()
        };
        let mut candidates = Vec::new();
        for each in seen.chunk_by(|a, b| (a.lane, a.row) == (b.lane, b.row)) {
            let (lane, row) = (each[0].lane, each[0].row);
            let (start, end) = (state(lane, row), state(lane, row + 1));
            let is_finite = start.iter().chain(&end).all(|x| x.is_finite());
            if !is_finite || self.stops[lane].is_some() || on.first_bad[lane] >= 0 {
                continue;
            }
            let (member, number) = (first + lane, k + row as i64);
            let [t, t_end] = [number, number + 1].map(|number| events.begin.at(member) + number as f64 * h);
            let step = Step { member, number, t, h, t_end, start, end, window: None };
            let events = each.iter().map(|seen| (seen.event, seen.g)).collect();
            candidates.push(Candidates { step: Arc::new(step), events });
        }
        for stop in self.watch.take(candidates) {
            let lane = stop.step.member - first;
            self.stops[lane] = Some(stop);
        }
    }
}
