"""Hyperbolic functions.

|x| = n·ln 2 + r, and sinh and cosh of that by the addition theorem, from 2ⁿ and 2⁻ⁿ, which are exact, and sinh r and cosh r,
which are short polynomials; ``docs/coefficients.py`` finds their coefficients.
"""

from __future__ import annotations

from typing import Any

from ..bits import either_bits, magnitude, sign_of, where
from .elementary import elementary
from .exponential import LN2, LOG2_E
from .exponential import reduced as exponential
from .pieces import MAGIC, fast_sum, halves, polynomial, power_of_two, quotient

#: (sinh r − r)/r³ in powers of r².
SINH = (
    0.16666666666666677,
    0.008333333333321454,
    0.00019841269886514685,
    2.7557243862350308e-06,
    2.5109145832168022e-08,
)
#: (cosh r − 1 − r²/2)/r⁴ in powers of r².
COSH = (
    0.041666666666666685,
    0.001388888888887332,
    2.4801587349060595e-05,
    2.755725199229993e-07,
    2.0921702372435563e-09,
)
#: Below it sinh x and tanh x round to x.
IDENTITY_BELOW = 2.0**-28
#: From here on sinh x and cosh x are infinite.
OVERFLOW_FROM = 710.6
#: From here on tanh x rounds to 1.
TANH_ONE_FROM = 22.0


def _half(x: Any) -> tuple[Any, Any]:
    """Half of sinh |x| and half of cosh |x|; their double may be infinite."""
    x = where(x > OVERFLOW_FROM, OVERFLOW_FROM, x)
    n = (x * LOG2_E + MAGIC) - MAGIC
    upper, lower = x - n * LN2[0], n * LN2[1]
    r = upper - lower
    z = r * r
    growing, falling = power_of_two(n - 2.0), power_of_two(1000.0 - n) * 2.0**-1002
    first, second = halves(upper)  # a product with the first half is exact where exactness is needed
    rest_of_sinh = (second - lower) + (z * r) * polynomial(z, SINH)
    rest_of_cosh = z * (0.5 + z * polynomial(z, COSH))
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
    return either_bits(where(y < IDENTITY_BELOW, y, sine * 2.0), sign_of(x))


@elementary
def cosh(x: Any) -> Any:
    """Hyperbolic cosine of x."""
    _, cosine = _half(magnitude(x))
    return cosine * 2.0


@elementary
def tanh(x: Any) -> Any:
    """Hyperbolic tangent of x: (e²ˣ − 1)/(e²ˣ + 1), each to more than 53 bits."""
    y = magnitude(x)
    p = exponential(2.0 * where(y > TANH_ONE_FROM, TANH_ONE_FROM, y))
    inverse = power_of_two(-p.n)
    pairs = []
    for part in (-inverse, inverse):  # e²ˣ − 1 and e²ˣ + 1, divided by 2ⁿ
        one, one_rest = fast_sum(1.0, part)
        s, lost = fast_sum(one, p.upper)
        pairs.append(fast_sum(s, lost + (p.rest + one_rest)))
    q, rest = quotient(*pairs[0], *pairs[1])
    return either_bits(where(y < IDENTITY_BELOW, y, q + rest), sign_of(x))
