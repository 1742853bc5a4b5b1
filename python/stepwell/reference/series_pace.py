"""Adaptive steps by the Taylor series of a solution: the length of a step, and the decision after it.

The last two coefficients give the length of a step beforehand (Jorba and Zou 2005, §3.2). With ‖cⱼ‖ the size of a group of
coefficients and τ its tolerated error, the term j is as small as is tolerated at (τ/‖cⱼ‖)^(1/j). The step is the least of
these for j = p − 1 and p and all groups, times exp(−0.7/(p − 1)), but at most half of the radius of convergence. It is rejected
only if a function might leave its branch within it, if a number is not finite or if it does not move the time.

Sums are compensated: what rounding leaves out of a number at the end of a step, the next step adds. These roundings would be as
large as those within the steps.
"""

from __future__ import annotations

import functools
import math
import operator
from collections.abc import Callable, Sequence
from math import prod
from typing import Any

import numpy as np

from ..base.arrays import Array
from .acceptance import Acceptance
from .adaptive import (
    LEAST_PART,
    MAX_FACTOR,
    ONSET,
    PUSHED,
    ROUNDING,
    Attempted,
    Pace,
    largest,
    longer,
    numbers_in,
    over,
    sizes,
    stacked,
    total,
)
from .bits import DOUBLE, add_bits, and_bits, at_most, less, shift_up, where
from .log import split
from .series import Branch, expanded
from .tableau import polynomial

#: The most by which a step may be longer than the one before: where the last terms vanish, nothing else bounds it.
MAX_GROWTH = 1024.0
#: The size of the last terms over the tolerated one, between bounds whose logarithms exist.
BOUNDS = (1e-280, 1e280)
#: The margin of a step of order p is 2^(−MARGIN/(p − 1)): exp(−0.7/(p − 1)).
MARGIN = 0.7 * 1.4426950408889634
#: The most that a step is of the radius of convergence. Beyond it the last terms do not bound those that follow, however small.
SHARE = 0.5
#: A step that failed is tried again with this part of its length. Three more of these come before steps grow again, at first
#: twofold: so many are left before what it met.
SHRINK = 0.25

#: The orders between which a tolerance chooses, and by how much they grow with its logarithm.
LEAST_ORDER, MOST_ORDER = 4, 20
ORDER_BY_LOGARITHM = 0.6

#: The last two terms may vanish by chance, as at the turning point of a pendulum at a right angle, of whose series only every
#: fourth term is left. So a step is rejected whose end shows that it erred by this many times what is tolerated.
DEFECT = 8.0
#: Some roundings of the time, which is the difference of larger ones in rates that are about to end in a pole.
TIME_ROUNDING = 1.0 / (1 << 46)

#: 2^r on [−½, ½], and log₂(1 + f)/f for 1 + f between √½ and √2: fitted at Chebyshev's nodes, wrong by 3.5e-6 and, times f, by
#: 2.9e-5.
ROUGH_EXP2 = (1.0, 0.693121045203, 0.24022349038, 0.0559219758423, 0.00966636851538)
ROUGH_LOG2 = (1.44264046428, -0.72062921586, 0.485737842443, -0.389675223792, 0.250287846961)
#: The bits of an exponent, and that of 1.
EXPONENT = 0x7FF << 52
ONE = 1023 << 52


def order_of(tolerance: float) -> int:
    """The order that takes about the least work, p = ⌈1 − 0.6·ln tolerance⌉.

    If a step of order p cost p², it would be ½·ln (Jorba and Zou 2005, §3.2); but part of the cost is the same for every order.
    """
    return min(max(math.ceil(1.0 - ORDER_BY_LOGARITHM * math.log(tolerance)), LEAST_ORDER), MOST_ORDER)


