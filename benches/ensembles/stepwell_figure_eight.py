"""By Taylor series, with adaptive steps."""

import warnings

import numpy as np
import stepwell as sw

from .work import APART, MAX_STEPS, OBSERVED_OF_A_TURN, TOLERANCE, TURN, TURNS, X, velocities

BODIES = sw.NBody([1.0, 1.0, 1.0], force="newton")


def separation(t, v, y):
    pairs = [(y[i, 0] - y[j, 0]) ** 2 + (y[i, 1] - y[j, 1]) ** 2 for i, j in ((0, 1), (1, 2), (2, 0))]
    return np.maximum(np.maximum(pairs[0], pairs[1]), pairs[2])


def run(size):
    warnings.simplefilter("ignore", sw.ToleranceWarning)  # of members that need more steps
    v = velocities(size)
    found = sw.sweep(
        BODIES,
        {"v": ("start", np.stack([v, v, -2.0 * v]))},
        "taylor",
        y=X,
        tolerance=TOLERANCE,
        at=TURN / OBSERVED_OF_A_TURN * np.arange(TURNS * OBSERVED_OF_A_TURN + 1),
        max_steps=MAX_STEPS,
        outcomes=sw.sweeps.Crossing(separation, APART**2, name="apart"),
    )
    return found.apart_crossing.values / TURN
