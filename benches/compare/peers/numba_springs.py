"""numba on springs, one thread, in the faster of three forms: forces are added to both ends one after the other, with the numbers
of a particle side by side or those of a direction; or they are kept, in a loop that becomes vectors, and summed particle by
particle."""

from __future__ import annotations

import functools
import math

import numpy as np

from . import Contestant, Ready, Workload, fastest
from .numba_peer import njit


def beside(h, steps, v, y, i, j, k, rest, by_mass, gravity, begins, springs, sign):
    """Particle by particle: three numbers beside each other."""
    v, y, f = v.copy(), y.copy(), np.zeros_like(y)
    for step in range(steps + 1):
        kick, drift = (h if 0 < step < steps else 0.5 * h), (h if step < steps else 0.0)
        f[:] = 0.0
        for s in range(len(i)):
            p, q = i[s], j[s]
            a, b, c = y[q, 0] - y[p, 0], y[q, 1] - y[p, 1], y[q, 2] - y[p, 2]
            length = math.sqrt(a * a + b * b + c * c)
            pull = k[s] * (length - rest[s]) / length
            f[p, 0] += pull * a
            f[p, 1] += pull * b
            f[p, 2] += pull * c
            f[q, 0] -= pull * a
            f[q, 1] -= pull * b
            f[q, 2] -= pull * c
        for p in range(len(y)):
            if by_mass[p] > 0.0:
                for d in range(3):
                    v[p, d] += kick * by_mass[p] * f[p, d] + kick * gravity[d]
            for d in range(3):
                y[p, d] += drift * v[p, d]
    return v, y


def scatter(h, steps, v, y, i, j, k, rest, by_mass, gravity, begins, springs, sign):
    """Direction by direction."""
    u, x, f = v.T.copy(), y.T.copy(), np.zeros(y.T.shape)
    for step in range(steps + 1):
        kick, drift = (h if 0 < step < steps else 0.5 * h), (h if step < steps else 0.0)
        f[:] = 0.0
        for s in range(len(i)):
            p, q = i[s], j[s]
            a, b, c = x[0, q] - x[0, p], x[1, q] - x[1, p], x[2, q] - x[2, p]
            length = math.sqrt(a * a + b * b + c * c)
            pull = k[s] * (length - rest[s]) / length
            f[0, p] += pull * a
            f[1, p] += pull * b
            f[2, p] += pull * c
            f[0, q] -= pull * a
            f[1, q] -= pull * b
            f[2, q] -= pull * c
        for d in range(3):
            for p in range(len(by_mass)):
                fall = kick * gravity[d] if by_mass[p] > 0.0 else 0.0
                u[d, p] += kick * by_mass[p] * f[d, p] + fall
                x[d, p] += drift * u[d, p]
    return u.T.copy(), x.T.copy()


def kept(h, steps, v, y, i, j, k, rest, by_mass, gravity, begins, springs, sign):
    """All forces first."""
    u, x, f = v.T.copy(), y.T.copy(), np.empty((3, len(i)))
    x0, x1, x2, f0, f1, f2 = x[0], x[1], x[2], f[0], f[1], f[2]
    for step in range(steps + 1):
        kick, drift = (h if 0 < step < steps else 0.5 * h), (h if step < steps else 0.0)
        for s in range(len(i)):
            p, q = i[s], j[s]
            a, b, c = x0[q] - x0[p], x1[q] - x1[p], x2[q] - x2[p]
            length = math.sqrt(a * a + b * b + c * c)
            pull = k[s] * (length - rest[s]) / length
            f0[s], f1[s], f2[s] = pull * a, pull * b, pull * c
        for p in range(len(by_mass)):
            if by_mass[p] > 0.0:
                a = b = c = 0.0
                for e in range(begins[p], begins[p + 1]):
                    s = springs[e]
                    a += sign[e] * f0[s]
                    b += sign[e] * f1[s]
                    c += sign[e] * f2[s]
                w = kick * by_mass[p]
                u[0, p] += w * a + kick * gravity[0]
                u[1, p] += w * b + kick * gravity[1]
                u[2, p] += w * c + kick * gravity[2]
        for d in range(3):
            for p in range(len(by_mass)):
                x[d, p] += drift * u[d, p]
    return u.T.copy(), x.T.copy()


@functools.cache
def compiled(form):
    """With fast-math."""
    return njit(form)


def made(form, work: Workload) -> Ready:
    """A workload in this form."""
    data = {name: np.ascontiguousarray(row[..., 0]) for name, row in work.data.items()}
    pairs = data.pop("pairs").astype(np.int64)
    ends = np.argsort(pairs.reshape(-1), kind="stable")
    begins = np.searchsorted(pairs.reshape(-1)[ends], np.arange(len(data["v"]) + 1))
    lists = begins, ends // 2, np.where(ends % 2 == 0, 1.0, -1.0)
    i, j = (np.ascontiguousarray(each) for each in pairs.T)
    v, y, *others = data.values()
    run = compiled(form)
    run(work.dt, 1, v, y, i, j, *others, *lists)
    return Ready(lambda: run(work.dt, work.steps, v, y, i, j, *others, *lists), form.__name__)


def ready(work: Workload, quick: bool) -> Ready:
    """The fastest."""
    return fastest([functools.partial(made, form) for form in (beside, scatter, kept)], work, quick)


CONTESTANTS = [Contestant("numba", {"cloth_leapfrog": ready})]
