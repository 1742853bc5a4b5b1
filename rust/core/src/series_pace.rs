//! Adaptive steps by the series of a solution: how far it reaches, and what comes after a step.
//!
//! The step is found from the last two coefficients before it is made (Jorba and Zou 2005, §3.2), so none is rejected. With ‖cⱼ‖ the size
//! of a group of coefficients and τ what is tolerated there, the term j is as small as is tolerated at (τ/‖cⱼ‖)^(1/j). The step is
//! the least of these for j = p − 1 and p and all groups, times exp(−0.7/(p − 1)). `reference/series_pace.py` is the specification.

use crate::{
    functions::{rough_exp2, rough_log2},
    number::Number,
    pace::{Acceptance, ONSET, Pace, Scales, largest, longer, over, total},
    program::coefficients,
    system::{Block, System},
};

/// The most by which a step may be longer than the one before: where the last terms vanish, nothing else bounds it.
const MAX_GROWTH: f64 = 1024.0;
/// The size of the last terms over the tolerated one, between bounds whose logarithms exist.
const BOUNDS: [f64; 2] = [1e-280, 1e280];
/// The margin of a step of order p is 2^(−MARGIN/(p − 1)): exp(−0.7/(p − 1)).
const MARGIN: f64 = 0.7 * std::f64::consts::LOG2_E;

/// Coefficients of v and y, from the first on.
pub type Terms<N> = Vec<(Block<N>, Block<N>)>;

/// The coefficients at the start of a step. The system is scaled to a step of 1.
pub fn terms<N: Number>(order: u32, system: &dyn System<N>, pace: &Pace<N>, v: &Block<N>, y: &Block<N>) -> Terms<N> {
    coefficients(system, order, [pace.t, N::of(1.0)], v, y)
}

/// One step by these coefficients, or one extra step, which leaves the pace as it is and whose state has to be put back. Also the largest
/// sizes so far.
#[allow(clippy::too_many_arguments, reason = "all that an attempt depends on")]
pub fn attempt<N: Number>(
    terms: &[(Block<N>, Block<N>)],
    projected: &dyn System<N>,
    acceptance: &Acceptance,
    (pace, scales): (Pace<N>, &Scales<N>),
    budget: N,
    v: &Block<N>,
    y: &Block<N>,
) -> (Pace<N>, Vec<N>, Block<N>, Block<N>) {
    let outlook = pace.outlook(budget);
    let (far, bound) = (reach(acceptance, (&pace, scales), [v, y], terms), pace.wall - pace.t);
    let ends = bound.below(far);
    let end = N::choose(ends, bound, far);
    let step = N::choose(outlook.is_extra, pace.extra, end);
    let (new_v, new_y) = (value(v, terms.iter().map(|term| &term.0), step), value(y, terms.iter().map(|term| &term.1), step));
    let new = acceptance.sizes(new_v.as_slice(), new_y.as_slice());
    let (new_v, new_y) = projected.project(new_v, new_y);
    let (next, longest, took) = decided(&pace, (end, ends), (&scales.longest, &new), outlook.is_extra, outlook.runs);
    let next = match projected.tally() {
        Some(done) => Pace { work: N::choose(took & !outlook.is_extra, pace.work + done, pace.work), ..next },
        None => next,
    };
    let goes_on = |new: &Block<N>, old: &Block<N>| new.zip_map(old, |new, old| N::choose(took, new, old));
    (next, longest, goes_on(&new_v, v), goes_on(&new_y, y))
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
fn reach<N: Number>(
    acceptance: &Acceptance,
    (pace, scales): (&Pace<N>, &Scales<N>),
    [v, y]: [&Block<N>; 2],
    terms: &[(Block<N>, Block<N>)],
) -> N {
    let (zero, order) = (N::of(0.0), terms.len() as u32);
    let of = |k: u32| {
        let (v, y) = &terms[k as usize - 1];
        acceptance.sizes(v.as_slice(), y.as_slice())
    };
    let (present, first) = (acceptance.sizes(v.as_slice(), y.as_slice()), of(1));
    // A group at zero counts as long as its rate would have made it in the last step, and as a part of the others of its block.
    let [of_v, of_y] = acceptance.counts(v.len(), y.len());
    let mut standing = Vec::new();
    for block in [0..of_v, of_v..of_v + of_y] {
        let (longest, now) = (&scales.longest[block.clone()], &present[block]);
        if now.len() > 1 {
            let onset = N::of(ONSET) * longer(largest(longest), largest(now));
            standing.extend(longest.iter().map(|size| N::choose(zero.below(*size), *size, onset)));
        } else {
            standing.extend(longest);
        }
    }
    let bound = |group: usize| {
        let counts = N::choose(zero.below(pace.lasts), standing[group], present[group]);
        let [relative, absolute] = scales.tolerances(group, pace);
        absolute + relative * longer(counts, first[group] * pace.before)
    };
    let bound: Vec<N> = (0..present.len()).map(bound).collect();
    let logarithm = |k: u32| rough_log2(over(&of(k), &bound).clamped(BOUNDS[0], BOUNDS[1])) * N::of(-1.0 / f64::from(k));
    let (one, other) = (logarithm(order - 1), logarithm(order));
    let reach = rough_exp2(N::choose(one.below(other), one, other) - N::of(MARGIN / f64::from(order - 1)));
    let most = N::of(MAX_GROWTH) * pace.before;
    pace.shortened(N::choose(most.below(reach), most, reach), pace.t)
}

/// What comes after a step, which may end at the wall, the largest sizes so far, and whether the state goes on. `longest` and `new` are the
/// largest sizes before, and those that the groups would have.
fn decided<N: Number>(
    pace: &Pace<N>,
    (step, ends): (N, N::Truth),
    (longest, new): (&[N], &[N]),
    is_extra: N::Truth,
    runs: N::Truth,
) -> (Pace<N>, Vec<N>, N::Truth) {
    let number = N::of;
    let good = total(new).below(number(f64::INFINITY)); // NaN is not
    let reached = N::choose(ends, pace.wall, pace.t + step);
    let passes = pace.target.below(reached);
    let (takes, holds, fails) = (runs & good & !passes, runs & good & passes, runs & !good);
    let count = |truth: N::Truth| N::choose(truth, number(1.0), number(0.0));
    let next = Pace {
        t: N::choose(takes, reached, pace.t),
        h: N::choose(takes | holds, step, N::choose(fails, number(0.0), pace.h)),
        extra: N::choose(is_extra, number(0.0), pace.extra),
        held: N::choose(holds, number(1.0), pace.held),
        before: N::choose(takes & !ends, step, pace.before),
        accepted: pace.accepted + count(takes),
        rejected: pace.rejected + count(fails),
        extra_steps: pace.extra_steps + count(holds | is_extra),
        error: N::choose(fails, number(f64::INFINITY), pace.error),
        ..*pace
    };
    let grows = longest.iter().zip(new).map(|(so_far, new)| N::choose(takes & so_far.below(*new), *new, *so_far));
    (next, grows.collect(), takes | is_extra)
}
