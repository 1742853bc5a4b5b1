"""Adaptive steps: each member has steps of its own, as long as the estimate of their error stays within a tolerance.

The increments of a step h are h times those of a step of 1, so a system is scaled once and stretched to every step.
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np

from . import tableau
from .bits import at_most, less, where
from .tableau import Increments, Weights
from .types import Array, Blocks, Scaled, Whole

#: A new step is the old one times SAFETY·r^(−5/32)·p^(1/16), r being the error over the tolerance and p that of the step before
#: (PI control, Gustafsson 1988), held between MIN_FACTOR and MAX_FACTOR; after a rejected step there is no p and no growth. Where
#: the error is estimated in a higher order than LOW, it is SAFETY·r^(−3/32)·p^(1/32). The powers are dyadic so that square roots
#: make them, which are the same to the last bit everywhere.
SAFETY, MIN_FACTOR, MAX_FACTOR = 0.9, 0.2, 5.0
LOW = 5
#: r below TINY counts as TINY; p's root, the sixteenth or the thirty-second, is that of 1e-4 or more.
TINY, CALM_ROOTS = 1e-10, (0.5623413251903491, 0.7498942093324558)
#: A change of y in a step that is smaller than this, relative to the largest length of y so far, is lost in rounding, with some
#: margin. So an error of v that moves y by less is tolerated, however small v is: near rest, where forces cancel, v is only
#: rounding.
ROUNDING = 1.0 / (1 << 40)
#: A jump of a force is met by ever shorter steps until one errs by no more than the tolerance of the length that the push would
#: have made in this part of the time since the start: it must be long beside the roundings of time, and short beside the motion
#: that follows.
PUSHED = 1.0 / 64.0

#: The first step is the fraction FIRST of the time in which the state changes at the start: rather too short than too long, since
#: it then grows by MAX_FACTOR a step. Where there is no such time it is BLIND, in units of time. It is at least MOVES times the
#: time of the start, 2¹² roundings.
FIRST, BLIND, MOVES = 0.01, 1e-6, 1.0 / (1 << 40)

OK, BUDGET, UNDERFLOW, NOT_FINITE = 0, 2, 3, 4


class Pair(Protocol):
    """A method that estimates its error: its file in ``steppers/``, which may have weights ``COARSE`` of a second estimate."""

    WEIGHTS: Weights
    ERROR: Weights

    def stages(self, s: Any, t: Any, h: Any, v: Array, y: Array, /) -> Increments:
        """The increments of all stages; time and step are each member's own."""


class Outlook(NamedTuple):
    """The length of the next step, whether it is an extra one, and whether there is a step of the run to try."""

    step: Any
    is_extra: Any
    runs: Any


class Pace(NamedTuple):
    """The time of each member and the state of its step-size controller. All are floats, even the counts.

    Steps do not depend on the saved times: a step that passes the next of them is held, not taken, until the states within it are
    saved. Each is computed by an extra step, from the start of the held one.

    Attributes:
        t: its time.
        h: the step that it will try next.
        target: the next output time.
        extra: above zero, the length of the extra step that comes next, to a saved time.
        held: 1 if the next step is held: it was accepted, but passes the target.
        relative: tolerated error of a step, relative to the length of a block.
        absolute: tolerated error in addition to the relative one.
        lasts: 1 if errors are relative to the largest length of a block so far, 0 if they are relative to its present length.
        longest_v: the square of the largest length of v so far.
        longest_y: likewise of y.
        begin: the time of the start.
        interval: the longest step while inputs change from sample to sample, so that no sample is skipped.
        until: the time until which they do.
        before: the sixteenth root of the last accepted error over the tolerance, or its thirty-second.
        most: how much the next step may grow.
        accepted: accepted attempts.
        rejected: rejected attempts.
        extra_steps: steps for saved states: the extra ones, and those that were held and are made once more.
        error: the square of the last error over the tolerance.
        work: the energy that a control or projection added in accepted steps; for a control the sum over their evaluations.
    """

    t: Any
    h: Any
    target: Any
    extra: Any
    held: Any
    relative: Any
    absolute: Any
    lasts: Any
    longest_v: Any
    longest_y: Any
    begin: Any
    interval: Any
    until: Any
    before: Any
    most: Any
    accepted: Any
    rejected: Any
    extra_steps: Any
    error: Any
    work: Any

    def outlook(self, budget: Any) -> Outlook:
        """What comes next."""
        is_extra = less(0.0, self.extra)
        moves = less(self.t, self.t + self.h)
        left = less(self.accepted + self.rejected, budget)
        runs = less(self.t, self.target) & moves & left & at_most(self.held, 0.0) & ~is_extra
        return Outlook(where(is_extra, self.extra, self.h), is_extra, runs)


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

    def energies(self, v: Array, y: Array) -> tuple[Array, Array, Array]:
        """h·v̇, h times the kinetic energy, and h times the whole energy."""
        dv, kinetic, whole = self.s.energies(v, y)  # type: ignore[attr-defined]
        return self.h * dv, self.h * kinetic, self.h * whole


