"""Symplectic correctors of Wisdom and Holman's method (Wisdom, Holman and Touma 1996).

A step of kick, drift and kick moves in coordinates of its own, which differ from the true ones by terms in the masses of the
planets. To the first power in these, the generator of the difference is ((x/2)·coth(x/2) − 1)/x of the kick, x being h times the
bracket with Kepler's motion. A kick at another time, taken back at the opposite one, is an odd function sinh(a·x) of it; a sum
of those has as many powers of x right as it has terms.
"""

import math
from typing import Any

from ..base.arrays import Array, Blocks
from .splitting import drift, kick

#: The time of the first kick as a share of the step; those of the others are its multiples.
FIRST = math.sqrt(7 / 40)

#: Of each order the kicks at these times, each as the fraction p/q = 2·a·b. With as many powers of x right as there are of them:
#: Σ (p/q)·a²ᵏ = B₂ₖ₊₂/(2·(2k + 2)) for k = 0, 1, …
KICKS = {
    3: ((1, 24),),
    5: ((4, 63), (-11, 504)),
    7: ((2893, 37044), (-16741, 370440), (541, 61740)),
}


def terms(order: int) -> tuple[tuple[float, float], ...]:
    """Times and kicks as shares of the step: Σ 2·b·sinh(a·x) = ½·((x/2)·coth(x/2) − 1)/x + O(x^order)."""
    return tuple((i * FIRST, p / q / (2.0 * i * FIRST)) for i, (p, q) in enumerate(KICKS[order], start=1))


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
