"""Small motions of a net of springs about a state: a linear system of the particles that are not fixed.

A fixed particle keeps any velocity, and a net without one drifts. ``parts`` finds such motions of a linear system exactly and
removes them; in the eigenvalues of a whole step their rounding would hide the limit.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ...base.arrays import Array
from ...model.systems import LinearSystem, Springs
from . import maps
from .limit_result import Mode


def free_numbers(springs: Springs) -> Any:
    """The numbers of a block that belong to particles that are not fixed."""
    numbers = np.arange(springs.n * springs.y_shape[1]).reshape(springs.y_shape)
    return np.delete(numbers, springs.fixed, axis=0).reshape(-1)


def linearised(springs: Springs, v: Array, y: Array) -> LinearSystem:
    """The linear system of small disturbances of a state, velocities first, with the batch of the state."""
    free = free_numbers(springs)
    free_states = np.concatenate([free, springs.n * springs.y_shape[1] + free])
    return LinearSystem(maps.rates(springs, 0.0, v, y)[np.ix_(free_states, free_states)], velocities=len(free))


def lifted(springs: Springs, mode: Mode | None) -> Mode | None:
    """A mode of the small motions as a mode of the whole net."""
    if mode is None:
        return None
    blocks = [np.zeros(springs.y_shape, dtype=np.complex128) for _ in range(2)]
    for block, shape in zip(blocks, (mode.v, mode.y), strict=True):
        block.reshape(-1)[free_numbers(springs)] = shape
    return mode._replace(v=blocks[0], y=blocks[1])
