//! The motion between the states of a run: steps of any length, rates, and the quantities of events.

use std::{fmt, sync::Mutex};

use super::{
    evaluation::{Cached, Evaluation, Evaluator, Filled},
    found::Found,
};
use smallvec::SmallVec;

use crate::{
    isa::Level,
    model::spec::{Row, Table},
    tape::real::Real,
};

/// The slope of a quantity without derivative is its change over this share of a step, divided by the share.
const SHORT: f64 = 1.0 / (1u64 << 26) as f64;

/// Values and the parameters that they depend on, by rows.
pub struct Values<'a, T: Real = f64> {
    /// The values.
    pub of: Evaluation<T>,
    /// The parameters, one number for all members, or one for each.
    pub parameters: Vec<Row<'a>>,
    /// The sampled inputs, if the values depend on such.
    pub tables: Vec<Table<'a>>,
}

impl<T: Cached> Values<'_, T> {
    fn evaluator(&self, level: Level) -> Evaluator<'_, T> {
        Evaluator::new(&self.of, &self.parameters, &self.tables, level)
    }
}

/// A step, of a time, a length and a state; of 32 bits its numbers are rounded to these.
pub enum Trial<'a> {
    /// Numbers of 64 bits.
    Double(Values<'a>),
    /// Numbers of 32 bits.
    Single(Values<'a, f32>),
}

/// The evaluator of a [`Trial`].
enum Trials<'a> {
    Double(Evaluator<'a>),
    Single(Evaluator<'a, f32>),
}

/// The times of an event that are known before a run, in the order of the motion, and the signs of its quantity before them.
pub struct Times<'a> {
    /// Rows of one time for all members, or one for each: negated if the motion goes back in time, ascending, the last infinite.
    pub keys: &'a [f64],
    /// The signs, likewise.
    pub signs: &'a [f64],
    /// How many numbers a row has.
    pub columns: usize,
}

impl Times<'_> {
    /// How many times of a member are not after this one, and where they stand.
    fn place(&self, member: usize, key: f64) -> (usize, impl Fn(usize) -> usize + use<>) {
        let (columns, column) = (self.columns, if self.columns > 1 { member } else { 0 });
        let at = move |row: usize| row * columns + column;
        let (mut low, mut high) = (0, self.keys.len() / columns - 1);
        while low < high {
            let middle = (low + high) / 2;
            (low, high) = if self.keys[at(middle)] <= key { (middle + 1, high) } else { (low, middle) };
        }
        (low, at)
    }

    /// The times of a member from one on, and before another.
    pub(super) fn within(&self, member: usize, from: f64, until: f64) -> impl Iterator<Item = f64> {
        let column = if self.columns > 1 { member } else { 0 };
        let all = self.keys.iter().skip(column).step_by(self.columns).copied();
        all.filter(move |key| *key >= from && *key < until)
    }

    /// The first time of a member after this one, and the sign before it.
    pub(super) fn after(&self, member: usize, key: f64) -> [f64; 2] {
        let (place, at) = self.place(member, key);
        [self.keys[at(place)], self.signs[at(place)]]
    }

    /// The time of a member that is nearest to this one.
    pub(super) fn nearest(&self, member: usize, key: f64) -> f64 {
        let (place, at) = self.place(member, key);
        let [later, earlier] = [place, place.saturating_sub(1)].map(|row| self.keys[at(row)]);
        if later - key < (key - earlier).abs() { later } else { earlier }
    }
}

/// An event.
pub struct Event<'a> {
    /// The times of the event, if they are known: its quantity then never changes its sign.
    pub times: Option<Times<'a>>,
    /// The quantity, of a time and a state.
    pub quantity: Values<'a>,
    /// The rate of change of that, of a time, a state and the rates of change of these; none if it has no derivative.
    pub slope: Option<Values<'a>>,
    /// The new state that it gives a member, of a time and a state; none if it changes nothing.
    pub then: Option<Values<'a>>,
    /// The sign of the changes that count; 0 for both.
    pub direction: f64,
    /// The number of the change at which it stops a member; 0 for none.
    pub terminal: i64,
    /// How many changes of a member are kept.
    pub most: i64,
}

