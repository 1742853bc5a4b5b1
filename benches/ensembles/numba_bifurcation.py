"""By Runge-Kutta 4, in blocks whose members are side by side, so that loops become vectors; chunks by joblib's threads."""

import numpy as np
from joblib import Parallel, delayed, effective_n_jobs
from numba import njit

from .work import DELTA, OMEGA, PERIOD, PERIODS, STEPS_OF_A_PERIOD, TRANSIENT, strengths

BLOCK = 64
H = PERIOD / STEPS_OF_A_PERIOD
#: The drive repeats itself: its cosine at the start and in the middle of each step of a period.
DRIVE = np.cos(OMEGA * H * 0.5 * np.arange(2 * STEPS_OF_A_PERIOD + 1))


@njit(inline="always")
def rate(drive, v, y):
    return drive - DELTA * v + y - y * y * y


@njit(nogil=True, error_model="numpy", fastmath={"contract"})
def steps(gamma, drive, out):
    g, v, y = np.empty(BLOCK), np.empty(BLOCK), np.empty(BLOCK)
    for begin in range(0, len(gamma), BLOCK):
        width = min(BLOCK, len(gamma) - begin)
        for i in range(BLOCK):
            g[i], v[i], y[i] = gamma[begin + min(i, width - 1)], 0.0, 1.0
        for period in range(TRANSIENT + PERIODS):
            for k in range(STEPS_OF_A_PERIOD):
                first, middle, last = drive[2 * k], drive[2 * k + 1], drive[2 * k + 2]
                for i in range(BLOCK):
                    v1, y1 = v[i], y[i]
                    a1 = rate(g[i] * first, v1, y1)
                    v2, y2 = v1 + 0.5 * H * a1, y1 + 0.5 * H * v1
                    a2 = rate(g[i] * middle, v2, y2)
                    v3, y3 = v1 + 0.5 * H * a2, y1 + 0.5 * H * v2
                    a3 = rate(g[i] * middle, v3, y3)
                    v4, y4 = v1 + H * a3, y1 + H * v3
                    a4 = rate(g[i] * last, v4, y4)
                    v[i] = v1 + H / 6.0 * (a1 + 2.0 * (a2 + a3) + a4)
                    y[i] = y1 + H / 6.0 * (v1 + 2.0 * (v2 + v3) + v4)
            if period >= TRANSIENT:
                for i in range(width):
                    out[begin + i, period - TRANSIENT] = y[i]


def run(size):
    gamma, out = strengths(size), np.empty((size, PERIODS))
    chunk = max(BLOCK, -(-size // (16 * effective_n_jobs(-1))))
    parts = [slice(k, k + chunk) for k in range(0, size, chunk)]
    Parallel(n_jobs=-1, prefer="threads")(delayed(steps)(gamma[part], DRIVE, out[part]) for part in parts)
    return out
