"""A table of an exact solution that takes long to compute."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..base.arrays import Array, Shape
from ..base.immutable import ValueEquality

Exact = Callable[[Array], tuple[Array, Array]]

#: The number of intervals at first, and the most in all.
FIRST_INTERVALS, MAX_INTERVALS = 200, 20_000

#: The Chebyshev nodes of the interpolation in an interval, and points between nodes at which it is checked. Four suffice, because
#: the error of a polynomial through such nodes is similar between all of them, and each point costs a step of the run.
NODES = 0.5 - 0.5 * np.cos(np.linspace(0.0, np.pi, 14))
CHECK_POINTS = (0.5 * (NODES[1:] + NODES[:-1]))[[0, 4, 8, 12]]

#: For each node the product of its distances to the others.
NODE_PRODUCTS = [float(np.prod(node - np.delete(NODES, j))) for j, node in enumerate(NODES)]


def tabled(exact: Exact, until: float, scales: tuple[Array, Array], close: float) -> Exact:
    """A faster function, by a polynomial over each interval, that differs by at most ``close`` times the scales up to a time.

    The scales are those of the numbers of v and of y. Intervals are halved until that holds; if it takes too many, the function
    itself is returned.
    """
    begins, length, number = np.linspace(0.0, until, FIRST_INTERVALS, endpoint=False), until / FIRST_INTERVALS, 0
    good: list[tuple[Array, Array, Array, Array]] = []
    while len(begins):
        number += len(begins)
        if number > MAX_INTERVALS:
            return exact
        # At the nodes, and between them for the check.
        times = begins[:, np.newaxis] + length * np.concatenate([NODES, CHECK_POINTS])
        blocks = [block.reshape(*times.shape, *block.shape[1:]) for block in exact(np.minimum(times, until).ravel())]
        close_enough = np.ones(len(begins), dtype=bool)
        for block, scale in zip(blocks, scales, strict=True):
            approximated = np.tensordot(_shares(CHECK_POINTS), block[:, : len(NODES)], axes=(0, 1)).swapaxes(0, 1)
            near = np.abs(approximated - block[:, len(NODES) :]) <= close * scale
            close_enough &= near.reshape(len(begins), -1).all(axis=1)
        v, y = (block[close_enough, : len(NODES)] for block in blocks)
        good.append((begins[close_enough], np.full(len(v), length), v, y))
        left, length = begins[~close_enough], 0.5 * length
        begins = np.sort(np.concatenate([left, left + length]))
    starts, lengths, v, y = (np.concatenate(each) for each in zip(*good, strict=True))
    order = np.argsort(starts)
    starts, lengths = starts[order], lengths[order]
    # The numbers of a state are rows for each node, because operations on long rows are the fastest.
    tables = [np.ascontiguousarray(block[order].reshape(*block.shape[:2], -1).transpose(1, 2, 0)) for block in (v, y)]

    return Table(starts, lengths, tables, [block.shape[2:] for block in (v, y)])


class Table(ValueEquality):
    """A motion by a table: a polynomial over each interval; they begin at ``starts``, ascending.

    ``tables`` are the values of v and of y at the nodes, shape (nodes, numbers of the block, intervals).
    """

    def __init__(self, starts: Array, lengths: Array, tables: list[Array], shapes: list[Shape]) -> None:
        self.starts, self.lengths, self.tables, self.shapes = starts, lengths, tables, shapes

    def __call__(self, t: Array) -> tuple[Array, Array]:
        """Both blocks at these times."""
        piece = np.clip(np.searchsorted(self.starts, t, "right") - 1, 0, len(self.starts) - 1)
        shares = _shares((t - self.starts[piece]) / self.lengths[piece])
        blocks = []
        for table, shape in zip(self.tables, self.shapes, strict=True):
            value = np.zeros((table.shape[1], len(t)))
            for share, at_node in zip(shares, table, strict=True):
                value += share * np.take(at_node, piece, axis=1)
            blocks.append(np.ascontiguousarray(value.T).reshape(len(t), *shape))
        return blocks[0], blocks[1]


def _shares(u: Array) -> Array:
    """The weight of each node in the interpolating polynomial at places u of an interval, shape (nodes, places)."""
    away = u - NODES[:, np.newaxis]
    shares, product = np.empty_like(away), np.ones(len(u))
    for j in range(len(NODES)):  # times the distances to the nodes before it
        shares[j] = product / NODE_PRODUCTS[j]
        product *= away[j]
    product = np.ones(len(u))
    for j in reversed(range(len(NODES))):  # times those to the nodes after it
        shares[j] *= product
        product *= away[j]
    return shares
