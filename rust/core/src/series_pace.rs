//! Adaptive steps by the series of a solution: how far it reaches, and what comes after a step.
//!
//! The step is found from the last two coefficients before it is made (Jorba and Zou 2005, §3.2), so none is rejected. With ‖cⱼ‖ the length
//! of a block of coefficients and τ what is tolerated there, the term j is as small as is tolerated at (τ/‖cⱼ‖)^(1/j). The step is
//! the least of these for j = p − 1 and p and both blocks, times exp(−0.7/(p − 1)). `reference/series_pace.py` is the specification.

use crate::{
    functions::{rough_exp2, rough_log2},
    number::{Branch, Number},
    pace::{MAX_FACTOR, Pace, ROUNDING, length2, longer},
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
/// A step that failed is tried again with this part of its length. Three more of these come before steps grow again, at first twofold: so many
/// are left before what it met.
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
    let per_unit = N::of(1.0) / unit;
    let (reach, moved) = reach(&pace, per_unit, [v, y], terms);
    let share = N::choose(outlook.is_extra, pace.extra * per_unit, reach);
    let (new_v, new_y) = (value(v, terms.iter().map(|term| &term.0), share), value(y, terms.iter().map(|term| &term.1), share));
    let new = lengths([&new_v, &new_y]);
    let (new_v, new_y) = projected.project(new_v, new_y);
    let stays = on_branches(branches, share, moved);
    let tolerable = N::of(0.5) / moved.sqrt() * unit;
    let (next, took) = decided(&pace, reach * unit, (new, stays, tolerable), outlook.is_extra, outlook.runs);
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

/// The largest of some squares times what is `per` them.
fn over<N: Number>(squares: &[N], per: &[N]) -> N {
    let zero = N::of(0.0);
    let share = |(square, per): (&N, &N)| N::choose(square.at_most(zero), zero, *square * *per);
    squares.iter().zip(per).map(share).reduce(longer).unwrap_or(zero)
}

/// One over a bound. Where that is zero there has never been anything, and what begins now does not count.
fn inverse<N: Number>(bound: N) -> N {
    N::choose(N::of(0.0).below(bound), N::of(1.0) / bound, N::of(0.0))
}

/// How many units of time the series is as good as is tolerated, and the square of the motion in one over the tolerated error. In `before`
/// the pace has the length of the last step that was taken; a held one does not count, for it is made once more and must be the same.
fn reach<N: Number>(pace: &Pace<N>, per_unit: N, start: [&Block<N>; 2], terms: &[(Block<N>, Block<N>)]) -> (N, N) {
    let (zero, number) = (N::of(0.0), N::of);
    let order = terms.len();
    let of = |k: usize| lengths([&terms[k - 1].0, &terms[k - 1].1]);
    let (present, first, second, last_but_one, last) = (lengths(start), of(1), of(2), of(order - 1), of(order));
    let before = pace.before * per_unit;
    // Over squares of what is tolerated, of the absolute part and of the relative one, added; and over those of the motion.
    let (mut per_tolerated, mut per_motion, mut is_lost) = (Vec::new(), Vec::new(), Vec::new());
    for i in 0..present.len() {
        // A block at zero counts as long as its rate would have made it in the last step.
        let counts = N::choose(zero.below(pace.lasts), pace.longest[i], present[i]);
        let counts = longer(counts, first[i] * (before * before));
        per_tolerated.push(inverse(pace.absolute * pace.absolute + (pace.relative * pace.relative) * counts));
        let lost = number(ROUNDING * ROUNDING) * counts;
        per_motion.push(inverse(longer(longer(first[i], second[i]), lost)));
        is_lost.push(first[i].at_most(lost));
    }
    let logarithm = |squares: &[N], per: &[N]| rough_log2(over(squares, per).clamped(BOUNDS[0], BOUNDS[1]));
    let p = order as f64;
    let one = logarithm(&last_but_one, &per_tolerated) * number(-0.5 / (p - 1.0));
    let other = logarithm(&last, &per_tolerated) * number(-0.5 / p);
    let by_error = N::choose(one.below(other), one, other) - number(MARGIN / (p - 1.0));
    let either: Vec<N> = last_but_one.iter().zip(&last).map(|(one, other)| longer(*one, *other)).collect();
    let by_radius = logarithm(&either, &per_motion) * number(-0.5 / (p - 2.0));
    let by_radius = by_radius + number(SHARE.log2() - (p - 1.0).log2() / (p - 2.0));
    // A motion that is lost in rounding has no radius: it goes on as before.
    let is_lost = is_lost.into_iter().fold(by_radius.below(zero), |all, each| all & each);
    let by_radius = N::choose(is_lost, zero, by_radius);
    let reach = rough_exp2(N::choose(by_radius.below(by_error), by_radius, by_error));
    let limited = N::choose(number(1.0).below(pace.most), pace.most, number(1.0));
    let most = N::choose(pace.most.below(number(MAX_FACTOR)), limited, number(MAX_GROWTH)) * before;
    (N::choose(most.below(reach), most, reach), over(&first, &per_tolerated))
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
/// on their branch, none without any; `tolerable`: a step that may leave it.
fn decided<N: Number>(
    pace: &Pace<N>,
    reach: N,
    (new, stays, tolerable): ([N; 2], Option<N::Truth>, N),
    is_extra: N::Truth,
    runs: N::Truth,
) -> (Pace<N>, N::Truth) {
    let number = N::of;
    let finite = (new[0] + new[1]).below(number(f64::INFINITY)); // NaN is not
    // A time that is rounded to its next value might be beyond a pole that the step itself does not reach.
    let fits = finite & pace.t.below(pace.t + number(0.25) * reach);
    let good = stays.map_or(fits, |stays| fits & stays);
    let shorter = number(SHRINK) * N::choose(reach.below(pace.before), reach, pace.before);
    let shorter = stays.map_or(shorter, |stays| N::choose(stays, shorter, longer(shorter, tolerable)));
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
        most: {
            let failed = N::choose(fails, number(SHRINK), pace.most);
            N::choose(takes & pace.most.below(number(MAX_FACTOR)), number(2.0) * pace.most, failed)
        },
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
