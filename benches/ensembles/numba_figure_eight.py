"""By Dormand-Prince 8(5,3) with adaptive steps, member after member; each ends as soon as two bodies are apart.

Members have steps of their own, so they are not side by side. Chunks by joblib's threads.
"""

from math import sqrt

import numpy as np
from joblib import Parallel, delayed, effective_n_jobs
from numba import njit
from scipy.integrate._ivp import dop853_coefficients as of_dop853

from .work import APART, MAX_STEPS, TURN, TURNS, X, velocities

#: The coarsest power of ten with which as many members are right as by stepwell.
TOLERANCE = 1e-12

STAGES = of_dop853.N_STAGES
A, B = of_dop853.A[:STAGES, :STAGES].copy(), of_dop853.B
E3, E5 = of_dop853.E3, of_dop853.E5


@njit(inline="always")
def rates(s, k):
    p, q, r, t, m, n = s[2] - s[0], s[3] - s[1], s[4] - s[2], s[5] - s[3], s[0] - s[4], s[1] - s[5]
    d, e, f = p * p + q * q, r * r + t * t, m * m + n * n
    a, b, c = 1.0 / (d * sqrt(d)), 1.0 / (e * sqrt(e)), 1.0 / (f * sqrt(f))
    for i in range(6):
        k[i] = s[6 + i]
    k[6], k[7], k[8], k[9] = a * p - c * m, a * q - c * n, b * r - a * p, b * t - a * q
    k[10], k[11] = c * m - b * r, c * n - b * t
    return max(max(d, e), f)


@njit(nogil=True, error_model="numpy", fastmath={"contract"})
def follow(velocity, start, out):
    s, new, end = np.empty(12), np.empty(12), TURNS * TURN
    k = np.empty((STAGES + 1, 12))
    for member in range(velocity.shape[1]):
        s[:6] = start.ravel()
        for i in range(6):
            s[6 + i] = velocity[i % 2, member] * (-2.0 if i > 3 else 1.0)
        t, h, far, out[member] = 0.0, 0.01, rates(s, k[0]), np.nan
        for _ in range(MAX_STEPS):
            h = min(h, end - t)
            for stage in range(1, STAGES):
                new[:] = s
                for j in range(stage):
                    if A[stage, j] != 0.0:
                        for i in range(12):
                            new[i] += h * A[stage, j] * k[j, i]
                rates(new, k[stage])
            new[:] = s
            for j in range(STAGES):
                for i in range(12):
                    new[i] += h * B[j] * k[j, i]
            farther = rates(new, k[STAGES])
            error3, error5 = 0.0, 0.0
            for i in range(12):
                e3, e5, scale = 0.0, 0.0, TOLERANCE * (1.0 + max(abs(s[i]), abs(new[i])))
                for j in range(STAGES + 1):
                    e3, e5 = e3 + E3[j] * k[j, i], e5 + E5[j] * k[j, i]
                error3, error5 = error3 + (e3 / scale) ** 2, error5 + (e5 / scale) ** 2
            error = h * error5 / sqrt(12.0 * (error5 + 0.01 * error3) + 1e-300)
            if error <= 1.0:
                if far < APART * APART <= farther:
                    out[member] = (t + h * (APART * APART - far) / (farther - far)) / TURN
                    break
                t, far = t + h, farther
                s[:], k[0] = new, k[STAGES]
                if t >= end:
                    break
            h *= min(5.0, max(0.2, 0.9 * (error + 1e-12) ** -0.125))


def run(size):
    velocity, out = velocities(size), np.empty(size * size)
    chunk = max(1, -(-size * size // (64 * effective_n_jobs(-1))))
    parts = [slice(k, k + chunk) for k in range(0, size * size, chunk)]
    Parallel(n_jobs=-1, prefer="threads")(delayed(follow)(velocity[:, part], X, out[part]) for part in parts)
    return out