def attempt(
    order: int,
    system: Attempted,
    block_axes: tuple[int, int],
    acceptance: Acceptance,
    pace: Pace,
    budget: Any,
    v: Array,
    y: Array,
) -> tuple[Pace, Array, Array]:
    """One step, or one extra step, which leaves the pace as it is."""
    outlook, groups = pace.outlook(budget), acceptance.groups
    unit = unit_of(pace.before)
    terms, branches = expanded(system.unit, order, pace.t, (unit, unit), v, y)
    far, moved, allowed = reach(order, pace, unit, block_axes, acceptance, v, y, terms)
    bound = pace.wall - pace.t
    ends = less(bound, far)
    step = where(ends, bound, far)
    length = where(outlook.is_extra, pace.extra, step)
    share = length * (1.0 / unit)
    low: tuple[Any, Any] = lows(v, y, pace) if acceptance.compensated else (0.0, 0.0)
    changes = [polynomial(rest, [term[i] for term in terms], share) for i, rest in enumerate(low)]
    (v1, low_v), (y1, low_y) = compensated(v, changes[0]), compensated(y, changes[1])
    new = sizes(v1, y1, block_axes, groups)
    slopes = [[(k + 1.0) * term[i] for k, term in enumerate(terms[1:], 1)] for i in range(2)]
    slope_v, slope_y = (polynomial(first, rest, share) for first, rest in zip(terms[0], slopes, strict=True))
    end = pace.t + length
    rate_v, rate_y = system.unit.dv(end, v1, y1), system.unit.dy(end, v1, y1)
    defect = sizes(slope_v - unit * rate_v, slope_y - unit * rate_y, block_axes, groups)
    # Rates that change in a step by their own size change by this in some roundings of the time.
    rounded = sizes(slope_v, slope_y, block_axes, groups) * (TIME_ROUNDING * longer(end, -end) * (1.0 / unit))
    # What rests so far counts as long as the rates at the end would have made it in a part of the time since the start.
    rests = at_most(total(pace.longest), 0.0) & less(0.0, pace.lasts)
    since = where(rests, DEFECT * (order + 1.0) * PUSHED * (end - pace.begin), 0.0)
    pushed = sizes(rate_v, rate_y, block_axes, groups) * (since * pace.tolerances()[0])
    agrees = functools.reduce(operator.and_, at_most(share * defect, (allowed + rounded) + pushed))
    stays: Any = None
    v1, y1, work = system.project(v1, y1)
    if branches:
        stays = on_branches(branches, share, moved)
    validity = agrees, stays, 0.5 / moved * unit
    following, goes_on = decided(pace, (step, ends), new, validity, outlook.is_extra, outlook.runs)
    takes = goes_on & ~outlook.is_extra
    if work is not None:
        following = following._replace(work=where(takes, pace.work + work, pace.work))
    if acceptance.compensated:
        new_low = np.concatenate([np.asarray(each).reshape(-1, *pace.low.shape[1:]) for each in (low_v, low_y)])
        following = following._replace(low=where(takes, new_low, pace.low))
    return following, where(goes_on, v1, v), where(goes_on, y1, y)


def unit_of(step: Any) -> Any:
    """The unit of time of the coefficients, the power of two at or below a step: they overflow in no unit of the user's."""
    return and_bits(step, EXPONENT)


def lows(v: Array, y: Array, pace: Pace) -> tuple[Array, Array]:
    """The remainders of v and y that rounding leaves out of the state."""
    of_v = np.size(v) // max(1, prod(pace.low.shape[1:]))
    return pace.low[:of_v].reshape(np.shape(v)), pace.low[of_v:].reshape(np.shape(y))


def compensated(start: Array, change: Array) -> tuple[Array, Array]:
    """The sum of both, and what its rounding leaves out, exactly (Møller 1965; Knuth 1969)."""
    end = start + change
    added = end - start
    return end, (start - (end - added)) + (change - added)


