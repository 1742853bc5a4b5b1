"""Roots and squares."""

from __future__ import annotations

from typing import Any, NamedTuple

from ..bits import PRECISIONS, PerPrecision, either_bits, equal, magnitude, or_bits, shift_down, shift_up, sign_of, where
from ..bits import sqrt as root
from .elementary import elementary
from .pieces import INFINITY, fast_sum, halves


class Constants(NamedTuple):
    """Constants of one precision. All are powers of two but the start.

    Attributes:
        exponent_place: the lowest bit of those that the cube root starts from.
        cube_start: this minus a third of these bits of |x| gives those of x^(−1/3), with an error of at most 3.5 %.
        small: the cube root of a number below this is that of a larger one.
        small_factors: by how much that is larger, and by how much its cube root is smaller.
        lengths: a hypotenuse is scaled if its longer side is below the first or above the second.
        short_factors: its scale below the first, and the inverse of it.
        long_factors: its scale above the second, and the inverse of it.
    """

    exponent_place: int
    cube_start: float
    small: float
    small_factors: tuple[float, float]
    lengths: tuple[float, float]
    short_factors: tuple[float, float]
    long_factors: tuple[float, float]


CONSTANTS = PerPrecision(
    double=Constants(
        exponent_place=32,
        cube_start=1430185000.0,
        small=2.0**-900,
        small_factors=(2.0**300, 2.0**-100),
        lengths=(2.0**-400, 2.0**500),
        short_factors=(2.0**600, 2.0**-600),
        long_factors=(2.0**-600, 2.0**600),
    ),
    single=Constants(
        exponent_place=8,
        cube_start=5546525.0,
        small=2.0**-100,
        small_factors=(2.0**60, 2.0**-20),
        lengths=(2.0**-40, 2.0**60),
        short_factors=(2.0**100, 2.0**-100),
        long_factors=(2.0**-70, 2.0**70),
    ),
)


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
    """Cube root of x, from x^(−1/3) by Newton's method, which needs no division, and a last step with more digits than x has."""
    constants, precision = CONSTANTS.of(x), PRECISIONS.of(x)
    whole, place = precision.first_whole, constants.exponent_place
    y = magnitude(x)
    small = y < constants.small
    a = where(small, y * constants.small_factors[0], y)
    third = (or_bits(shift_down(a, place), precision.pattern(whole)) - whole) * (-1.0 / 3.0)
    inverse = shift_up(third + (whole + constants.cube_start), place)
    for _ in range(2):  # from 3.5 % to 2e-4, and to 2e-11 or rounding
        e = 1.0 - a * (inverse * inverse * inverse)
        inverse = inverse + inverse * (e * (1.0 / 3.0 + 2.0 / 9.0 * e))
    t, _ = halves((a * inverse) * inverse)
    t2 = t * t  # exact
    (t3, t4) = halves(t2)
    e = ((a - t3 * t) - t4 * t) * ((inverse * inverse) * inverse)  # 1 − t³/a
    value = (t + t * (e * (1.0 / 3.0 + 2.0 / 9.0 * e))) * where(small, constants.small_factors[1], 1.0)
    return either_bits(where(y < INFINITY, where(y > 0.0, value, y), y), sign_of(x))


@elementary
def hypot(x: Any, y: Any) -> Any:
    """√(x² + y²), without overflow or underflow in between; ∞ if one is infinite, even if the other is NaN."""
    x, y = magnitude(x), magnitude(y)
    swap = x < y
    a, b = where(swap, y, x), where(swap, x, y)
    constants = CONSTANTS.of(x)
    large, small = a > constants.lengths[1], a < constants.lengths[0]
    (longer, shorter_again), (shorter, longer_again) = constants.short_factors, constants.long_factors
    scale = where(large, shorter, where(small, longer, 1.0))
    back = where(large, longer_again, where(small, shorter_again, 1.0))
    p, q = a * scale, b * scale
    (p1, p2), (q1, q2) = halves(p), halves(q)
    # p² + q² with more digits than numbers have, and its root by one step from the rounded one.
    p_rest, q_rest = p2 * (p + p1), q2 * (q + q1)
    s, lost = fast_sum(p1 * p1, q1 * q1)
    lost = lost + (p_rest + q_rest)
    h = root(s + lost)
    h1, h2 = halves(h)
    rest = (s - h1 * h1) - h2 * (h + h1) + lost
    value = (h + rest * where(h > 0.0, 0.5 / h, 0.0)) * back
    return where(equal(a, INFINITY), INFINITY, where(equal(b, INFINITY), INFINITY, value))
