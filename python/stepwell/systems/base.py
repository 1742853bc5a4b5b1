"""What every system says of itself."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from .._checks import Array, Shape


@dataclass
class Parameters:
    """A system as the core takes it: options, size, one row per parameter, tables of samples (values, interval, start)."""

    options: list[str] = field(default_factory=list)
    size: int = 0
    rows: list[Array] = field(default_factory=list)
    tables: list[tuple[Array, float, float]] = field(default_factory=list)


class System(ABC):
    """Two blocks, velocities ``v`` and coordinates ``y``, and a rate for each.

    Attributes:
        kernel: name of its files in the core and in the reference.
        v_shape: shape of a member's velocity block.
        y_shape: shape of a member's coordinate block.
        axes: names of the blocks' axes, for messages.
        second_order: whether ẏ is v times a number, so that ÿ = a(t, y) if no force depends on v.
        velocity_term: the term that depends on the velocity, or None.
        linear: whether the rates are linear in v, y and the inputs.
        batch: shape to which the parameters broadcast.
    """

    kernel: ClassVar[str]
    axes: ClassVar[str] = ""
    second_order: ClassVar[bool] = True
    linear: ClassVar[bool] = False
    v_shape: Shape = ()
    y_shape: Shape = ()
    velocity_term: str | None = None
    batch: Shape = ()

    @abstractmethod
    def scaled(self, h: float, batch: Shape) -> Any:
        """The NumPy reference of this system, scaled to the step h, for states of that batch shape."""

    @abstractmethod
    def parameters(self, batch: Shape) -> Parameters:
        """This system as the core takes it."""

    @abstractmethod
    def energy(self, v: Array, y: Array) -> Array:
        """The energy of states with the blocks' axes first and axes of the batch last."""

    # What the transition-matrix form asks of a linear system.

    def inputs(self) -> dict[str, Any]:
        """Its inputs by name, as reference signals."""
        return {}

    def without_inputs(self) -> System:
        """The same system, left to itself."""
        return self

    def with_pulse(self, name: str, values: Array, interval: float) -> System:
        """The same system with these samples as its only input."""
        raise KeyError(name)


def row(values: Array, batch: Shape) -> Array:
    """One parameter as a row for the core: one number, or one for each member."""
    if values.ndim == 0:
        return values.reshape(1)
    return np.ascontiguousarray(np.broadcast_to(values, batch)).reshape(-1)
