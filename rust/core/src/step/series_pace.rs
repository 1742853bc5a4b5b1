//! Adaptive steps by the series of a solution: how far it reaches, and what comes after a step.
//!
//! The step is found from the last two coefficients before it is made (Jorba and Zou 2005, §3.2). With ‖cⱼ‖ the size of a group
//! of coefficients and τ what is tolerated there, the term j is as small as is tolerated at (τ/‖cⱼ‖)^(1/j). The step is the least
//! of these for j = p − 1 and p and all groups, times exp(−0.7/(p − 1)), but at most half of the radius of convergence. It is
//! rejected only if a function might leave its branch within it, if a number is not finite or if it does not move the time.
//! `reference/series_pace.py` is the specification.

use super::pace::{Acceptance, LEAST_PART, MAX_FACTOR, ONSET, PUSHED, Pace, ROUNDING, Scales, largest, longer, over, total};
use crate::{
    functions::{rough_exp2, rough_log2},
    model::{
        program::{Terms, coefficients},
        system::{Block, System},
    },
    tape::number::{Branch, Number},
};

/// The most by which a step may be longer than the one before: where the last terms vanish, nothing else bounds it.
const MAX_GROWTH: f64 = 1024.0;
/// The size of the last terms over the tolerated one, between bounds whose logarithms exist.
const BOUNDS: [f64; 2] = [1e-280, 1e280];
/// The margin of a step of order p is 2^(−MARGIN/(p − 1)): exp(−0.7/(p − 1)).
const MARGIN: f64 = 0.7 * std::f64::consts::LOG2_E;
/// The most that a step is of the radius of convergence. Beyond it the last terms say nothing of those that follow, however
/// small.
const SHARE: f64 = 0.5;
/// A step that failed is tried again with this part of its length. Three more of these come before steps grow again, at first
/// twofold: that many are left before what it met.
const SHRINK: f64 = 0.25;
/// The last two terms may vanish by chance, as at the turning point of a pendulum at a right angle, of whose series only every
/// fourth term is left. So a step is rejected whose end shows that it erred by this many times what is tolerated.
const DEFECT: f64 = 8.0;
/// Some roundings of the time, which is the difference of larger ones in rates that are about to end in a pole.
const TIME_ROUNDING: f64 = 1.0 / (1u64 << 46) as f64;
/// The bits of an exponent.
const EXPONENT: u64 = 0x7FF << 52;

/// Coefficients of v and y, and the branches of functions that the rates are on.
pub(crate) type Known<'a, N> = (&'a [Term<N>], &'a [Branch<N>]);

/// The coefficients of v and y of one power.
type Term<N> = (Block<N>, Block<N>);

/// The coefficients at the start of a step, and the branches of functions that the rates are on. The system is scaled to a step
/// of 1.
pub(crate) fn terms<N: Number>(
    order: u32,
    system: &dyn System<N>,
    pace: &Pace<N>,
    v: &Block<N>,
    y: &Block<N>,
) -> (Terms<N>, Vec<Branch<N>>) {
    let unit = unit_of(pace.before);
    coefficients(system, order, [pace.t, unit, unit], v, y)
}

