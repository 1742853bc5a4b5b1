//! Adaptive steps by the series of a solution: how far it reaches, and what comes after a step.
//!
//! The step is found from the last two coefficients before it is made (Jorba and Zou 2005, §3.2), so none is rejected. With ‖cⱼ‖ the length
//! of a block of coefficients and τ what is tolerated there, the term j is as small as is tolerated at (τ/‖cⱼ‖)^(1/j). The step is
//! the least of these for j = p − 1 and p and both blocks, times exp(−0.7/(p − 1)). `reference/series_pace.py` is the specification.

use crate::{
    functions::{rough_exp2, rough_log2},
    number::Number,
    pace::{Pace, length2, longer},
    program::coefficients,
    system::{Block, System},
};

/// The most by which a step may be longer than the one before: where the last terms vanish, nothing else bounds it.
const MAX_GROWTH: f64 = 1024.0;
/// The squared length of the last terms over the tolerated one, between bounds whose logarithms exist.
const BOUNDS: [f64; 2] = [1e-280, 1e280];
/// The margin of a step of order p is 2^(−MARGIN/(p − 1)): exp(−0.7/(p − 1)).
const MARGIN: f64 = 0.7 * std::f64::consts::LOG2_E;

/// Coefficients of v and y, from the first on.
pub type Terms<N> = Vec<(Block<N>, Block<N>)>;

/// The coefficients at the start of a step. The system is scaled to a step of 1.
pub fn terms<N: Number>(order: u32, system: &dyn System<N>, pace: &Pace<N>, v: &Block<N>, y: &Block<N>) -> Terms<N> {
    coefficients(system, order, [pace.t, N::of(1.0)], v, y)
}

/// One step by these coefficients, or one extra step, which leaves the pace as it is and whose state has to be put back.
pub fn attempt<N: Number>(
    terms: &[(Block<N>, Block<N>)],
    projected: &dyn System<N>,
    pace: Pace<N>,
    budget: N,
    v: &Block<N>,
    y: &Block<N>,
) -> (Pace<N>, Block<N>, Block<N>) {
    let outlook = pace.outlook(budget);
    let reach = reach(terms.len() as u32, &pace, [v, y], terms);
    let step = N::choose(outlook.is_extra, pace.extra, reach);
    let (new_v, new_y) = (value(v, terms.iter().map(|term| &term.0), step), value(y, terms.iter().map(|term| &term.1), step));
    let new = [length2(&new_v), length2(&new_y)];
    let (new_v, new_y) = projected.project(new_v, new_y);
    let (next, took) = decided(&pace, reach, new, outlook.is_extra, outlook.runs);
    let next = match projected.tally() {
        Some(done) => Pace { work: N::choose(took & !outlook.is_extra, pace.work + done, pace.work), ..next },
        None => next,
    };
    let goes_on = |new: &Block<N>, old: &Block<N>| new.zip_map(old, |new, old| N::choose(took, new, old));
    (next, goes_on(&new_v, v), goes_on(&new_y, y))
}

/// The sum of a series at a distance. Odd and even powers are summed apart by Horner's rule, which takes half the time of one sum; the start
/// comes last, so that it is rounded once.
fn value<'a, N: Number + 'a>(start: &Block<N>, terms: impl Iterator<Item = &'a Block<N>>, step: N) -> Block<N> {
    let square = step * step;
    let terms: Vec<&Block<N>> = terms.collect();
    let sum = |first: usize| {
        let powers = terms.iter().skip(first).step_by(2).rev().map(|term| (*term).clone());
        powers.reduce(|sum, term| term.zip_map(&sum, |term, sum| term + square * sum))
    };
    let (Some(odd), Some(even)) = (sum(0), sum(1)) else { return start.clone() };
    let rest = odd.zip_map(&even, |odd, even| odd + step * even);
    start.zip_map(&rest, |start, rest| start + step * rest)
}

/// How far the series is as good as is tolerated. In `before` the pace has the length of the last step that was taken; a held one does not
/// count, for it is made once more and must be the same.
fn reach<N: Number>(order: u32, pace: &Pace<N>, start: [&Block<N>; 2], terms: &[(Block<N>, Block<N>)]) -> N {
    let of = |k: u32| {
        let (v, y) = &terms[k as usize - 1];
        [length2(v), length2(y)]
    };
    let (present, first) = (start.map(length2), of(1));
    // A block at zero counts as long as its rate would have made it in the last step.
    // Squares of what is tolerated: of the absolute part and of the relative one, added.
    let tolerated = [0, 1].map(|i| {
        let counts = N::choose(N::of(0.0).below(pace.lasts), pace.longest[i], present[i]);
        let square = longer(counts, first[i] * (pace.before * pace.before));
        pace.absolute * pace.absolute + (pace.relative * pace.relative) * square
    });
    let per = tolerated.map(|square| N::of(1.0) / square);
    let zero = N::of(0.0);
    let share = |square: N, per: N| N::choose(square.at_most(zero), zero, square * per);
    let logarithm = |k: u32| {
        let last = of(k);
        let over = longer(share(last[0], per[0]), share(last[1], per[1])).clamped(BOUNDS[0], BOUNDS[1]);
        rough_log2(over) * N::of(-0.5 / f64::from(k))
    };
    let (one, other) = (logarithm(order - 1), logarithm(order));
    let reach = rough_exp2(N::choose(one.below(other), one, other) - N::of(MARGIN / f64::from(order - 1)));
    let most = N::of(MAX_GROWTH) * pace.before;
    N::choose(most.below(reach), most, reach)
}

/// What comes after a step, and whether the state goes on. `new`: squares of the lengths of the new blocks.
fn decided<N: Number>(pace: &Pace<N>, reach: N, new: [N; 2], is_extra: N::Truth, runs: N::Truth) -> (Pace<N>, N::Truth) {
    let number = N::of;
    let good = (new[0] + new[1]).below(number(f64::INFINITY)); // NaN is not
    let reached = pace.t + reach;
    let passes = pace.target.below(reached);
    let (takes, holds, fails) = (runs & good & !passes, runs & good & passes, runs & !good);
    let count = |truth: N::Truth| N::choose(truth, number(1.0), number(0.0));
    let longest = |i: usize| N::choose(takes & pace.longest[i].below(new[i]), new[i], pace.longest[i]);
    let next = Pace {
        t: N::choose(takes, reached, pace.t),
        h: N::choose(takes | holds, reach, N::choose(fails, number(0.0), pace.h)),
        extra: N::choose(is_extra, number(0.0), pace.extra),
        held: N::choose(holds, number(1.0), pace.held),
        before: N::choose(takes, reach, pace.before),
        longest: [longest(0), longest(1)],
        accepted: pace.accepted + count(takes),
        rejected: pace.rejected + count(fails),
        extra_steps: pace.extra_steps + count(holds | is_extra),
        error: N::choose(fails, number(f64::INFINITY), pace.error),
        ..*pace
    };
    (next, takes | is_extra)
}
