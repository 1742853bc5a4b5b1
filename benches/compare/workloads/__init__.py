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
class Workload(ABC):
    """A batch of systems, a method, a number of steps from t = 0, and the exact solution.

    ``data`` holds rows of one number per member: first ``v`` and ``y`` at the start, then the parameters, in the order
    in which kernels take them. Peers look up ``kind`` to see whether they can do it.
    """

    kind: ClassVar[str]
    about: ClassVar[str]
    name: str
    data: Mapping[str, Array]
    dt: float
    steps: int

    @property
    def members(self) -> int:
        """How many members the batch has."""
        return self.data["v"].size

    @property
    def end(self) -> float:
        """The time at the end."""
        return self.steps * self.dt

    def cut(self, *, members: int | None = None, steps: int | None = None) -> Self:
        """The same work with fewer members or fewer steps."""
        data = {name: row[:members] for name, row in self.data.items()}
        return replace(self, data=data, steps=min(self.steps, steps or self.steps))

    @abstractmethod
    def exact(self) -> tuple[Array, Array]:
        """v and y at the end, by a formula."""

    @abstractmethod
    def bound(self) -> float:
        """What the error of the method cannot exceed; rounding is some powers of ten below."""

    def error(self, v: Array, y: Array) -> float:
        """The largest distance of a member from its exact state. Amplitudes are about 1."""
        exact_v, exact_y = self.exact()
        return float(np.hypot(v - exact_v, y - exact_y).max())


def catalogue() -> list[Workload]:
    """Every workload of every file, by name of file."""
    modules = (importlib.import_module(f"{__name__}.{m.name}") for m in pkgutil.iter_modules(__path__))
    return [workload for module in modules for workload in module.WORKLOADS]
