//! Quantities whose changes of sign are noticed while steps are made, for runs with events.
//!
//! A step compares each quantity after it with what it was one and two steps before, about as `may_change` of
//! `reference/events.py` does. In which steps and which they are is found afterwards, by repeating steps; so what is noticed here
//! only has to be complete.

use crate::{
    error::Error,
    model::{
        spec::{Parameters, Signature},
        system::{Block, Shape},
        systems::equations::{self, values_of},
    },
    tape::{
        Id, Op,
        number::{Number, Symbol},
    },
};

/// See `reference/events.py`.
pub(crate) const REACH: f64 = 4.0;

/// How many numbers of a state it takes, behind all others: of each quantity what it was one step before and what it is, and
/// whether one may have changed its sign.
pub(crate) fn numbers(signature: &Signature) -> usize {
    signature.watched.as_ref().map_or(0, |watched| 2 * watched.quantities().len() + 1)
}

/// An error if the quantities read what is not given.
pub(crate) fn check(signature: &Signature, shape: Shape) -> Result<(), Error> {
    signature.watched.as_ref().map_or(Ok(()), |watched| equations::check(watched, signature, shape.v + shape.y))
}

/// The numbers after a step to this state; the first of them is number `first` of the state. Quantities depend on the state
/// alone.
pub(crate) fn next(p: &Parameters<Symbol>, t: Symbol, [v, y]: [&Block<Symbol>; 2], first: usize) -> Vec<Id> {
    let Some(watched) = &p.signature.watched else { return Vec::new() };
    let now = values_of(watched, p, t, v, y);
    let state = |i: usize| Symbol::new(Op::State((first + i) as u32));
    let mut clear = None;
    let mut next = Vec::new();
    for (i, now) in now.into_iter().enumerate() {
        let (before, last) = (state(2 * i), state(2 * i + 1));
        let change = now - last;
        let bend = Symbol::of(REACH) * (change - (last - before));
        // Where the sign changes, the change is longer than both. Squares are quicker than sizes, and what is too small for them
        // counts as zero, so that more is noticed rather than less. NaN is not clear.
        let far = bend * bend + change * change;
        let is_clear = far.below(now * now) & far.below(last * last);
        clear = Some(clear.map_or(is_clear, |clear| clear & is_clear));
        next.extend([last, now]);
    }
    let may = state(next.len());
    next.extend(clear.map(|clear| Symbol::choose(clear, may, Symbol::of(1.0))));
    next.into_iter().map(|symbol| symbol.0).collect()
}
