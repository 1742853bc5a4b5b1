//! Quantities whose changes of sign are noticed while steps are made, for runs with events.
//!
//! A step computes them at its start, compares each with what it was at the start of the step before, and counts. Where and which they are
//! is found afterwards, by repeating steps; so what is noticed here only has to be complete.

use crate::{
    error::Error,
    method::Record,
    number::{Number, Symbol},
    spec::{Given, Parameters},
    system::{Block, Kind, Shape},
    systems::equations::values_of,
    tape::{Id, Op},
    trace::around,
    window,
};

/// How many numbers of a state it takes, behind all others: the last value of each quantity, and the count.
pub fn numbers(given: &Given) -> usize {
    given.watched.as_ref().map_or(0, |watched| watched.quantities().len() + 1)
}

/// An error if the quantities read what is not given.
pub fn check(given: &Given, shape: Shape) -> Result<(), Error> {
    given.watched.as_ref().map_or(Ok(()), |watched| watched.check(given, shape.v + shape.y))
}

/// The next of these numbers, of which the first is number `first` of the state; after a step from this state of the slots.
///
/// They begin with 0, which has no sign: the first step notices nothing. NaN has no sign either.
pub fn next(
    kind: &Kind,
    p: &Parameters<Symbol>,
    method: &Record,
    choice: usize,
    t: Symbol,
    [v, y]: [&Block<Symbol>; 2],
    first: usize,
) -> Vec<Id> {
    let Some(watched) = &p.given.watched else { return Vec::new() };
    let v = match method.finish(choice) {
        None => v.clone(),
        Some(program) => {
            let made = || program.run(around(kind, p).as_ref(), t, p.h, v, y).into_iter().next();
            window::over(p.given, || window::of_slot(t, p.h), made).unwrap_or_else(|| v.clone())
        }
    };
    let now = values_of(watched, p, t, &v, y);
    let state = |i: usize| Symbol::new(Op::State((first + i) as u32));
    let zero = Symbol::of(0.0);
    let mut count = state(now.len());
    for (i, ((direction, _), now)) in watched.quantities().iter().zip(&now).enumerate() {
        let before = state(i);
        let rising = before.below(zero) & zero.at_most(*now);
        let falling = zero.below(before) & now.at_most(zero);
        let changes = match direction.as_str() {
            "rising" => rising,
            "falling" => falling,
            _ => rising | falling,
        };
        count = Symbol::choose(changes, count + Symbol::of(1.0), count);
    }
    now.into_iter().chain([count]).map(|symbol| symbol.0).collect()
}
