"""Quantities of saved states: of runs in float32, with adaptive steps or events, and those that are asked for later."""

from __future__ import annotations

from collections.abc import Sequence
from math import prod

import numpy as np

from ... import _core
from ...base.arrays import Array
from ...base.immutable import changed
from ...model.methods import method
from ...model.systems import System
from .plan import Plan, model

#: This many numbers of states, and of what is recorded of them, are copied to rows at once.
NUMBERS_AT_ONCE = 1 << 18


def recorded(system: System, names: Sequence[str], dt: float, v: Array, y: Array, backend: str = "rust") -> dict[str, Array]:
    """Quantities by name, each of the shape (saved, *its own, *batch), in float64 whatever the states are.

    Args:
        system: the system that was stepped.
        names: which of its quantities.
        dt: the step of the run.
        v: velocities of the saved states, shape (saved, *block, *batch).
        y: coordinates, likewise.
        backend: "rust", or "numpy" for the reference.
    """
    shapes = {name: system.quantities[name] for name in names}
    if backend == "numpy":
        return {name: _by_reference(system, name, len(shape), dt, v, y) for name, shape in shapes.items()}
    saved, batch = len(y), y.shape[1 + len(system.y_shape) :]
    sizes, members = [prod(system.v_shape), prod(system.y_shape), sum(map(prod, shapes.values()))], prod(batch)
    numbers: Array = np.empty((saved, sizes[-1], members))
    if numbers.size:
        # No step is made, so any method will do; what is around the system adds nothing to its quantities.
        alone = changed(system.uncontrolled, around=())
        spec = model(Plan(alone, method("false_euler"), batch, dt, record=tuple(names)))
        states = [block.reshape(saved, size, members) for block, size in zip((v, y), sizes, strict=False)]
        at_once = max(1, NUMBERS_AT_ONCE // (sum(sizes) * members))
        for first in range(0, saved, at_once):
            rows_v, rows_y = (_rows(block[first : first + at_once]) for block in states)
            made = np.empty((sizes[-1], rows_y.shape[1]))
            _core.recorded(spec, dt, members, rows_v, rows_y, made)
            numbers[first : first + at_once] = made.reshape(sizes[-1], -1, members).transpose(1, 0, 2)
    by_name, place = {}, 0
    for name, shape in shapes.items():
        by_name[name] = numbers[:, place : place + prod(shape)].reshape(saved, *shape, *batch)
        place += prod(shape)
    return by_name


def _rows(states: Array) -> Array:
    """A row for each number of a block, with the members of each saved state one after the other."""
    saved, size, members = states.shape
    return np.ascontiguousarray(states.transpose(1, 0, 2).reshape(size, saved * members), np.float64)


def _by_reference(system: System, name: str, axes: int, dt: float, v: Array, y: Array) -> Array:
    blocks = ((v, system.v_shape), (y, system.y_shape))
    v, y = (np.moveaxis(np.asarray(block, np.float64), 0, len(shape)) for block, shape in blocks)
    with np.errstate(all="ignore"):
        return np.moveaxis(system.recordable(name, v, y, dt), axes, 0)