def reach(
    order: int,
    pace: Pace,
    unit: Any,
    block_axes: tuple[int, int],
    acceptance: Acceptance,
    v: Array,
    y: Array,
    terms: Sequence[tuple[Array, Array]],
) -> tuple[Any, Any, Any]:
    """The step that is tolerated, the motion in a unit of time over the tolerated error, and the tolerated defect times the step.

    The error is that of the largest sizes so far. The defect of a group is by how much the series and the rates at the end of the
    step differ. Times the step it is p + 1 times the first term that is left out.

    In ``before`` the pace has the length of the last step that was taken, at the start that of a step to try first. A held one
    does not count, for it is made once more and must be the same.
    """
    groups, counts = acceptance.groups, acceptance.counts(*numbers_in(v, y, block_axes))
    present, first, second, last_but_one, last = (
        sizes(*blocks, block_axes, groups) for blocks in ((v, y), *terms[:2], *terms[order - 2 :])
    )
    relative, absolute = pace.tolerances()
    # A group at zero counts as long as its rate would have made it in the last step, or the rate of that, and as a part of the
    # others of its block.
    standing = []
    for block in (slice(0, counts[0]), slice(counts[0], sum(counts))):
        longest, now = pace.longest[block], present[block]
        onset = ONSET * longer(largest(longest), largest(now)) if len(now) > 1 else 0.0
        for size in longest:
            standing.append(where(less(0.0, size), LEAST_PART * size, onset) if len(now) > 1 else LEAST_PART * size)
    counts_as = longer(where(less(0.0, pace.lasts), stacked(standing), 0.0), present)
    part = pace.before * (1.0 / unit)
    counts_as = longer(counts_as, first * part)
    counts_as = where(less(0.0, counts_as), counts_as, second * (part * part))

    def bound_of(size: Any) -> Any:
        # What begins at zero, where nothing else has been, tolerates no error: it does not count.
        tolerated = absolute + relative * size
        return where(less(0.0, tolerated), tolerated, np.inf)

    bound = bound_of(counts_as)

    def logarithm(size: Any) -> Any:
        # A size that is not a number counts as the largest: which bits NaN has, its logarithm would show.
        size = where(less(size, BOUNDS[0]), BOUNDS[0], size)
        return rough_log2(where(less(size, BOUNDS[1]), size, BOUNDS[1]))

    moved, lost = over(first, bound), ROUNDING * counts_as
    one, other = over(last_but_one, bound), over(last, bound)
    by_one, by_other = logarithm(one) * (-1.0 / (order - 1)), logarithm(other) * (-1.0 / order)
    by_error = where(less(by_one, by_other), by_one, by_other) - MARGIN / (order - 1)
    motion = longer(longer(moved, over(second, bound)), over(lost, bound))
    falls = logarithm(longer(one, other)) - logarithm(motion)
    by_radius = falls * (-1.0 / (order - 2)) + (math.log2(SHARE) - math.log2(order - 1) / (order - 2))
    # A motion that is lost in rounding has no radius: it goes on as before. What is at rest has none either, and may wait longer.
    is_lost = functools.reduce(operator.and_, at_most(first, lost), less(by_radius, 0.0))
    by_radius = where(at_most(total(first), 0.0), by_error, where(is_lost, 0.0, by_radius))
    far = rough_exp2(where(less(by_radius, by_error), by_radius, by_error)) * unit
    limited = where(less(1.0, pace.most), pace.most, 1.0)
    most = where(less(pace.most, MAX_FACTOR), limited, MAX_GROWTH) * pace.before
    # A defect may be rounding of rates that are differences of larger numbers, and a branch may end at zero, so both are compared
    # with the largest sizes so far.
    so_far = longer(where(less(0.0, pace.lasts), pace.longest, 0.0), counts_as)
    bound = bound_of(so_far)
    allowed = DEFECT * (order + 1.0) * (bound + ROUNDING * so_far)
    return pace.shortened(where(less(most, far), most, far), pace.t), over(first, bound), allowed


