"""The observed quantities of a run: v, y, a component of them, a recordable quantity, or a function of the state."""

from __future__ import annotations

from collections.abc import Callable
from math import prod
from typing import Any, NamedTuple

import numpy as np

from ...base import checks
from ...base.arrays import Array, Shape
from ...errors import ArgumentError, ShapeError, UnsupportedError
from ...model.systems import System
from ...runs.result import Run

Name = str
#: The observable quantities.
Of = Name | tuple[Any, ...] | Callable[[Array, Array, Array], Any]


class Piece(NamedTuple):
    """Some saved states of a run of a chunk of members.

    Attributes:
        run: the piece of the run; its first state may be the last one of the piece before.
        since: the index of the first new state: 1 if the first is that of the piece before, else 0.
    """

    run: Run
    since: int

    @property
    def t(self) -> Array:
        """Times of the new states."""
        return self.run.t[self.since :]

    def of(self, what: Of) -> Array:
        """A quantity of the new states, shape (states, *its own axes, members).

        For states in float32, v and y are float32; other quantities are computed from them in float64.
        """
        run, since = self.run, self.since
        if isinstance(what, str) and what in ("v", "y"):
            return np.asarray(getattr(run, what)[since:])
        if isinstance(what, tuple):
            return np.asarray(getattr(run, what[0])[(slice(since, None), *what[1:])])
        if isinstance(what, str):
            return np.asarray(run.quantity(what)[since:])
        v, y = (np.moveaxis(np.asarray(a[since:], np.float64), 0, -2) for a in (run.v, run.y))
        with np.errstate(all="ignore"):
            values = np.asarray(what(self.t[:, np.newaxis], v, y), dtype=np.float64)
        shape = (len(self.t), run.status.size)
        if values.shape[-2:] != shape:
            try:
                values = np.broadcast_to(values, shape)
            except ValueError:
                raise ShapeError(
                    f"of: expected that {name_of(what)}(t, v, y) returns the shape (…, {shape[0]}, {shape[1]}), states and "
                    f"members, got {values.shape}"
                ) from None
        return np.moveaxis(values, -2, 0)


class Rows:
    """The rows of the numbers that a device observes: v, y, then the quantities ``names``, in the order of asking.

    ``records`` says whether the device computes quantities of a state.
    """

    def __init__(self, system: System, *, records: bool) -> None:
        self.system, self._records = system, records
        self.states = prod(system.v_shape) + prod(system.y_shape)
        self.names: list[str] = []

    def of(self, what: Of) -> tuple[int, ...] | None:
        """The rows of a quantity, or None if the device does not have it."""
        n_v = prod(self.system.v_shape)
        if callable(what):
            return None
        if isinstance(what, tuple):
            shape = self.system.v_shape if what[0] == "v" else self.system.y_shape
            return (int(np.ravel_multi_index(what[1:], shape)) + (0 if what[0] == "v" else n_v),)
        if what in ("v", "y"):
            first = 0 if what == "v" else n_v
        elif self._records:
            self.names += [] if what in self.names else [what]
            before = self.names[: self.names.index(what)]
            first = self.states + sum(prod(self.system.quantities[name]) for name in before)
        else:
            return None
        return tuple(range(first, first + prod(shape_of(what, self.system))))


class Observed(NamedTuple):
    """The results of a device, shape (results, members), for all observed states of a run, which has the last state alone.

    ``begin`` and ``end`` are the times of the first and of the last observed state, or those of each member.
    """

    run: Run
    numbers: Array
    begin: Any
    end: Any


def shape_of(what: Of, system: System) -> Shape:
    """The own axes of a quantity; of a function's result they are not known before, and ()."""
    if not isinstance(what, str):
        return ()
    shapes: dict[str, Shape] = {"v": system.v_shape, "y": system.y_shape}
    return shapes[what] if what in shapes else system.quantities[what]