class Attempted:
    """How an attempt uses a system: its rates for a step, pushed by a control, and the projection of the state after it.

    ``s`` is the system scaled to a step of 1. A control, which has ``pushes``, needs the step; a projection does not.
    """

    def __init__(self, s: Any, control: Any = None) -> None:
        self.s, self.push = s, control if control is not None and control.pushes else None
        self.projected = s if control is None or control.pushes else control.around(s, 1.0)

    def rates(self, step: Any) -> Any:
        """The rates for a step, which may be another for each member."""
        stretched = self.s.stretched(step) if hasattr(self.s, "stretched") else Stretched(self.s, step)
        return stretched if self.push is None else self.push.around(stretched, step)

    def project(self, v: Array, y: Array) -> tuple[Array, Array, Any]:
        """The state after the step, and the energy that this added; None without a projection."""
        if not hasattr(self.projected, "project"):
            return v, y, None
        if not hasattr(self.projected, "work"):
            return *self.projected.project(v, y), None
        self.projected.work = 0.0
        v, y = self.projected.project(v, y)
        return v, y, self.projected.work


class Outcome(NamedTuple):
    """Saved states, and the state, pace and status of each member at the end."""

    v: Array
    y: Array
    last_v: Array
    last_y: Array
    pace: Pace
    status: Whole


def start(
    t0: float,
    first: Array,
    tolerance: tuple[Array, Array, float],
    samples: tuple[float, float],
    v: Array,
    y: Array,
    block_axes: tuple[int, int],
) -> Pace:
    """The paces of members at the start, with a step to try first.

    ``tolerance`` is ``relative``, ``absolute`` and ``lasts`` of a ``Pace``, ``samples`` its ``interval`` and ``until``.
    """
    t, one, zero = (np.full(first.shape, number) for number in (t0, 1.0, 0.0))
    relative, absolute, lasts = tolerance
    interval, until = samples
    first = np.minimum(first, interval) if t0 < until else first
    with np.errstate(all="ignore"):
        longest_v, longest_y = (length2(block, axes) for block, axes in zip((v, y), block_axes, strict=True))
    counts = relative, absolute, lasts * one, longest_v, longest_y, t, interval * one, until * one, one, MAX_FACTOR * one
    return Pace(t, first, t, zero, zero, *counts, zero, zero, zero, zero, zero)


def first_step(s: Scaled, t0: float, v: Array, y: Array, block_axes: tuple[int, int]) -> Array:
    """The step to try first, for each member: a share of the shortest time in which a block changes by its length.

    That is |v|/|v̇|, |y|/|ẏ| and, from rest, √(|y|/|v̇|): times that do not depend on the units of v and y.
    """
    with np.errstate(all="ignore"):
        rates: Any = s.dv(t0, v, y), s.dy(t0, v, y)
        (lv, ly), (rv, ry) = (
            [np.sqrt(length2(block, axes)) for block, axes in zip(blocks, block_axes, strict=True)] for blocks in ((v, y), rates)
        )
        least = np.full(lv.shape, np.inf)
        for time in (lv / rv, ly / ry, np.sqrt(ly / rv)):
            least = np.where((time > 0.0) & (time < least), time, least)
        return np.maximum(np.where(least < np.inf, FIRST * least, BLIND), MOVES * abs(t0))