/// One step by these coefficients, or one extra step, which leaves the pace as it is and whose state has to be put back. `rates`
/// are those of a step of 1, by which the end of a step is checked; a step that is made once more needs neither them nor
/// branches.
#[allow(clippy::too_many_arguments, reason = "all that an attempt depends on")]
pub(crate) fn attempt<N: Number>(
    (terms, branches): Known<N>,
    rates: Option<&dyn System<N>>,
    projected: &dyn System<N>,
    acceptance: &Acceptance,
    (pace, scales): (Pace<N>, &Scales<N>),
    budget: N,
    v: &Block<N>,
    y: &Block<N>,
) -> (Pace<N>, Scales<N>, Block<N>, Block<N>) {
    let outlook = pace.outlook(budget);
    let unit = unit_of(pace.before);
    let Reach { far, moved, allowed } = reach(acceptance, (&pace, scales), unit, [v, y], terms);
    let bound = pace.wall - pace.t;
    let ends = bound.below(far);
    let step = N::choose(ends, bound, far);
    let length = N::choose(outlook.is_extra, pace.extra, step);
    let share = length * (N::of(1.0) / unit);
    let low = |i: usize| scales.low.get(i).copied().unwrap_or(N::of(0.0));
    let (from_v, from_y) = (Block::from_fn(v.len(), |i, _| low(i)), Block::from_fn(y.len(), |i, _| low(v.len() + i)));
    let (new_v, low_v) = compensated(v, &value(&from_v, terms.iter().map(|term| &term.0), share));
    let (new_y, low_y) = compensated(y, &value(&from_y, terms.iter().map(|term| &term.1), share));
    let new = acceptance.sizes(new_v.as_slice(), new_y.as_slice());
    let agrees = rates.and_then(|s| {
        let slope = |of: &dyn Fn(&Term<N>) -> Block<N>| {
            let rest: Vec<Block<N>> = (2..).zip(&terms[1..]).map(|(k, term)| of(term).map(|x| N::of(f64::from(k)) * x)).collect();
            value(&of(&terms[0]), rest.iter(), share)
        };
        let end = pace.t + length;
        let slopes = [slope(&|term| term.0.clone()), slope(&|term| term.1.clone())];
        let rates = [s.dv(end, &new_v, &new_y), s.dy(end, &new_v, &new_y)];
        let [v, y] = [0, 1].map(|i| slopes[i].zip_map(&rates[i], |slope, rate| slope - unit * rate));
        let defect = acceptance.sizes(v.as_slice(), y.as_slice());
        // Rates that change in a step by their own size change by this in some roundings of the time.
        let per = N::of(TIME_ROUNDING) * longer(end, -end) * (N::of(1.0) / unit);
        let rounded = acceptance.sizes(slopes[0].as_slice(), slopes[1].as_slice()).into_iter().map(|size| size * per);
        // What rests so far counts as long as the rates at the end would have made it in a part of the time since the start.
        let rests = total(&scales.longest).at_most(N::of(0.0)) & N::of(0.0).below(pace.lasts);
        let since = N::of(DEFECT * (terms.len() as f64 + 1.0) * PUSHED) * (end - pace.begin);
        let since = N::choose(rests, since, N::of(0.0));
        let pushed = acceptance.sizes(rates[0].as_slice(), rates[1].as_slice()).into_iter().enumerate();
        let pushed = pushed.map(|(group, size)| size * (since * scales.tolerances(group, &pace)[0]));
        let allowed = allowed.iter().zip(rounded).zip(pushed).map(|((allowed, rounded), pushed)| (*allowed + rounded) + pushed);
        defect.into_iter().zip(allowed).map(|(size, allowed)| (share * size).at_most(allowed)).reduce(|all, each| all & each)
    });
    let (new_v, new_y) = projected.project(new_v, new_y);
    let (stays, tolerable) = (on_branches(branches, share, moved), N::of(0.5) / moved * unit);
    let (next, longest, took) =
        decided(&pace, (step, ends), (&scales.longest, &new), (agrees, stays, tolerable), outlook.is_extra, outlook.runs);
    let next = match projected.tally() {
        Some(done) => Pace { work: N::choose(took & !outlook.is_extra, pace.work + done, pace.work), ..next },
        None => next,
    };
    let goes_on = |new: &Block<N>, old: &Block<N>| new.zip_map(old, |new, old| N::choose(took, new, old));
    let low = low_v.iter().chain(low_y.iter()).zip(&scales.low);
    let low = low.map(|(new, old)| N::choose(took & !outlook.is_extra, *new, *old)).collect();
    (next, Scales { longest, low, ..scales.clone() }, goes_on(&new_v, v), goes_on(&new_y, y))
}

/// The unit of time of the coefficients, the power of two at or below a step: they overflow in no unit of the user's.
fn unit_of<N: Number>(step: N) -> N {
    step.and_bits(EXPONENT)
}

