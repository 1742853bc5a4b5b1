"""Further elementary functions of float32, by parts of those in ``single.py``; ``docs/coefficients.py`` finds the coefficients.

Each goes the way of the function of float64 of the same name, and what is said there holds here.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ...errors import UnsupportedError
from ..bits import and_bits, either_bits, equal, floor, magnitude, or_bits, shift_down, shift_up, sign_of, sqrt, turn_bits, where
from .elementary import SINGLE
from .pieces import by_parity, fast_sum, polynomial
from .single import (
    BIAS,
    INFINITY,
    LN2,
    MAGIC,
    NAN,
    OVERFLOW_FROM,
    TWO_23,
    TWO_23_BITS,
    angle_of,
    at_the_ends,
    cos,
    exp,
    exponent_and_rest,
    exponent_of,
    held,
    log,
    logarithm_of,
    round,
    scaled,
    sin,
)

#: The first 12 bits of a number's 24. A product of two such numbers is exact.
UPPER = 0xFFFF_F000
#: The bits of 1 and of 2.
ONE, TWO = 0x3F80 << 16, 0x4000 << 16

#: ln 2, 1/ln 2, 1/ln 10: a first part of 12 bits, and the rest.
LN2_UPPER = (0.693115234375, 3.194618329871446e-05)
LOG2_E = (1.4423828125, 0.00031222839606925845)
LOG10_E = (0.4342041015625, 9.038033749675378e-05)
#: log₁₀ 2; k times the first part, of 16 bits, is exact.
LOG10_2 = (0.301025390625, 4.605039066518657e-06)
#: (eʳ − 1 − r − r²/2)/r³.
EXP_LONG = (0.1666666716337204, 0.04166645556688309, 0.008333197794854641, 0.0013935758033767343, 0.0001995340862777084)
#: (2ʳ − 1 − r·ln 2)/r².
EXP2 = (0.24022650718688965, 0.05550360679626465, 0.009618077427148819, 0.0013390871463343501, 0.0001545635750517249)
#: Up to the first a power of 2 is 0, from the second on it is infinite; up to the third eˣ − 1 rounds to −1.
LOWEST_POWER_OF_TWO, HIGHEST_POWER_OF_TWO, MINUS_ONE_UNTIL = -152.0, 129.0, -18.0

#: (sinh r − r)/r³ and (cosh r − 1 − r²/2)/r⁴ in powers of r².
SINH = (0.1666666716337204, 0.008333191275596619, 0.00019959326891694218)
COSH = (0.04166645556688309, 0.0013935758033767343)
#: Below it sinh x and tanh x round to x; from the second on sinh x and cosh x are infinite; from the third on tanh x rounds to 1.
IDENTITY_BELOW, INFINITE_FROM, TANH_ONE_FROM = 2.0**-13, 89.6, 10.0

#: (arctan t − t)/t³ in powers of t², up to t = tan(π/8); (arcsin x − x)/x³ in powers of x², up to x = 1/2.
ATAN = (-0.3333331346511841, 0.1999838948249817, -0.1424224078655243, 0.10585514456033707, -0.060594793409109116)
ASIN = (
    0.16666659712791443,
    0.07500515133142471,
    0.04451543092727661,
    0.03181745857000351,
    0.01440940611064434,
    0.03754977136850357,
)
#: π/4: a first part of 21 bits, so that up to four times it is exact, and the rest.
QUARTER_PI = (0.785398006439209, 1.5695823663008923e-07)
TAN_EIGHTH = 0.41421356237309503
#: From here on the arc tangent rounds to π/2.
RIGHT_ANGLE_FROM = 2.0**30

#: This minus a third of the upper 24 bits of |x| gives the upper bits of x^(−1/3), with an error of at most 3.5 %.
CUBE_START = 5546525.0

#: 3·(artanh s − s − s³/3)/s⁵ in powers of s².
LOG_LONG = (0.5999999642372131, 0.4285793602466583, 0.3327159285545349, 0.292916864156723)
#: 2/(3·ln 2): a first part of 12 bits, the rest, and rounded as a whole.
TWO_THIRDS_LOG2_E = (0.961669921875, 0.00012677205086220056, 0.9617966939259756)
#: With an exponent of this size the power is 0 or infinity for all numbers except 1.
LARGEST_EXPONENT = 2.0**33


def halves(x: Any) -> tuple[Any, Any]:
    """The first 12 bits, and the other 12."""
    upper = and_bits(x, UPPER)
    return upper, x - upper


def quotient(n: Any, n_rest: Any, d: Any, d_rest: Any) -> tuple[Any, Any]:
    """(n + n_rest)/(d + d_rest) as a sum of two, by one division."""
    inverse = 1.0 / d
    q = n * inverse
    (q1, q2), (d1, d2) = halves(q), halves(d)
    rest = ((n - q1 * d1) - q1 * d2) - q2 * d1 - q2 * d2  # exact but for the last product
    return q, ((rest + n_rest) - q * d_rest) * inverse


def power_of_two(n: Any) -> Any:
    """2ⁿ of a whole number from −126 to 127; 0 of −127."""
    return shift_up(n + (MAGIC + BIAS), 23)


def tan(x: Any) -> Any:
    """Tan x; NaN beyond 2²¹."""
    p = angle_of(x)
    r1, r2 = halves(p.sine)
    z_rest = (r1 * r1 - p.z) + r2 * (p.sine + r1)
    (s, s_rest), (c, c_rest) = fast_sum(p.sine, p.sine_rest), fast_sum(p.cosine, p.cosine_rest - 0.5 * z_rest)
    pairs = zip((c, c_rest, s, s_rest), (s, s_rest, c, c_rest), strict=True)
    q, rest = quotient(*(where(p.odd, yes, no) for yes, no in pairs))
    return turn_bits(q + rest, sign_of(turn_bits(shift_up(p.turn, 31), x)))


def expm1(x: Any) -> Any:
    """eˣ − 1, also where that is small."""
    y = held(x, MINUS_ONE_UNTIL, OVERFLOW_FROM)
    p = exponent_of(y)
    one, one_rest = fast_sum(x.number(1.0), -0.5 * power_of_two(1.0 - p.n))
    s, lost = fast_sum(one, p.upper)
    # Where 1 + upper cancels: r²/2 by itself has one rounding less than within the polynomial.
    z = p.r * p.r
    rest = (0.5 * z + (z * p.r) * polynomial(p.r, EXP_LONG)) - p.lower
    rest = rest + (p.r * ((p.upper - p.r) - p.lower) + one_rest)
    return either_bits(scaled(s + (lost + rest), p.n, y < 0.25), sign_of(x))


def exp2_of_sum(x: Any, tail: Any, low: Any) -> Any:
    """Two to the power x + tail, for |x| below 160 and |tail| below 1/4; ``low`` is whether x is below 0."""
    n = ((x + tail) + MAGIC) - MAGIC
    upper = x - n  # exact
    r = upper + tail
    r1, _ = halves(r)
    r2 = (upper - r1) + tail
    s, lost = fast_sum(1.0, r1 * LN2_UPPER[0])
    z = r * r
    rest = (r2 * (LN2_UPPER[0] + LN2_UPPER[1]) + r1 * LN2_UPPER[1]) + z * by_parity(r, z, EXP2)
    return scaled(s + (lost + rest), n, low)


def exp2(x: Any) -> Any:
    """Two to the power x; exact for whole x."""
    x = held(x, LOWEST_POWER_OF_TWO, HIGHEST_POWER_OF_TWO)
    return exp2_of_sum(x, x.number(0.0), x < 0.0)


def log1p(x: Any) -> Any:
    """Ln(1 + x), accurate also where x is small; −∞ for −1, NaN below."""
    u = 1.0 + x
    one = u - x
    lost = (1.0 - one) + (x - (u - one))
    p = logarithm_of(u, normal=True)
    lost = (lost * power_of_two(1.0 - p.k)) * (0.5 - (p.s - p.s * p.s))
    value = p.k * LN2[0] - ((p.half - (p.rest + (p.k * LN2[1] + lost))) - p.f)
    return at_the_ends(u, either_bits(value, sign_of(x)))


def _in_base(x: Any, factor: tuple[float, float], unit: tuple[float, float]) -> Any:
    """A logarithm to a base b, given 1/ln b and log_b 2, each in two parts."""
    p = logarithm_of(x)
    upper, _ = halves(p.f - p.half)
    lower = ((p.f - upper) - p.half) + p.rest
    s, lost = fast_sum(p.k * unit[0], upper * factor[0])
    lower = (lower * (factor[0] + factor[1]) + upper * factor[1]) + p.k * unit[1]
    return at_the_ends(x, s + (lost + lower))


def log2(x: Any) -> Any:
    """Logarithm to base 2; exact for powers of 2."""
    return _in_base(x, LOG2_E, (1.0, 0.0))


def log10(x: Any) -> Any:
    """Logarithm to base 10."""
    return _in_base(x, LOG10_E, LOG10_2)


def _half(x: Any) -> tuple[Any, Any]:
    """Half of sinh |x| and half of cosh |x|; their double may be infinite."""
    x = where(x > INFINITE_FROM, x.number(INFINITE_FROM), x)
    p = exponent_of(x)
    z = p.r * p.r
    growing, falling = power_of_two(p.n - 2.0), power_of_two(100.0 - p.n) * 2.0**-102
    first, second = halves(p.upper)
    rest_of_sinh = (second - p.lower) + (z * p.r) * polynomial(z, SINH)
    rest_of_cosh = z * (0.5 + z * polynomial(z, COSH))
    odd, even = fast_sum(growing, -falling), fast_sum(growing, falling)

    def added(one: Any, other: Any) -> Any:
        s, lost = fast_sum(one[0], other[0] * first)
        return s + (lost + ((one[0] * rest_of_cosh + other[0] * rest_of_sinh) + one[1]))

    return added(odd, even), added(even, odd)


def sinh(x: Any) -> Any:
    """Hyperbolic sine of x."""
    y = magnitude(x)
    sine, _ = _half(y)
    return either_bits(where(y < IDENTITY_BELOW, y, sine * 2.0), sign_of(x))


def cosh(x: Any) -> Any:
    """Hyperbolic cosine of x."""
    _, cosine = _half(magnitude(x))
    return cosine * 2.0


def tanh(x: Any) -> Any:
    """Hyperbolic tangent of x: (e²ˣ − 1)/(e²ˣ + 1), each to more than 24 bits."""
    y = magnitude(x)
    p = exponent_of(2.0 * where(y > TANH_ONE_FROM, x.number(TANH_ONE_FROM), y))
    inverse = power_of_two(-p.n)
    pairs = []
    for part in (-inverse, inverse):
        one, one_rest = fast_sum(x.number(1.0), part)
        s, lost = fast_sum(one, p.upper)
        pairs.append(fast_sum(s, lost + (p.rest + one_rest)))
    q, rest = quotient(*pairs[0], *pairs[1])
    return either_bits(where(y < IDENTITY_BELOW, y, q + rest), sign_of(x))


def angle(b: Any, a: Any, quarters: Any, turned: Any) -> Any:
    """quarters·π/4 plus arctan(b/a), or minus that if ``turned`` is −0 and not +0; 0 ≤ b ≤ a."""
    large = TAN_EIGHTH * a < b
    difference, total = b - a, b + a
    n, d = where(large, difference, b), where(large, total, a)
    n_rest, d_rest = where(large, b - (difference + a), 0.0), where(large, (a - total) + b, 0.0)
    t, rest = quotient(n, n_rest, d, d_rest)
    z = t * t
    t, rest = turn_bits(t, turned), turn_bits(rest + (z * t) * polynomial(z, ATAN), turned)
    quarters = quarters + where(large, or_bits(turned, ONE), 0.0)  # one more, or one less
    s, lost = fast_sum(quarters * QUARTER_PI[0], t)
    return s + ((quarters * QUARTER_PI[1] + rest) + lost)


def arctan(x: Any) -> Any:
    """Arc tangent of x, from −π/2 to π/2."""
    y = magnitude(x)
    y = where(y > RIGHT_ANGLE_FROM, x.number(RIGHT_ANGLE_FROM), y)  # finite
    above, one = y > 1.0, x.number(1.0)
    value = angle(where(above, one, y), where(above, y, one), above.choose(2.0, 0.0), above.choose(-0.0, 0.0))
    return either_bits(value, sign_of(x))


def arctan2(y: Any, x: Any) -> Any:
    """Angle of the point (x, y), from −π to π; zeros and infinities as in C."""
    sign, up, right = sign_of(x), magnitude(y), magnitude(x)
    swap = right < up
    a, b = where(swap, up, right), where(swap, right, up)
    # Scaled so that products are exact unless the angle is 0 or subnormal, and moved from zero by less than affects the result.
    scale = where(a < 2.0**20, x.number(2.0**100), (a > 2.0**110).choose(2.0**-30, 1.0))
    endless = equal(a, INFINITY)
    b = where(endless, where(equal(b, INFINITY), x.number(1.0), b * 0.0), b * scale)
    a = where(endless, x.number(1.0), a * scale + 2.0**-120)
    quarters = where(swap, x.number(2.0), 2.0 - or_bits(sign, TWO))
    return either_bits(angle(b, a, quarters, where(swap, -sign, sign)), sign_of(y))


def half_angle(x: Any) -> tuple[Any, Any, Any]:
    """The common part of arcsin x and arccos x: whether |x| is above 1/2, and an angle in two parts."""
    y = magnitude(x)
    large = y > 0.5
    z = where(large, (1.0 - y) * 0.5, y * y)
    root = sqrt(z)
    first, _ = halves(root)
    second = (z - first * first) / ((root + first) + 2.0**-120)  # not 0/0 if |x| = 1
    sine = where(large, root, y)
    longer = (sine * z) * polynomial(z, ASIN)
    return large, where(large, first, y), where(large, second, 0.0) + longer


def arcsin(x: Any) -> Any:
    """Arc sine of x, from −π/2 to π/2; NaN beyond ±1."""
    large, sine, rest = half_angle(x)
    s, lost = fast_sum(x.number(2.0 * QUARTER_PI[0]), -2.0 * sine)
    value = where(large, s + (lost + (2.0 * QUARTER_PI[1] - 2.0 * rest)), sine + rest)
    return either_bits(value, sign_of(x))


def arccos(x: Any) -> Any:
    """Arc cosine of x, from 0 to π; NaN beyond ±1."""
    large, sine, rest = half_angle(x)
    sign = sign_of(x)
    turned = where(large, sign, -sign)
    sine, rest = where(large, 2.0 * sine, sine), where(large, 2.0 * rest, rest)
    quarters = where(large, 2.0 - or_bits(sign, TWO), 2.0)
    s, lost = fast_sum(quarters * QUARTER_PI[0], turn_bits(sine, turned))
    return s + (lost + (quarters * QUARTER_PI[1] + turn_bits(rest, turned)))


def cbrt(x: Any) -> Any:
    """Cube root of x, from x^(−1/3) by Newton's method."""
    y = magnitude(x)
    small = y < 2.0**-100
    a = where(small, y * 2.0**60, y)
    third = (or_bits(shift_down(a, 8), TWO_23_BITS) - TWO_23) * (-1.0 / 3.0)
    inverse = shift_up(third + (TWO_23 + CUBE_START), 8)
    for _ in range(2):  # from 3.5 % to 2e-4, and to rounding
        e = 1.0 - a * (inverse * inverse * inverse)
        inverse = inverse + inverse * (e * (1.0 / 3.0 + 2.0 / 9.0 * e))
    t, _ = halves((a * inverse) * inverse)
    t2 = t * t  # exact
    t3, t4 = halves(t2)
    e = ((a - t3 * t) - t4 * t) * ((inverse * inverse) * inverse)  # 1 − t³/a
    value = (t + t * (e * (1.0 / 3.0 + 2.0 / 9.0 * e))) * small.choose(2.0**-20, 1.0)
    return either_bits(where(y < INFINITY, where(y > 0.0, value, y), y), sign_of(x))


