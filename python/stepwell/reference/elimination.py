"""Linear equations of a few unknowns whose matrix is symmetric and positive definite: elimination in a fixed order, LDLᵀ.

Nothing is exchanged by its size, so that a step has no branch; a matrix of this kind does not need it (Golub and Van Loan,
*Matrix Computations*, §4.2). A matrix is given by the rows of its lower triangle. None is an entry that is zero whatever the
state is, and its terms are left out.
"""

from __future__ import annotations

from typing import Any

#: Of each row the factors left of the diagonal, and the diagonal.
Factors = tuple[list[list[Any]], list[Any]]


def factored(rows: list[list[Any]]) -> Factors:
    """L without its ones, and D."""
    rows = [list(row) for row in rows]
    below: list[list[Any]] = [[None] * i for i in range(len(rows))]
    for j, pivot_row in enumerate(rows):
        touched = [i for i in range(j + 1, len(rows)) if rows[i][j] is not None]
        for i in touched:
            below[i][j] = factor = rows[i][j] / pivot_row[j]
            for k in touched:
                if k > i:
                    break
                term = factor * rows[k][j]
                rows[i][k] = -term if rows[i][k] is None else rows[i][k] - term
    return below, [row[-1] for row in rows]


def solved(factors: Factors, right: list[Any]) -> list[Any]:
    """The unknowns, from the right-hand sides. None is 0 whatever the state is, on either side."""
    below, pivots = factors
    x = list(right)

    def less(from_: int, factor: Any, known: int) -> None:
        if factor is not None and x[known] is not None:
            term = factor * x[known]
            x[from_] = -term if x[from_] is None else x[from_] - term

    for i, row in enumerate(below):
        for j, factor in enumerate(row):
            less(i, factor, j)
    for j in reversed(range(len(x))):
        if x[j] is not None:
            x[j] = x[j] / pivots[j]
        for i in range(j + 1, len(x)):
            less(j, below[i][j], i)
    return x
