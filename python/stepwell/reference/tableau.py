"""Explicit Runge-Kutta methods by their tableau, as the papers print them: weights of increments, zeros left out of the sums."""

from collections.abc import Sequence
from typing import Any

from ..base.arrays import Array, Blocks, Scaled

Weights = Sequence[float]
Increments = list[tuple[Array, Array]]


def stages(nodes: Weights, rows: Sequence[Weights], s: Scaled, t: float, h: float, v: Array, y: Array) -> Increments:
    """The increments of both blocks, one stage after the other."""
    increments: Increments = []
    for node, row in zip(nodes, rows, strict=True):
        at = t + node * h if node not in (0.0, 1.0) else t + h if node else t
        vi, yi = plus(v, y, row, increments) if row else (v, y)
        increments.append((s.dv(at, vi, yi), s.dy(at, vi, yi)))
    return increments


def plus(v: Array, y: Array, weights: Weights, increments: Increments) -> Blocks:
    """Both blocks and the weighted sums of their increments."""
    dv, dy = combined(weights, increments)
    return v + dv, y + dy


def powers(weights: Sequence[Weights], increments: Increments) -> Increments:
    """The coefficients of the powers of θ in the state at the share θ of a step: a continuous extension of the method."""
    return [combined(row, increments) for row in weights]


def polynomial(start: Any, terms: Sequence[Array], share: Any) -> Array:
    """A start, and the sum of terms times powers of a share from the first on: odd and even powers apart, by Horner's rule.

    The start comes last, so that it is rounded once.
    """
    square = share * share

    def summed(powers: Sequence[Array]) -> Any:
        total = powers[-1]
        for term in reversed(powers[:-1]):
            total = term + square * total
        return total

    odd, even = summed(terms[::2]), summed(terms[1::2])
    end: Array = start + share * (odd + share * even)
    return end


def combined(weights: Weights, increments: Increments) -> Blocks:
    """The weighted sums of the increments of both blocks, from the left."""
    terms = [(c, dv, dy) for c, (dv, dy) in zip(weights, increments, strict=True) if c != 0.0]
    (c, dv, dy), *rest = terms
    v, y = c * dv, c * dy
    for c, dv, dy in rest:
        v, y = v + c * dv, y + c * dy
    return v, y
