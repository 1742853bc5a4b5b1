"""What tests of springs share."""

from __future__ import annotations

from typing import Any

import numpy as np
import stepwell as sw


def lattice(rows: int, columns: int, dim: int = 3, *, diagonals: bool = False) -> tuple[Any, Any]:
    """The springs of a lattice of unit lengths and the places of its particles."""
    at = np.arange(rows * columns).reshape(rows, columns)
    pairs = [(at[:, :-1], at[:, 1:]), (at[:-1], at[1:])]
    if diagonals:
        pairs += [(at[:-1, :-1], at[1:, 1:]), (at[:-1, 1:], at[1:, :-1])]
    places = np.zeros((rows * columns, dim))
    places[:, 0], places[:, 1] = np.tile(np.arange(columns), rows), np.repeat(np.arange(rows), columns)
    return np.concatenate([np.stack([i.ravel(), j.ravel()], axis=1) for i, j in pairs]), places


def tangled(seed: int, n: int, dim: int, springs: int, **options: Any) -> tuple[sw.Springs, dict[str, Any]]:
    """A net without any order, of unequal springs and particles, and a state of it."""
    rng = np.random.default_rng(seed)
    every = np.array([(i, j) for i in range(n) for j in range(n) if i < j])
    pairs = rng.permutation(every)[:springs]
    pairs = np.where(rng.random((len(pairs), 1)) < 0.5, pairs, pairs[:, ::-1])
    arguments = {"stiffness": rng.uniform(0.5, 2.0, len(pairs)), "rest": rng.uniform(0.0, 1.0, len(pairs))}
    arguments |= {"masses": rng.uniform(0.5, 2.0, n)} | options
    return sw.Springs(pairs, **arguments), {"v": rng.normal(size=(n, dim)), "y": rng.normal(size=(n, dim))}
