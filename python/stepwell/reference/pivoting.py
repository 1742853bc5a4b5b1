"""Linear equations with any matrix: elimination with rows exchanged by the size of their entries (partial pivoting).

A step has no branch, so the exchanges are choices: each later row is compared with the pivot's, and the larger entry wins. A
matrix is a list of rows. None is an entry that is zero whatever the state is, and its terms are left out; the order of the
unknowns keeps such zeros.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any, NamedTuple

from . import bits, ordering

#: Notes a part of an elimination: its word and its numbers, by their places.
Note = Callable[[str, dict[tuple[int, ...], Any]], None]
_note: ContextVar[Note | None] = ContextVar("note", default=None)


@contextmanager
def noting(note: Note) -> Iterator[None]:
    """Within this context the parts of each elimination are noted: matrix, exchange, reciprocal, factor and solution."""
    before = _note.set(note)
    try:
        yield
    finally:
        _note.reset(before)


class Factors(NamedTuple):
    """The factors of a matrix.

    Attributes:
        order: the unknowns, in the order of their elimination.
        exchanges: of each unknown the later rows with which its row was exchanged: where a comparison says so, or always (None).
        below: of each unknown the later rows that lost a multiple of its row, and the multiples.
        rows: the rows, in which the entries of later unknowns remain.
        over: the reciprocals of the diagonal.
    """

    order: list[int]
    exchanges: list[list[tuple[int, Any]]]
    below: list[list[tuple[int, Any]]]
    rows: list[list[Any]]
    over: list[Any]


def factored(matrix: list[list[Any]]) -> Factors:
    """The factors; without a pivot for an unknown they are not finite."""
    rows, left = [list(row) for row in matrix], list(range(len(matrix)))
    order = ordering.order([sum(1 << c for c, entry in enumerate(row) if entry is not None) for row in matrix])
    factors = Factors(order, [], [], rows, [])
    for k in order:
        left.remove(k)
        exchanges: list[tuple[int, Any]] = []
        for i in left:
            if rows[i][k] is None:
                continue
            larger = None if rows[k][k] is None else bits.less(bits.magnitude(rows[k][k]), bits.magnitude(rows[i][k]))
            for c in [k, *left]:
                rows[k][c], rows[i][c] = exchanged(larger, rows[k][c], rows[i][c])
            exchanges.append((i, larger))
        factors.exchanges.append(exchanges)
        factors.over.append(1.0 / (0.0 if rows[k][k] is None else rows[k][k]))
        factors.below.append([(i, rows[i][k] * factors.over[-1]) for i in left if rows[i][k] is not None])
        for i, factor in factors.below[-1]:
            for c in left:
                rows[i][c] = less(rows[i][c], product(factor, rows[k][c]))
    if (note := _note.get()) is not None:
        note("matrix", {(i, j): entry for i, row in enumerate(matrix) for j, entry in enumerate(row)})
        note("exchange", {(k, i): larger for k, each in zip(order, factors.exchanges, strict=True) for i, larger in each})
        note("reciprocal", {(k,): over for k, over in zip(order, factors.over, strict=True)})
        note("factor", {(i, k): factor for k, each in zip(order, factors.below, strict=True) for i, factor in each})
    return factors


def solved(factors: Factors, right: list[Any]) -> list[Any]:
    """The unknowns, from the right-hand sides."""
    x = list(right)
    for k, exchanges, below in zip(factors.order, factors.exchanges, factors.below, strict=True):
        for i, larger in exchanges:
            x[k], x[i] = exchanged(larger, x[k], x[i])
        for i, factor in below:
            x[i] = less(x[i], product(factor, x[k]))
    for place, k in reversed(list(enumerate(factors.order))):
        for c in reversed(factors.order[place + 1 :]):
            x[k] = less(x[k], product(factors.rows[k][c], x[c]))
        x[k] = x[k] * factors.over[place]
    if (note := _note.get()) is not None:
        note("solution", {(k,): each for k, each in enumerate(x)})
    return x


def exchanged(larger: Any, a: Any, b: Any) -> tuple[Any, Any]:
    """Both entries, exchanged where that is true; None is always."""
    if larger is None:
        return b, a
    if a is None and b is None:
        return None, None
    a, b = (0.0 if entry is None else entry for entry in (a, b))
    return bits.where(larger, b, a), bits.where(larger, a, b)


def product(a: Any, b: Any) -> Any:
    """a·b, None if one of them is."""
    return None if a is None or b is None else a * b


def less(entry: Any, term: Any) -> Any:
    """An entry without a term."""
    if term is None:
        return entry
    return -term if entry is None else entry - term
