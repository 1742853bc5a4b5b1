"""By leapfrog."""

import numpy as np
import stepwell as sw

from .work import APART, OBSERVED_OF_A_TURN, STEPS_OF_A_TURN, TURN, TURNS, X, velocities


def separation(t, v, y):
    pairs = [(y[i, 0] - y[j, 0]) ** 2 + (y[i, 1] - y[j, 1]) ** 2 for i, j in ((0, 1), (1, 2), (2, 0))]
    return np.maximum(np.maximum(pairs[0], pairs[1]), pairs[2])


def run(size):
    v = velocities(size)
    found = sw.sweep(
        sw.NBody([1.0, 1.0, 1.0]),
        {"v": ("start", np.stack([v, v, -2.0 * v]))},
        "leapfrog",
        y=X,
        dt=TURN / STEPS_OF_A_TURN,
        steps=TURNS * STEPS_OF_A_TURN,
        observe=STEPS_OF_A_TURN // OBSERVED_OF_A_TURN,
        outcomes=sw.sweeps.Crossing(separation, APART**2, name="apart"),
    )
    return found.apart_crossing.values / TURN
