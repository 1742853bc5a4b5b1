"""Events: changes of sign of a quantity g along a motion, and where in a step they are: the specification of both backends."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from .types import Array

#: A change of sign is located to this share of its step, or to the distance of two numbers at its time, whichever is longer.
SHARE, SPACING = 2.0**-48, 2.0**-52
#: The most trials for one change of sign: bisection needs 48, and may be left behind by one.
MOST_TRIALS = 49
#: By what multiple of its squared width a trial is moved towards the middle of the bracket, so that both ends come nearer.
TRUNCATION = 0.02

#: From some members and shares of their steps to g, v and y there; the axis of the members comes last.
Trial = Callable[[Any, Array], tuple[Array, Array, Array]]


def crosses(before: Array, after: Array, direction: int) -> Any:
    """Whether g changes its sign from one state to the next: rising (direction 1), falling (−1), or either (0).

    A state at which g is 0 belongs to the step that ends there, and not to the one that begins there. NaN has no sign.
    """
    rising = (before < 0.0) & (after >= 0.0) if direction >= 0 else None
    falling = (before > 0.0) & (after <= 0.0) if direction <= 0 else None
    if rising is None or falling is None:
        return falling if rising is None else rising
    return rising | falling


def located(trial: Trial, before: Array, after: Array, v: Array, y: Array, width: Array) -> tuple[Array, Array, Array]:
    """Where in its step g changes its sign, and the state there, which is one that is known to be at or past the change.

    Each trial is a step of the method from the step's own start, of another length. The lengths are chosen by the ITP method
    (Oliveira and Takahashi 2020), a secant that never takes more than one trial more than bisection would.

    Args:
        trial: makes steps of these shares of the full ones.
        before: g at the start of each step, shape (n,).
        after: g at its end, likewise, of the other sign or 0.
        v: velocities at its end, shape (*block, n).
        y: coordinates at its end, likewise.
        width: to which share of each step it is located, shape (n,), ``SHARE`` or more.

    Returns:
        The share of each step, above 0 and at most 1, and v and y there.
    """
    v, y, n = v.copy(), y.copy(), len(before)
    sign = np.where(before < 0.0, 1.0, -1.0)
    low, high, g_low, g_high = np.zeros(n), np.ones(n), sign * before, sign * after
    for done in range(MOST_TRIALS):
        live = np.flatnonzero((high - low > width) & (g_high != 0.0))
        if not len(live):
            break
        share = _next(low[live], high[live], g_low[live], g_high[live], width[live], done)
        g, v_there, y_there = trial(live, share)
        g = sign[live] * g
        past = g >= 0.0
        after_it, before_it = live[past], live[~past]
        low[before_it], g_low[before_it] = share[~past], g[~past]
        high[after_it], g_high[after_it] = share[past], g[past]
        v[..., after_it], y[..., after_it] = v_there[..., past], y_there[..., past]
    return high, v, y


def width_at(t: Array, h: Array) -> Array:
    """To which share of the steps from these times, of these lengths, a change of sign is located."""
    return np.maximum(SHARE, SPACING * np.abs(t / h))


def _next(low: Array, high: Array, g_low: Array, g_high: Array, within: Array, done: int) -> Array:
    """The next trial within brackets: the secant's, a little towards the middle, and not too far from the middle."""
    width, middle = high - low, 0.5 * (low + high)
    with np.errstate(all="ignore"):
        secant = (g_high * low - g_low * high) / (g_high - g_low)
        towards = np.where(secant <= middle, 1.0, -1.0)
        moved = TRUNCATION * (width * width)
        near = np.where(moved <= np.abs(middle - secant), secant + towards * moved, middle)
    # Both ends must be able to move: a trial at an end would change nothing.
    near = np.minimum(np.maximum(near, low + 0.5 * within), high - 0.5 * within)
    most = np.ldexp(0.5 * SHARE, MOST_TRIALS - done) - 0.5 * width
    return np.asarray(np.where(np.abs(near - middle) <= most, near, middle - towards * most))