/// The sum of a series at a distance. Odd and even powers are summed apart by Horner's rule, which takes half the time of one
/// sum; the start comes last, so that it is rounded once.
pub(crate) fn value<'a, N: Number + 'a>(start: &Block<N>, terms: impl Iterator<Item = &'a Block<N>>, share: N) -> Block<N> {
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

/// The sum of both, and what its rounding leaves out, exactly (Møller 1965; Knuth 1969).
fn compensated<N: Number>(start: &Block<N>, change: &Block<N>) -> (Block<N>, Block<N>) {
    let end = start.zip_map(change, |start, change| start + change);
    let added = end.zip_map(start, |end, start| end - start);
    let of_start = end.zip_map(&added, |end, added| end - added);
    let of_start = start.zip_map(&of_start, |start, of_start| start - of_start);
    let of_change = change.zip_map(&added, |change, added| change - added);
    let low = of_start.zip_map(&of_change, |a, b| a + b);
    (end, low)
}

/// How many units of time a part of a step is, whose coefficients were found after a step of this length.
pub(crate) fn share_of(length: f64, before: f64) -> f64 {
    length * (1.0 / f64::from_bits(before.to_bits() & EXPONENT))
}

/// States within a step that are summed side by side.
pub(crate) const SIDE: usize = 8;

/// One number of the states that an attempt makes at parts of its step, of that many coefficients, at least two, each so far
/// behind the one before; `low` is what rounding left out before. There are no closures, which would be compiled for the
/// baseline.
#[inline(always)]
pub(crate) fn sums(
    (start, low): (f64, f64),
    (terms, behind): (&[f64], usize),
    order: usize,
    shares: &[f64; SIDE],
) -> [f64; SIDE] {
    let (mut sum, mut other) = ([terms[(order - 1) * behind]; SIDE], [terms[(order - 2) * behind]; SIDE]);
    let mut k = order - 2;
    while k > 1 {
        k -= 2;
        let (term, further) = (terms[(k + 1) * behind], terms[k * behind]);
        for i in 0..SIDE {
            sum[i] = term + shares[i] * shares[i] * sum[i];
            other[i] = further + shares[i] * shares[i] * other[i];
        }
    }
    if k == 1 {
        for i in 0..SIDE {
            (sum[i], other[i]) = (other[i], terms[0] + shares[i] * shares[i] * sum[i]);
        }
    }
    for i in 0..SIDE {
        sum[i] = start + (low + shares[i] * (other[i] + shares[i] * sum[i]));
    }
    sum
}

/// The result of [`reach`].
struct Reach<N> {
    /// How far the series is as good as is tolerated.
    far: N,
    /// The motion in one unit of time over the tolerated error of the largest sizes so far.
    moved: N,
    /// The error that a step may have: for each group the defect times the step, the difference between the series and the
    /// rates at its end. It is p + 1 times the first term that is left out.
    allowed: Vec<N>,
}

/// How far the series is as good as is tolerated. In `before` the pace has the length of the last step that was taken; a held one
/// does not count, for it is made once more and must be the same.
fn reach<N: Number>(
    acceptance: &Acceptance,
    (pace, scales): (&Pace<N>, &Scales<N>),
    unit: N,
    [v, y]: [&Block<N>; 2],
    terms: &[Term<N>],
) -> Reach<N> {
    let (zero, number, order) = (N::of(0.0), N::of, terms.len());
    let of = |k: usize| {
        let (v, y) = &terms[k - 1];
        acceptance.sizes(v.as_slice(), y.as_slice())
    };
    let (present, first, second) = (acceptance.sizes(v.as_slice(), y.as_slice()), of(1), of(2));
    // A group at zero counts as long as its rate would have made it in the last step, or the rate of that, and as a part of the
    // others of its block.
    let [of_v, of_y] = acceptance.counts(v.len(), y.len());
    let mut standing = Vec::new();
    for block in [0..of_v, of_v..of_v + of_y] {
        let (longest, now) = (&scales.longest[block.clone()], &present[block]);
        if now.len() > 1 {
            let onset = N::of(ONSET) * longer(largest(longest), largest(now));
            standing.extend(longest.iter().map(|size| N::choose(zero.below(*size), number(LEAST_PART) * *size, onset)));
        } else {
            standing.extend(longest.iter().map(|size| number(LEAST_PART) * *size));
        }
    }
    let before = pace.before * (number(1.0) / unit);
    let groups = 0..present.len();
    let counts_as = |group: usize| {
        let counts = longer(N::choose(zero.below(pace.lasts), standing[group], zero), present[group]);
        let counts = longer(counts, first[group] * before);
        N::choose(zero.below(counts), counts, second[group] * (before * before))
    };
    let counts_as: Vec<N> = groups.map(counts_as).collect();
    // What begins at zero, where nothing else has been, tolerates no error: it does not count.
    let bound_of = |sizes: &[N]| {
        let of_group = |(group, size): (usize, &N)| {
            let [relative, absolute] = scales.tolerances(group, pace);
            let tolerated = absolute + relative * *size;
            N::choose(zero.below(tolerated), tolerated, number(f64::INFINITY))
        };
        sizes.iter().enumerate().map(of_group).collect::<Vec<N>>()
    };
    let bound = bound_of(&counts_as);
    // A size that is not a number counts as the largest: which bits NaN has, its logarithm would show.
    let logarithm = |size: N| {
        let [least, most] = BOUNDS.map(number);
        let size = N::choose(size.below(least), least, size);
        rough_log2(N::choose(size.below(most), size, most))
    };
    let p = order as f64;
    let lost: Vec<N> = counts_as.iter().map(|size| number(ROUNDING) * *size).collect();
    let moved = over(&first, &bound);
    let (one, other) = (over(&of(order - 1), &bound), over(&of(order), &bound));
    let (by_one, by_other) = (logarithm(one) * number(-1.0 / (p - 1.0)), logarithm(other) * number(-1.0 / p));
    let by_error = N::choose(by_one.below(by_other), by_one, by_other) - number(MARGIN / (p - 1.0));
    let motion = longer(longer(moved, over(&second, &bound)), over(&lost, &bound));
    let falls = logarithm(longer(one, other)) - logarithm(motion);
    let by_radius = falls * number(-1.0 / (p - 2.0)) + number(SHARE.log2() - (p - 1.0).log2() / (p - 2.0));
    // A motion that is lost in rounding has no radius: it goes on as before. What is at rest has none either, and may wait
    // longer.
    let is_lost = first.iter().zip(&lost).map(|(rate, lost)| rate.at_most(*lost));
    let is_lost = is_lost.fold(by_radius.below(zero), |all, each| all & each);
    let by_radius = N::choose(total(&first).at_most(zero), by_error, N::choose(is_lost, zero, by_radius));
    let far = rough_exp2(N::choose(by_radius.below(by_error), by_radius, by_error)) * unit;
    let limited = N::choose(number(1.0).below(pace.most), pace.most, number(1.0));
    let most = N::choose(pace.most.below(number(MAX_FACTOR)), limited, number(MAX_GROWTH)) * pace.before;
    // A defect may be rounding of rates that are differences of larger numbers, and a branch may end at zero, so both are
    // compared with the largest sizes so far.
    let so_far = scales.longest.iter().zip(&counts_as);
    let so_far: Vec<N> = so_far.map(|(size, now)| longer(N::choose(zero.below(pace.lasts), *size, zero), *now)).collect();
    let allowed = |(bound, size): (N, &N)| number(DEFECT * (p + 1.0)) * (bound + number(ROUNDING) * *size);
    let bound = bound_of(&so_far);
    let moved = over(&first, &bound);
    let allowed = bound.into_iter().zip(&so_far).map(allowed).collect();
    Reach { far: pace.shortened(N::choose(most.below(far), most, far), pace.t), moved, allowed }
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
    Some((moved * share).at_most(N::of(1.0)) | stays)
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

/// The pace after a step, which may end at the wall, the largest sizes so far, and whether the state goes on. `longest` and
/// `new` are the largest sizes before, and those that the groups would have. The series holds over the step if its end agrees
/// with the rates and if functions stay on their branch, none if that is not asked; but for a `tolerable` step, which may leave
/// it since all its motion is tolerated: no shorter one is tried for their sake.
fn decided<N: Number>(
    pace: &Pace<N>,
    (step, ends): (N, N::Truth),
    (longest, new): (&[N], &[N]),
    (agrees, stays, tolerable): (Option<N::Truth>, Option<N::Truth>, N),
    is_extra: N::Truth,
    runs: N::Truth,
) -> (Pace<N>, Vec<N>, N::Truth) {
    let number = N::of;
    let finite = total(new).below(number(f64::INFINITY)); // NaN is not
    // A time that is rounded to its next value might be beyond a pole that the step itself does not reach.
    let fits = finite & (ends | pace.t.below(pace.t + number(0.25) * step));
    let good = [agrees, stays].into_iter().flatten().fold(fits, |good, each| good & each);
    let shorter = number(SHRINK) * N::choose(step.below(pace.before), step, pace.before);
    let shorter = stays.map_or(shorter, |stays| {
        let leaves = agrees.map_or(finite, |agrees| finite & agrees) & !stays;
        N::choose(leaves, longer(shorter, tolerable), shorter)
    });
    let reached = N::choose(ends, pace.wall, pace.t + step);
    let passes = pace.target.below(reached);
    let (takes, holds, fails) = (runs & good & !passes, runs & good & passes, runs & !good);
    let count = |truth: N::Truth| N::choose(truth, number(1.0), number(0.0));
    let next = Pace {
        t: N::choose(takes, reached, pace.t),
        h: N::choose(takes | holds, step, N::choose(fails, shorter, pace.h)),
        extra: N::choose(is_extra, number(0.0), pace.extra),
        held: N::choose(holds, number(1.0), pace.held),
        before: N::choose(takes & !ends, step, N::choose(fails, shorter, pace.before)),
        most: {
            let failed = N::choose(fails, number(SHRINK), pace.most);
            N::choose(takes & pace.most.below(number(MAX_FACTOR)), number(2.0) * pace.most, failed)
        },
        accepted: pace.accepted + count(takes),
        rejected: pace.rejected + count(fails),
        extra_steps: pace.extra_steps + count(holds | is_extra),
        error: {
            let failed = N::choose(finite, number(1.0), number(f64::INFINITY));
            N::choose(takes, number(0.0), N::choose(fails, failed, pace.error))
        },
        ..*pace
    };
    let grows = longest.iter().zip(new).map(|(so_far, new)| N::choose(takes & so_far.below(*new), *new, *so_far));
    (next, grows.collect(), takes | is_extra)
}
