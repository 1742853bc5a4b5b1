"""Hyperbolic functions.

|x| = n·ln 2 + r, and sinh and cosh of that by the addition theorem, from 2ⁿ and 2⁻ⁿ, which are exact, and sinh r and cosh r,
which are short polynomials; ``docs/coefficients.py`` finds their coefficients.
"""

from __future__ import annotations

from math import ldexp
from typing import Any, NamedTuple

from ..bits import PerPrecision, either_bits, is_single, magnitude, sign_of, where
from .elementary import elementary
from .exponential import reduced as exponential
from .pieces import fast_sum, halves, polynomial, power_of_two, quotient


class Constants(NamedTuple):
    """Constants of one precision.

    Attributes:
        sinh: (sinh r − r)/r³ in powers of r².
        cosh: (cosh r − 1 − r²/2)/r⁴ in powers of r².
        identity_below: below it sinh x and tanh x round to x.
        overflow_from: from here on sinh x and cosh x are infinite.
        tanh_one_from: from here on tanh x rounds to 1.
        least_exponent: about the exponent of the least normal number, without its sign.
    """

    sinh: tuple[float, ...]
    cosh: tuple[float, ...]
    identity_below: float
    overflow_from: float
    tanh_one_from: float
    least_exponent: float


CONSTANTS = PerPrecision(
    double=Constants(
        sinh=(
            0.16666666666666677,
            0.008333333333321454,
            0.00019841269886514685,
            2.7557243862350308e-06,
            2.5109145832168022e-08,
        ),
        cosh=(
            0.041666666666666685,
            0.001388888888887332,
            2.4801587349060595e-05,
            2.755725199229993e-07,
            2.0921702372435563e-09,
        ),
        identity_below=2.0**-28,
        overflow_from=710.6,
        tanh_one_from=22.0,
        least_exponent=1000.0,
    ),
    single=Constants(
        sinh=(0.1666666716337204, 0.008333191275596619, 0.00019959326891694218),
        cosh=(0.04166645556688309, 0.0013935758033767343),
        identity_below=2.0**-13,
        overflow_from=89.6,
        tanh_one_from=10.0,
        least_exponent=100.0,
    ),
)


def _half(x: Any) -> tuple[Any, Any]:
    """Half of sinh |x| and half of cosh |x|; their double may be infinite."""
    constants = CONSTANTS.of(x)
    x = where(x > constants.overflow_from, constants.overflow_from, x)
    n, _, upper, lower, r, z = exponential(x)
    growing = power_of_two(n - 2.0)
    falling = power_of_two(constants.least_exponent - n) * ldexp(1.0, -int(constants.least_exponent) - 2)
    first, second = halves(upper)  # a product with the first half is exact where exactness is needed
    rest_of_sinh = (second - lower) + (z * r) * polynomial(z, constants.sinh)
    rest_of_cosh = z * (0.5 + z * polynomial(z, constants.cosh))
    # Half of sinh and of cosh of n·ln 2, each with its rest.
    odd, even = fast_sum(growing, -falling), fast_sum(growing, falling)

    def added(one: Any, other: Any) -> Any:
        s, lost = fast_sum(one[0], other[0] * first)
        return s + (lost + ((one[0] * rest_of_cosh + other[0] * rest_of_sinh) + one[1]))

    return added(odd, even), added(even, odd)


@elementary
def sinh(x: Any) -> Any:
    """Hyperbolic sine of x.

    Example:
        >>> print(sinh(1.0))
        1.1752011936438014
    """
    y = magnitude(x)
    sine, _ = _half(y)
    return either_bits(where(y < CONSTANTS.of(x).identity_below, y, sine * 2.0), sign_of(x))


@elementary
def cosh(x: Any) -> Any:
    """Hyperbolic cosine of x."""
    _, cosine = _half(magnitude(x))
    return cosine * 2.0


@elementary
def tanh(x: Any) -> Any:
    """Hyperbolic tangent of x: (e²ˣ − 1)/(e²ˣ + 1), each with more digits than numbers have."""
    constants = CONSTANTS.of(x)
    y = magnitude(x)
    p = exponential(2.0 * where(y > constants.tanh_one_from, constants.tanh_one_from, y))
    rest = p.rest() if is_single(x) else None  # of few terms, and first of all
    inverse = power_of_two(-p.n)
    pairs = []
    for part in (-inverse, inverse):  # e²ˣ − 1 and e²ˣ + 1, divided by 2ⁿ
        one, one_rest = fast_sum(1.0, part)
        s, lost = fast_sum(one, p.upper)
        pairs.append(fast_sum(s, lost + ((p.accurate_rest() if rest is None else rest) + one_rest)))
    q, q_rest = quotient(*pairs[0], *pairs[1])
    return either_bits(where(y < constants.identity_below, y, q + q_rest), sign_of(x))