/// The events of a run, and the motion of its members.
pub struct Events<'a> {
    /// The events.
    pub events: Vec<Event<'a>>,
    /// A step of any length.
    pub step: Trial<'a>,
    /// Whether the steps of the run are such steps, to the last bit; fused ones are not.
    pub repeats: bool,
    /// The change of a state in a step at its rates, of the same numbers.
    pub rates: Values<'a>,
    /// How many numbers a state has, v before y.
    pub numbers: usize,
    /// The number of groups whose largest sizes are known, with adaptive steps.
    pub groups: usize,
    /// The times of step 0.
    pub begin: Row<'a>,
    /// −1 where the time of the run is that of the events, negated.
    pub sign: f64,
    /// −1 where the time of the run falls.
    pub way: f64,
    /// The jumps of adaptive steps, as known times.
    pub jumps: Option<Times<'a>>,
    /// The instruction set of hot loops.
    pub level: Level,
    /// The occurrences found so far.
    pub found: Mutex<Found>,
}

impl fmt::Debug for Events<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Events").field("number", &self.events.len()).finish_non_exhaustive()
    }
}

/// The numbers of a state, or one of each event: few, so that they stand in place.
pub(crate) type Numbers = SmallVec<[f64; 6]>;
/// A truth for each event.
pub(crate) type Truths = SmallVec<[bool; 6]>;

/// States of members at times, of `numbers` each, one after the other.
#[derive(Clone, Debug, Default)]
pub(crate) struct States {
    pub members: Vec<usize>,
    pub t: Vec<f64>,
    pub numbers: Vec<f64>,
}

impl States {
    pub(crate) fn push(&mut self, member: usize, t: f64, state: &[f64]) {
        self.members.push(member);
        self.t.push(t);
        self.numbers.extend_from_slice(state);
    }
}

/// A state of one member at a time.
#[derive(Clone, Copy)]
pub(crate) struct At<'s> {
    pub member: usize,
    pub t: f64,
    pub state: &'s [f64],
}

/// Answers questions about the motion of any members.
pub(crate) struct Motion<'a> {
    pub events: &'a Events<'a>,
    step: Trials<'a>,
    rates: Evaluator<'a>,
    quantities: Vec<(Evaluator<'a>, Option<Evaluator<'a>>)>,
    new_states: Vec<Option<Evaluator<'a>>>,
}

impl<'a> Motion<'a> {
    pub(crate) fn new(events: &'a Events<'a>) -> Self {
        let level = events.level;
        let of =
            |event: &'a Event<'a>| (event.quantity.evaluator(level), event.slope.as_ref().map(|slope| slope.evaluator(level)));
        Motion {
            events,
            step: match &events.step {
                Trial::Double(values) => Trials::Double(values.evaluator(level)),
                Trial::Single(values) => Trials::Single(values.evaluator(level)),
            },
            rates: events.rates.evaluator(level),
            quantities: events.events.iter().map(of).collect(),
            new_states: events.events.iter().map(|event| Some(event.then.as_ref()?.evaluator(level))).collect(),
        }
    }

    /// Time, length and state of each, one after the other.
    fn with_lengths(&self, from: &States, lengths: &[f64]) -> Vec<f64> {
        let n = self.events.numbers;
        let mut inputs = Vec::with_capacity(from.t.len() * (n + 2));
        for (i, (t, h)) in from.t.iter().zip(lengths).enumerate() {
            inputs.extend([*t, *h]);
            inputs.extend_from_slice(&from.numbers[i * n..(i + 1) * n]);
        }
        inputs
    }

    /// The states after steps of these lengths.
    pub(crate) fn steps(&mut self, from: &States, lengths: &[f64]) -> States {
        let inputs = self.with_lengths(from, lengths);
        let numbers = match &mut self.step {
            Trials::Double(step) => step.run(&from.members, &inputs),
            Trials::Single(step) => step.run(&from.members, &inputs),
        };
        let t = from.t.iter().zip(lengths).map(|(t, h)| t + h).collect();
        States { members: from.members.clone(), t, numbers }
    }

    /// The state after a step of this length.
    pub(crate) fn step(&mut self, At { member, t, state }: At, h: f64) -> &[f64] {
        match &mut self.step {
            Trials::Double(step) => step.one(member, &[&[t, h], state]),
            Trials::Single(step) => step.one(member, &[&[t, h], state]),
        }
    }

