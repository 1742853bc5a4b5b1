"""Springs in plain NumPy, as most people write them: whole arrays, and the faster of two ways to sum the forces on particles."""

from __future__ import annotations

import functools

import numpy as np

from . import Contestant, Ready, Workload, fastest


def added_at(ends, force, out):
    """Element by element, unbuffered."""
    out[:] = 0.0
    np.add.at(out, ends[0], force)
    np.subtract.at(out, ends[1], force)


def counted(ends, force, out):
    """A weighted count for each direction."""
    n, (i, j) = len(out), ends
    for c, row in enumerate(force.T):
        out[:, c] = np.bincount(i, row, n) - np.bincount(j, row, n)


def made(sums, work: Workload) -> Ready:
    """Leapfrog with these sums."""
    data = {name: row[..., 0] for name, row in work.data.items()}
    ends = i, j = data["pairs"].astype(np.intp).T
    h = work.dt
    by_mass = h * data["by_mass"][:, np.newaxis]
    fall = h * data["gravity"] * (by_mass > 0.0)

    def call():
        v, y, pull = data["v"].copy(), data["y"].copy(), np.empty_like(data["y"])
        for step in range(work.steps + 1):
            d = y[j] - y[i]
            length = np.sqrt(np.einsum("sc,sc->s", d, d))
            sums(ends, (data["stiffness"] * (1.0 - data["rest"] / length))[:, np.newaxis] * d, pull)
            kick = by_mass * pull + fall
            v += kick if 0 < step < work.steps else 0.5 * kick
            if step < work.steps:
                y += h * v
        return v, y

    return Ready(call, sums.__name__)


def ready(work: Workload, quick: bool) -> Ready:
    """The faster of both."""
    return fastest([functools.partial(made, sums) for sums in (added_at, counted)], work, quick)


CONTESTANTS = [Contestant("NumPy", {"cloth_leapfrog": ready}, slow="steps")]
