"""Steps of chosen length: each member takes its own, so long that the estimate of its error stays within a tolerance.

The increments of a step h are h times those of a step of 1, so a system is scaled once and stretched to every step.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np

from . import tableau
from .bits import at_most, less, where
from .tableau import Increments, Weights
from .types import Array, Blocks, Scaled, Whole

#: A new step is the old one times SAFETY·r^(−5/32)·p^(1/16), r being the error over the tolerance and p that of the step before
#: (PI control, Gustafsson 1988), held between LEAST and MOST; after a rejected step there is no p and no growth. Where the error
#: is estimated in a higher order than LOW, it is SAFETY·r^(−3/32)·p^(1/32). The powers are dyadic so that square roots make them,
#: which are the same to the last bit everywhere.
SAFETY, LEAST, MOST = 0.9, 0.2, 5.0
LOW = 5
#: r below TINY counts as TINY; p's root, the sixteenth or the thirty-second, is that of 1e-4 or more.
TINY, CALM_ROOTS = 1e-10, (0.5623413251903491, 0.7498942093324558)

OK, BUDGET, UNDERFLOW, NOT_FINITE = 0, 2, 3, 4


class Pair(Protocol):
    """A method that estimates its error: its file in ``steppers/``, which may have weights ``COARSE`` of a second estimate."""

    WEIGHTS: Weights
    ERROR: Weights

    def stages(self, s: Any, t: Any, h: Any, v: Array, y: Array, /) -> Increments:
        """The increments of all stages; time and step are each member's own."""


class Pace(NamedTuple):
    """Where each member stands, and how it goes on. All are numbers: those that count, too.

    Attributes:
        t: its time.
        h: the step that it will try next.
        target: the time to reach, exactly.
        relative: tolerated error of a step, relative to the length of a block.
        absolute: tolerated error beside the relative one.
        before: the sixteenth root of the last accepted error over the tolerance, or its thirty-second.
        most: how much the next step may grow.
        accepted: accepted attempts.
        rejected: rejected attempts.
        error: the square of the last error over the tolerance.
    """

    t: Any
    h: Any
    target: Any
    relative: Any
    absolute: Any
    before: Any
    most: Any
    accepted: Any
    rejected: Any
    error: Any

    def outlook(self, budget: Any) -> tuple[Any, Any, Any]:
        """The step to try, whether it ends at the target, and whether there is anything to try."""
        rest = self.target - self.t
        last = at_most(rest, self.h)
        step = where(last, rest, self.h)
        moves = less(self.t, self.t + step)
        return step, last, less(self.t, self.target) & moves & less(self.accepted + self.rejected, budget)


class Stretched:
    """A system scaled to a step of 1, stretched to each member's step."""

    def __init__(self, s: Scaled, h: Array) -> None:
        self.s, self.h = s, h

    def dv(self, t: Array, v: Array, y: Array) -> Array:
        """h·v̇."""
        return self.h * self.s.dv(t, v, y)  # type: ignore[arg-type, operator]  # a time for each member

    def dy(self, t: Array, v: Array, y: Array) -> Array:
        """h·ẏ."""
        return self.h * self.s.dy(t, v, y)  # type: ignore[arg-type, operator]


class Outcome(NamedTuple):
    """Kept states, and for each member where it stands: time, next step, accepted and rejected steps, status."""

    v: Array
    y: Array
    t: Array
    h: Array
    accepted: Whole
    rejected: Whole
    status: Whole


def run(
    pair: Pair,
    s: Scaled,
    v: Array,
    y: Array,
    block_axes: tuple[int, int],
    *,
    t0: float,
    at: Sequence[float],
    first: Array,
    relative: Array,
    absolute: Array,
    budget: int,
    order: int,
) -> Outcome:
    """Go from t0 to each time of ``at``, ascending, exactly. Members that stop before have NaN from there on.

    ``order`` is the one in which the error is estimated.
    """
    t, one, zero = (np.full(first.shape, number) for number in (t0, 1.0, 0.0))
    pace = Pace(t, first, t, relative, absolute, one, MOST * one, zero, zero, zero)
    kept_v, kept_y = [], []
    with np.errstate(all="ignore"):
        for target in at:
            pace = pace._replace(target=target * one)
            while pace.outlook(budget)[2].any():
                pace, v, y = attempt(pair, s, order, block_axes, pace, budget, v, y)
            there = pace.t >= target
            kept_v.append(np.where(there, v, np.nan))
            kept_y.append(np.where(there, y, np.nan))
    accepted, rejected = pace.accepted, pace.rejected
    spent = accepted + rejected >= budget
    status = np.where(there, OK, np.where(spent, BUDGET, np.where(pace.error < np.inf, UNDERFLOW, NOT_FINITE)))
    counts = (each.astype(np.int64) for each in (accepted, rejected, status))
    return Outcome(np.stack(kept_v), np.stack(kept_y), pace.t, pace.h, *counts)


