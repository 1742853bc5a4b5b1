//! The mean over a step of fixed length of an input that holds its samples.
//!
//! A step that evaluated such an input at its own end would see the next sample, and one within which a sample begins would see
//! it from the next of its evaluations on; either makes every method one of first order. The mean does not: where samples begin
//! with steps it is the sample itself, and elsewhere the error is of second order in the step.

use std::cell::RefCell;

use super::spec::Signature;
use crate::tape::{
    Op,
    number::{Number, Symbol},
    series,
};

/// The ends of a stretch of time, and its length.
pub(crate) type Window<N> = [N; 3];

/// The parts of a length that lead back in time, and on; one of them is zero.
fn ways<N: Number>(h: N) -> [N; 2] {
    let zero = N::of(0.0);
    let back = N::choose(h.below(zero), h, zero);
    [back, h - back]
}

/// The window of a step from t. A method that carries something in place of v evaluates rates in the middle of what it steps
/// over.
pub(crate) fn of_step<N: Number>(t: N, h: N, carries: bool) -> Window<N> {
    let [back, on] = ways(h);
    let length = on - back;
    if carries { [t - N::of(0.5) * length, t + N::of(0.5) * length, length] } else { [t + back, t + on, length] }
}

/// The window of half a kick at t, from what a method carries to velocities and back.
pub(crate) fn of_slot<N: Number>(t: N, h: N) -> Window<N> {
    let [back, on] = ways(N::of(0.5) * h);
    [t - on, t - back, on - back]
}

/// The mean over a window from the sample `before` to the sample `after`, or the same one, which began at time `began`.
pub(crate) fn mean<N: Number>([_, to, length]: Window<N>, began: N, before: N, after: N) -> N {
    let (zero, one) = (N::of(0.0), N::of(1.0));
    let share = (to - began) / length;
    let share = N::choose(zero.below(share), share, zero);
    let share = N::choose(share.below(one), share, one);
    before + share * (after - before)
}

/// Whether a table holds samples that a step averages: the table after it says when they begin.
pub(crate) fn is_held(signature: &Signature, table: usize) -> bool {
    belongs(signature, table, table + 1, ".times")
}

/// Whether a table is that part of an input whose first table is another.
fn belongs(signature: &Signature, first: usize, table: usize, part: &str) -> bool {
    let name = |table: usize| signature.tables.get(table).map(|(name, _)| name.as_str());
    name(first).zip(name(table)).is_some_and(|(name, other)| other.strip_suffix(part) == Some(name))
}

/// How a table is looked up.
#[derive(Clone, Copy, PartialEq)]
enum Lookup {
    /// The sample at a time.
    AtTime,
    /// The mean over the window, at times as they are.
    Mean,
    /// The mean, at times that count from one of each member, which is in the table behind that of times.
    MeanSince,
}

thread_local! {
    /// The window in which symbols of this thread look samples up, and how each table is.
    static NOW: RefCell<Option<(Window<Symbol>, Vec<Lookup>)>> = const { RefCell::new(None) };
}

/// Runs a function in which steps see the mean of samples over a window, if there are samples that are held.
pub(crate) fn over<T>(signature: &Signature, window: impl FnOnce() -> Window<Symbol>, f: impl FnOnce() -> T) -> T {
    let lookup = |table: usize| match is_held(signature, table) {
        true if belongs(signature, table, table + 2, ".origin") => Lookup::MeanSince,
        true => Lookup::Mean,
        false => Lookup::AtTime,
    };
    let lookups: Vec<Lookup> = (0..signature.tables.len()).map(lookup).collect();
    let now = lookups.iter().any(|&lookup| lookup != Lookup::AtTime).then(|| (window(), lookups));
    let outer = NOW.replace(now);
    let made = f();
    NOW.replace(outer);
    made
}

thread_local! {
    /// The values of all sampled inputs, where they are known and no time is asked for.
    static VALUES: RefCell<Vec<Symbol>> = const { RefCell::new(Vec::new()) };
}

/// Runs a function in which sampled inputs have these values at all times.
pub(crate) fn held<T>(values: Vec<Symbol>, f: impl FnOnce() -> T) -> T {
    let outer = VALUES.replace(values);
    let made = f();
    VALUES.replace(outer);
    made
}

/// A sampled input: its mean over the window if there is one, or else its value at a time.
pub(crate) fn sample(table: u32, t: Symbol) -> Symbol {
    if let Some(value) = VALUES.with_borrow(|values| values.get(table as usize).copied()) {
        return value;
    }
    let at = |table: u32, t: Symbol| Symbol::new(Op::Sample(table, t.0));
    let now = NOW.with_borrow(|now| now.as_ref().map(|(window, lookups)| (*window, lookups[table as usize])));
    let Some((window @ [from, to, _], lookup)) = now.filter(|(_, lookup)| *lookup != Lookup::AtTime) else { return at(table, t) };
    let seen = if lookup == Lookup::MeanSince {
        let origin = at(table + 2, to);
        let (before, after) = (at(table, from - origin), at(table, to - origin));
        mean(window, origin + at(table + 1, to - origin), before, after)
    } else {
        let (before, after) = (at(table, from), at(table, to));
        mean(window, at(table + 1, to), before, after)
    };
    if series::is_marking() {
        series::mark(seen, series::Mark::Factors(Vec::new(), None)); // it is the same all over the step, though made of the time
    }
    seen
}
