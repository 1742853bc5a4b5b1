"""The argument ``positive=``: components that must not become negative, as places among the numbers of a state."""

from __future__ import annotations

from math import prod
from typing import Any

import numpy as np

from ...base import checks
from ...base.arrays import Array
from ...errors import ArgumentError
from ...model.systems import System


def places_of(system: System, components: Any) -> list[int]:
    """Places of the components that must not become negative, among the numbers of v and then of y."""
    if components is None or components is False:
        return []
    n_v, n_y = prod(system.v_shape), prod(system.y_shape)
    if components is True:
        return list(range(n_v, n_v + n_y))
    parts = components if isinstance(components, (list, np.ndarray)) else [components]
    return sorted({_place(system, part) for part in parts})


def checked_places(system: System, components: Any, v: Array, y: Array) -> tuple[int, ...]:
    """``places_of``; raise if one of the components is negative at the start."""
    places = places_of(system, components)
    if not places:
        return ()
    rows = [row for block, axes in ((v, len(system.v_shape)), (y, len(system.y_shape))) for row in _rows_of(block, axes)]
    for place in places:
        if (rows[place] < 0.0).any():
            raise ArgumentError(
                f"positive: expected a start at which {name_of(system, place)} is not negative, got {rows[place].min():g}"
            )
    return tuple(places)


def _rows_of(block: Array, axes: int) -> list[Array]:
    return list(block.reshape((prod(block.shape[:axes]), *block.shape[axes:])))


def _place(system: System, part: Any) -> int:
    """The place of a component, from an index of y, or from ("v", …) or ("y", …)."""
    block, index = (
        ("y", part) if not isinstance(part, tuple) or not part or isinstance(part[0], (int, np.integer)) else (part[0], part[1:])
    )
    block = checks.known("positive", block, ["v", "y"])
    shape = system.v_shape if block == "v" else system.y_shape
    index = index if isinstance(index, tuple) else (index,)
    fits = len(index) == len(shape) and all(
        isinstance(i, (int, np.integer)) and not isinstance(i, bool) and 0 <= i < n for i, n in zip(index, shape, strict=True)
    )
    if shape == () and index == (0,):
        index, fits = (), True
    if not fits:
        raise ArgumentError(
            f"positive: expected True, or components of {block}, whose shape is {shape}: an index of y, or as ('y', 0), got "
            f"{checks.short(part)}"
        )
    first = prod(system.v_shape) if block == "y" else 0
    return first + (int(np.ravel_multi_index(index, shape)) if shape else 0)


def name_of(system: System, place: int) -> str:
    """The name of a component, such as y[1], by its place among the numbers of v and then of y."""
    n_v = prod(system.v_shape)
    block, shape, number = ("v", system.v_shape, place) if place < n_v else ("y", system.y_shape, place - n_v)
    return f"{block}[{', '.join(map(str, np.unravel_index(number, shape)))}]" if shape else block
