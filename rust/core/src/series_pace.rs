//! Adaptive steps by the series of a solution: how far it reaches, and what comes after a step.
//!
//! The step is found from the last two coefficients before it is made (Jorba and Zou 2005, §3.2), so none is rejected. With ‖cⱼ‖ the length
//! of a block of coefficients and τ what is tolerated there, the term j is as small as is tolerated at (τ/‖cⱼ‖)^(1/j). The step is
//! the least of these for j = p − 1 and p and both blocks, times exp(−0.7/(p − 1)). `reference/series_pace.py` is the specification.

use crate::{
    functions::{rough_exp2, rough_log2},
    number::{Branch, Number},
    pace::{Pace, ROUNDING, length2, longer},
    program::coefficients,
    system::{Block, System},
};

/// The most by which a step may be longer than the one before: where the last terms vanish, nothing else bounds it.
const MAX_GROWTH: f64 = 1024.0;
/// The squared length of the last terms over the tolerated one, between bounds whose logarithms exist.
const BOUNDS: [f64; 2] = [1e-280, 1e280];
/// The margin of a step of order p is 2^(−MARGIN/(p − 1)): exp(−0.7/(p − 1)).
const MARGIN: f64 = 0.7 * std::f64::consts::LOG2_E;
/// The most that a step is of the radius of convergence. Beyond it the last terms say nothing of those that follow, however small.
const SHARE: f64 = 0.5;
/// A step that failed is tried again with this part of its length.
const SHRINK: f64 = 0.25;
/// The bits of an exponent.
const EXPONENT: u64 = 0x7FF << 52;

/// Coefficients of v and y, from the first on.
pub type Terms<N> = Vec<(Block<N>, Block<N>)>;
/// The same, and the branches of functions that the rates are on.
pub type Known<'a, N> = (&'a [(Block<N>, Block<N>)], &'a [Branch<N>]);

/// The coefficients at the start of a step, and the branches of functions that the rates are on. The system is scaled to a step of 1.
pub fn terms<N: Number>(
    order: u32,
    system: &dyn System<N>,
    pace: &Pace<N>,
    v: &Block<N>,
    y: &Block<N>,
) -> (Terms<N>, Vec<Branch<N>>) {
    let unit = unit_of(pace.before);
    coefficients(system, order, [pace.t, unit, unit], v, y)
}

/// One step by these coefficients, or one extra step, which leaves the pace as it is and whose state has to be put back. A step that is made
/// once more needs no branches: it was on them.
pub fn attempt<N: Number>(
    (terms, branches): Known<N>,
    projected: &dyn System<N>,
    pace: Pace<N>,
    budget: N,
    v: &Block<N>,
    y: &Block<N>,
) -> (Pace<N>, Block<N>, Block<N>) {
    let outlook = pace.outlook(budget);
    let unit = unit_of(pace.before);
    let (reach, moved) = reach(&pace, unit, [v, y], terms, !branches.is_empty());
    let share = N::choose(outlook.is_extra, pace.extra, reach) / unit;
    let (new_v, new_y) = (value(v, terms.iter().map(|term| &term.0), share), value(y, terms.iter().map(|term| &term.1), share));
    let new = lengths([&new_v, &new_y]);
    let (new_v, new_y) = projected.project(new_v, new_y);
    let stays = on_branches(branches, share, moved);
    let (next, took) = decided(&pace, reach, (new, stays), outlook.is_extra, outlook.runs);
    let next = match projected.tally() {
        Some(done) => Pace { work: N::choose(took & !outlook.is_extra, pace.work + done, pace.work), ..next },
        None => next,
    };
    let goes_on = |new: &Block<N>, old: &Block<N>| new.zip_map(old, |new, old| N::choose(took, new, old));
    (next, goes_on(&new_v, v), goes_on(&new_y, y))
}

