"""W8: a cloth of 32 × 32 particles, hung by two corners, by leapfrog; only the final state is kept."""

from __future__ import annotations

from functools import cached_property
from typing import ClassVar, Self

import numpy as np

from . import Array, Unit, Workload

#: A bound of ω², 8·k/m of neighbours in rows and columns, and the step: an eighth of what is stable.
SQUARE, PARTS = 960.0**2, 8


class Cloth(Workload):
    """``data`` holds v and y of shape (particles, 3, 1), pairs of shape (springs, 2, 1), numbers of the springs and of the
    particles, 1/m being zero where one is fixed, and gravity."""

    kind = "cloth_leapfrog"
    about = "one cloth, leapfrog, one thread"
    unit: ClassVar[Unit] = Unit("µs/step", 1e6, time=True)

    @property
    def size(self) -> str:
        """Particles and springs."""
        return f"{len(self.data['v']):,} particles, {len(self.data['pairs']):,} springs"

    def quick(self) -> Self:
        """A few steps: the net stays, since its size is part of the work."""
        return self.cut(steps=40)

    def pull(self, y: Array) -> Array:
        """Every acceleration."""
        data = self.data
        i, j = data["pairs"][..., 0].astype(np.intp).T
        d = y[j] - y[i]
        length = np.sqrt((d * d).sum(axis=1, keepdims=True))
        force = (data["stiffness"][:, np.newaxis] * (1.0 - data["rest"][:, np.newaxis] / length)) * d
        a = np.zeros_like(y)
        np.add.at(a, i, force)
        np.subtract.at(a, j, force)
        by_mass = data["by_mass"][:, np.newaxis]
        return by_mass * a + (by_mass > 0.0) * data["gravity"]

    def by_rk4(self, steps: int) -> tuple[Array, Array]:
        """The end by the method of Runge and Kutta."""
        (v, y), h = (self.data["v"], self.data["y"]), self.end / steps
        for _ in range(steps):
            a1 = self.pull(y)
            v2, a2 = v + h / 2 * a1, self.pull(y + h / 2 * v)
            v3, a3 = v + h / 2 * a2, self.pull(y + h / 2 * v2)
            v4, a4 = v + h * a3, self.pull(y + h * v3)
            v, y = v + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4), y + h / 6 * (v + 2 * v2 + 2 * v3 + v4)
        return v, y

    def by_leapfrog(self, steps: int) -> tuple[Array, Array]:
        """The end by the work's own method."""
        (v, y), h = (self.data["v"], self.data["y"]), self.end / steps
        v = v - h / 2 * self.pull(y)
        for _ in range(steps):
            v = v + h * self.pull(y)
            y = y + h * v
        return v + h / 2 * self.pull(y), y

    @cached_property
    def truth(self) -> tuple[Array, Array]:
        """The end, found once."""
        return self.by_rk4(self.steps)

    @cached_property
    def missed(self) -> float:
        """What the method misses with twice the step, found once."""
        return self.error(*self.by_leapfrog(max(1, self.steps // 2)))

    def exact(self) -> tuple[Array, Array]:
        """By a better method."""
        return self.truth

    def bound(self) -> float:
        """By its order, the method misses a quarter with its own step. Twice that is allowed."""
        return 2.0 * self.missed * (max(1, self.steps // 2) / self.steps) ** 2 + 1e-12

    def error(self, v: Array, y: Array) -> float:
        """The largest distance of a particle's (v, y) from the true one."""
        off = [a.reshape(b.shape) - b for a, b in zip((v, y), self.exact(), strict=True)]
        return float(np.sqrt(sum((each * each).sum(axis=1) for each in off)).max())


def make(n: int, steps: int) -> Cloth:
    """One unit of length and of mass."""
    at = np.arange(n * n).reshape(n, n)
    ends = (at[:, :-1], at[:, 1:]), (at[:-1], at[1:])
    pairs = np.concatenate([np.stack([i.ravel(), j.ravel()], axis=1) for i, j in ends])
    y = np.zeros((n * n, 3))
    y[:, 0], y[:, 1] = np.tile(np.linspace(0.0, 1.0, n), n), np.repeat(np.linspace(0.0, -1.0, n), n)
    mass = 1.0 / (n * n)
    data = {
        "v": np.zeros_like(y),
        "y": y,
        "pairs": pairs.astype(np.float64),
        "stiffness": np.full(len(pairs), mass * SQUARE / 8.0),
        "rest": np.full(len(pairs), 1.0 / (n - 1)),
        "by_mass": np.where(np.isin(at.ravel(), (0, n - 1)), 0.0, 1.0 / mass),
        "gravity": np.array([0.0, 0.0, -9.81]),
    }
    step = 2.0 / np.sqrt(SQUARE) / PARTS
    return Cloth("W8", {name: row[..., np.newaxis] for name, row in data.items()}, float(step), steps)


WORKLOADS = [make(32, 1000)]
