"""What works with bodies share: the truth, and what the method may miss. Written here once more, apart from stepwell."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from .workloads import Array, Workload


@dataclass(frozen=True)
class Bodies(Workload):
    """Bodies under Newton's law, G = 1.

    ``data`` holds ``v`` and ``y`` of shape (bodies, dim, members), ``masses`` of shape (bodies, members) and ``softening`` of
    shape (members,). What peers can do depends on the ``family`` and the ``method``.
    """

    family: ClassVar[str]
    #: The true steps and those of the bound, in steps of the work.
    fine: ClassVar[int] = 4
    coarse: ClassVar[int] = 2
    method: str = "leapfrog"

    @property
    def kind(self) -> str:  # type: ignore[override]
        """What peers look up."""
        return f"{self.family}_{self.method}"

    @property
    def bodies(self) -> int:
        """How many bodies a member has."""
        return len(self.data["v"])

    @property
    def dim(self) -> int:
        """Of the space."""
        return self.data["v"].shape[1]

    def pull(self, y: Array) -> Array:
        """Every acceleration, body by body: all others pull it."""
        a, masses, soft = np.empty_like(y), self.data["masses"], self.data["softening"] ** 2
        with np.errstate(divide="ignore", invalid="ignore"):
            for i in range(len(y)):
                d = y - y[i]
                r2 = np.einsum("jc...,jc...->j...", d, d) + soft
                strength = masses / (r2 * np.sqrt(r2))
                strength[i] = 0.0
                a[i] = np.einsum("jc...,j...->c...", d, strength)
        return a

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

    def by_method(self, steps: int) -> tuple[Array, Array]:
        """The end by the work's own method: kick, drift, and for leapfrog the first and the last half of a kick."""
        (v, y), h = (self.data["v"], self.data["y"]), self.end / steps
        half = 0.5 * h if self.method == "leapfrog" else 0.0
        if half:
            v = v - half * self.pull(y)
        for _ in range(steps):
            v = v + h * self.pull(y)
            y = y + h * v
        return (v + half * self.pull(y) if half else v), y

    @cached_property
    def truth(self) -> tuple[Array, Array]:
        """The end, found once. A method of order 4 with four times the step asks as often, and misses (4h)⁴ for h²."""
        return self.by_rk4(max(1, self.steps // self.fine))

    @cached_property
    def missed(self) -> float:
        """What the method misses with fewer and longer steps, found once."""
        return self.error(*self.by_method(max(1, self.steps // self.coarse)))

    def exact(self) -> tuple[Array, Array]:
        """By a better method."""
        return self.truth

    def bound(self) -> float:
        """By its order, the method misses so many times less with its own step. Twice that is allowed, also to REBOUND."""
        order = 2 if self.method == "leapfrog" else 1
        return 2.0 * self.missed * (max(1, self.steps // self.coarse) / self.steps) ** order + 1e-13  # rounding

    def error(self, v: Array, y: Array) -> float:
        """The largest distance of a body's (v, y) from the true one."""
        off = [a.reshape(b.shape) - b for a, b in zip((v, y), self.exact(), strict=True)]
        return float(np.sqrt(sum((each * each).sum(axis=1) for each in off)).max())
