"""Roots and squares."""

from __future__ import annotations

from typing import Any

from ..bits import either_bits, equal, magnitude, or_bits, shift_down, shift_up, sign_of, where
from ..bits import sqrt as root
from .elementary import elementary
from .pieces import fast_sum, halves

INFINITY = float("inf")
#: 2⁵²: its low bits hold a whole number.
TWO_52 = 4503599627370496.0
TWO_52_BITS = 0x4330000000000000
#: This minus a third of the upper 32 bits of |x| gives the upper bits of x^(−1/3), with an error of at most 3.5 %.
CUBE_START = 1430185000.0


@elementary
def sqrt(x: Any) -> Any:
    """Square root of x, correctly rounded; −0 for −0, NaN for negative numbers.

    Example:
        >>> print(sqrt(2.0))
        1.4142135623730951
    """
    return root(x)


@elementary
def square(x: Any) -> Any:
    """x·x."""
    return x * x


@elementary
def cbrt(x: Any) -> Any:
    """Cube root of x, from x^(−1/3) by Newton's method, which needs no division, and a last step to more than 53 bits."""
    y = magnitude(x)
    small = y < 2.0**-900
    a = where(small, y * 2.0**300, y)
    third = (or_bits(shift_down(a, 32), TWO_52_BITS) - TWO_52) * (-1.0 / 3.0)
    inverse = shift_up(third + (TWO_52 + CUBE_START), 32)
    for _ in range(2):  # from 3.5 % to 2e-4, and to 2e-11
        e = 1.0 - a * (inverse * inverse * inverse)
        inverse = inverse + inverse * (e * (1.0 / 3.0 + 2.0 / 9.0 * e))
    t, _ = halves((a * inverse) * inverse)
    t2 = t * t  # exact
    (t3, t4) = halves(t2)
    e = ((a - t3 * t) - t4 * t) * ((inverse * inverse) * inverse)  # 1 − t³/a
    value = (t + t * (e * (1.0 / 3.0 + 2.0 / 9.0 * e))) * where(small, 2.0**-100, 1.0)
    return either_bits(where(y < INFINITY, where(y > 0.0, value, y), y), sign_of(x))


@elementary
def hypot(x: Any, y: Any) -> Any:
    """√(x² + y²), without overflow or underflow in between; ∞ if one is infinite, even if the other is NaN."""
    x, y = magnitude(x), magnitude(y)
    swap = x < y
    a, b = where(swap, y, x), where(swap, x, y)
    large, small = a > 2.0**500, a < 2.0**-400
    scale = where(large, 2.0**-600, where(small, 2.0**600, 1.0))
    back = where(large, 2.0**600, where(small, 2.0**-600, 1.0))
    p, q = a * scale, b * scale
    (p1, p2), (q1, q2) = halves(p), halves(q)
    # p² + q² to more than 53 bits, and its root by one step from the rounded one.
    p_rest, q_rest = p2 * (p + p1), q2 * (q + q1)
    s, lost = fast_sum(p1 * p1, q1 * q1)
    lost = lost + (p_rest + q_rest)
    h = root(s + lost)
    h1, h2 = halves(h)
    rest = (s - h1 * h1) - h2 * (h + h1) + lost
    value = (h + rest * where(h > 0.0, 0.5 / h, 0.0)) * back
    return where(equal(a, INFINITY), INFINITY, where(equal(b, INFINITY), INFINITY, value))
