"""Inverse trigonometric functions; ``docs/coefficients.py`` finds the coefficients."""

from __future__ import annotations

from typing import Any, NamedTuple

from ..bits import PRECISIONS, PerPrecision, either_bits, equal, magnitude, or_bits, sign_of, sqrt, turn_bits, where
from .elementary import elementary
from .pieces import INFINITY, fast_sum, halves, polynomial, quotient

TAN_EIGHTH = 0.41421356237309503


class Constants(NamedTuple):
    """Constants of one precision.

    Attributes:
        atan: (arctan t − t)/t³ in powers of t², up to t = tan(π/8).
        asin: (arcsin x − x)/x³ in powers of x², up to x = 1/2.
        quarter_pi: π/4: a first part of 50 or 21 bits, so that up to four times it is exact, and the rest.
        right_angle_from: from here on the arc tangent rounds to π/2.
        lengths: a point is scaled if its larger coordinate is below the first or above the second.
        scales: by what it is scaled below the first and above the second.
        next_to_zero: less than affects a result if it is added to a scaled number.
    """

    atan: tuple[float, ...]
    asin: tuple[float, ...]
    quarter_pi: tuple[float, float]
    right_angle_from: float
    lengths: tuple[float, float]
    scales: tuple[float, float]
    next_to_zero: float


CONSTANTS = PerPrecision(
    double=Constants(
        atan=(
            -0.33333333333333187,
            0.19999999999951215,
            -0.14285714279995193,
            0.11111110774690779,
            -0.09090897533501092,
            0.0769205661728733,
            -0.0666306677020241,
            0.058476399881540575,
            -0.05038265409309135,
            0.03804000391080192,
            -0.01788209264572132,
        ),
        asin=(
            0.1666666666666676,
            0.07499999999971095,
            0.044642857174224136,
            0.03038194272950777,
            0.022372214318213676,
            0.017351624732641444,
            0.013980662389073067,
            0.011400238094136402,
            0.01077270078341017,
            0.0037352343200085705,
            0.021636856974466507,
            -0.020898809490814328,
            0.03256583927490458,
        ),
        quarter_pi=(0.7853981633974483, 3.061616997868383e-17),
        right_angle_from=2.0**70,
        lengths=(2.0**100, 2.0**1000),
        scales=(2.0**900, 2.0**-60),
        next_to_zero=2.0**-1000,
    ),
    single=Constants(
        atan=(-0.3333331346511841, 0.1999838948249817, -0.1424224078655243, 0.10585514456033707, -0.060594793409109116),
        asin=(
            0.16666659712791443,
            0.07500515133142471,
            0.04451543092727661,
            0.03181745857000351,
            0.01440940611064434,
            0.03754977136850357,
        ),
        quarter_pi=(0.785398006439209, 1.5695823663008923e-07),
        right_angle_from=2.0**30,
        lengths=(2.0**20, 2.0**110),
        scales=(2.0**100, 2.0**-30),
        next_to_zero=2.0**-120,
    ),
)


def angle(b: Any, a: Any, quarters: Any, turned: Any) -> Any:
    """quarters·π/4 plus arctan(b/a), or minus that if ``turned`` is −0 and not +0; 0 ≤ b ≤ a.

    From tan(π/8) on, arctan(b/a) = π/4 + arctan((b − a)/(b + a)). The quotient has more digits than numbers have.
    """
    constants, one = CONSTANTS.of(b), PRECISIONS.of(b).pattern(1.0)
    large = TAN_EIGHTH * a < b
    difference, total = b - a, b + a
    n, d = where(large, difference, b), where(large, total, a)
    n_rest = where(large, b - (difference + a), 0.0)
    d_rest = where(large, (a - total) + b, 0.0)
    t, rest = quotient(n, n_rest, d, d_rest)
    z = t * t
    t, rest = turn_bits(t, turned), turn_bits(rest + (z * t) * polynomial(z, constants.atan), turned)
    quarters = quarters + where(large, or_bits(turned, one), 0.0)  # one more, or one less
    s, lost = fast_sum(quarters * constants.quarter_pi[0], t)
    return s + ((quarters * constants.quarter_pi[1] + rest) + lost)


