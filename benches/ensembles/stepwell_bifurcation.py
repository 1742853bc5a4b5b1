"""By Runge-Kutta 4."""

import numpy as np
import stepwell as sw

from .work import DELTA, OMEGA, PERIOD, PERIODS, STEPS_OF_A_PERIOD, TRANSIENT, strengths


@sw.system
def duffing(t, v, y, *, gamma=0.5):
    return gamma * np.cos(OMEGA * t) - DELTA * v + y - y**3


def run(size):
    found = sw.sweep(
        duffing,
        {"gamma": strengths(size)},
        "rk4",
        v=0.0,
        y=1.0,
        dt=PERIOD / STEPS_OF_A_PERIOD,
        transient=TRANSIENT * STEPS_OF_A_PERIOD,
        steps=PERIODS * STEPS_OF_A_PERIOD,
        every=STEPS_OF_A_PERIOD,
    )
    return found.y.values[:, 1:]
