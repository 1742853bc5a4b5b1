"""By heyoka's ensemble of integrators, each for as many members as a vector has numbers."""

from functools import cache

import heyoka as hy
import numpy as np

from .work import APART, MAX_STEPS, OBSERVED_OF_A_TURN, TURN, TURNS, X, velocities

#: The coarsest power of ten with which as many members are right as by stepwell.
TOLERANCE = 1e-9
#: Integrators that are in memory at once.
AT_ONCE = 64
GRID = TURN / OBSERVED_OF_A_TURN * np.arange(TURNS * OBSERVED_OF_A_TURN + 1)
PAIRS = ((0, 1), (1, 2), (2, 0))


@cache
def integrator():
    x, y, u, v = (hy.make_vars(*(f"{name}{body}" for body in range(3))) for name in "xyuv")
    a, b = [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]
    for i, j in PAIRS:
        p, q = x[j] - x[i], y[j] - y[i]
        strength = (p * p + q * q) ** -1.5
        a[i], b[i], a[j], b[j] = a[i] + strength * p, b[i] + strength * q, a[j] - strength * p, b[j] - strength * q
    rates = [*zip(x, u, strict=True), *zip(y, v, strict=True), *zip(u, a, strict=True), *zip(v, b, strict=True)]
    lanes = hy.recommended_simd_size()
    return hy.taylor_adaptive_batch(rates, np.ones((12, lanes)), tol=TOLERANCE)


def turns_until_apart(s):
    """Of states of shape (times, 12, members)."""
    far = np.max([(s[:, i] - s[:, j]) ** 2 + (s[:, 3 + i] - s[:, 3 + j]) ** 2 for i, j in PAIRS], axis=0)
    passed = (far[:-1] < APART**2) & (far[1:] >= APART**2)
    k, each = passed.argmax(axis=0), np.arange(far.shape[1])
    share = (APART**2 - far[k, each]) / (far[k + 1, each] - far[k, each])
    return np.where(passed.any(axis=0), (k + share) / OBSERVED_OF_A_TURN, np.nan)


def run(size):
    lanes, velocity = integrator().batch_size, velocities(size)
    members = velocity.shape[1]
    out = np.empty(members)
    batches = velocity[:, np.minimum(np.arange(-(-members // lanes) * lanes), members - 1)].reshape(2, -1, lanes)
    for first in range(0, batches.shape[1], AT_ONCE):

        def begin(made, i, first=first):
            u, v = batches[:, first + i]
            made.state[:6] = X.T.reshape(6, 1)
            made.state[6:] = [u, u, -2.0 * u, v, v, -2.0 * v]
            return made

        several = min(AT_ONCE, batches.shape[1] - first)
        for i, found in enumerate(hy.ensemble_propagate_grid_batch(integrator(), GRID, several, begin, max_steps=MAX_STEPS)):
            rows = slice((first + i) * lanes, min((first + i + 1) * lanes, members))
            out[rows] = turns_until_apart(found[-1])[: rows.stop - rows.start]
    return out
