"""W2: damped pendulums under one drive, each with its own strength of it, by Standard Heun and by Runge-Kutta 4."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from . import Array, Unit, Workload

#: v̇ = −sin y − 2·DAMPING·v + amplitude·sin(FREQUENCY·t), ẏ = v: the driven pendulum of the books on chaos.
DAMPING, FREQUENCY = 0.25, 2.0 / 3.0


@dataclass(frozen=True)
class Pendulums(Workload):
    """There is no formula: the truth is a better method, and what a method may miss is what it misses with half the steps."""

    about = "damped pendulums under one drive, its strength their own"
    unit = Unit("M steps/s", 1e6)
    method: str = "standard_heun"

    @property
    def kind(self) -> str:  # type: ignore[override]
        """What peers look up."""
        return f"pendulums_{self.method}"

    def rate(self, t: float, v: Array, y: Array) -> Array:
        """v̇."""
        return self.data["amplitude"] * np.sin(FREQUENCY * t) - np.sin(y) - 2.0 * DAMPING * v

    def by_rk4(self, steps: int) -> tuple[Array, Array]:
        """The end by the method of Runge and Kutta."""
        v, y, h = self.data["v"], self.data["y"], self.end / steps
        for k in range(steps):
            t = k * h
            a1 = self.rate(t, v, y)
            v2 = v + h / 2 * a1
            a2 = self.rate(t + h / 2, v2, y + h / 2 * v)
            v3 = v + h / 2 * a2
            a3 = self.rate(t + h / 2, v3, y + h / 2 * v2)
            v4 = v + h * a3
            a4 = self.rate(t + h, v4, y + h * v3)
            v, y = v + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4), y + h / 6 * (v + 2 * v2 + 2 * v3 + v4)
        return v, y

    def by_heun(self, steps: int) -> tuple[Array, Array]:
        """The end by Standard Heun."""
        v, y, h = self.data["v"], self.data["y"], self.end / steps
        for k in range(steps):
            a1 = self.rate(k * h, v, y)
            v1 = v + h * a1
            a2 = self.rate(k * h + h, v1, y + h * v)
            v, y = v + h / 2 * (a1 + a2), y + h / 2 * (v + v1)
        return v, y

    @cached_property
    def truth(self) -> tuple[Array, Array]:
        """The end, found once, with twice the steps."""
        return self.by_rk4(2 * self.steps)

    @cached_property
    def missed(self) -> float:
        """What the method misses with half the steps, found once."""
        return self.error(*(self.by_rk4 if self.method == "rk4" else self.by_heun)(max(1, self.steps // 2)))

    def exact(self) -> tuple[Array, Array]:
        """By a better method."""
        return self.truth

    def bound(self) -> float:
        """By its order, the method misses so many times less with its own step; twice that is allowed, and rounding."""
        order = 4 if self.method == "rk4" else 2
        return 2.0 * self.missed * (max(1, self.steps // 2) / self.steps) ** order + 1e-12


def make(method: str) -> Pendulums:
    """Amplitudes from none to where the motion is chaotic, for a time in which that does not show."""
    rng = np.random.default_rng(3)
    members = 10_000
    data = {
        "v": np.zeros(members),
        "y": rng.uniform(-1.0, 1.0, members),
        "amplitude": rng.uniform(0.0, 1.5, members),
    }
    return Pendulums(f"W2 {method}", data, 0.01, 1000, method)


WORKLOADS = [make("standard_heun"), make("rk4")]