def dtype_of(what: Of, run: Run) -> Any:
    """The type of the numbers of ``Piece.of``."""
    return run.y.dtype if isinstance(what, tuple) or what in ("v", "y") else np.float64


def name_of(what: Of | Callable[..., Any]) -> str:
    """The name of an observed quantity in the names of variables."""
    if isinstance(what, str):
        return what
    if isinstance(what, tuple):
        return "_".join(map(str, what))
    name = getattr(what, "__name__", "")
    return name if name.isidentifier() else type(what).__name__


def checked(what: Any) -> Of:
    """An argument that should be an observable quantity, checked."""
    if isinstance(what, tuple):
        if len(what) < 2 or what[0] not in ("v", "y"):
            raise ArgumentError(f"of: expected a component such as ('y', 0), got {checks.short(what)}")
        if nested := [each for each in what[1:] if isinstance(each, (tuple, list))]:
            right = (what[0], *nested[0])
            raise ArgumentError(f"of: expected a component of a block with several axes as {right}, got {checks.short(what)}")
        return (what[0], *(checks.count("of", each, 0) for each in what[1:]))
    if callable(what):
        checks.argument_order("of", what, ("t", "v", "y"))
    if isinstance(what, str) or callable(what):
        quantity: Of = what
        return quantity
    raise ArgumentError(
        f"of: expected 'v', 'y', a component such as ('y', 0), a quantity such as 'energy', or a function f(t, v, y), "
        f"got {checks.short(what)}"
    )


def possible(what: Of, system: System) -> None:
    """Raise if a system has no such quantity, before any work."""
    shapes: dict[str, Shape] = {"v": system.v_shape, "y": system.y_shape}
    if isinstance(what, str) and what == "v" and system.v_shape == (0,):
        raise UnsupportedError(f"of: {system!r} is of first order and has no v")
    if isinstance(what, str) and what not in shapes:
        checks.known("of", what, ("v", "y", "energy", *system.quantities))
        if what == "energy" and what not in system.quantities:
            system.energy(*(np.zeros((*shape, *system.batch)) for shape in shapes.values()))
    if isinstance(what, tuple):
        shape = shapes[what[0]]
        if len(what) - 1 != len(shape) or any(i >= n for i, n in zip(what[1:], shape, strict=True)):
            places = ("row", "column", "layer")[: len(shape)] if len(shape) < 4 else range(len(shape))
            like = ", ".join((f'"{what[0]}"', *map(str, places)))
            raise ShapeError(f"of: a component of {what[0]} of shape {shape} is ({like}), got {what}")


def block_dims(system: System, block: str) -> tuple[str, ...]:
    """Names of the dimensions of a block."""
    shape = system.v_shape if block == "v" else system.y_shape
    alike = system.v_shape == system.y_shape
    names = [each.strip() for each in system.axes.split(",")] if system.axes else []
    if alike and len(names) == len(shape) and all(names):
        return tuple(names)
    stem = "component" if alike or system.v_shape == (0,) else f"{block}_component"
    return (stem,) if len(shape) == 1 else tuple(f"{stem}_{i}" for i in range(len(shape)))


def has_rates(what: Of) -> bool:
    """True if the rate of change of a quantity is one of the system: of v, y, or a component."""
    return isinstance(what, tuple) or what in ("v", "y")


def rates(run: Run, what: Of, t: Array, v: Array, y: Array) -> Array | None:
    """The rate of change of v, y, or a component, at states of all members of a run; None for other quantities.

    ``t`` has one time for each member, ``v`` and ``y`` have the shape (*block, members).
    """
    if not has_rates(what):
        return None
    block = what[0] if isinstance(what, tuple) else what
    with np.errstate(all="ignore"):
        s = run.system.scaled(run.dt, run.status.shape, run.force)
        change = np.asarray((s.dv if block == "v" else s.dy)(t, v, y)) / run.dt
    shape = (v if block == "v" else y).shape
    change = np.broadcast_to(change, shape)
    return change[what[1:]] if isinstance(what, tuple) else change
