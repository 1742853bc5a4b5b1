"""The stability limit of a user's method on the undamped oscillator.

A method that keeps blocks between steps multiplies a vector of v, y and these by a matrix. Its step is stable if no eigenvalue of
that matrix is outside the unit circle.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ...model.methods import Method
from ...model.systems import Oscillator
from .limit import stability_limit

#: Angles Φ that are tried, each so many times the one before; beyond the last a method counts as stable.
FIRST, LAST, RATIO = 0.01, 100.0, 1.01

#: By how much an eigenvalue may be outside the unit circle by rounding. A method of order p that grows at any step does so by
#: about Φ to the power of p + 1 a step, at the first angle more than this up to p = 5.
ROUNDING = 1e-12


def oscillator_limit(method: Method) -> float:
    """Φ below which the undamped oscillator is stable; 0 means never."""
    if not method.kept:
        limit = stability_limit(Oscillator(1.0), method)
        return float(limit)
    stable = 0.0
    for angle in np.geomspace(FIRST, LAST, round(np.log(LAST / FIRST) / np.log(RATIO)) + 1):
        if _growth(method, angle) > ROUNDING:
            break
        stable = float(angle)
    else:
        return np.inf
    if stable == 0.0:
        return 0.0
    grows = float(angle)
    while grows - stable > 4.0 * np.spacing(grows):
        middle = 0.5 * (stable + grows)
        if _growth(method, middle) > ROUNDING:
            grows = middle
        else:
            stable = middle
    return stable


def _growth(method: Method, angle: float) -> float:
    """By how much the largest eigenvalue of a step is outside the unit circle."""
    n = 2 + len(method.kept)
    vectors = np.eye(n)
    steps: Any = method.steps
    rows = steps.step(Oscillator(1.0).scaled(angle, (n,)), 0.0, angle, vectors[0], vectors[1], *vectors[2:])
    return float(np.abs(np.linalg.eigvals(np.stack(rows))).max()) - 1.0