def hypot(x: Any, y: Any) -> Any:
    """√(x² + y²), without overflow or underflow in between; ∞ if one is infinite, even if the other is NaN."""
    x, y = magnitude(x), magnitude(y)
    swap = x < y
    a, b = where(swap, y, x), where(swap, x, y)
    large, small = a > 2.0**60, a < 2.0**-40
    scale = where(large, x.number(2.0**-70), small.choose(2.0**100, 1.0))
    back = where(large, x.number(2.0**70), small.choose(2.0**-100, 1.0))
    p, q = a * scale, b * scale
    (p1, p2), (q1, q2) = halves(p), halves(q)
    p_rest, q_rest = p2 * (p + p1), q2 * (q + q1)
    s, lost = fast_sum(p1 * p1, q1 * q1)
    lost = lost + (p_rest + q_rest)
    h = sqrt(s + lost)
    h1, h2 = halves(h)
    rest = (s - h1 * h1) - h2 * (h + h1) + lost
    value = (h + rest * where(h > 0.0, 0.5 / h, 0.0)) * back
    infinity = x.number(INFINITY)
    return where(equal(a, INFINITY), infinity, where(equal(b, INFINITY), infinity, value))


def mod(x: Any, y: Any) -> Any:
    """The remainder of x after subtraction of whole multiples of y, with the sign of y.

    Exact if it has at most 24 bits and |x/y| is below 2²³; NaN from there on.
    """
    a, b = magnitude(x), magnitude(y)
    n = floor(a / b)  # perhaps one too many
    (n1, n2), (b1, b2) = halves(n), halves(b)
    r = (((a - n1 * b1) - n1 * b2) - n2 * b1) - n2 * b2
    r = where(r < 0.0, r + b, r)
    r = where(n < TWO_23, r, x.number(NAN))
    r = where(a < b, a, r)  # also of an infinite b
    r = turn_bits(r, sign_of(x))
    apart = turn_bits(r, sign_of(y)) < 0.0
    return where(equal(r, 0.0), sign_of(y), where(apart, r + y, r))


