"""Linear algebra of implicit methods: the Jacobian J at the start of a step, and the solution of (M − γhJ)·x = r.

M is the mass matrix of the system, or that of units. The derivatives are the coefficients of first order of the rates' Taylor
series along one number of the state, or along the time.
"""

from __future__ import annotations

import operator
from functools import reduce
from typing import Any

import numpy as np

from ..base.arrays import Array, Blocks
from . import pivoting
from .pivoting import less, product
from .series import Book, Series, as_objects, in_array
from .systems.equations import stacked


class Implicit:
    """The linear equations of a step that starts at this state.

    Where ẏ does not depend on y, as in a system of second order, y follows from v, and only v is solved for.
    """

    def __init__(self, s: Any, t: Any, v: Array, y: Array) -> None:
        #: Of both blocks the axes of one member; behind them are those of the batch.
        self.axes = getattr(s, "axes", (np.ndim(v), np.ndim(y)))
        self.v, self.y = np.asarray(v), np.asarray(y)
        self.of_v, self.of_y = len(self._rows(v, 0)), len(self._rows(y, 1))
        #: The entries of the mass matrix by row and column; None is the matrix of units.
        mass = getattr(s, "mass_matrix", None)
        self.mass = None if mass is None else [dict(row) for row in mass.rows]
        #: Of each number of the state the derivatives of all rates by it; None is zero whatever the state is.
        *self.by_state, self.time = self._derivatives(s, t)
        self.follows = bool(self.of_v and self.of_y) and all(
            derivative is None for by_y in self.by_state[self.of_v :] for derivative in by_y[self.of_v :]
        )

    def _rows(self, block: Any, which: int) -> list[Any]:
        """The numbers of a member, each over the batch."""
        block = np.asarray(block)
        return [block[index] for index in np.ndindex(block.shape[: self.axes[which]])]

    def _derivatives(self, s: Any, t: Any) -> list[list[Any]]:
        """The derivatives of all rates by each number of the state, and by the time. The rates are run once."""
        work, book = getattr(s, "work", None), Book()
        blocks = [np.frompyfunc(lambda each: Series(book, each, None), 1, 1)(block) for block in (self.v, self.y)]
        times = np.frompyfunc(lambda each: Series(book, each, None), 1, 1)(t)
        rates = s.dv(times, *blocks), s.dy(times, *blocks)
        if work is not None:
            s.work = work  # these rates push nothing
        seeds = [*(row for which, block in enumerate(blocks) for row in self._rows(block, which)), times]
        rows = [
            row
            for which, (rate, block) in enumerate(zip(rates, blocks, strict=True))
            for row in self._rows(np.broadcast_to(as_objects(rate), np.shape(block)), which)
        ]
        result = []
        for number in range(len(seeds)):
            for i, row in enumerate(seeds):
                for seed in np.asarray(row, dtype=object).flat:
                    seed.terms[1:] = [1.0 if i == number else None]
            book.advance(1)
            result.append([self._first_order(row) for row in rows])
            for each in book.series:
                del each.terms[1:]
        return result

    @staticmethod
    def _first_order(row: Any) -> Any:
        """The coefficients of first order of one rate, over the batch."""
        row = np.asarray(row, dtype=object)
        terms = [each.terms[1] if isinstance(each, Series) else None for each in row.flat]
        if all(term is None for term in terms):
            return None
        return in_array(terms, row.shape)[()]

    def _entry(self, gamma: float, rate: int, number: int) -> Any:
        """γ·h times the derivative of a rate by a number of the state."""
        derivative = self.by_state[number][rate]
        return None if derivative is None else gamma * derivative

    def _mass(self, row: int, column: int) -> float | None:
        if self.mass is None:
            return 1.0 if row == column else None
        return self.mass[row].get(column)

    def _factored(self, gamma: float) -> pivoting.Factors:
        everything = self.of_v + self.of_y
        n = self.of_v if self.follows else everything
        matrix: list[list[Any]] = [n * [None] for _ in range(n)]
        for i in range(n):
            by_way_of = [k for k in range(n, everything) if self.by_state[k][i] is not None]
            for j in range(n):
                entry = less(self._mass(i, j), self._entry(gamma, i, j))
                for k in by_way_of:
                    entry = less(entry, product(self._entry(gamma, i, k), self._entry(gamma, k, j)))
                matrix[i][j] = entry
        return pivoting.factored(matrix)

    def solve(self, gamma: float, right_v: Array, right_y: Array) -> Blocks:
        """X of (M − γhJ)·x = r, for both blocks."""
        factors, of_v = self._factored(gamma), self.of_v
        r_v, r_y = self._rows(right_v, 0), self._rows(right_y, 1)
        if not self.follows:
            x = pivoting.solved(factors, [*r_v, *r_y])
            return self._blocks(x[:of_v], x[of_v:])
        for i in range(of_v):
            for k, r in enumerate(r_y):
                r_v[i] = _plus(r_v[i], product(self._entry(gamma, i, of_v + k), r))
        x = pivoting.solved(factors, r_v)
        for k in range(self.of_y):
            for j in range(of_v):
                r_y[k] = _plus(r_y[k], product(self._entry(gamma, of_v + k, j), x[j]))
        return self._blocks(x, r_y)

    def square(self, v: Array, y: Array) -> Any:
        """The sum of the squares of all numbers of a member, from the first on."""
        squares = [row * row for row in (*self._rows(v, 0), *self._rows(y, 1))]
        return reduce(operator.add, squares)

    def by_time(self, h: Any) -> Blocks:
        """H times the derivatives of both rates by the time."""
        rows = [0.0 if each is None else h * each for each in self.time]
        return self._blocks(rows[: self.of_v], rows[self.of_v :])

    def _blocks(self, *rows: list[Any]) -> Blocks:
        v, y = (
            stacked(of, block.shape[:axes], block.shape[axes:])
            for of, block, axes in zip(rows, (self.v, self.y), self.axes, strict=True)
        )
        return v, y


def _plus(x: Any, term: Any) -> Any:
    return x if term is None else x + term
