"""What every system says of itself."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable
from math import prod
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from .._checks import Array, Shape
from ..errors import UnsupportedError
from ..reference.types import Scaled

if TYPE_CHECKING:
    from ..control import EnergyControl, Projection
    from .inputs import Input


class Parameters:
    """A system as the core takes it: options, sizes, rows of parameters, tables of samples (values, interval, start).

    Arrays have two axes: what is counted, and the members, or 1 for all members.
    """

    def __init__(
        self,
        options: Iterable[str] = (),
        sizes: Iterable[int] = (),
        rows: Iterable[Array] = (),
        tables: Iterable[tuple[Array, float, float]] = (),
    ) -> None:
        self.options = list(options)
        self.sizes = list(sizes)
        self.rows = list(rows)
        self.tables = list(tables)


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
        input_names: the inputs that it can be given, each a number.
        batch: shape to which the parameters broadcast.
    """

    kernel: ClassVar[str]
    axes: ClassVar[str] = ""
    linear: ClassVar[bool] = False
    second_order: bool = True
    v_shape: Shape = ()
    y_shape: Shape = ()
    velocity_term: str | None = None
    input_names: tuple[str, ...] = ()
    batch: Shape = ()

    @property
    def quantities(self) -> dict[str, Shape]:
        """What the core can record beside the states, with the shape of each."""
        return {}

    @abstractmethod
    def scaled(self, h: float, batch: Shape) -> Scaled:
        """The NumPy reference of this system, scaled to the step h, for states of that batch shape."""

    @abstractmethod
    def parameters(self, batch: Shape) -> Parameters:
        """This system as the core takes it."""

    def energy(self, v: Array, y: Array) -> Array:
        """The energy of states with the blocks' axes first and axes of the batch last.

        Raises:
            UnsupportedError: if the system has none of its own.
        """
        raise UnsupportedError(f"energy: {self!r} has no energy of its own; compute what you mean by it from v and y")

    def recordable(self, name: str, v: Array, y: Array, dt: float) -> Array:
        """A quantity of states of a run with that step, the same to the bit as if it had been recorded."""
        return self.energy(v, y)

    def auxiliary(self, t: float, v: Array, y: Array) -> Array:
        """The auxiliary outputs z (§3) of states at time t, shape (outputs, *batch).

        Raises:
            UnsupportedError: if the system has none.
        """
        raise UnsupportedError(f"z: {self!r} has no auxiliary outputs")

    def check_time(self, last: float) -> None:
        """Raise if the system's inputs make no sense up to a time."""
        for given in self.given_inputs().values():
            given.check(last)

    def sized(self, *states: Any) -> System:
        """The same system for states of these shapes; only a system that leaves its size open minds."""
        return self

    def controlled(self, control: EnergyControl | Projection, v: Array, y: Array, dt: float) -> System:
        """The same system under control, the target that of the state if the control has none.

        Raises:
            UnsupportedError: if the system has no energy that a control can keep.
        """
        raise UnsupportedError(f"control: {self!r} has no energy control")

    # What the transition-matrix form and the analysis ask of a linear system.

    def given_inputs(self) -> dict[str, Input]:
        """The inputs that it was given, by name."""
        return {}

    def without_inputs(self) -> System:
        """The same system, left to itself."""
        return self

    def with_pulse(self, name: str, values: Array, interval: float) -> System:
        """The same system with these samples as its only input."""
        raise KeyError(name)


def shown(given: dict[str, Any]) -> str:
    """Arguments for a repr: those that are not None, arrays by their shape."""
    short = {k: f"array{v.shape}" if isinstance(v, np.ndarray) and v.ndim else v for k, v in given.items() if v is not None}
    return ", ".join(f"{k}={v}" for k, v in short.items())


def row(values: Array, batch: Shape) -> Array:
    """One parameter as a row for the core."""
    return rows(values[np.newaxis], batch)


def rows(values: Array, batch: Shape) -> Array:
    """Parameters, counted along the first axis, as rows for the core."""
    count, own = len(values), values.shape[1:]
    if not any(values.strides[1:]):  # one number for all members, broadcast or not
        for _ in own:
            values = values[..., 0]
        return np.ascontiguousarray(values.reshape(count, 1))
    if own == batch:
        return np.ascontiguousarray(values).reshape(count, prod(batch))
    aligned = values.reshape(count, *(1,) * (len(batch) - len(own)), *own)
    return np.ascontiguousarray(np.broadcast_to(aligned, (count, *batch))).reshape(count, prod(batch))
