"""By leapfrog, in blocks whose members are side by side; a block ends when all of its members are apart.

Chunks by joblib's threads.
"""

from math import sqrt

import numpy as np
from joblib import Parallel, delayed, effective_n_jobs
from numba import njit

from .work import APART, OBSERVED_OF_A_TURN, STEPS_OF_A_TURN, TURN, TURNS, X, velocities

BLOCK = 16
H = TURN / STEPS_OF_A_TURN


@njit(inline="always")
def pull(p, q):
    r = p * p + q * q
    return 1.0 / (r * sqrt(r))


@njit(nogil=True, error_model="numpy", fastmath={"contract"})
def steps(velocity, start, out):
    s = np.empty((12, BLOCK))  # x and y of the bodies, and their velocities
    far, before, there = np.empty(BLOCK), np.empty(BLOCK), np.empty(BLOCK)
    members, interval = velocity.shape[1], STEPS_OF_A_TURN // OBSERVED_OF_A_TURN
    for begin in range(0, members, BLOCK):
        width = min(BLOCK, members - begin)
        for i in range(BLOCK):
            k = begin + min(i, width - 1)
            for body in range(3):
                for c in range(2):
                    s[2 * body + c, i] = start[body, c]
                    s[6 + 2 * body + c, i] = velocity[c, k] * (-2.0 if body == 2 else 1.0)
            far[i], before[i] = np.nan, 4.0
        left = BLOCK
        for seen in range(TURNS * OBSERVED_OF_A_TURN):
            for step in range(interval + 1):
                kick = 0.5 * H if step == 0 or step == interval else H
                drift = 0.0 if step == interval else H
                for i in range(BLOCK):
                    x1, y1, x2, y2, x3, y3 = s[0, i], s[1, i], s[2, i], s[3, i], s[4, i], s[5, i]
                    p, q, r, t, m, n = x2 - x1, y2 - y1, x3 - x2, y3 - y2, x1 - x3, y1 - y3
                    a, b, c = kick * pull(p, q), kick * pull(r, t), kick * pull(m, n)
                    u1, v1 = s[6, i] + (a * p - c * m), s[7, i] + (a * q - c * n)
                    u2, v2 = s[8, i] + (b * r - a * p), s[9, i] + (b * t - a * q)
                    u3, v3 = s[10, i] + (c * m - b * r), s[11, i] + (c * n - b * t)
                    s[0, i], s[1, i], s[2, i] = x1 + drift * u1, y1 + drift * v1, x2 + drift * u2
                    s[3, i], s[4, i], s[5, i] = y2 + drift * v2, x3 + drift * u3, y3 + drift * v3
                    s[6, i], s[7, i], s[8, i], s[9, i], s[10, i], s[11, i] = u1, v1, u2, v2, u3, v3
            for i in range(BLOCK):
                p, q, r, t = s[2, i] - s[0, i], s[3, i] - s[1, i], s[4, i] - s[2, i], s[5, i] - s[3, i]
                m, n = s[0, i] - s[4, i], s[1, i] - s[5, i]
                there[i] = max(max(p * p + q * q, r * r + t * t), m * m + n * n)
            for i in range(BLOCK):
                if np.isnan(far[i]) and before[i] < APART * APART <= there[i]:
                    far[i] = (seen + (APART * APART - before[i]) / (there[i] - before[i])) / OBSERVED_OF_A_TURN
                    left -= 1
                before[i] = there[i]
            if left == 0:
                break
        for i in range(width):
            out[begin + i] = far[i]


def run(size):
    velocity, out = velocities(size), np.empty(size * size)
    chunk = max(BLOCK, -(-size * size // (64 * effective_n_jobs(-1))))
    parts = [slice(k, k + chunk) for k in range(0, size * size, chunk)]
    Parallel(n_jobs=-1, prefer="threads")(delayed(steps)(velocity[:, part], X, out[part]) for part in parts)
    return out
