"""Arithmetic with more than 53 bits, without fused multiply-adds, and common first and last parts of functions.

A number of about 106 bits is the sum of two, of which the second is at most half a unit in the last place of the first.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ..bits import and_bits, shift_up, where

#: The first 26 bits of a number's 53. A product of two such numbers is exact.
UPPER = 0xFFFF_FFFF_F800_0000
#: 1.5·2⁵²: a number added to it is rounded to a whole one, which then stands in the low bits.
MAGIC = 6755399441055744.0
#: The exponent's bits of 1.
BIAS = 1023.0


def polynomial(x: Any, coefficients: Sequence[float]) -> Any:
    """c₀ + x·(c₁ + x·(c₂ + …))."""
    value: Any = coefficients[-1]
    for c in coefficients[-2::-1]:
        value = c + x * value
    return value


def by_parity(x: Any, z: Any, coefficients: Sequence[float]) -> Any:
    """The same polynomial, with z = x²: even and odd powers are summed apart, so that neither sum waits for the other."""
    return polynomial(z, coefficients[::2]) + x * polynomial(z, coefficients[1::2])


def halves(x: Any) -> tuple[Any, Any]:
    """The first 26 bits, and the other 27."""
    upper = and_bits(x, UPPER)
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
    """2ⁿ of a whole number from −1022 to 1023; 0 of −1023."""
    return shift_up(n + (MAGIC + BIAS), 52)


def magic(low: Any) -> Any:
    """What a number is added to for ``scaled``: it is rounded as by ``MAGIC``, and an exponent's bits stand in the low ones."""
    return where(low, MAGIC + (BIAS + 100.0), MAGIC + (BIAS - 1.0))


def scaled(x: Any, turn: Any, low: Any) -> Any:
    """x·2ⁿ, rounded once, for |x| near 1 and n from −1100 to 1024; ``turn`` is n + ``magic(low)``.

    No single number of normal size is 2ⁿ for all of these, so there are two factors: one of them is 2⁻¹⁰⁰ or 2. ``low`` is true
    where n < 0, perhaps also where n = 0.
    """
    return (x * shift_up(turn, 52)) * where(low, 2.0**-100, 2.0)
