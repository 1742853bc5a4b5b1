"""By heyoka's ensemble of integrators, each for as many members as a vector has numbers."""

from functools import cache

import heyoka as hy
import numpy as np

from .work import APART, OBSERVED_OF_A_TURN, TURN, TURNS, X, velocities

#: The coarsest power of ten with which as many members are right as by the steps of the others.
TOLERANCE = 1e-6
#: Integrators that are in memory at once.
AT_ONCE = 128
#: Most steps of a vector of members: near a collision they become so short that it would never end.
MAX_STEPS = 200 * TURNS
GRID = TURN / OBSERVED_OF_A_TURN * np.arange(TURNS * OBSERVED_OF_A_TURN + 1)


@cache
def integrator():
    lanes = hy.recommended_simd_size()
    return hy.taylor_adaptive_batch(hy.model.nbody(3), np.ones((18, lanes)), tol=TOLERANCE, compact_mode=True)