@elementary
def arctan(x: Any) -> Any:
    """Arc tangent of x, from −π/2 to π/2.

    Example:
        >>> print(arctan(1.0))
        0.7853981633974483
    """
    y = magnitude(x)
    right_angle_from = CONSTANTS.of(x).right_angle_from
    y = where(y > right_angle_from, right_angle_from, y)  # finite
    above = y > 1.0
    value = angle(where(above, 1.0, y), where(above, y, 1.0), where(above, 2.0, 0.0), where(above, -0.0, 0.0))
    return either_bits(value, sign_of(x))


@elementary
def arctan2(y: Any, x: Any) -> Any:
    """Angle of the point (x, y), from −π to π; zeros and infinities as in C."""
    constants = CONSTANTS.of(x)
    sign, up, right = sign_of(x), magnitude(y), magnitude(x)
    swap = right < up
    a, b = where(swap, up, right), where(swap, right, up)
    # Scaled so that products are exact unless the angle is 0 or subnormal, and moved from zero by less than affects the result.
    scale = where(a < constants.lengths[0], constants.scales[0], where(a > constants.lengths[1], constants.scales[1], 1.0))
    # Of two infinities the angle is π/4.
    endless = equal(a, INFINITY)
    b = where(endless, where(equal(b, INFINITY), 1.0, b * 0.0), b * scale)
    a = where(endless, 1.0, a * scale + constants.next_to_zero)
    quarters = where(swap, 2.0, 2.0 - or_bits(sign, PRECISIONS.of(x).pattern(2.0)))
    return either_bits(angle(b, a, quarters, where(swap, -sign, sign)), sign_of(y))


def half_angle(x: Any) -> tuple[Any, Any, Any]:
    """The common part of arcsin x and arccos x: whether |x| is above 1/2, and an angle in two parts.

    The angle is arcsin |x| if |x| is at most 1/2, and else arcsin √((1 − |x|)/2), which is half of arccos |x|. Its first part is
    its sine, cut to half the digits if that is a root.
    """
    constants = CONSTANTS.of(x)
    y = magnitude(x)
    large = y > 0.5
    z = where(large, (1.0 - y) * 0.5, y * y)
    root = sqrt(z)
    first, _ = halves(root)
    second = (z - first * first) / ((root + first) + constants.next_to_zero)  # not 0/0 if |x| = 1
    sine = where(large, root, y)
    longer = (sine * z) * polynomial(z, constants.asin)
    return large, where(large, first, y), where(large, second, 0.0) + longer


@elementary
def arcsin(x: Any) -> Any:
    """Arc sine of x, from −π/2 to π/2; NaN beyond ±1 (fdlibm's reduction)."""
    large, sine, rest = half_angle(x)
    first, second = CONSTANTS.of(x).quarter_pi
    s, lost = fast_sum(2.0 * first, -2.0 * sine)
    value = where(large, s + (lost + (2.0 * second - 2.0 * rest)), sine + rest)
    return either_bits(value, sign_of(x))


@elementary
def arccos(x: Any) -> Any:
    """Arc cosine of x, from 0 to π; NaN beyond ±1 (fdlibm's reduction)."""
    large, sine, rest = half_angle(x)
    sign = sign_of(x)
    # π/2 − arcsin x; where |x| is large, 0 + 2·angle or π − 2·angle.
    turned = where(large, sign, -sign)
    sine, rest = where(large, 2.0 * sine, sine), where(large, 2.0 * rest, rest)
    quarters = where(large, 2.0 - or_bits(sign, PRECISIONS.of(x).pattern(2.0)), 2.0)
    first, second = CONSTANTS.of(x).quarter_pi
    s, lost = fast_sum(quarters * first, turn_bits(sine, turned))
    return s + (lost + (quarters * second + turn_bits(rest, turned)))