def log2_in_two(x: Any) -> tuple[Any, Any]:
    """log₂ of a positive number: 12 bits, and the rest to more than 20."""
    k, m = exponent_and_rest(x)
    f = m - 1.0
    total = and_bits(m + 1.0, UPPER)
    total_rest = m - (total - 1.0)
    inverse = 1.0 / (m + 1.0)
    s = f * inverse
    s1, _ = halves(s)
    s2 = inverse * ((f - s1 * total) - s1 * total_rest)
    s = s1 + s2
    z, z1 = s * s, s1 * s1
    square = z * z
    rest = square * by_parity(z, square, LOG_LONG) + s2 * (s1 + s)
    t1 = and_bits((3.0 + z1) + rest, UPPER)
    t2 = rest - ((t1 - 3.0) - z1)
    u = s1 * t1
    v = s2 * t1 + t2 * s
    p1 = and_bits(u + v, UPPER)
    p2 = v - (p1 - u)
    first, second, whole = TWO_THIRDS_LOG2_E
    w1 = first * p1
    w2 = second * p1 + p2 * whole
    upper = and_bits((w1 + w2) + k, UPPER)
    return upper, w2 - ((upper - k) - w1)


def any_power(x: Any, y: Any) -> Any:
    """X to the power y, as C's pow."""
    a = magnitude(x)
    upper, lower = log2_in_two(a)
    e = held(y, -LARGEST_EXPONENT, LARGEST_EXPONENT)
    e1, e2 = halves(e)
    p, p_rest = e1 * upper, e2 * upper + e * lower
    below, above = p < LOWEST_POWER_OF_TWO, p > HIGHEST_POWER_OF_TWO
    p = where(below, x.number(LOWEST_POWER_OF_TWO), where(above, x.number(HIGHEST_POWER_OF_TWO), p))
    p_rest = where(below | above, x.number(0.0), p_rest)
    value = exp2_of_sum(p, p_rest, p < 0.0)
    half = 0.5 * y
    whole, even = equal(floor(y), y), equal(floor(half), half)
    value = where(whole, value, where(x < 0.0, x.number(NAN), value))
    endless = equal(a, 0.0) | equal(a, INFINITY)  # each stays, or becomes the other one
    value = where(endless, where(y < 0.0, turn_bits(a, x.number(INFINITY)), a), value)
    value = either_bits(value, where(even, 0.0, where(whole, sign_of(x), 0.0)))
    value = where(equal(x, x) & equal(y, y), value, x.number(NAN))
    return where(equal(y, 0.0) | equal(x, 1.0), x.number(1.0), value)


#: The functions of float32 by the names of those of float64.
FUNCTIONS: dict[str, Callable[..., Any]] = {
    each.__name__: each
    for each in (
        *(any_power, arccos, arcsin, arctan, arctan2, cbrt, cos, cosh, exp, exp2, expm1, hypot, log, log10, log1p, log2, mod),
        *(round, sin, sinh, tan, tanh),
    )
}
#: Those whose text is right for numbers of any precision: comparisons, choices, signs, single operations and products.
OF_ANY = {"abs", "ceil", "copysign", "deg2rad", "equal", "floor", "greater", "greater_equal", "less", "less_equal", "maximum"}
OF_ANY |= {"minimum", "not_equal", "of", "rad2deg", "sign", "sqrt", "square", "trunc"}


def version(name: str, function: Callable[..., Any]) -> Callable[..., Any]:
    """The function of that name for float32; raise if there is none."""
    if name in OF_ANY:
        return function
    if name in FUNCTIONS:
        return FUNCTIONS[name]
    known = ", ".join(sorted((OF_ANY | set(FUNCTIONS)) - {"any_power", "of"}))
    raise UnsupportedError(f"dtype: {name} has no version of float32; there are {known}; or use dtype='float64'")


SINGLE.append(version)
