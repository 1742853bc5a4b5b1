"""W1 and W2 in float32: half the bytes, twice the members in a vector."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from . import SINGLE_KIND, Array, Workload
from .w1_false_euler import Free
from .w1_false_euler import make as free
from .w2_pendulums import Pendulums
from .w2_pendulums import make as pendulums

#: Half a unit in the last place of 1.
HALF_UNIT = 2.0**-24
#: Roundings of a step that count, those of the sums that make v and y; what they are made of is smaller by the step. Twice that.
ROUNDINGS = 4
#: A state is displaced by this to see how differences grow.
DISPLACED = 1e-6


class Single(Workload):
    """What works in float32 have in common; their data are numbers of float32, so that nothing is rounded beforehand."""

    beside: ClassVar[tuple[str, ...]] = ("C", "C, exact")

    @abstractmethod
    def growth(self) -> float:
        """How many times as large a difference may become by the end."""

    @cached_property
    def rounding(self) -> float:  # type: ignore[override]
        """How far roundings may displace the end: each as much as a number of the state is rounded by, and then grown."""
        largest = max(1.0, *(float(abs(block).max()) for block in (self.data["v"], self.data["y"], *self.exact())))
        return self.steps * ROUNDINGS * HALF_UNIT * largest * self.growth()

    def bound(self) -> float:
        """That of the method, and rounding."""
        return super().bound() + self.rounding


class SingleFree(Single, Free):
    """Undamped oscillators."""

    kind = SINGLE_KIND + Free.kind
    about = f"float32, {Free.about}"

    def growth(self) -> float:
        """A circle becomes an ellipse with half axes of 1 ± Φ/2."""
        phi = float(self.data["omega"].max()) * self.dt
        return (1.0 + phi / 2.0) / (1.0 - phi / 2.0)


class SinglePendulums(Single, Pendulums):
    """Damped pendulums under one drive."""

    about = f"float32, {Pendulums.about}"

    @property
    def kind(self) -> str:  # type: ignore[override]
        """What peers look up."""
        return f"{SINGLE_KIND}pendulums_{self.method}"

    def growth(self) -> float:
        """As small differences of the start grow."""
        grown = [1.0]
        for name in ("v", "y"):
            moved = replace(self, data=self.data | {name: self.data[name] + DISPLACED})
            grown.append(
                float(np.hypot(*(a - b for a, b in zip(moved.by_rk4(self.steps), self.by_rk4(self.steps), strict=True))).max())
                / DISPLACED
            )
        return max(grown)


def rounded(kind: Any, work: Any, **more: Any) -> Any:
    """The same work with numbers of float32."""
    data: dict[str, Array] = {name: row.astype(np.float32).astype(np.float64) for name, row in work.data.items()}
    name = work.name.replace("W1", "W1 float32").replace("W2", "W2 float32")
    return kind(name, data, float(np.float32(work.dt)), work.steps, **more)


WORKLOADS = [
    rounded(SingleFree, free(100_000, 1000)),
    rounded(SingleFree, free(1000, 1000)),
    *(rounded(SinglePendulums, pendulums(method), method=method) for method in ("standard_heun", "rk4")),
]
