"""A motion that takes long to compute, from a table."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .._checks import Array

Exact = Callable[[Array], tuple[Array, Array]]

#: Intervals at first, and at most.
FEWEST, MOST = 200, 20_000

#: Where in an interval the table has the motion, at Chebyshev's places, and where it is looked at, once between each two.
NODES = 0.5 - 0.5 * np.cos(np.linspace(0.0, np.pi, 12))
BETWEEN = 0.5 * (NODES[1:] + NODES[:-1])

#: The product of a node's distances to the others.
APART = [float(np.prod(node - np.delete(NODES, j))) for j, node in enumerate(NODES)]


def tabled(exact: Exact, until: float, scales: tuple[float, float], close: float) -> Exact:
    """A quicker function that is the same within ``close``, in the scales, up to a time: by a polynomial over each interval.

    Intervals are halved until that is so; where it would take too many, it is the same function.
    """
    begins, length, number = np.linspace(0.0, until, FEWEST, endpoint=False), until / FEWEST, 0
    good: list[tuple[Array, Array, Array, Array]] = []
    while len(begins):
        number += len(begins)
        if number > MOST:
            return exact
        # At the nodes and between them, to see how good it is.
        asked = begins[:, np.newaxis] + length * np.concatenate([NODES, BETWEEN])
        blocks = [block.reshape(*asked.shape, *block.shape[1:]) for block in exact(np.minimum(asked, until).ravel())]
        close_enough = np.ones(len(begins), dtype=bool)
        for block, scale in zip(blocks, scales, strict=True):
            found = np.tensordot(_shares(BETWEEN), block[:, : len(NODES)], axes=(0, 1)).swapaxes(0, 1)
            missed = np.abs(found - block[:, len(NODES) :]).reshape(len(begins), -1).max(axis=1, initial=0.0)
            close_enough &= missed <= close * scale
        v, y = (block[close_enough, : len(NODES)] for block in blocks)
        good.append((begins[close_enough], np.full(len(v), length), v, y))
        left, length = begins[~close_enough], 0.5 * length
        begins = np.sort(np.concatenate([left, left + length]))
    starts, lengths, v, y = (np.concatenate(each) for each in zip(*good, strict=True))
    order = np.argsort(starts)
    starts, lengths = starts[order], lengths[order]
    # For each node the numbers of a state as rows, for operations on long rows are the quick ones.
    tables = [np.ascontiguousarray(block[order].reshape(*block.shape[:2], -1).transpose(1, 2, 0)) for block in (v, y)]

    def answer(t: Array) -> tuple[Array, Array]:
        piece = np.clip(np.searchsorted(starts, t, "right") - 1, 0, len(starts) - 1)
        shares = _shares((t - starts[piece]) / lengths[piece])
        found = []
        for table, block in zip(tables, (v, y), strict=True):
            value = np.zeros((table.shape[1], len(t)))
            for share, at_node in zip(shares, table, strict=True):
                value += share * np.take(at_node, piece, axis=1)
            found.append(np.ascontiguousarray(value.T).reshape(len(t), *block.shape[2:]))
        return found[0], found[1]

    return answer


def _shares(u: Array) -> Array:
    """What each node counts for in the polynomial through all at places u within an interval, shape (nodes, places)."""
    away = u - NODES[:, np.newaxis]
    shares, product = np.empty_like(away), np.ones(len(u))
    for j in range(len(NODES)):  # times the distances to the nodes before it
        shares[j] = product / APART[j]
        product *= away[j]
    product = np.ones(len(u))
    for j in reversed(range(len(NODES))):  # times those to the nodes after it
        shares[j] *= product
        product *= away[j]
    return shares
