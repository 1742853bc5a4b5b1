"""Events: changes of sign of a quantity g along a motion, located within steps. Specifies both backends."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from typing import Any, NamedTuple

import numpy as np

from ..base.arrays import Array, Whole

#: The relative accuracy of a change of sign, of the time since the start of its step: the rounding error of a trial's length.
SPACING = 2.0**-52
#: It is looked for in rounds, the first down to this share of the step, in so many trials: bisection needs 48, and may be ahead
#: by eight. With one alone, a first secant that is no good, as where g has just left zero, leaves bisection for all others. Each
#: later round begins with the bracket of the last, since an event may be ever so near to the step's start.
SHARE, MOST_TRIALS = 2.0**-48, 56
#: Brackets shorter than this share of a step are not cut any further.
LEAST_SHARE = 2.0**-1000
#: By what multiple of its squared width, over the width at first, a trial is moved towards the middle of the bracket, so that
#: both ends come nearer.
TRUNCATION = 0.02

#: A step in which g keeps its sign is looked into where g at one of its ends is no more than so many times the bend there: by how
#: much its change differs from that of the step before. There and back to zero a parabola is at an eighth of that.
REACH = 4.0
#: How much further than at its ends g may bend within a step, as a share of the control points of the cubic with the same values
#: and slopes at both ends, which lie a third of the step from them. Of a step in which it changes its sign such a share is less:
#: of a straight line, which has one zero, both points must not seem to be across.
BENDS, BENDS_TWICE = 1.4, 1.25
#: A part of a step is halved so many times, to find two zeros in it: a smooth g that touches zero is then within its roundings.
MOST_HALVINGS = 26
#: Of one step no more parts than this are halved at a time. A step that follows the motion has a few at most; one that is far
#: beyond the stability limit, whose slopes say nothing of it, would else have twice as many after each halving.
MOST_PARTS = 32
#: As ``MOST_HALVINGS``, for steps in which g begins at zero and leaves it: a bracket begins where g is not zero any more.
MOST_HALVINGS_FROM_ZERO = 60

#: From some members and shares of their steps to g, v and y there; the axis of the members comes last.
Trial = Callable[[Any, Array], tuple[Array, Array, Array]]
#: As ``Trial``, with the slope of g along the motion, over the time of the whole step, behind g.
Look = Callable[[Any, Array], tuple[Array, Array, Array, Array]]


class Parts(NamedTuple):
    """Parts of steps with g, its slope and the state at their ends. Positions are shares of the step, from 0 to 1.

    Attributes:
        of: the index of the step of each part.
        low: where the part begins.
        high: where the part ends.
        g_low: g at the beginning.
        g_high: g at the end.
        slope_low: the rate of change of g at the beginning, along the motion, times the length of the whole step.
        slope_high: the same rate at the end.
        v: velocities at the end of the part, shape (*block, n).
        y: coordinates at the end of the part, likewise.
    """

    of: Whole
    low: Array
    high: Array
    g_low: Array
    g_high: Array
    slope_low: Array
    slope_high: Array
    v: Array
    y: Array

    def some(self, which: Any) -> Parts:
        """Select parts by indices or a mask."""
        parts: Any = (each[..., which] for each in self)
        return Parts(*parts)


def joined(parts: Sequence[Parts]) -> Parts:
    """Concatenate parts."""
    return Parts(*(np.concatenate(each, axis=-1) for each in zip(*parts, strict=True)))


def may_change(before: Array, g: Array) -> Any:
    """True where g may change its sign in a step, once or twice: shape (steps, members).

    Args:
        before: g at the state before the first step, NaN where it is not known, shape (members,).
        g: its values at the ends of the steps, shape (steps + 1, members).
    """
    with np.errstate(all="ignore"):
        bend, size, above = np.empty((len(g) - 1, *g.shape[1:])), np.abs(g), g > 0.0
        change = g[1:] - g[:-1]
        np.subtract(change[1:], change[:-1], out=bend[1:])
        np.subtract(change[0], g[0] - before, out=bend[0])
        bend[0, np.isnan(before)] = np.inf
        np.abs(bend, out=bend)
        bend *= REACH
        may: Any = np.minimum(size[1:], size[:-1], out=change) <= bend
        may |= above[1:] != above[:-1]
    return may


def sides(parts: Parts) -> tuple[Array, Array]:
    """The sign of g just after the beginning of each part and just before its end; where g is zero, by its slope.

    So a zero of g at the end of a step belongs to that step and not to the next one. A g that begins at zero and ends there
    without a slope has not left it. NaN has no sign.
    """
    begin = np.where(parts.g_low == 0.0, np.sign(parts.slope_low), np.sign(parts.g_low))
    end = np.where(parts.g_high == 0.0, -np.sign(parts.slope_high), np.sign(parts.g_high))
    return begin, np.where((end == 0.0) & (parts.g_low != 0.0), begin, end)


def bends(parts: Parts) -> Any:
    """True where these parts may have more zeros than the signs at their ends show.

    They have none if the control points of the cubic with the same values and slopes are on one side of zero.
    """
    begin, end = sides(parts)
    third = (parts.high - parts.low) / 3.0
    with np.errstate(all="ignore"):
        into, back = third * parts.slope_low, -third * parts.slope_high
        one = (begin * (parts.g_low + BENDS * into) < 0.0) | (begin * (parts.g_high + BENDS * back) < 0.0)
        both = (begin * (parts.g_low + BENDS_TWICE * into) < 0.0) & (end * (parts.g_high + BENDS_TWICE * back) < 0.0)
    return np.where(begin * end < 0.0, both, one)


def parted(look: Look, parts: Parts) -> tuple[Parts, Whole]:
    """Divide steps into parts in which g changes its sign once.

    Args:
        look: g, its slope and the state at a share of these steps.
        parts: whole steps.

    Returns:
        The parts with a change of sign, ascending in each step (g may be 0 at their ends); and the steps at whose start g is zero
        and returns to zero within rounding errors.
    """
    brackets, stuck = [], np.zeros(0, dtype=np.int64)
    count = int(parts.of.max(initial=-1)) + 1
    for halving in range(MOST_HALVINGS_FROM_ZERO + 1):
        begin, end = sides(parts)
        changes = begin * end < 0.0
        leaves_zero = changes & (parts.g_low * begin <= 0.0)  # a bracket begins where g has left it
        zero_at_end = (parts.g_high == 0.0) & (end != 0.0)
        halves = (bends(parts) | (changes & zero_at_end)) & (halving < MOST_HALVINGS)
        split = leaves_zero | (halves & (np.bincount(parts.of[halves], minlength=count)[parts.of] <= MOST_PARTS))
        brackets.append(parts.some(changes & ~split))
        at_end = zero_at_end & ~changes & ~split
        brackets.append(parts.some(at_end)._replace(low=parts.high[at_end], g_low=end[at_end]))
        if halving == MOST_HALVINGS_FROM_ZERO:
            stuck = parts.of[split]
            break
        parts = parts.some(split)
        if not len(parts.of):
            break
        middle = np.where(leaves_zero[split] & (halving % 3 < 2), _return(parts), 0.5 * (parts.low + parts.high))
        g, slope, v, y = look(parts.of, middle)
        first_half = parts._replace(high=middle, g_high=g, slope_high=slope, v=v, y=y)
        lies = (parts.g_low == 0.0) & (g == 0.0) & (slope == 0.0)  # it has not left zero yet, and is on the same side
        # Zero at the ends and between them, it stays: so does the place of a body at rest in a step of Standard Euler.
        moves = (parts.g_low != 0.0) | (g != 0.0) | (parts.g_high != 0.0)
        second_half = parts._replace(low=middle, g_low=g, slope_low=np.where(lies, parts.slope_low, slope))
        parts = joined([first_half.some(moves), second_half.some(moves)])
    once = joined(brackets)
    return once.some(np.lexsort((once.high, once.of))), stuck


def _return(parts: Parts) -> Array:
    """Where to cut parts in which g leaves zero and returns: first after its return, then between both zeros.

    The return is estimated by the parabola with the same slope at zero. If it does not return within the part, cut in the middle.
    """
    width = parts.high - parts.low
    with np.errstate(all="ignore"):
        back = parts.slope_low * width / (parts.slope_low * width - parts.g_high)
        cut = np.where(1.5 * back < 0.75, 1.5 * back, 0.5 * back)
    return parts.low + width * np.where((cut > 0.0) & (cut < 0.75), cut, 0.5)


def located(trial: Trial, low: Array, high: Array, g_low: Array, g_high: Array, v: Array, y: Array) -> tuple[Array, Array, Array]:
    """Locate a change of sign of g in each step, and the state there, which is at or after the change.

    Each trial is a step of the method from the step's own start, of another length. The lengths are chosen by the ITP method
    (Oliveira and Takahashi 2020), a secant that in the first round never takes more than eight trials more than bisection would,
    and in each later one two.

    Args:
        trial: makes steps of these shares of the full steps.
        low: the share of each step after which the change is, shape (n,).
        high: the share at or before which it is, likewise.
        g_low: g at ``low``, likewise.
        g_high: g at ``high``, of the other sign or 0, likewise.
        v: velocities at ``high``, shape (*block, n).
        y: coordinates at ``high``, likewise.

    Returns:
        The share of each step, above 0 and at most 1, and v and y at it.
    """
    low, high, v, y, n = low.copy(), high.copy(), v.copy(), y.copy(), len(low)
    sign = np.where(g_low < 0.0, 1.0, -1.0)
    g_low, g_high = sign * g_low, sign * g_high
    within, left, unit = np.full(n, SHARE), np.full(n, MOST_TRIALS), high - low
    while True:
        width = high - low
        live = np.flatnonzero((width > np.maximum(SPACING * high, LEAST_SHARE)) & (g_high != 0.0))
        if not len(live):
            return high, v, y
        again = live[(width[live] <= within[live]) | (left[live] == 0)]
        within[again], unit[again] = SPACING * high[again], width[again]
        left[again] = np.frexp(width[again])[1] - np.frexp(within[again])[1] + 2
        bracket = low[live], high[live], g_low[live], g_high[live]
        share = next_trial(*bracket, SPACING * high[live], within[live], unit[live], left[live])
        left[live] -= 1
        g, v_there, y_there = trial(live, share)
        g = sign[live] * g
        past = g >= 0.0
        after_it, before_it = live[past], live[~past]
        low[before_it], g_low[before_it] = share[~past], g[~past]
        high[after_it], g_high[after_it] = share[past], g[past]
        v[..., after_it], y[..., after_it] = v_there[..., past], y_there[..., past]


def located_alone(
    g: Callable[[float], float],
    low: float,
    high: float,
    g_low: float,
    g_high: float,
    roundings: Callable[[float], float] = lambda high: SPACING * high,
) -> tuple[float, float]:
    """Bracket a change of sign of g in a single step: as ``located``, but in Python's numbers, which take a tenth of the time.

    Args:
        g: the function of the share of the step.
        low: the share of the step after which the change is.
        high: the share at or before which it is.
        g_low: g at ``low``.
        g_high: g at ``high``, of the other sign or 0.
        roundings: the width at which a bracket is narrow enough, as a function of its higher end.
    """
    sign = 1.0 if g_low < 0.0 else -1.0
    g_low, g_high = sign * g_low, sign * g_high
    within, left, unit = SHARE, MOST_TRIALS, high - low
    while (width := high - low) > max(roundings(high), LEAST_SHARE) and g_high != 0.0:
        if width <= within or left == 0:
            within, unit = roundings(high), width
            left = math.frexp(width)[1] - math.frexp(within)[1] + 2
        share = next_trial(low, high, g_low, g_high, roundings(high), within, unit, left, NUMBERS)
        left -= 1
        value = sign * g(share)
        if value >= 0.0:
            high, g_high = share, value
        else:
            low, g_low = share, value
    return low, high


class Arithmetic(NamedTuple):
    """Functions that have other names for NumPy's arrays and for Python's numbers."""

    where: Callable[..., Any]
    minimum: Callable[..., Any]
    maximum: Callable[..., Any]
    ldexp: Callable[..., Any]


ARRAYS = Arithmetic(np.where, np.minimum, np.maximum, np.ldexp)
NUMBERS = Arithmetic(lambda condition, yes, no: yes if condition else no, min, max, math.ldexp)


def next_trial(
    low: Any, high: Any, g_low: Any, g_high: Any, edge: Any, within: Any, unit: Any, left: Any, of: Arithmetic = ARRAYS
) -> Any:
    """The next trial within brackets: that of the secant, moved a little towards the middle, and not too far from the middle.

    The remaining trials narrow the brackets from ``unit`` to ``within``; ``edge`` is the least distance from both ends.
    """
    width, middle = high - low, 0.5 * (low + high)
    with np.errstate(all="ignore") if of is ARRAYS else nullcontext():
        secant = (g_high * low - g_low * high) / (g_high - g_low)
        towards = of.where(secant <= middle, 1.0, -1.0)
        moved = TRUNCATION * (width / unit) * width
        near = of.where(moved <= abs(middle - secant), secant + towards * moved, middle)
    near = of.minimum(of.maximum(near, low + edge), high - edge)
    most = of.ldexp(0.5 * within, left) - 0.5 * width
    share = of.where(abs(near - middle) <= most, near, middle - towards * most)
    return of.where((low < share) & (share < high), share, middle)  # a trial at an end of the bracket would not narrow it
