"""The mass matrix of equations M·ẏ = f, of which some rows may be zero: those equations are algebraic, 0 = f."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..base.arrays import Array, Shape
from .systems.equations import stacked

#: The columns and entries of a row of a matrix; those that are zero are left out.
Row = list[tuple[int, float]]


class Mass:
    """A constant matrix M for the numbers of y, a block of this shape.

    Attributes:
        rows: its rows.
        shape: the shape of a member's y.
    """

    def __init__(self, rows: list[Row], shape: Shape) -> None:
        self.rows, self.shape = rows, shape

    def times(self, y: Array) -> Array:
        """M·y."""
        numbers = self._numbers(y)
        return self._block([combined(row, numbers) for row in self.rows], y)

    def rates(self, dy: Array) -> Array:
        """Rates without those of algebraic equations, of which none is that of a number."""
        numbers = self._numbers(dy)
        return self._block([number if row else 0.0 for row, number in zip(self.rows, numbers, strict=True)], dy)

    def _numbers(self, y: Any) -> list[Any]:
        return [np.asarray(y)[index] for index in np.ndindex(self.shape)]

    def _block(self, numbers: list[Any], like: Any) -> Array:
        block: Array = stacked(numbers, self.shape, np.shape(like)[len(self.shape) :])
        return block


def combined(row: Row, numbers: Any) -> Any:
    """The sum of numbers, each times the entry of its column."""
    total: Any = None
    for column, entry in row:
        term = numbers[column] if entry == 1.0 else entry * numbers[column]
        total = term if total is None else total + term
    return 0.0 if total is None else total


def times(s: Any, dy: Array) -> Array:
    """M·dy, or dy of a system without a mass matrix."""
    mass = getattr(s, "mass_matrix", None)
    return dy if mass is None else mass.times(dy)


def rates(s: Any, dy: Array) -> Array:
    """The rates of the numbers of y that have one; zero for others."""
    mass = getattr(s, "mass_matrix", None)
    return dy if mass is None else mass.rates(dy)