/// The unit of time of the coefficients, the power of two at or below a step: they overflow in no unit of the user's.
fn unit_of<N: Number>(step: N) -> N {
    step.and_bits(EXPONENT)
}

/// The sum of a series at a distance. Odd and even powers are summed apart by Horner's rule, which takes half the time of one sum; the start
/// comes last, so that it is rounded once.
fn value<'a, N: Number + 'a>(start: &Block<N>, terms: impl Iterator<Item = &'a Block<N>>, share: N) -> Block<N> {
    let square = share * share;
    let terms: Vec<&Block<N>> = terms.collect();
    let sum = |first: usize| {
        let powers = terms.iter().skip(first).step_by(2).rev().map(|term| (*term).clone());
        powers.reduce(|sum, term| term.zip_map(&sum, |term, sum| term + square * sum))
    };
    let (Some(odd), Some(even)) = (sum(0), sum(1)) else { return start.clone() };
    let rest = odd.zip_map(&even, |odd, even| odd + share * even);
    start.zip_map(&rest, |start, rest| start + share * rest)
}

/// The squares of the lengths to which errors are relative: of both blocks.
fn lengths<N: Number>(blocks: [&Block<N>; 2]) -> [N; 2] {
    blocks.map(length2)
}

/// The largest of some squares over their bounds. One whose bound is zero has always been zero, and does not count.
fn over<N: Number>(squares: &[N], bounds: &[N]) -> N {
    let zero = N::of(0.0);
    let share = |(square, bound): (&N, &N)| {
        let share = N::choose(zero.below(*bound), *square / *bound, zero);
        N::choose(square.at_most(zero), zero, share)
    };
    squares.iter().zip(bounds).map(share).reduce(longer).unwrap_or(zero)
}

/// How far the series is as good as is tolerated, and the square of the motion in a unit of time over the tolerated error. In `before` the
/// pace has the length of the last step that was taken; a held one does not count, for it is made once more and must be the same.
fn reach<N: Number>(
    pace: &Pace<N>,
    unit: N,
    start: [&Block<N>; 2],
    terms: &[(Block<N>, Block<N>)],
    has_branches: bool,
) -> (N, N) {
    let order = terms.len();
    let of = |k: usize| lengths([&terms[k - 1].0, &terms[k - 1].1]);
    let (present, first, second) = (lengths(start), of(1), of(2));
    let before = pace.before / unit;
    // Squares of what is tolerated, of the absolute part and of the relative one, added; and of what is lost in rounding.
    let (mut tolerated, mut lost, mut motion) = (Vec::new(), Vec::new(), Vec::new());
    for i in 0..present.len() {
        // A block at zero counts as long as its rate would have made it in the last step.
        let counts = N::choose(N::of(0.0).below(pace.lasts), pace.longest[i], present[i]);
        let counts = longer(counts, first[i] * (before * before));
        tolerated.push(pace.absolute * pace.absolute + (pace.relative * pace.relative) * counts);
        lost.push(N::of(ROUNDING * ROUNDING) * counts);
        motion.push(longer(longer(first[i], second[i]), lost[i]));
    }
    let logarithm = |squares: &[N], bounds: &[N]| rough_log2(over(squares, bounds).clamped(BOUNDS[0], BOUNDS[1]));
    let bounds = [order - 1, order].map(|k| {
        let (last, of) = (of(k), k as f64);
        let by_error = logarithm(&last, &tolerated) * N::of(-0.5 / of) - N::of(MARGIN / (order - 1) as f64);
        let half = logarithm(&last, &motion) * N::of(-0.5 / (of - 1.0)) + N::of(SHARE.log2() - of.log2() / (of - 1.0));
        [by_error, if has_branches { longer(half, logarithm(&first, &lost) * N::of(-0.5)) } else { half }]
    });
    let least = bounds.into_iter().flatten().reduce(|one, other| N::choose(one.below(other), one, other));
    let reach = rough_exp2(least.unwrap_or(N::of(f64::NAN))) * unit;
    let most = N::choose(N::of(1.0).below(pace.most), N::of(MAX_GROWTH), N::of(1.0)) * pace.before;
    (N::choose(most.below(reach), most, reach), over(&first, &tolerated))
}

