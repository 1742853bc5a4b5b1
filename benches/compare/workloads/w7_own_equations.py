"""W7: own equations, given to each program as its users give them, by Runge-Kutta 4; only the final state is kept."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import ClassVar, Self

import numpy as np

from ..own.equations import EQUATIONS, Equation, stacked
from . import Array, Unit, Workload

#: Members that the truth is found for at once: few enough for the cache.
CHUNK = 4096


@dataclass(frozen=True)
class Own(Workload):
    """There is no formula: the truth is found with half the step, and what may be missed is told by what twice the step misses.

    ``data`` holds v of shape (numbers, members), without any if the equations are of the first order, y, and then the parameters
    that are the members' own. Blocks of one number have the shape (members,).
    """

    unit: ClassVar[Unit] = Unit("M steps/s", 1e6)
    beside: ClassVar[tuple[str, ...]] = ("numba", "numba, exact", "numba, plain")
    equation: Equation = field(kw_only=True)

    @property
    def kind(self) -> str:  # type: ignore[override]
        """What peers look up."""
        return f"own_{self.equation.name}"

    @property
    def about(self) -> str:  # type: ignore[override]
        """With the method."""
        return f"{self.equation.about}, Runge-Kutta 4"

    def quick(self) -> Self:
        """A fifth of the steps, and never only one vector."""
        return self.cut(members=500, steps=50)

    def by_rk4(self, steps: int) -> tuple[Array, Array]:
        """The end by the method of Runge and Kutta."""
        state, own = stacked(self.data, self.equation)
        rates, h = self.equation.function(np), self.end / steps
        for begin in range(0, self.members, CHUNK):
            s, p = state[:, begin : begin + CHUNK], own[:, begin : begin + CHUNK]
            for k in range(steps):
                t = k * h
                d1 = np.array(rates(t, s, p))
                d2 = np.array(rates(t + h / 2, s + h / 2 * d1, p))
                d3 = np.array(rates(t + h / 2, s + h / 2 * d2, p))
                d4 = np.array(rates(t + h, s + h * d3, p))
                s = s + h / 6 * (d1 + 2 * d2 + 2 * d3 + d4)
            state[:, begin : begin + CHUNK] = s
        return self.blocks(state)

    def blocks(self, state: Array) -> tuple[Array, Array]:
        """v and y, as they are in ``data``, of the numbers of a state."""
        first = self.data["v"].size // self.members
        return state[:first].reshape(self.data["v"].shape), state[first:].reshape(self.data["y"].shape)

    @cached_property
    def truth(self) -> tuple[Array, Array]:
        """The end, found once, with twice the steps."""
        return self.by_rk4(2 * self.steps)

    @cached_property
    def missed(self) -> float:
        """What the method misses with half the steps, found once."""
        return self.error(*self.by_rk4(max(1, self.steps // 2)))

    def exact(self) -> tuple[Array, Array]:
        """With half the step."""
        return self.truth

    @property
    def expected(self) -> float:
        """What the method misses with its own step, by its order."""
        return self.missed * (max(1, self.steps // 2) / self.steps) ** 4

    def bound(self) -> float:
        """Twice what is expected, and rounding: of states up to 100, some hundred steps of 1e-14."""
        return 2.0 * self.expected + 1e-11

    def error(self, v: Array, y: Array) -> float:
        """The largest distance of a member's state from the true one."""
        off = [(a - b).reshape(-1, self.members) for a, b in zip((v, y), self.exact(), strict=True)]
        return float(np.sqrt(sum((each * each).sum(axis=0) for each in off)).max())


def make(equation: Equation, members: int) -> Own:
    """States and parameters anywhere between their bounds."""
    rng = np.random.default_rng(7)
    state = np.array([rng.uniform(*bounds, members) for bounds in equation.start.values()])
    if equation.system.order == 1:
        v, y = np.empty((0, members)), state
    else:
        v, y = (block[0] if len(block) == 1 else block for block in np.split(state, 2))
    own = {name: rng.uniform(*bounds, members) for name, bounds in equation.own.items()}
    return Own(f"W7 {equation.name}", {"v": v, "y": y, **own}, equation.dt, equation.steps, equation=equation)


WORKLOADS = [make(equation, 100_000) for equation in EQUATIONS]