    /// The change of the state in a step of length `h` at its rates.
    pub(crate) fn change(&mut self, At { member, t, state }: At, h: f64) -> &[f64] {
        self.rates.one(member, &[&[t, h], state])
    }

    /// The quantity of an event.
    pub(crate) fn g(&mut self, e: usize, At { member, t, state }: At) -> f64 {
        self.quantities[e].0.one(member, &[&[self.events.sign * t], state])[0]
    }

    /// The state that an event gives a member in place of this one.
    pub(crate) fn changed(&mut self, e: usize, At { member, t, state }: At) -> Numbers {
        let Some(then) = &mut self.new_states[e] else { return state.into() };
        then.one(member, &[&[self.events.sign * t], state]).into()
    }

    /// The change of a quantity in a step of length `h` at the present rates.
    pub(crate) fn slope(&mut self, e: usize, at: At, h: f64) -> f64 {
        let (sign, At { member, t, state }) = (self.events.sign, at);
        let rates = self.rates.one(member, &[&[t, h], state]);
        if let Some(slope) = &mut self.quantities[e].1 {
            return finite(slope.one(member, &[&[sign * t], state, &[sign * h], rates])[0]);
        }
        let rates = rates.to_vec();
        let states = States { members: vec![member], t: vec![t], numbers: state.to_vec() };
        self.differences(e, &states, &[h], &rates)[0]
    }

    /// The quantities of an event in several states.
    pub(crate) fn quantity(&mut self, e: usize, at: &States) -> Vec<f64> {
        let (n, sign) = (self.events.numbers, self.events.sign);
        let mut inputs = Vec::with_capacity(at.t.len() * (n + 1));
        for (i, t) in at.t.iter().enumerate() {
            inputs.push(sign * *t);
            inputs.extend_from_slice(&at.numbers[i * n..(i + 1) * n]);
        }
        self.quantities[e].0.run(&at.members, &inputs)
    }

    /// The changes of the quantity in steps of these lengths at the present rates.
    pub(crate) fn slopes(&mut self, e: usize, at: &States, lengths: &[f64]) -> Vec<f64> {
        let (n, sign) = (self.events.numbers, self.events.sign);
        let inputs = self.with_lengths(at, lengths);
        let rates = self.rates.run(&at.members, &inputs);
        let Some(slope) = &mut self.quantities[e].1 else { return self.differences(e, at, lengths, &rates) };
        let mut inputs = Vec::with_capacity(at.t.len() * 2 * (n + 1));
        for (i, (t, h)) in at.t.iter().zip(lengths).enumerate() {
            inputs.push(sign * *t);
            inputs.extend_from_slice(&at.numbers[i * n..(i + 1) * n]);
            inputs.push(sign * *h);
            inputs.extend_from_slice(&rates[i * n..(i + 1) * n]);
        }
        slope.run(&at.members, &inputs).into_iter().map(finite).collect()
    }

    /// The slopes as differences over a short step.
    fn differences(&mut self, e: usize, at: &States, lengths: &[f64], rates: &[f64]) -> Vec<f64> {
        let sign = self.events.sign;
        let t = at.t.iter().zip(lengths).map(|(t, h)| sign * (sign * *t + SHORT * (sign * *h))).collect();
        let numbers = at.numbers.iter().zip(rates).map(|(x, rate)| x + SHORT * rate).collect();
        let there = self.quantity(e, &States { members: at.members.clone(), t, numbers });
        let here = self.quantity(e, at);
        there.into_iter().zip(here).map(|(there, here)| finite((there - here) / SHORT)).collect()
    }

    /// Quantities of all events in lanes.
    pub(crate) fn in_lanes(&self, lanes: usize) -> Vec<Filled> {
        let of = |event: &Event| Filled::of_lanes(&event.quantity.of, self.events.level, lanes);
        self.events.events.iter().map(of).collect()
    }
}

/// NaN says nothing, and so counts as zero; what is infinite as the largest number.
pub(crate) fn finite(x: f64) -> f64 {
    if x.is_nan() { 0.0 } else { x.clamp(f64::MIN, f64::MAX) }
}
