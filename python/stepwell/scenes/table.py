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
            found = np.tensordot(_shares(BETWEEN), block[:, : len(NODES)], axes=(1, 1)).swapaxes(0, 1)
            missed = np.abs(found - block[:, len(NODES) :]).reshape(len(begins), -1).max(axis=1, initial=0.0)
            close_enough &= missed <= close * scale
        v, y = (block[close_enough, : len(NODES)] for block in blocks)
        good.append((begins[close_enough], np.full(len(v), length), v, y))
        left, length = begins[~close_enough], 0.5 * length
        begins = np.sort(np.concatenate([left, left + length]))
    starts, lengths, v, y = (np.concatenate(each) for each in zip(*good, strict=True))
    order = np.argsort(starts)
    starts, lengths, tables = starts[order], lengths[order], (v[order], y[order])

    def answer(t: Array) -> tuple[Array, Array]:
        piece = np.clip(np.searchsorted(starts, t, "right") - 1, 0, len(starts) - 1)
        shares = _shares((t - starts[piece]) / lengths[piece])
        found = []
        for table in tables:
            value = np.zeros((len(t), *table.shape[2:]))
            for j in range(len(NODES)):
                value += shares[:, j].reshape(-1, *(1,) * (table.ndim - 2)) * table[piece, j]
            found.append(value)
        return found[0], found[1]

    return answer


def _shares(u: Array) -> Array:
    """What each node counts for in the polynomial through all at places u within an interval, shape (places, nodes)."""
    shares = np.ones((len(u), len(NODES)))
    for j in range(len(NODES)):
        for m in range(len(NODES)):
            if m != j:
                shares[:, j] *= (u - NODES[m]) / (NODES[j] - NODES[m])
    return shares
