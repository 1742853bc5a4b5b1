"""The order in which unknowns are eliminated, by the places of a matrix that may hold a number."""

from __future__ import annotations


def order(rows: list[int]) -> list[int]:
    """The unknowns in the order of their elimination, from the columns of each row, as the bits of a number.

    Of the unknowns that are left, the next is the one, or the first of several, whose rows have the fewest entries when each is
    as long as all of them together, as it is after exchanges that depend on numbers.
    """
    rows, left, unknowns = list(rows), list(range(len(rows))), []
    while left:
        unknown = min(left, key=lambda unknown: _entries(rows, left, unknown))
        among, columns = _candidates(rows, left, unknown)
        left.remove(unknown)
        unknowns.append(unknown)
        if among and not rows[unknown] >> unknown & 1:
            # Without an entry on the diagonal the first row that has one is taken in any case.
            first = among.pop(0)
            rows[unknown], rows[first] = rows[first], rows[unknown]
        for row in among:
            if row != unknown:
                rows[row] = columns & ~(1 << unknown)
    return unknowns


def _entries(rows: list[int], left: list[int], unknown: int) -> int:
    among, columns = _candidates(rows, left, unknown)
    return len(among) * columns.bit_count()


def _candidates(rows: list[int], left: list[int], unknown: int) -> tuple[list[int], int]:
    """The rows that may be taken for an unknown, and all columns that they have."""
    among, columns = [row for row in left if rows[row] >> unknown & 1], 0
    for row in among:
        columns |= rows[row]
    return among, columns
