"""Sine, cosine and tangent.

The argument is reduced by n·π/2 to r in [−π/4, π/4] (Cody and Waite), with π/2 in four parts. n times each of the first three is
exact for n < 2²⁴ (2¹³ in float32), so r is accurate to its own last bits even near a multiple of π/2, and a tail beyond them is
kept. Both sine and cosine of r are computed, by polynomials as in fdlibm's kernels, and one of them is chosen: a step that needs
both costs little more than a step that needs one. ``docs/coefficients.py`` finds the coefficients.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from ..bits import PRECISIONS, PerPrecision, add_bits, and_bits, equal, magnitude, shift_up, sign_of, turn_bits, where
from .elementary import elementary
from .pieces import NAN, fast_sum, halves, polynomial, quotient

TWO_OVER_PI = 0.6366197723675814
#: π/180 and 180/π.
DEGREE, RADIAN = 0.017453292519943295, 57.29577951308232


class Constants(NamedTuple):
    """Constants of one precision.

    Attributes:
        half_pi: π/2: three parts of 29 or 11 bits, and what then remains to 53 or 24.
        sin: (sin r − r)/r³ in powers of r².
        cos: (cos r − 1 + r²/2)/r⁴ in powers of r².
        largest_angle: beyond this an argument is more than 1/8 of a radian from its neighbours, and its sine means nothing.
    """

    half_pi: tuple[float, float, float, float]
    sin: tuple[float, ...]
    cos: tuple[float, ...]
    largest_angle: float


CONSTANTS = PerPrecision(
    double=Constants(
        half_pi=(1.570796325802803, 9.920935808982456e-10, -1.2177051780877821e-18, 2.9038559739793605e-28),
        sin=(
            -0.1666666666666663,
            0.008333333333321976,
            -0.00019841269829525107,
            2.755731360899387e-06,
            -2.505074680230245e-08,
            1.5896212232510631e-10,
        ),
        cos=(
            0.041666666666666595,
            -0.0013888888888873461,
            2.480158728911982e-05,
            -2.75573142586856e-07,
            2.0875711707973604e-09,
            -1.1359097367080523e-11,
        ),
        largest_angle=2.0**50,
    ),
    single=Constants(
        half_pi=(1.5703125, 0.0004837512969970703, 7.549533620476723e-08, 2.5633440682570896e-12),
        sin=(-0.16666655242443085, 0.008332191035151482, -0.00019518620683811605),
        cos=(0.04166664555668831, -0.00138873013202101, 2.4430661142105237e-05),
        largest_angle=2.0**21,
    ),
)


class Reduced(NamedTuple):
    """|x| − n·π/2, and from it sine and cosine as sums of two numbers.

    Attributes:
        turn: a number in whose low bits n stands.
        odd: whether n is odd.
        z: r², rounded.
        sine, sine_rest: sin r is their sum, of which the first is r.
        cosine, cosine_rest: cos r is their sum, of which the first is 1 − r²/2, rounded.
    """

    turn: Any
    odd: Any
    z: Any
    sine: Any
    sine_rest: Any
    cosine: Any
    cosine_rest: Any


def reduced(x: Any) -> Reduced:
    """Both functions of what remains of |x|; NaN where it is too large."""
    constants, precision = CONSTANTS.of(x), PRECISIONS.of(x)
    half_pi = constants.half_pi
    x = magnitude(x)
    x = where(x <= constants.largest_angle, x, NAN)
    turn = x * TWO_OVER_PI + precision.magic
    n = turn - precision.magic
    a = x - n * half_pi[0]
    b = n * half_pi[1]
    c = a - b
    d = n * half_pi[2] - ((a - c) - b)
    r = c - d
    tail = ((c - r) - d) - n * half_pi[3]
    z = r * r
    half = 0.5 * z
    cosine = 1.0 - half
    sine_rest = (z * r) * polynomial(z, constants.sin) + tail * cosine
    cosine_rest = ((1.0 - cosine) - half) + ((z * z) * polynomial(z, constants.cos) - r * tail)
    return Reduced(turn, equal(and_bits(turn, 1), precision.lowest_bit), z, r, sine_rest, cosine, cosine_rest)


@elementary
def sin(x: Any) -> Any:
    """Sin x, x in radians; NaN beyond 2⁵⁰, or 2²¹ in float32 (fdlibm's kernels; Cody and Waite's reduction).

    Example:
        >>> print(sin(0.5))
        0.479425538604203
    """
    p = reduced(x)
    value = where(p.odd, p.cosine + p.cosine_rest, p.sine + p.sine_rest)
    return turn_bits(value, sign_of(turn_bits(shift_up(p.turn, PRECISIONS.of(x).sign_place - 1), x)))


@elementary
def cos(x: Any) -> Any:
    """Cos x, x in radians; NaN beyond the same (see ``sin``)."""
    p = reduced(x)
    value = where(p.odd, p.sine + p.sine_rest, p.cosine + p.cosine_rest)
    return turn_bits(value, sign_of(shift_up(add_bits(p.turn, 1), PRECISIONS.of(x).sign_place - 1)))


@elementary
def tan(x: Any) -> Any:
    """Tan x, x in radians; NaN beyond the same (see ``sin``). The quotient of both, each with more digits than numbers have."""
    p = reduced(x)
    r1, r2 = halves(p.sine)
    z_rest = (r1 * r1 - p.z) + r2 * (p.sine + r1)  # what is lost of r² would be a quarter of a unit in the last place
    (s, s_rest), (c, c_rest) = fast_sum(p.sine, p.sine_rest), fast_sum(p.cosine, p.cosine_rest - 0.5 * z_rest)
    pairs = zip((c, c_rest, s, s_rest), (s, s_rest, c, c_rest), strict=True)
    q, rest = quotient(*(where(p.odd, yes, no) for yes, no in pairs))
    return turn_bits(q + rest, sign_of(turn_bits(shift_up(p.turn, PRECISIONS.of(x).sign_place), x)))


@elementary
def deg2rad(x: Any) -> Any:
    """Degrees in radians: x times π/180, rounded."""
    return x * DEGREE


@elementary
def rad2deg(x: Any) -> Any:
    """Radians in degrees: x times 180/π, rounded."""
    return x * RADIAN
