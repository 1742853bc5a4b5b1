"""By heyoka's ensemble of integrators, each for as many members as a vector has numbers."""

from functools import cache

import heyoka as hy
import numpy as np

from .work import DELTA, OMEGA, PERIOD, PERIODS, TRANSIENT, strengths

#: The coarsest power of ten with which as many members are right as by stepwell.
TOLERANCE = 1e-4
#: Integrators that are in memory at once.
AT_ONCE = 1024
GRID = PERIOD * np.append(0.0, TRANSIENT + 1.0 + np.arange(PERIODS))


@cache
def integrator():
    v, y = hy.make_vars("v", "y")
    rates = [(v, hy.par[0] * hy.cos(OMEGA * hy.time) - DELTA * v + y - y**3), (y, v)]
    lanes = hy.recommended_simd_size()
    return hy.taylor_adaptive_batch(rates, np.ones((2, lanes)), pars=np.ones((1, lanes)), tol=TOLERANCE)


def run(size):
    lanes, gamma = integrator().batch_size, strengths(size)
    out = np.empty((size, PERIODS))
    batches = gamma[np.minimum(np.arange(-(-size // lanes) * lanes), size - 1)].reshape(-1, lanes)
    for first in range(0, len(batches), AT_ONCE):

        def begin(made, i, first=first):
            made.state[:], made.pars[0] = [[0.0], [1.0]], batches[first + i]
            return made

        several = min(AT_ONCE, len(batches) - first)
        for i, found in enumerate(hy.ensemble_propagate_grid_batch(integrator(), GRID, several, begin)):
            rows = slice((first + i) * lanes, min((first + i + 1) * lanes, size))
            out[rows] = found[-1][1:, 1, : rows.stop - rows.start].T
    return out
