"""The workloads, one file each. A file defines ``WORKLOADS``, a list of them; that puts it into the report."""

from __future__ import annotations

import importlib
import pkgutil
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Unit:
    """In what a speed is shown: so many pieces of work a second, or the time of a piece."""

    name: str
    scale: float
    time: bool = False

    def shown(self, rate: float) -> float:
        """The number, from pieces of work a second."""
        return self.scale / rate if self.time else rate / self.scale


@dataclass(frozen=True)
class Workload(ABC):
    """A batch of systems, a method, a number of steps from t = 0, and the truth about the end.

    ``data`` holds arrays whose last axis is that of the members: first ``v`` and ``y`` at the start, then the parameters, in the
    order in which kernels take them. Peers look up ``kind`` to see whether they can do it.
    """

    kind: ClassVar[str]
    about: ClassVar[str]
    unit: ClassVar[Unit] = Unit("G steps/s", 1e9)
    #: The contestants that all others are compared with, where they take part.
    beside: ClassVar[tuple[str, ...]] = ("numba", "C", "C, exact")
    #: How far contestants with the same method may be apart: a few thousand operations of 1e-16 each, and another sine.
    rounding: ClassVar[float] = 1e-11
    name: str
    data: Mapping[str, Array]
    dt: float
    steps: int

    @property
    def members(self) -> int:
        """How many members the batch has."""
        return self.data["v"].shape[-1]

    @property
    def size(self) -> str:
        """What the title says of the size."""
        return f"{self.members:,} member{'s' * (self.members != 1)}"

    @property
    def end(self) -> float:
        """The time at the end."""
        return self.steps * self.dt

    def amount(self, evaluations: int) -> float:
        """The pieces of work in a call that asks a member so often for its rates; here steps of members, however made."""
        return self.members * self.steps

    def cut(self, *, members: int | None = None, steps: int | None = None) -> Self:
        """The same work with fewer members or fewer steps."""
        if (members or self.members) >= self.members and (steps or self.steps) >= self.steps:
            return self  # which may know the truth already
        data = {name: row[..., :members] for name, row in self.data.items()}
        return replace(self, data=data, steps=min(self.steps, steps or self.steps))

    def quick(self) -> Self:
        """A little of the work, to see that it is done right."""
        return self.cut(members=2000, steps=2000 if self.members == 1 else 200)

    @abstractmethod
    def exact(self) -> tuple[Array, Array]:
        """v and y at the end, by a formula or by a better method."""

    @abstractmethod
    def bound(self) -> float:
        """What the error of the method cannot exceed; rounding is some powers of ten below."""

    def error(self, v: Array, y: Array) -> float:
        """The largest distance of a member from its exact state. Amplitudes are about 1."""
        exact_v, exact_y = self.exact()
        return float(np.hypot(v - exact_v, y - exact_y).max())


#: The kinds of work in float32 begin so.
SINGLE_KIND = "single_"


def catalogue() -> list[Workload]:
    """Every workload of every file, by name of file."""
    modules = (importlib.import_module(f"{__name__}.{m.name}") for m in pkgutil.iter_modules(__path__))
    return [workload for module in modules for workload in module.WORKLOADS]
