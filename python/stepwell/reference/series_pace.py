"""Adaptive steps by the series of a solution: how far it reaches, and what comes after a step.

The step is found from the last two coefficients before it is made (Jorba and Zou 2005, §3.2), so none is rejected. With ‖cⱼ‖ the
size of a group of coefficients and τ what is tolerated there, the term j is as small as is tolerated at (τ/‖cⱼ‖)^(1/j). The
step is the least of these for j = p − 1 and p and all groups, times exp(−0.7/(p − 1)).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from .acceptance import Acceptance
from .adaptive import ONSET, Attempted, Pace, largest, longer, over, sizes, stacked, total
from .bits import add_bits, held, less, shift_up, where
from .log import split
from .series import coefficients
from .types import Array

#: The most by which a step may be longer than the one before: where the last terms vanish, nothing else bounds it.
MAX_GROWTH = 1024.0
#: The size of the last terms over the tolerated one, between bounds whose logarithms exist.
BOUNDS = (1e-280, 1e280)
#: The margin of a step of order p is 2^(−MARGIN/(p − 1)): exp(−0.7/(p − 1)).
MARGIN = 0.7 * 1.4426950408889634

#: The orders between which a tolerance chooses, and by how much they grow with its logarithm.
LEAST_ORDER, MOST_ORDER = 4, 20
ORDER_BY_LOGARITHM = 0.6

#: 1.5·2⁵², to which a whole number is added that stands in the low bits of the sum.
MAGIC = 6755399441055744.0
#: 2^r on [−½, ½], and log₂(1 + f)/f for 1 + f between √½ and √2: fitted at Chebyshev's nodes, wrong by 3.5e-6 and, times f, by
#: 2.9e-5.
ROUGH_EXP2 = (1.0, 0.693121045203, 0.24022349038, 0.0559219758423, 0.00966636851538)
ROUGH_LOG2 = (1.44264046428, -0.72062921586, 0.485737842443, -0.389675223792, 0.250287846961)
#: The exponent of 1.
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
    terms = coefficients(system.s, order, pace.t, 1.0, v, y)
    far, bound = reach(order, pace, block_axes, acceptance, v, y, terms), pace.wall - pace.t
    ends = less(bound, far)
    step = where(outlook.is_extra, pace.extra, where(ends, bound, far))
    v1, y1 = (value(start, [term[i] for term in terms], step) for i, start in enumerate((v, y)))
    new = sizes(v1, y1, block_axes, groups)
    v1, y1, work = system.project(v1, y1)
    following, goes_on = decided(pace, where(ends, bound, far), ends, new, outlook.is_extra, outlook.runs)
    if work is not None:
        following = following._replace(work=where(goes_on & ~outlook.is_extra, pace.work + work, pace.work))
    return following, where(goes_on, v1, v), where(goes_on, y1, y)


def value(start: Array, terms: Sequence[Array], step: Any) -> Array:
    """The sum of a series at a distance: odd and even powers apart, by Horner's rule.

    The start comes last, so that it is rounded once.
    """
    square = step * step

    def summed(powers: Sequence[Array]) -> Any:
        total = powers[-1]
        for term in reversed(powers[:-1]):
            total = term + square * total
        return total

    odd, even = summed(terms[::2]), summed(terms[1::2])
    end: Array = start + step * (odd + step * even)
    return end


def reach(
    order: int,
    pace: Pace,
    block_axes: tuple[int, int],
    acceptance: Acceptance,
    v: Array,
    y: Array,
    terms: Sequence[tuple[Array, Array]],
) -> Any:
    """How far the series is as good as is tolerated.

    In ``before`` the pace has the length of the last step that was taken, at the start that of a step to try first. A held one
    does not count, for it is made once more and must be the same.
    """
    groups, counts = acceptance.groups, acceptance.counts(np.size(v), np.size(y))
    present, first = sizes(v, y, block_axes, groups), sizes(*terms[0], block_axes, groups)
    relative, absolute = pace.tolerances()
    # A group at zero counts as long as its rate would have made it in the last step, and as a part of the others of its block.
    standing = []
    for block in (slice(0, counts[0]), slice(counts[0], sum(counts))):
        longest, now = pace.longest[block], present[block]
        onset = ONSET * longer(largest(longest), largest(now)) if len(now) > 1 else 0.0
        standing += [where(less(0.0, size), size, onset) if len(now) > 1 else size for size in longest]
    counts_as = where(less(0.0, pace.lasts), stacked(standing), present)
    bound = absolute + relative * longer(counts_as, first * pace.before)

    def logarithm(k: int) -> Any:
        return rough_log2(held(over(sizes(*terms[k - 1], block_axes, groups), bound), *BOUNDS)) * (-1.0 / k)

    one, other = logarithm(order - 1), logarithm(order)
    far = rough_exp2(where(less(one, other), one, other) - MARGIN / (order - 1))
    most = MAX_GROWTH * pace.before
    return pace.shortened(where(less(most, far), most, far), pace.t)


def rough_exp2(x: Any) -> Any:
    """2ˣ to five digits, which is enough for a step: 2ᵏ·2^r, |r| ≤ ½."""
    magic = x + MAGIC
    return rough(x - (magic - MAGIC), ROUGH_EXP2) * add_bits(shift_up(magic, 52), ONE)


def rough_log2(x: Any) -> Any:
    """Log₂ x to four digits behind the point."""
    exponent, fraction = split(x)
    return exponent + fraction * rough(fraction, ROUGH_LOG2)


def rough(x: Any, coefficients: Sequence[float]) -> Any:
    """A polynomial of degree four, in few operations one after the other."""
    c0, c1, c2, c3, c4 = coefficients
    x2 = x * x
    return (c0 + c1 * x) + x2 * ((c2 + c3 * x) + c4 * x2)


def decided(pace: Pace, step: Any, ends: Any, new: Any, is_extra: Any, runs: Any) -> tuple[Pace, Any]:
    """The pace after a step, which may end at the wall, and whether the state advances; ``new`` are the sizes it would have."""
    good = less(total(new), np.inf)  # NaN is not
    reached = where(ends, pace.wall, pace.t + step)
    passes = less(pace.target, reached)
    takes, holds, fails = runs & good & ~passes, runs & good & passes, runs & ~good
    following = pace._replace(
        t=where(takes, reached, pace.t),
        h=where(takes | holds, step, where(fails, 0.0, pace.h)),
        extra=where(is_extra, 0.0, pace.extra),
        held=where(holds, 1.0, pace.held),
        longest=where(takes & less(pace.longest, new), new, pace.longest),
        before=where(takes & ~ends, step, pace.before),
        accepted=pace.accepted + where(takes, 1.0, 0.0),
        rejected=pace.rejected + where(fails, 1.0, 0.0),
        extra_steps=pace.extra_steps + where(holds | is_extra, 1.0, 0.0),
        error=where(fails, np.inf, pace.error),
    )
    return following, takes | is_extra