def run(
    attempt: Callable[[Pace, int, Array, Array], tuple[Pace, Array, Array]],
    v: Array,
    y: Array,
    pace: Pace,
    *,
    at: Sequence[float],
    budget: int,
) -> Outcome:
    """Continue all members and save their states at each time of ``at``, ascending. Members that stop before have NaN.

    ``attempt(pace, budget, v, y)`` is one attempt of all members.
    """
    one = np.ones(pace.t.shape)
    saved_v, saved_y = [], []
    with np.errstate(all="ignore"):
        for target in at:
            within = (pace.held > 0.0) & (target < pace.t + pace.h)
            pace = pace._replace(target=target * one, held=where(within, 1.0, 0.0))
            while pace.outlook(budget).runs.any():
                pace, v, y = attempt(pace, budget, v, y)
            held = pace.held > 0.0
            to_target = pace._replace(extra=where(held, target - pace.t, 0.0))
            to_target, v1, y1 = attempt(to_target, budget, v, y) if held.any() else (pace, v, y)
            pace = pace._replace(extra_steps=to_target.extra_steps)
            there = held | (pace.t >= target)
            saved_v.append(np.where(there, v1, np.nan))
            saved_y.append(np.where(there, y1, np.nan))
    spent = pace.accepted + pace.rejected >= budget
    status = np.where(there, OK, np.where(spent, BUDGET, np.where(pace.error < np.inf, UNDERFLOW, NOT_FINITE)))
    return Outcome(np.stack(saved_v), np.stack(saved_y), v, y, pace, status.astype(np.int64))


def attempt(
    pair: Pair, system: Attempted, order: int, block_axes: tuple[int, int], pace: Pace, budget: Any, v: Array, y: Array
) -> tuple[Pace, Array, Array]:
    """One attempt at a step: the state advances, projected, if the error is tolerated, and if there is a step to try.

    An extra step leaves the pace as it is. ``order`` is the one in which the error is estimated.
    """
    outlook = pace.outlook(budget)
    step = outlook.step
    s = system.rates(step)
    increments = pair.stages(s, pace.t, step, v, y)
    v1, y1 = tableau.plus(v, y, pair.WEIGHTS, increments)
    old, new = ([length2(block, axes) for block, axes in zip(blocks, block_axes, strict=True)] for blocks in ((v, y), (v1, y1)))
    weights = tolerated(pace, step, old, new)
    r2 = over(tableau.combined(pair.ERROR, increments), weights, block_axes)
    if coarse := getattr(pair, "COARSE", None):
        corrected = (r2 * r2) / (r2 + 0.01 * over(tableau.combined(coarse, increments), weights, block_axes))
        r2 = where(less(0.0, r2), corrected, r2)
    following, goes_on = decided(pace, order > LOW, r2, new, outlook)
    v1, y1, work = system.project(v1, y1)
    done = work if system.push is None else s.work / step
    if done is not None:
        following = following._replace(work=where(goes_on & ~outlook.is_extra, pace.work + done, pace.work))
    return following, where(goes_on, v1, v), where(goes_on, y1, y)