/// Whether all functions stay on their branch within a step, or all its motion is tolerated as an error; none without branches.
fn on_branches<N: Number>(branches: &[Branch<N>], share: N, moved: N) -> Option<N::Truth> {
    let zero = N::of(0.0);
    let mut stays = Vec::new();
    for Branch { terms, least, most } in branches {
        if least.is_finite() {
            let bound = furthest(terms, share, |term| N::choose(term.below(zero), term, zero));
            stays.push(N::of(*least).at_most(bound));
        }
        if most.is_finite() {
            let bound = furthest(terms, share, |term| N::choose(zero.below(term), term, zero));
            stays.push(bound.at_most(N::of(*most)));
        }
    }
    let stays = stays.into_iter().reduce(|all, each| all & each)?;
    Some((moved * (share * share)).at_most(N::of(1.0)) | stays)
}

/// How far the terms to one side alone would take a value within a step: no further can it be.
fn furthest<N: Number>(terms: &[Option<N>], share: N, part: impl Fn(N) -> N) -> N {
    let start = terms.first().copied().flatten().unwrap_or(N::of(0.0));
    let total = terms[1..].iter().rev().fold(None, |total: Option<N>, term| {
        let beyond = total.map(|total| share * total);
        match (term.map(&part), beyond) {
            (Some(part), Some(beyond)) => Some(part + beyond),
            (part, beyond) => part.or(beyond),
        }
    });
    total.map_or(start, |total| start + share * total)
}

/// What comes after a step, and whether the state goes on. `new`: squares of the lengths of the new blocks. `stays`: whether functions stay
/// on their branch; none without any.
fn decided<N: Number>(
    pace: &Pace<N>,
    reach: N,
    (new, stays): ([N; 2], Option<N::Truth>),
    is_extra: N::Truth,
    runs: N::Truth,
) -> (Pace<N>, N::Truth) {
    let number = N::of;
    let finite = (new[0] + new[1]).below(number(f64::INFINITY)); // NaN is not
    // A time that is rounded to its next value might be beyond a pole that the step itself does not reach.
    let fits = finite & pace.t.below(pace.t + number(0.25) * reach);
    let good = stays.map_or(fits, |stays| fits & stays);
    let shorter = number(SHRINK) * N::choose(reach.below(pace.before), reach, pace.before);
    let reached = pace.t + reach;
    let passes = pace.target.below(reached);
    let (takes, holds, fails) = (runs & good & !passes, runs & good & passes, runs & !good);
    let count = |truth: N::Truth| N::choose(truth, number(1.0), number(0.0));
    let longest = |i: usize| N::choose(takes & pace.longest[i].below(new[i]), new[i], pace.longest[i]);
    let next = Pace {
        t: N::choose(takes, reached, pace.t),
        h: N::choose(takes | holds, reach, N::choose(fails, shorter, pace.h)),
        extra: N::choose(is_extra, number(0.0), pace.extra),
        held: N::choose(holds, number(1.0), pace.held),
        before: N::choose(takes, reach, N::choose(fails, shorter, pace.before)),
        most: N::choose(takes, number(MAX_GROWTH), N::choose(fails, number(1.0), pace.most)),
        longest: [longest(0), longest(1)],
        accepted: pace.accepted + count(takes),
        rejected: pace.rejected + count(fails),
        extra_steps: pace.extra_steps + count(holds | is_extra),
        error: {
            let failed = N::choose(finite, number(1.0), number(f64::INFINITY));
            N::choose(takes, number(0.0), N::choose(fails, failed, pace.error))
        },
        ..*pace
    };
    (next, takes | is_extra)
}
