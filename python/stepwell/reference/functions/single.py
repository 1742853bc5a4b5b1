"""Elementary functions of float32, of symbols only: for numbers of 32 bits steps exist as tapes alone.

They go the ways of the functions of float64 with shorter polynomials. ``docs/theory/numerics.md`` says how accurate each is. The
functions that need parts of others are in ``single_others.py``.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from ..bits import add_bits, and_bits, either_bits, equal, magnitude, or_bits, shift_down, shift_up, sign_of, turn_bits, where
from .pieces import fast_sum, polynomial

#: 1.5·2²³: a number added to it is rounded to a whole one, which then stands in the low bits.
MAGIC = 12582912.0
#: The exponent's bits of 1.
BIAS = 127.0
TWO_OVER_PI = 0.6366197723675814
#: π/2: three parts of 11 bits, whose products with n are exact for n < 2¹³, and what then remains to 24.
HALF_PI = (1.5703125, 0.0004837512969970703, 7.549533620476723e-08, 2.5633440682570896e-12)
#: (sin r − r)/r³ and (cos r − 1 + r²/2)/r⁴ in powers of r², on [−π/4, π/4].
SIN = (-0.16666655242443085, 0.008332191035151482, -0.00019518620683811605)
COS = (0.04166664555668831, -0.00138873013202101, 2.4430661142105237e-05)
#: Beyond this an argument is more than 1/8 of a radian from its neighbours, and its sine means nothing.
LARGEST_ANGLE = 2.0**21
#: The number with only the lowest bit set.
ODD = 2.0**-149

LOG2_E = 1.4426950408889634
#: ln 2; n times the first part, of 15 bits, is exact.
LN2 = (0.693145751953125, 1.428606765330187e-06)
#: (eʳ − 1 − r)/r².
EXP = (0.5, 0.1666651964187622, 0.04166640341281891, 0.008368822745978832, 0.0013940529897809029)
#: Up to the first number eˣ rounds to 0; from the second on it is infinite.
UNDERFLOW_UNTIL, OVERFLOW_FROM = -105.0, 89.0

#: 2·(artanh s − s)/s³ in powers of s².
LOG = (0.6666666269302368, 0.40000972151756287, 0.2849878966808319, 0.2427894026041031)
#: √½, cut: the mantissa is taken from √½ to √2.
HALF_ROOT = 0x3F350400
TO_ONE = 0x3F800000 - HALF_ROOT
MANTISSA = 0x007FFFFF
#: 2²³: its low bits hold a whole number.
TWO_23, TWO_23_BITS = 8388608.0, 0x4B000000
LEAST_NORMAL = 2.0**-126
INFINITY, NAN = float("inf"), float("nan")


class Angle(NamedTuple):
    """|x| − n·π/2, and sine and cosine of it, each as a sum of two numbers.

    Attributes:
        turn: a number in whose low bits n stands.
        odd: whether n is odd.
        sine, sine_rest: sin r is their sum, of which the first is r.
        cosine, cosine_rest: cos r is their sum, of which the first is 1 − r²/2, rounded.
        z: r², rounded.
    """

    turn: Any
    odd: Any
    sine: Any
    sine_rest: Any
    cosine: Any
    cosine_rest: Any
    z: Any


def angle_of(x: Any) -> Angle:
    """Both functions of what remains of |x|; NaN if |x| is too large."""
    x = magnitude(x)
    x = where(x <= LARGEST_ANGLE, x, x.number(NAN))
    turn = x * TWO_OVER_PI + MAGIC
    n = turn - MAGIC
    a, b = x - n * HALF_PI[0], n * HALF_PI[1]
    c = a - b
    d = n * HALF_PI[2] - ((a - c) - b)
    r = c - d
    tail = ((c - r) - d) - n * HALF_PI[3]
    z = r * r
    half = 0.5 * z
    cosine = 1.0 - half
    sine_rest = (z * r) * polynomial(z, SIN) + tail * cosine
    cosine_rest = ((1.0 - cosine) - half) + ((z * z) * polynomial(z, COS) - r * tail)
    return Angle(turn, equal(and_bits(turn, 1), ODD), r, sine_rest, cosine, cosine_rest, z)


def sin(x: Any) -> Any:
    """Sin x; NaN beyond 2²¹."""
    p = angle_of(x)
    value = where(p.odd, p.cosine + p.cosine_rest, p.sine + p.sine_rest)
    return turn_bits(value, sign_of(turn_bits(shift_up(p.turn, 30), x)))


def cos(x: Any) -> Any:
    """Cos x; NaN beyond 2²¹."""
    p = angle_of(x)
    value = where(p.odd, p.sine + p.sine_rest, p.cosine + p.cosine_rest)
    return turn_bits(value, sign_of(shift_up(add_bits(p.turn, 1), 30)))


class Exponent(NamedTuple):
    """x = n·ln 2 + upper − lower, and eʳ = 1 + upper + rest."""

    n: Any
    upper: Any
    lower: Any
    r: Any
    rest: Any


def exponent_of(x: Any) -> Exponent:
    """Of a number for which n is far below 2¹¹."""
    n = (x * LOG2_E + MAGIC) - MAGIC
    upper, lower = x - n * LN2[0], n * LN2[1]
    r = upper - lower
    return Exponent(n, upper, lower, r, (r * r) * polynomial(r, EXP) - lower)


def held(x: Any, least: float, most: float) -> Any:
    """X limited to two constants; a NaN remains one."""
    x = where(x < least, x.number(least), x)
    return where(x > most, x.number(most), x)


def scaled(value: Any, n: Any, low: Any) -> Any:
    """value·2ⁿ, rounded once, for |value| near 1; ``low`` is true where n < 0, perhaps also where n = 0.

    No single number of normal size is 2ⁿ for all n, so there are two factors.
    """
    first = shift_up(n + where(low, n.number(MAGIC + BIAS + 64.0), n.number(MAGIC + BIAS - 1.0)), 23)
    return (value * first) * where(low, n.number(2.0**-64), n.number(2.0))


def exp(x: Any) -> Any:
    """Exponential of x, subnormal results included."""
    x = held(x, UNDERFLOW_UNTIL, OVERFLOW_FROM)
    p = exponent_of(x)
    s, lost = fast_sum(1.0, p.upper)
    return scaled(s + (lost + p.rest), p.n, x < 0.0)


def exponent_and_rest(x: Any, *, normal: bool = False) -> tuple[Any, Any]:
    """K and m of x = 2ᵏ·m with m from √½ to √2, of a positive number, which is not subnormal if ``normal``."""
    offset: Any = TWO_23 + BIAS
    if not normal:
        tiny = x < LEAST_NORMAL
        x, offset = where(tiny, x * 2.0**25, x), where(tiny, x.number(offset + 25.0), x.number(offset))
    u = add_bits(x, TO_ONE)
    return or_bits(shift_down(u, 23), TWO_23_BITS) - offset, add_bits(and_bits(u, MANTISSA), HALF_ROOT)


class Logarithm(NamedTuple):
    """ln x = k·ln 2 + f − half + rest, with half = f²/2 and s = f/(2 + f)."""

    k: Any
    f: Any
    half: Any
    s: Any
    rest: Any


def logarithm_of(x: Any, *, normal: bool = False) -> Logarithm:
    """Of a positive number."""
    k, m = exponent_and_rest(x, normal=normal)
    f = m - 1.0
    s = f / (2.0 + f)
    z = s * s
    half = (0.5 * f) * f
    return Logarithm(k, f, half, s, s * (half + z * polynomial(z, LOG)))


def at_the_ends(x: Any, value: Any) -> Any:
    """A logarithm where x is positive and finite; −∞ of 0, NaN of negative numbers."""
    value = where(x < INFINITY, value, x)  # infinity and NaN
    return where(equal(x, 0.0), x.number(-INFINITY), where(x < 0.0, x.number(NAN), value))


def log(x: Any) -> Any:
    """Ln x, subnormal numbers included; −∞ of 0, NaN of negative numbers."""
    p = logarithm_of(x)
    return at_the_ends(x, p.k * LN2[0] - ((p.half - (p.rest + p.k * LN2[1])) - p.f))


def round(x: Any) -> Any:
    """The whole number nearest to x; the even one if two are equally near."""
    y = magnitude(x)
    return either_bits(where(y < TWO_23, (y + TWO_23) - TWO_23, y), sign_of(x))
