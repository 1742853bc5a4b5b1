"""Arithmetic with more digits than numbers have, without fused multiply-adds, and common first and last parts of functions.

A number of twice as many digits is the sum of two, of which the second is at most half a unit in the last place of the first.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ..bits import PRECISIONS, and_bits, shift_up

INFINITY, NAN = float("inf"), float("nan")


def polynomial(x: Any, coefficients: Sequence[float]) -> Any:
    """c₀ + x·(c₁ + x·(c₂ + …))."""
    value: Any = coefficients[-1]
    for c in coefficients[-2::-1]:
        value = c + x * value
    return value


def by_parity(x: Any, z: Any, coefficients: Sequence[float]) -> Any:
    """A polynomial, with z = x²: even and odd powers are summed apart, so that neither sum waits for the other."""
    return polynomial(z, coefficients[::2]) + x * polynomial(z, coefficients[1::2])


def halves(x: Any) -> tuple[Any, Any]:
    """The first half of the digits, 26 of 53 or 12 of 24, and the other one."""
    upper = and_bits(x, PRECISIONS.of(x).upper_half)
    return upper, x - upper


def fast_sum(x: Any, y: Any) -> tuple[Any, Any]:
    """Sum, rounded, and its rounding error (Dekker); the exponent of x is at least that of y, or x is 0."""
    s = x + y
    return s, (x - s) + y


def quotient(n: Any, n_rest: Any, d: Any, d_rest: Any) -> tuple[Any, Any]:
    """(n + n_rest)/(d + d_rest) as a sum of two, by one division."""
    inverse = 1.0 / d
    q = n * inverse
    (q1, q2), (d1, d2) = halves(q), halves(d)
    rest = ((n - q1 * d1) - q1 * d2) - q2 * d1 - q2 * d2  # exact but for the last product
    return q, ((rest + n_rest) - q * d_rest) * inverse


def power_of_two(n: Any) -> Any:
    """2ⁿ of a whole number for which it is a normal number; 0 of the next one below these."""
    precision = PRECISIONS.of(n)
    return shift_up(n + (precision.magic + precision.bias), precision.fraction_bits)
