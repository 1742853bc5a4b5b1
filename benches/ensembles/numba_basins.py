"""By Runge-Kutta 4, in blocks whose members are side by side, so that loops become vectors; chunks by joblib's threads."""

from math import sqrt

import numpy as np
from joblib import Parallel, delayed, effective_n_jobs
from numba import njit

from .work import END, FRICTION, GRAVITY, HEIGHT, MAGNETS, STEPS, bobs, nearest

BLOCK = 32
H = END / STEPS
(A1, B1), (A2, B2), (A3, B3) = MAGNETS


@njit(inline="always")
def rate(u, v, x, y):
    p, q = x - A1, y - B1
    r = p * p + q * q + HEIGHT * HEIGHT
    w = 1.0 / (r * sqrt(r))
    a, b = -GRAVITY * x - FRICTION * u - w * p, -GRAVITY * y - FRICTION * v - w * q
    p, q = x - A2, y - B2
    r = p * p + q * q + HEIGHT * HEIGHT
    w = 1.0 / (r * sqrt(r))
    a, b = a - w * p, b - w * q
    p, q = x - A3, y - B3
    r = p * p + q * q + HEIGHT * HEIGHT
    w = 1.0 / (r * sqrt(r))
    return a - w * p, b - w * q


@njit(nogil=True, error_model="numpy", fastmath={"contract"})
def steps(start, end):
    us, vs, xs, ys = np.empty(BLOCK), np.empty(BLOCK), np.empty(BLOCK), np.empty(BLOCK)
    members = start.shape[1]
    for begin in range(0, members, BLOCK):
        width = min(BLOCK, members - begin)
        for i in range(BLOCK):
            k = begin + min(i, width - 1)
            us[i], vs[i], xs[i], ys[i] = 0.0, 0.0, start[0, k], start[1, k]
        for _ in range(STEPS):
            for i in range(BLOCK):
                u1, v1, x1, y1 = us[i], vs[i], xs[i], ys[i]
                a1, b1 = rate(u1, v1, x1, y1)
                u2, v2 = u1 + 0.5 * H * a1, v1 + 0.5 * H * b1
                a2, b2 = rate(u2, v2, x1 + 0.5 * H * u1, y1 + 0.5 * H * v1)
                u3, v3 = u1 + 0.5 * H * a2, v1 + 0.5 * H * b2
                a3, b3 = rate(u3, v3, x1 + 0.5 * H * u2, y1 + 0.5 * H * v2)
                u4, v4 = u1 + H * a3, v1 + H * b3
                a4, b4 = rate(u4, v4, x1 + H * u3, y1 + H * v3)
                us[i] = u1 + H / 6.0 * (a1 + 2.0 * (a2 + a3) + a4)
                vs[i] = v1 + H / 6.0 * (b1 + 2.0 * (b2 + b3) + b4)
                xs[i] = x1 + H / 6.0 * (u1 + 2.0 * (u2 + u3) + u4)
                ys[i] = y1 + H / 6.0 * (v1 + 2.0 * (v2 + v3) + v4)
        for i in range(width):
            end[0, begin + i], end[1, begin + i] = xs[i], ys[i]


def part_of(start):
    end = np.empty(start.shape)
    steps(start, end)
    return nearest(end)


def run(size):
    start = bobs(size)
    chunk = max(BLOCK, -(-size * size // (64 * effective_n_jobs(-1))))
    parts = [slice(k, k + chunk) for k in range(0, size * size, chunk)]
    return np.concatenate(Parallel(n_jobs=-1, prefer="threads")(delayed(part_of)(start[:, part]) for part in parts))
