"""The ladder of steps of the search for a stability limit, and the search on it in as many digits as needed."""

from __future__ import annotations

from fractions import Fraction

import numpy as np

from . import exact
from .eigen import EPS
from .numbers import Polynomial

#: The ladder of steps, times the fastest rate: from the limits of light damping (2D by Standard Euler) to beyond the limit of a
#: method of a hundred stages. It is fine from FINE_FROM on, where methods have limits of their own.
FINE_FROM, RUNG_RATIO = 1e-2, 1.02
LADDER = np.concatenate([np.geomspace(1e-6, FINE_FROM, 97)[:-1], FINE_FROM * RUNG_RATIO ** np.arange(466)])

#: With more digits, only every ``COARSE_STRIDE``-th rung of the ladder is tried, and an eigenvalue outside the unit circle by
#: more than ``CIRCLE_TOLERANCE`` grows.
COARSE_STRIDE, CIRCLE_TOLERANCE = 8, 1e-13


def passes_zero(f: Polynomial, x: float) -> bool:
    """True if a polynomial changes its sign within a few last digits of x."""
    before, after = (f(Fraction(x * (1.0 + 8.0 * side * EPS))) for side in (-1, 1))
    return bool((before < 0) != (after < 0))


def in_many_digits(step: exact.Step, fastest: float, near: float = 0.0) -> float:
    """The step at which a mode begins to grow, in as many digits as needed: near this step, or on a ladder of wide rungs."""
    low, high = near * (1.0 - 1e-3), near * (1.0 + 1e-3)
    below, above = (step.beyond(low), step.beyond(high)) if near else (0.0, 0.0)
    if not below < -CIRCLE_TOLERANCE < CIRCLE_TOLERANCE < above:
        low, below = 0.0, 0.0
        for high in (LADDER[::COARSE_STRIDE] / fastest).tolist():
            above = step.beyond(high)
            if above > CIRCLE_TOLERANCE:
                break
            low, below = high, above
        else:
            return np.inf
        if not low:
            return 0.0  # already at the smallest steps
    crosses = below < -CIRCLE_TOLERANCE  # else the eigenvalue is on the circle at smaller steps
    for k in range(60):
        middle = 0.5 * (low + high)
        if crosses and k % 2:  # the secant; every other time the middle, so that both ends move
            middle = low - below * (high - low) / (above - below)
            if min(middle - low, high - middle) <= 2.0 * EPS * high:
                return middle
        if not low < middle < high:
            break
        value = step.beyond(middle)
        if value > (0.0 if crosses else CIRCLE_TOLERANCE):
            high, above = middle, value
        else:
            low, below = middle, value
    return high
