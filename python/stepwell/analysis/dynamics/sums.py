"""Linear sums of a state that no rate changes, as of the species that an enzyme is bound in: a motion keeps their values."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ...base.arrays import Array, Whole
from ...model.systems import System
from ..stability import maps
from .at_state import linearised, rates_at

#: Rates are compared at twice this many more places than a state has numbers, half of them with random signs, derivatives at
#: ``PLACES`` of them. A place is a start whose numbers are changed by random factors, e^x with x of this deviation.
MORE_PLACES, PLACES, DEVIATION = 8, 3, 1.5
#: A sum is constant if its rate is below this share of its terms, and its derivative by each number as well: the first if all
#: weights are simple, else the second, since they were computed.
CONSTANT = 1e-11, 1e-8
#: A weight that is a whole number of halves, …, twelfths up to this is exactly that; others stay as they were computed.
MOST_PARTS, SIMPLE = 12, 1e-9
#: A sum is solved for the largest of its terms; numbers that are smaller than this share of the largest count as that.
LEAST_SHARE = 1e-3


class Sums(NamedTuple):
    """Constant sums, each solved for one number of the state.

    Attributes:
        kept: the places of those numbers, shape (sums,).
        free: the places of all others, shape (n − sums,).
        ratios: how much a kept number falls where a free one rises by 1, shape (sums, n − sums).
        first: the first number that tells equilibria apart: where ẏ = v, the velocities before it are zero at all of them.
    """

    kept: Whole
    free: Whole
    ratios: Array
    first: int = 0

    @property
    def weights(self) -> Array:
        """The weights of each number in each sum, shape (sums, n)."""
        weights = np.zeros((len(self.kept), len(self.kept) + len(self.free)))
        weights[:, self.kept], weights[:, self.free] = np.eye(len(self.kept)), self.ratios
        return weights

    def reduced(self, matrix: Array) -> Array:
        """The derivative of the free rates by the free numbers, with all sums as they are, shape (free, free, *members)."""
        rows = matrix[self.free]
        return np.asarray(rows[:, self.free] - np.einsum("ik...,kj->ij...", rows[:, self.kept], self.ratios))

    def at(self, matrix: Array) -> Sums:
        """Return these sums, or none if the derivatives of the rates at a place show that one is not constant there."""
        if _changes(self.weights, matrix, CONSTANT[1]).any():
            return none(len(matrix), self.first)
        return self

    def whole(self, change: Array) -> Array:
        """The change of all numbers, shape (n, …), for one of the free numbers."""
        every = np.empty((len(self.kept) + len(self.free), *change.shape[1:]))
        every[self.free], every[self.kept] = change, -self.ratios @ change
        return every


def none(n: int, first: int = 0) -> Sums:
    """No sum of n numbers."""
    return Sums(np.arange(0), np.arange(n), np.zeros((0, n)), first)


def _changes(weights: Array, columns: Array, share: Any) -> Any:
    """Which sums of the rows are more than a share of their terms in some column."""
    return (np.abs(weights @ columns) > share * (np.abs(weights) @ np.abs(columns))).any(axis=1)


def constant_sums(system: System, starts: Array, t: float) -> Sums:
    """The linear sums that are constant in every motion of a system of one member, from its rates at random places.

    The places are near ``starts``, shape (n, starts). Momenta are left out where ẏ = v: they are zero at rest, whatever the start
    has.
    """
    n, (n_v, _) = len(starts), maps.size(system)
    size, drawn = np.abs(starts).max(axis=1), np.random.default_rng(n)
    places = np.exp(DEVIATION * drawn.normal(size=(n, 2 * (n + MORE_PLACES))))
    places *= np.where(size > 0.0, size, size.max() or 1.0)[:, np.newaxis]
    places[:, ::2] *= drawn.choice((-1.0, 1.0), size=places[:, ::2].shape)
    rates = rates_at(system, *maps.blocks(system, places), t)
    usable = np.isfinite(rates).all(axis=0) & rates.any(axis=0)
    rates, places = rates[:, usable], places[:, usable]
    first = n_v if n_v and rates.size and np.array_equal(rates[n_v:], places[:n_v]) else 0
    if rates.shape[1] <= n:
        return none(n, first)
    unit = np.abs(rates).max(axis=1)
    unit = np.where(unit > 0.0, unit, 1.0)[:, np.newaxis]
    vectors, singular, _ = np.linalg.svd(rates / unit / np.abs(rates / unit).max(axis=0), full_matrices=False)
    null = vectors[:, singular <= CONSTANT[0] * singular[0]].T / unit[:, 0]
    weights, simple, kept = _solved(null, np.maximum(size, LEAST_SHARE * size.max() or 1.0), first)
    constant = np.ones(len(kept), dtype=np.bool_)
    if len(kept):
        matrix = linearised(system, *maps.blocks(system, places[:, :PLACES]), t)[0]
        for each in (rates, *np.moveaxis(matrix, 2, 0)):
            constant &= ~_changes(weights, each, np.where(simple, *CONSTANT)[:, np.newaxis])
    if not constant.any() or len(kept) == n:
        return none(n, first)
    free = np.setdiff1d(np.arange(n), kept[constant])
    return Sums(kept[constant], free, weights[constant][:, free], first)


def _solved(null: Array, size: Array, first: int) -> tuple[Array, Whole, Whole]:
    """Sums that each have the weight 1 at a number that is in no other, one of its largest from number ``first`` on.

    Returns:
        The weights, which sums have simple ones only, and the places of the numbers.
    """
    weights, kept = null / np.abs(null * size).max(axis=1, keepdims=True, initial=0.0), []
    for k in range(len(weights)):
        terms = np.abs(weights[k:, first:] * size[first:])
        if not terms.max(initial=0.0) > SIMPLE:
            weights = weights[:k]
            break
        row, column = (int(i) for i in np.unravel_index(terms.argmax(), terms.shape))
        kept.append(first + column)
        weights[[k, k + row]] = weights[[k + row, k]]
        weights[k] /= weights[k, kept[-1]]
        others = np.arange(len(weights)) != k
        weights[others] -= np.outer(weights[others, kept[-1]], weights[k])
    simple = np.round(weights)
    for parts in range(2, MOST_PARTS + 1):
        nearest = np.round(parts * weights) / parts
        simple = np.where(np.abs(weights - simple) > SIMPLE, nearest, simple)
    near = np.abs(weights - simple) <= SIMPLE
    return np.where(near, simple, weights), near.all(axis=1), np.array(kept, dtype=np.int64)
