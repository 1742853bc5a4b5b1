"""Mass matrices: M·ẏ = f as equations of which each is the rate of one number, and algebraic equations.

Gauss-Jordan elimination with complete pivoting gives a matrix L for which L·M has, but for the order of its rows, the form
[[I, B], [0, 0]]. So ẏᵢ + Σ Bᵢⱼ·ẏⱼ = (L·f)ᵢ, and 0 = (L·f)ⱼ. Where M has an inverse there is no j: the rates are L·f.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ...base import checks
from ...base.arrays import Array
from ...errors import ArgumentError, ShapeError
from ...reference.mass import Row

#: Remainder of a row of M, its largest entry being between 1 and 2, counts as zero where it is below this.
NOTHING = 1e-13


class MassMatrix(NamedTuple):
    """A mass matrix, brought to this form.

    Attributes:
        matrix: M as it was given, shape (n, n).
        combinations: the rows of L, row i the one whose equation is for the number i of y.
        rows: the rows of L·M; empty ones are those of algebraic equations.
    """

    matrix: Array
    combinations: list[Row]
    rows: list[Row]

    @property
    def algebraic(self) -> list[int]:
        """The numbers of y whose equations are algebraic."""
        return [number for number, row in enumerate(self.rows) if not row]


def mass_matrix(argument: str, value: Any) -> MassMatrix:
    """A mass matrix from what a user gave: a square matrix, or a number for a state of one number."""
    matrix = checks.numbers(argument, value)
    if matrix.shape not in ((), (len(matrix),) * 2 if matrix.ndim else ()) or not matrix.size:
        raise ShapeError(f"{argument}: expected a square matrix, a row for each number of the state, got shape {matrix.shape}")
    matrix = np.atleast_2d(matrix)
    if not matrix.any():
        raise ArgumentError(f"{argument}: expected an entry that is not zero: without one nothing has a rate")
    return MassMatrix(matrix, *_reduced(matrix))


def _reduced(matrix: Array) -> tuple[list[Row], list[Row]]:
    n = len(matrix)
    largest = np.abs(matrix).max(axis=1)
    scale = np.array([2.0 ** -np.frexp(each)[1] if each else 1.0 for each in largest])  # powers of two: nothing is rounded
    both = np.hstack([matrix * scale[:, np.newaxis], np.eye(n)])
    open_rows, open_columns = np.ones(n, dtype=bool), np.ones(n, dtype=bool)
    row_of: dict[int, int] = {}
    while True:
        sizes = np.abs(both[:, :n]) * open_rows[:, np.newaxis] * open_columns
        size = sizes.max()
        if not size > NOTHING:
            break
        # Of the largest, one on the diagonal, so that equations stay in their rows where they can.
        rows, columns = np.nonzero(sizes == size)
        place = int(np.argmax(rows == columns))
        pivot, column = int(rows[place]), int(columns[place])
        both[pivot] /= both[pivot, column]
        both[pivot, column] = 1.0
        for other in np.flatnonzero(both[:, column]):
            if other != pivot:
                both[other] -= both[other, column] * both[pivot]
                both[other, column] = 0.0
        row_of[column] = pivot
        open_rows[pivot], open_columns[column] = False, False
    for free, left in zip(np.flatnonzero(open_columns), np.flatnonzero(open_rows), strict=True):
        row_of[int(free)] = int(left)
        both[left, :n] = 0.0
    ordered = both[[row_of[number] for number in range(n)]]
    return _sparse(ordered[:, n:], scale), _sparse(ordered[:, :n], np.ones(n))


def _sparse(matrix: Array, scale: Array) -> list[Row]:
    """The rows without what is rounding beside their largest entry, each column times its scale."""
    kept = np.abs(matrix) > NOTHING * np.abs(matrix).max(axis=1, keepdims=True, initial=0.0)
    scaled = matrix * scale
    return [
        [(int(column), float(row[column])) for column in np.flatnonzero(of_row)] for row, of_row in zip(scaled, kept, strict=True)
    ]