def decided(pace: Pace, high: bool, r2: Any, new: Sequence[Any], outlook: Outlook) -> tuple[Pace, Any]:
    """The pace after an attempt with this error, and whether the state advances; ``new`` are squares of the new lengths."""
    step, is_extra, runs = outlook
    # Lengths whose squares overflow would tolerate any error, so they count as not finite.
    r2 = where(less(new[0] + new[1], np.inf), r2, np.inf)
    good = at_most(r2, 1.0)  # NaN is not
    floored = where(less(TINY * TINY, r2), r2, TINY * TINY)
    r16 = np.sqrt(np.sqrt(np.sqrt(np.sqrt(floored))))  # the eighth root of r
    r32 = np.sqrt(r16)
    r64 = np.sqrt(r32)
    factor = SAFETY / ((r32 if high else r16) * r64)
    factor = where(good, factor * pace.before, factor)
    factor = where(less(MIN_FACTOR, factor), factor, MIN_FACTOR)
    ceiling = where(good, pace.most, 1.0)
    factor = where(less(factor, ceiling), factor, ceiling)
    factor = where(less(r2, np.inf), factor, MIN_FACTOR)
    reached = pace.t + step
    passes = less(pace.target, reached)
    takes, holds, fails = runs & good & ~passes, runs & good & passes, runs & ~good
    decides = takes | fails
    root, calm = (r64, CALM_ROOTS[1]) if high else (r32, CALM_ROOTS[0])
    root = where(less(calm, root), root, calm)
    t = where(takes, reached, pace.t)
    grown = step * factor
    grown = where(less(t, pace.until) & less(pace.interval, grown), pace.interval, grown)
    following = pace._replace(
        t=t,
        h=where(decides, grown, pace.h),
        extra=where(is_extra, 0.0, pace.extra),
        held=where(holds, 1.0, pace.held),
        longest_v=where(takes & less(pace.longest_v, new[0]), new[0], pace.longest_v),
        longest_y=where(takes & less(pace.longest_y, new[1]), new[1], pace.longest_y),
        before=where(takes, root, pace.before),
        most=where(decides, where(good, MAX_FACTOR, 1.0), pace.most),
        accepted=pace.accepted + where(takes, 1.0, 0.0),
        rejected=pace.rejected + where(fails, 1.0, 0.0),
        extra_steps=pace.extra_steps + where(holds | is_extra, 1.0, 0.0),
        error=where(decides, r2, pace.error),
    )
    return following, takes | is_extra


def tolerated(pace: Pace, step: Any, old: Sequence[Any], new: Sequence[Any]) -> list[Any]:
    """Squares of the errors that are tolerated in both blocks, from squares of their lengths before and after a step."""
    # A block at zero so far on which a force sets in counts as long as that force would have made it in a part of the time since.
    since = PUSHED * ((pace.t + step - pace.begin) / step)
    since2 = longer(1.0, since * since)
    rested = at_most(pace.longest_v + pace.longest_y, 0.0)
    lost = ROUNDING / step
    lasting_v, lasting_y = (
        where(rested, square * since2, longest) for longest, square in zip((pace.longest_v, pace.longest_y), new, strict=True)
    )
    lasting_v = longer(lasting_v, pace.longest_y * (lost * lost))
    found = []
    for lasting, before, after in zip((lasting_v, lasting_y), old, new, strict=True):
        counts = where(less(0.0, pace.lasts), lasting, before)
        length = pace.absolute + pace.relative * np.sqrt(longer(counts, after))
        found.append(length * length)
    return found


def longer(a: Any, b: Any) -> Any:
    """The larger of two lengths."""
    return where(less(a, b), b, a)


def over(error: Blocks, weights: Sequence[Any], block_axes: tuple[int, int]) -> Any:
    """The square of an error over what is tolerated, of both blocks together."""
    squares = (length2(block, axes) for block, axes in zip(error, block_axes, strict=True))
    # A block that is zero, as it has always been, tolerates no error and has none.
    of_v, of_y = (where(at_most(square, 0.0), 0.0, square / weight) for square, weight in zip(squares, weights, strict=True))
    return of_v + of_y


def length2(block: Array, axes: int) -> Array:
    """The square of a block's length, number after number."""
    block = np.asarray(block)
    if block.ndim == axes and block.dtype == np.float64:  # of one member: the same sum in floats, ten times as fast
        squares = 0.0
        for number in block.ravel().tolist():
            squares += number * number
        return np.asarray(squares)
    total: Array = np.zeros(block.shape[axes:])
    for number in block.reshape((-1, *block.shape[axes:])):
        total = total + number * number
    return total
