"""Symplectic correctors of Wisdom and Holman's method (Wisdom, Holman and Touma 1996).

A step of kick, drift and kick moves in coordinates of its own, which differ from the true ones by terms in the masses of the
planets. To the first power in these, the generator of the difference is ((x/2)·coth(x/2) − 1)/x of the kick, x being h times the
bracket with Kepler's motion. A kick at another time, taken back at the opposite one, is an odd function sinh(a·x) of it; a sum
of those has as many powers of x right as it has terms.
"""

import math
from fractions import Fraction
from functools import cache
from typing import Any

from ..base.arrays import Array, Blocks
from .splitting import drift, kick

#: Of each order how many times there are: it is correct up to that power of the step.
TIMES = {3: 1, 5: 2, 7: 3, 11: 5, 17: 8}

#: The square of the first time as a share of the step; the others are its multiples.
FIRST_SQUARED = Fraction(7, 40)

#: B₂, B₄, …, B₁₆
BERNOULLI = tuple(Fraction(*pair) for pair in ((1, 6), (-1, 30), (1, 42), (-1, 30), (5, 66), (-691, 2730), (7, 6), (-3617, 510)))


@cache
def terms(order: int) -> tuple[tuple[float, float], ...]:
    """Times and kicks as shares of the step: Σ 2·b·sinh(a·x) = ½·((x/2)·coth(x/2) − 1)/x + O(x^order)."""
    n = TIMES[order]
    # c = 2·a·b solves Σ c·(a²)ᵏ = ½·w·(2k + 1)!, w = B₂ₖ₊₂/(2k + 2)!: equations in whole multiples of FIRST_SQUARED.
    rows = [[pow(FIRST_SQUARED * i * i, k) for i in range(1, n + 1)] + [BERNOULLI[k] / (2 * (2 * k + 2))] for k in range(n)]
    for p in range(n):  # by Gauss and Jordan; no pivot is zero
        rows[p] = [each / rows[p][p] for each in rows[p]]
        for q in range(n):
            if q != p:
                rows[q] = [each - rows[q][p] * by for each, by in zip(rows[q], rows[p], strict=True)]
    times = [i * math.sqrt(FIRST_SQUARED) for i in range(1, n + 1)]
    return tuple((a, float(row[-1]) / (2.0 * a)) for a, row in zip(times, rows, strict=True))


def corrected(s: Any, t: float, v: Array, y: Array, order: int) -> Blocks:
    """The coordinates of the method from the true ones."""
    for a, b in terms(order):
        v, y = _pair(s, t, v, y, a, b)
        v, y = _pair(s, t, v, y, -a, -b)
    return v, y


def uncorrected(s: Any, t: float, v: Array, y: Array, order: int) -> Blocks:
    """The inverse."""
    for a, b in reversed(terms(order)):
        v, y = _pair(s, t, v, y, a, -b)
        v, y = _pair(s, t, v, y, -a, b)
    return v, y


def _pair(s: Any, t: float, v: Array, y: Array, a: float, b: float) -> Blocks:
    """A kick at one time, and taken back at the opposite one; with −a it is its inverse."""
    v, y = drift(s, a, t, v, y)
    v = v + b * kick(s, t, v, y)
    v, y = drift(s, -2.0 * a, t, v, y)
    v = v + -b * kick(s, t, v, y)
    return drift(s, a, t, v, y)
