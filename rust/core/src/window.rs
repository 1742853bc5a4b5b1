//! What a step of fixed length sees of an input that holds its samples: their mean over the step.
//!
//! A step that evaluated such an input at its own end would see the next sample, and one within which a sample begins would see it from the
//! next of its evaluations on; either makes every method one of first order. The mean does not: where samples begin with steps it is the
//! sample itself, and elsewhere what is lost is of second order in the step.

use std::cell::RefCell;

use crate::{
    number::{Number, Symbol},
    series,
    spec::Given,
    tape::Op,
};

/// The parameters, which no system has, by which rates of large systems are told of a window: its ends and its length.
pub const ENDS: [u32; 3] = [u32::MAX / 4 - 1, u32::MAX / 4 - 2, u32::MAX / 4 - 3];

/// The ends of a stretch of time, and its length.
pub type Window<N> = [N; 3];

/// What of a length leads back in time, and what leads on; one of them is zero.
fn ways<N: Number>(h: N) -> [N; 2] {
    let zero = N::of(0.0);
    let back = N::choose(h.below(zero), h, zero);
    [back, h - back]
}

/// The window of a step from t. A method that carries something in place of v evaluates rates in the middle of what it steps over.
pub fn of_step<N: Number>(t: N, h: N, carries: bool) -> Window<N> {
    let [back, on] = ways(h);
    let length = on - back;
    if carries { [t - N::of(0.5) * length, t + N::of(0.5) * length, length] } else { [t + back, t + on, length] }
}

/// The window of half a kick at t, from what a method carries to velocities and back.
pub fn of_slot<N: Number>(t: N, h: N) -> Window<N> {
    let [back, on] = ways(N::of(0.5) * h);
    [t - on, t - back, on - back]
}

/// The mean over a window that begins with one sample and ends with another, or the same, which began at that time.
pub fn mean<N: Number>([_, to, length]: Window<N>, began: N, before: N, after: N) -> N {
    let (zero, one) = (N::of(0.0), N::of(1.0));
    let share = (to - began) / length;
    let share = N::choose(zero.below(share), share, zero);
    let share = N::choose(share.below(one), share, one);
    before + share * (after - before)
}

/// Whether a table holds samples of which a step sees the mean: the one after it says when they begin.
pub fn is_held(given: &Given, table: usize) -> bool {
    belongs(given, table, table + 1, ".times")
}

/// Whether a table is that part of an input whose first table is another.
fn belongs(given: &Given, first: usize, table: usize, part: &str) -> bool {
    let name = |table: usize| given.tables.get(table).map(|(name, _)| name.as_str());
    name(first).zip(name(table)).is_some_and(|(name, other)| other.strip_suffix(part) == Some(name))
}

/// How a table is looked up.
#[derive(Clone, Copy, PartialEq)]
enum Lookup {
    /// At a time.
    AtTime,
    /// By its mean, at times as they are.
    Mean,
    /// By its mean, at times that count from one of each member, which is in the table behind that of times.
    MeanSince,
}

thread_local! {
    /// The window in which symbols of this thread look samples up, and how each table is.
    static NOW: RefCell<Option<(Window<Symbol>, Vec<Lookup>)>> = const { RefCell::new(None) };
}

/// Runs a function in which steps see the mean of samples over a window, if there are samples that are held.
pub fn over<T>(given: &Given, window: impl FnOnce() -> Window<Symbol>, f: impl FnOnce() -> T) -> T {
    let lookup = |table: usize| match is_held(given, table) {
        true if belongs(given, table, table + 2, ".origin") => Lookup::MeanSince,
        true => Lookup::Mean,
        false => Lookup::AtTime,
    };
    let lookups: Vec<Lookup> = (0..given.tables.len()).map(lookup).collect();
    let now = lookups.iter().any(|&lookup| lookup != Lookup::AtTime).then(|| (window(), lookups));
    let outer = NOW.replace(now);
    let made = f();
    NOW.replace(outer);
    made
}

/// A sampled input: its mean over the window if there is one, or else its value at a time.
pub fn sample(table: u32, t: Symbol) -> Symbol {
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
