"""Powers: x to the power y is 2 to the power y·log₂|x|, with the logarithm and the product to more than 64 bits.

The logarithm goes as in fdlibm's ``e_pow.c``, with one interval of mantissas instead of two; ``docs/coefficients.py`` finds the
coefficients.
"""

from __future__ import annotations

import functools
from typing import Any, NamedTuple

import numpy as np

from ...base.checks import numbers
from ..bits import (
    PRECISIONS,
    PerPrecision,
    and_bits,
    clamp,
    either_bits,
    equal,
    floor,
    is_single,
    magnitude,
    sign_of,
    turn_bits,
    where,
)
from ..bits import sqrt as root
from .elementary import elementary
from .exponential import CONSTANTS as EXPONENTIAL
from .exponential import exp2_of_sum
from .logarithms import exponent_and_rest
from .pieces import INFINITY, NAN, by_parity, halves


class Constants(NamedTuple):
    """The constants of a precision.

    Attributes:
        log_long: 3·(artanh s − s − s³/3)/s⁵ in powers of s².
        two_thirds_log2_e: 2/(3·ln 2): a first part of 26 or 12 bits, the rest, and rounded as a whole.
        largest_exponent: with an exponent of this size the power is 0 or infinity for all numbers except 1: in float64
            log₂(1 ± 2⁻⁵³) times it is beyond ±2⁹, in float32 log₂(1 ± 2⁻²⁴) times it.
    """

    log_long: tuple[float, ...]
    two_thirds_log2_e: tuple[float, float, float]
    largest_exponent: float


CONSTANTS = PerPrecision(
    double=Constants(
        log_long=(
            0.6000000000000356,
            0.42857142855077796,
            0.3333333379099096,
            0.272726756868231,
            0.23080171936530056,
            0.19884461675660128,
            0.1980104338875592,
        ),
        two_thirds_log2_e=(0.9617967009544373, -7.028461650952758e-09, 0.9617966939259756),
        largest_exponent=2.0**64,
    ),
    single=Constants(
        log_long=(0.5999999642372131, 0.4285793602466583, 0.3327159285545349, 0.292916864156723),
        two_thirds_log2_e=(0.961669921875, 0.00012677205086220056, 0.9617966939259756),
        largest_exponent=2.0**33,
    ),
)
#: Whole and half exponents up to this size are products.
LARGEST_PRODUCT = 16


def log2_in_two(x: Any) -> tuple[Any, Any]:
    """log₂ of a positive number: 26 or 12 bits, and the rest to more than 40 or 20."""
    constants, upper_half = CONSTANTS.of(x), PRECISIONS.of(x).upper_half
    k, m = exponent_and_rest(x)
    f = m - 1.0
    total = and_bits(m + 1.0, upper_half)
    total_rest = m - (total - 1.0)
    inverse = 1.0 / (m + 1.0)
    s = f * inverse
    s1, _ = halves(s)
    s2 = inverse * ((f - s1 * total) - s1 * total_rest)
    s = s1 + s2
    # s·(3 + s² + s⁴·P(s²)), where 3 + s² must be exact.
    z, z1 = s * s, s1 * s1
    square = z * z
    rest = square * by_parity(z, square, constants.log_long) + s2 * (s1 + s)
    t1 = and_bits((3.0 + z1) + rest, upper_half)
    t2 = rest - ((t1 - 3.0) - z1)
    u = s1 * t1
    v = s2 * t1 + t2 * s
    p1 = and_bits(u + v, upper_half)
    p2 = v - (p1 - u)
    first, second, whole = constants.two_thirds_log2_e
    w1 = first * p1
    w2 = second * p1 + p2 * whole
    upper = and_bits((w1 + w2) + k, upper_half)
    return upper, w2 - ((upper - k) - w1)


@elementary
def any_power(x: Any, y: Any) -> Any:
    """The power x^y, with the special values of C's pow."""
    a = magnitude(x)
    upper, lower = log2_in_two(a)
    largest = CONSTANTS.of(x).largest_exponent
    lowest, highest = EXPONENTIAL.of(x).lowest_power_of_two, EXPONENTIAL.of(x).highest_power_of_two
    # Both precisions select the same, but by different operations.
    single = is_single(x)
    e = clamp(y, -largest, largest) if single else where(y < -largest, -largest, where(y > largest, largest, y))
    e1, e2 = halves(e)
    p, p_rest = e1 * upper, e2 * upper + e * lower
    below, above = p < lowest, p > highest
    p = where(below, lowest, where(above, highest, p))
    p_rest = where(below | above, 0.0, p_rest) if single else where(below, 0.0, where(above, 0.0, p_rest))
    value = exp2_of_sum(p, p_rest)
    half = 0.5 * y
    whole, even = equal(floor(y), y), equal(floor(half), half)
    value = where(whole, value, where(x < 0.0, NAN, value))
    endless = equal(a, 0.0) | equal(a, INFINITY)  # the power is this number, or the other of the two
    value = where(endless, where(y < 0.0, turn_bits(a, INFINITY), a), value)
    value = either_bits(value, where(even, 0.0, where(whole, sign_of(x), 0.0)))
    value = where(equal(x, x) & equal(y, y), value, NAN)
    return where(equal(y, 0.0) | equal(x, 1.0), 1.0, value)


def _product(x: Any, n: int) -> Any:
    """Xⁿ: the product of those of x, x², x⁴, … whose exponents add up to n, the smallest first; None of n = 0."""
    value = None
    for place in range(n.bit_length()):
        x = x * x if place else x
        if n >> place & 1:
            value = x if value is None else value * x
    return value


@functools.cache
def _known_power(exponent: float) -> Any:
    """The function that raises x to a whole or half power."""
    whole = int(abs(exponent))

    @elementary
    def of(x: Any) -> Any:
        if exponent == 0.0:
            return where(equal(x, x), 1.0, 1.0)
        value: Any = _product(x, whole)
        if whole != abs(exponent):
            value = (value * root(x) if whole else root(x)) + 0.0  # √−0 becomes +0, as in C
        return 1.0 / value if exponent < 0.0 else value

    return of


def power(x: Any, y: Any) -> Any:
    """X to the power y.

    Args:
        x: a number, a symbol or an array.
        y: the same. If it is a number of Python or NumPy, and a multiple of ½ from −16 to 16, the power is a product: xⁿ is the
            product of those of x, x², x⁴, … whose exponents add up to n, the smallest first; it is then multiplied by √x if y is
            not whole, and 1 is divided by it if y is negative. For an array of exponents this does not hold.

    Returns:
        The power, at zeros, infinities and NaN as C's ``pow``, except that the square root of −∞ is NaN.

    Example:
        >>> print(power(2.0, 0.5), power(-8.0, 3))
        1.4142135623730951 -512.0
    """
    if isinstance(y, (int, float, np.integer, np.floating)) and not isinstance(y, bool):
        exponent = float(numbers("y", y, finite=False))
        if abs(exponent) <= LARGEST_PRODUCT and (2.0 * exponent).is_integer():
            return _known_power(exponent)(x)
    return any_power(x, y)
