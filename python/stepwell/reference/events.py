"""Events: changes of sign of a quantity g along a motion, and where in a step they are: the specification of both backends."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from .types import Array, Whole

#: A change of sign is located to this share of the time since the start of its step: to the roundings of a trial's length.
SPACING = 2.0**-52
#: It is looked for in rounds, the first down to this share of the step, in so many trials: bisection needs 48, and may be left
#: behind by one. Each later round begins with the bracket of the last, since an event may be ever so near to the step's start.
SHARE, MOST_TRIALS = 2.0**-48, 49
#: Brackets shorter than this share of a step are not cut any further.
LEAST_SHARE = 2.0**-1000
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


def located(trial: Trial, low: Array, high: Array, g_low: Array, g_high: Array, v: Array, y: Array) -> tuple[Array, Array, Array]:
    """Where in its step g changes its sign, and the state there, which is one that is known to be at or past the change.

    Each trial is a step of the method from the step's own start, of another length. The lengths are chosen by the ITP method
    (Oliveira and Takahashi 2020), a secant that in each round never takes more than one trial more than bisection would.

    Args:
        trial: makes steps of these shares of the full ones.
        low: the share of each step behind which the change is, shape (n,).
        high: the share before which it is, likewise, or at which.
        g_low: g there, likewise.
        g_high: g there, likewise, of the other sign or 0.
        v: velocities at the higher share, shape (*block, n).
        y: coordinates there, likewise.

    Returns:
        The share of each step, above 0 and at most 1, and v and y there.
    """
    low, high, v, y, n = low.copy(), high.copy(), v.copy(), y.copy(), len(low)
    sign = np.where(g_low < 0.0, 1.0, -1.0)
    g_low, g_high = sign * g_low, sign * g_high
    within, left = np.full(n, SHARE), np.full(n, MOST_TRIALS)
    while True:
        width = high - low
        live = np.flatnonzero((width > np.maximum(SPACING * high, LEAST_SHARE)) & (g_high != 0.0))
        if not len(live):
            return high, v, y
        again = live[(width[live] <= within[live]) | (left[live] == 0)]
        within[again] = SPACING * high[again]
        left[again] = np.frexp(width[again])[1] - np.frexp(within[again])[1] + 2
        share = _next(low[live], high[live], g_low[live], g_high[live], within[live], left[live])
        left[live] -= 1
        g, v_there, y_there = trial(live, share)
        g = sign[live] * g
        past = g >= 0.0
        after_it, before_it = live[past], live[~past]
        low[before_it], g_low[before_it] = share[~past], g[~past]
        high[after_it], g_high[after_it] = share[past], g[past]
        v[..., after_it], y[..., after_it] = v_there[..., past], y_there[..., past]


def _next(low: Array, high: Array, g_low: Array, g_high: Array, within: Array, left: Whole) -> Array:
    """The next trial within brackets: the secant's, a little towards the middle, and not too far from the middle.

    The brackets come down to ``within`` in so many trials as are left.
    """
    width, middle = high - low, 0.5 * (low + high)
    with np.errstate(all="ignore"):
        secant = (g_high * low - g_low * high) / (g_high - g_low)
        towards = np.where(secant <= middle, 1.0, -1.0)
        moved = TRUNCATION * (width * width)
        near = np.where(moved <= np.abs(middle - secant), secant + towards * moved, middle)
    edge = SPACING * high  # both ends must be able to move
    near = np.minimum(np.maximum(near, low + edge), high - edge)
    most = np.ldexp(0.5 * within, left) - 0.5 * width
    share = np.where(np.abs(near - middle) <= most, near, middle - towards * most)
    return np.where((low < share) & (share < high), share, middle)  # a trial at an end would change nothing
