"""Adaptive steps by the series of a solution: how far it reaches, and what comes after a step.

The step is found from the last two coefficients before it is made (Jorba and Zou 2005, §3.2), so none is rejected. With ‖cⱼ‖ the
length of a block of coefficients and τ what is tolerated there, the term j is as small as is tolerated at (τ/‖cⱼ‖)^(1/j). The
step is the least of these for j = p − 1 and p and both blocks, times exp(−0.7/(p − 1)).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from .adaptive import Attempted, Pace, length2, longer
from .bits import add_bits, at_most, held, less, shift_up, where
from .log import log
from .series import coefficients
from .types import Array

#: The most by which a step may be longer than the one before: where the last terms vanish, nothing else bounds it.
MAX_GROWTH = 1024.0
#: The squared length of the last terms over the tolerated one, between bounds whose logarithms exist.
BOUNDS = (1e-280, 1e280)
#: The margin of a step of order p is exp(−MARGIN/(p − 1)).
MARGIN = 0.7

#: The orders between which a tolerance chooses.
LEAST_ORDER, MOST_ORDER = 4, 26

#: 1/ln 2, ln 2, and 1.5·2⁵², to which a whole number is added that stands in the low bits of the sum.
PER_LN2, LN2, MAGIC = 1.4426950408889634, 0.6931471805599453, 6755399441055744.0
#: The exponent of 1.
ONE = 1023 << 52


def order_of(tolerance: float) -> int:
    """The order that takes the least work, p = ⌈1 − ½·ln tolerance⌉ (Jorba and Zou 2005, §3.2)."""
    return min(max(math.ceil(1.0 - 0.5 * math.log(tolerance)), LEAST_ORDER), MOST_ORDER)


def attempt(
    order: int, system: Attempted, block_axes: tuple[int, int], pace: Pace, budget: Any, v: Array, y: Array
) -> tuple[Pace, Array, Array]:
    """One step, or one extra step, which leaves the pace as it is."""
    outlook = pace.outlook(budget)
    terms = coefficients(system.s, order, pace.t, 1.0, v, y)
    far = reach(order, pace, block_axes, v, y, terms)
    step = where(outlook.is_extra, pace.extra, far)
    v1, y1 = (value(start, [term[i] for term in terms], step) for i, start in enumerate((v, y)))
    new = [length2(block, axes) for block, axes in zip((v1, y1), block_axes, strict=True)]
    v1, y1, work = system.project(v1, y1)
    following, goes_on = decided(pace, far, new, outlook.is_extra, outlook.runs)
    if work is not None:
        following = following._replace(work=where(goes_on & ~outlook.is_extra, pace.work + work, pace.work))
    return following, where(goes_on, v1, v), where(goes_on, y1, y)


def value(start: Array, terms: Sequence[Array], step: Any) -> Array:
    """The sum of a series at a distance, by Horner's rule."""
    total = terms[-1]
    for term in [*terms[-2::-1], start]:
        total = term + step * total
    return total


def reach(order: int, pace: Pace, block_axes: tuple[int, int], v: Array, y: Array, terms: Sequence[tuple[Array, Array]]) -> Any:
    """How far the series is as good as is tolerated.

    In ``before`` the pace has the length of the last step that was taken, at the start that of a step to try first. A held one
    does not count, for it is made once more and must be the same.
    """

    def lengths(blocks: Sequence[Array]) -> list[Any]:
        return [length2(block, axes) for block, axes in zip(blocks, block_axes, strict=True)]

    present, first = lengths((v, y)), lengths(terms[0])
    tolerated = []
    # A block at zero counts as long as its rate would have made it in the last step.
    for longest, now, rate in zip((pace.longest_v, pace.longest_y), present, first, strict=True):
        counts = where(less(0.0, pace.lasts), longest, now)
        length = pace.absolute + pace.relative * np.sqrt(longer(counts, rate * (pace.before * pace.before)))
        tolerated.append(length * length)

    def logarithm(k: int) -> Any:
        of_v, of_y = (
            where(at_most(square, 0.0), 0.0, square / weight)
            for square, weight in zip(lengths(terms[k - 1]), tolerated, strict=True)
        )
        return log(held(longer(of_v, of_y), *BOUNDS)) * (-0.5 / k)

    one, other = logarithm(order - 1), logarithm(order)
    far = rough_exp(where(less(one, other), one, other) - MARGIN / (order - 1))
    most = MAX_GROWTH * pace.before
    return where(less(most, far), most, far)


def rough_exp(x: Any) -> Any:
    """Exp x to eight digits, which is enough for a step: 2ᵏ·exp(r), |r| ≤ ½·ln 2."""
    magic = x * PER_LN2 + MAGIC
    r = x - (magic - MAGIC) * LN2
    value = 1.0
    for k in range(7, 0, -1):
        value = 1.0 + (r * (1.0 / k)) * value
    return value * add_bits(shift_up(magic, 52), ONE)


def decided(pace: Pace, far: Any, new: Sequence[Any], is_extra: Any, runs: Any) -> tuple[Pace, Any]:
    """The pace after a step, and whether the state advances; ``new`` are squares of the new lengths."""
    good = less(new[0] + new[1], np.inf)  # NaN is not
    reached = pace.t + far
    passes = less(pace.target, reached)
    takes, holds, fails = runs & good & ~passes, runs & good & passes, runs & ~good
    following = pace._replace(
        t=where(takes, reached, pace.t),
        h=where(takes | holds, far, where(fails, 0.0, pace.h)),
        extra=where(is_extra, 0.0, pace.extra),
        held=where(holds, 1.0, pace.held),
        before=where(takes, far, pace.before),
        longest_v=where(takes & less(pace.longest_v, new[0]), new[0], pace.longest_v),
        longest_y=where(takes & less(pace.longest_y, new[1]), new[1], pace.longest_y),
        accepted=pace.accepted + where(takes, 1.0, 0.0),
        rejected=pace.rejected + where(fails, 1.0, 0.0),
        extra_steps=pace.extra_steps + where(holds | is_extra, 1.0, 0.0),
        error=where(fails, np.inf, pace.error),
    )
    return following, takes | is_extra