def attempt(
    pair: Pair, s: Scaled, order: int, block_axes: tuple[int, int], pace: Pace, budget: Any, v: Array, y: Array
) -> tuple[Pace, Array, Array]:
    """One attempt at a step: the state goes on if its error is tolerated, and if there is anything to try."""
    step, last, runs = pace.outlook(budget)
    increments = pair.stages(Stretched(s, step), pace.t, step, v, y)
    v1, y1 = tableau.plus(v, y, pair.WEIGHTS, increments)
    tolerated = [
        allowed(old, new, axes, pace.relative, pace.absolute) for old, new, axes in zip((v, y), (v1, y1), block_axes, strict=True)
    ]
    r2 = over(tableau.combined(pair.ERROR, increments), tolerated, block_axes)
    if coarse := getattr(pair, "COARSE", None):
        corrected = (r2 * r2) / (r2 + 0.01 * over(tableau.combined(coarse, increments), tolerated, block_axes))
        r2 = where(less(0.0, r2), corrected, r2)
    pace, took = decided(pace, order > LOW, r2, step, last, runs)
    return pace, where(took, v1, v), where(took, y1, y)


def decided(pace: Pace, high: bool, r2: Any, step: Any, last: Any, runs: Any) -> tuple[Pace, Any]:
    """What comes after an attempt with this error, and whether the state goes on."""
    good = at_most(r2, 1.0)  # NaN is not
    floored = where(less(TINY * TINY, r2), r2, TINY * TINY)
    r16 = np.sqrt(np.sqrt(np.sqrt(np.sqrt(floored))))  # the eighth root of r
    r32 = np.sqrt(r16)
    r64 = np.sqrt(r32)
    factor = SAFETY / ((r32 if high else r16) * r64)
    factor = where(good, factor * pace.before, factor)
    factor = where(less(LEAST, factor), factor, LEAST)
    ceiling = where(good, pace.most, 1.0)
    factor = where(less(factor, ceiling), factor, ceiling)
    factor = where(less(r2, np.inf), factor, LEAST)
    grown = step * factor
    # A step that was cut to end at the target says little: what was meant before it stands.
    grown = where(good & last & less(grown, pace.h), pace.h, grown)
    took = runs & good
    root, calm = (r64, CALM_ROOTS[1]) if high else (r32, CALM_ROOTS[0])
    root = where(less(calm, root), root, calm)
    following = pace._replace(
        t=where(took, where(last, pace.target, pace.t + step), pace.t),
        h=where(runs, grown, pace.h),
        before=where(took, root, pace.before),
        most=where(runs, where(good, MOST, 1.0), pace.most),
        accepted=pace.accepted + where(took, 1.0, 0.0),
        rejected=pace.rejected + where(runs & ~good, 1.0, 0.0),
        error=where(runs, r2, pace.error),
    )
    return following, took


def allowed(old: Array, new: Array, axes: int, relative: Array, absolute: Array) -> Array:
    """The square of the length of an error that is tolerated in a block: relative to the longer of the old and the new one."""
    a, b = length2(old, axes), length2(new, axes)
    length = absolute + relative * np.sqrt(where(less(b, a), a, b))
    return np.asarray(length * length)


def over(error: Blocks, tolerated: Sequence[Array], block_axes: tuple[int, int]) -> Array:
    """The square of an error over what is tolerated, of both blocks together."""
    (ev, ey), (nv, ny) = error, block_axes
    return np.asarray(length2(ev, nv) / tolerated[0] + length2(ey, ny) / tolerated[1])


def length2(block: Array, axes: int) -> Array:
    """The square of a block's length, number after number."""
    block = np.asarray(block)
    total: Array = np.zeros(block.shape[axes:])
    for number in block.reshape((-1, *block.shape[axes:])):
        total = total + number * number
    return total