def on_branches(branches: Sequence[Branch], share: Any, moved: Any) -> Any:
    """True where all functions stay on their branch within a step, or all its motion is tolerated as an error."""
    symbols = {each.value.terms[0].id: each for each in branches if hasattr(each.value.terms[0], "id")}
    stays = []
    for value, least, most in (symbols[place] for place in sorted(symbols)) if symbols else branches:
        if least > -np.inf:
            stays.append(at_most(least, furthest(value.terms, share, lambda term: where(less(term, 0.0), term, 0.0))))
        if most < np.inf:
            stays.append(at_most(furthest(value.terms, share, lambda term: where(less(0.0, term), term, 0.0)), most))
    return at_most(moved * share, 1.0) | functools.reduce(operator.and_, stays)


def furthest(terms: Sequence[Any], share: Any, part: Callable[[Any], Any]) -> Any:
    """How far the terms to one side alone would take a value within a step, which bounds the value."""
    total = None
    for term in reversed(terms[1:]):
        beyond = None if total is None else share * total
        total = beyond if term is None else part(term) if beyond is None else part(term) + beyond
    return terms[0] if total is None else terms[0] + share * total


def rough_exp2(x: Any) -> Any:
    """2ˣ to five digits, which is enough for a step: 2ᵏ·2^r, |r| ≤ ½."""
    magic = x + DOUBLE.magic
    return rough(x - (magic - DOUBLE.magic), ROUGH_EXP2) * add_bits(shift_up(magic, 52), ONE)


def rough_log2(x: Any) -> Any:
    """Log₂ x to four digits behind the point."""
    exponent, fraction = split(x)
    return exponent + fraction * rough(fraction, ROUGH_LOG2)


def rough(x: Any, coefficients: Sequence[float]) -> Any:
    """A polynomial of degree four, in few operations one after the other."""
    c0, c1, c2, c3, c4 = coefficients
    x2 = x * x
    return (c0 + c1 * x) + x2 * ((c2 + c3 * x) + c4 * x2)


def decided(
    pace: Pace, reach: tuple[Any, Any], new: Any, validity: tuple[Any, Any, Any], is_extra: Any, runs: Any
) -> tuple[Pace, Any]:
    """The pace after a step, and whether the state advances.

    Args:
        pace: the one before the step.
        reach: the step, and whether it ends at the wall.
        new: the sizes that the state would have.
        validity: whether the end agrees with the rates; whether functions stay on their branch, None if there are none; and a
            step that may leave it, since all its motion is tolerated: for the sake of a branch no shorter one is tried.
        is_extra: whether it is an extra step.
        runs: whether there is a step to try.
    """
    (step, ends), (agrees, stays, tolerable) = reach, validity
    finite = less(total(new), np.inf)  # NaN is not
    # A time that is rounded to its next value might be beyond a pole that the step itself does not reach.
    fits = finite & (ends | less(pace.t, pace.t + 0.25 * step))
    good = fits & agrees if stays is None else fits & agrees & stays
    shorter = SHRINK * where(less(step, pace.before), step, pace.before)
    if stays is not None:
        shorter = where(finite & agrees & ~stays, longer(shorter, tolerable), shorter)
    reached = where(ends, pace.wall, pace.t + step)
    passes = less(pace.target, reached)
    takes, holds, fails = runs & good & ~passes, runs & good & passes, runs & ~good
    following = pace._replace(
        t=where(takes, reached, pace.t),
        h=where(takes | holds, step, where(fails, shorter, pace.h)),
        extra=where(is_extra, 0.0, pace.extra),
        held=where(holds, 1.0, pace.held),
        longest=where(takes & less(pace.longest, new), new, pace.longest),
        before=where(takes & ~ends, step, where(fails, shorter, pace.before)),
        most=where(takes & less(pace.most, MAX_FACTOR), 2.0 * pace.most, where(fails, SHRINK, pace.most)),
        accepted=pace.accepted + where(takes, 1.0, 0.0),
        rejected=pace.rejected + where(fails, 1.0, 0.0),
        extra_steps=pace.extra_steps + where(holds | is_extra, 1.0, 0.0),
        error=where(takes, 0.0, where(fails, where(finite, 1.0, np.inf), pace.error)),
    )
    return following, takes | is_extra
