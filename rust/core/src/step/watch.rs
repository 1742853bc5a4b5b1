//! Quantities whose changes of sign are noticed while steps are made, for runs with events.
//!
//! A step computes them at its start, compares each with what it was at the start of the step before, and counts where it is near
//! to zero against its change. Where and which they are is found afterwards, by repeating steps; so what is noticed here only has
//! to be complete.

use crate::{
    error::Error,
    model::{
        around,
        methods::Method,
        spec::{Parameters, Signature},
        system::{Block, Kind, Shape},
        systems::equations::{self, values_of},
        window,
    },
    tape::{
        Id, Op,
        number::{Number, Symbol},
    },
};

/// A quantity may be at zero and back within a step where it is no further from zero than so many times its change in this one:
/// `REACH` of `reference/events.py`.
const REACH: f64 = 4.0;

/// How many numbers of a state it takes, behind all others: the last value of each quantity, and the count.
pub(crate) fn numbers(signature: &Signature) -> usize {
    signature.watched.as_ref().map_or(0, |watched| watched.quantities().len() + 1)
}

/// An error if the quantities read what is not given.
pub(crate) fn check(signature: &Signature, shape: Shape) -> Result<(), Error> {
    signature.watched.as_ref().map_or(Ok(()), |watched| equations::check(watched, signature, shape.v + shape.y))
}

/// The next of these numbers, of which the first is number `first` of the state; after a step from this state of the slots.
///
/// They begin with 0, which has no sign: the first step notices nothing. NaN has no sign either.
pub(crate) fn next(
    kind: &Kind,
    p: &Parameters<Symbol>,
    method: &Method,
    choice: usize,
    t: Symbol,
    [v, y]: [&Block<Symbol>; 2],
    first: usize,
) -> Vec<Id> {
    let Some(watched) = &p.signature.watched else { return Vec::new() };
    let v = match method.finish(choice) {
        None => v.clone(),
        Some(program) => {
            let made = || program.run(around::wrap_for_carry(p, (kind.make)(p)).as_ref(), t, p.h, v, y).into_iter().next();
            window::over(p.signature, || window::of_slot(t, p.h), made).unwrap_or_else(|| v.clone())
        }
    };
    let now = values_of(watched, p, t, &v, y);
    let state = |i: usize| Symbol::new(Op::State((first + i) as u32));
    let zero = Symbol::of(0.0);
    let mut count = state(now.len());
    let reach = Symbol::of(REACH * REACH);
    for (i, now) in now.iter().enumerate() {
        let before = state(i);
        let (change, square, last) = (*now - before, *now * *now, before * before);
        let far = reach * (change * change);
        // A change of sign is a longer way than from zero to either of them, so that it is among these.
        let near = zero.below(last) & (square.at_most(far) | last.at_most(far));
        count = Symbol::choose(near, count + Symbol::of(1.0), count);
    }
    now.into_iter().chain([count]).map(|symbol| symbol.0).collect()
}
