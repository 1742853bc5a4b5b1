"""Logarithms.

x = 2ᵏ·(1 + f) with 1 + f between √½ and √2, and s = f/(2 + f), so that ln(1 + f) = 2·artanh s = f − f²/2 + s·(f²/2 + R(s²)), as
in fdlibm. ``docs/coefficients.py`` finds the coefficients of R.
"""

from __future__ import annotations

from math import ldexp
from typing import Any, NamedTuple

from ..bits import (
    PRECISIONS,
    PerPrecision,
    add_bits,
    and_bits,
    either_bits,
    equal,
    is_single,
    or_bits,
    shift_down,
    sign_of,
    where,
)
from .elementary import elementary
from .exponential import CONSTANTS as EXPONENTIAL
from .exponential import exp
from .pieces import INFINITY, NAN, fast_sum, halves, polynomial, power_of_two


class Constants(NamedTuple):
    """Constants of one precision.

    Attributes:
        log: 2·(artanh s − s)/s³ in powers of s².
        half_root: the bits of √½, cut: the mantissa is taken from √½ to √2.
        log2_e: 1/ln 2: a first part of 26 or 12 bits, and the rest.
        log10_e: 1/ln 10 likewise.
        log10_2: log₁₀ 2; k times the first part, of 40 or 16 bits, is exact.
    """

    log: tuple[float, ...]
    half_root: int
    log2_e: tuple[float, float]
    log10_e: tuple[float, float]
    log10_2: tuple[float, float]


CONSTANTS = PerPrecision(
    double=Constants(
        log=(
            0.6666666666666736,
            0.39999999999405483,
            0.28571428744061894,
            0.22222198426151224,
            0.18183571057432849,
            0.15313895728652202,
            0.1479736350587642,
        ),
        half_root=0x3FE6A09E00000000,
        log2_e=(1.4426950514316559, -1.0542692476429138e-08),
        log10_e=(0.4342944845557213, -2.6524694553078553e-09),
        log10_2=(0.3010299956640665, -8.532344317057107e-14),
    ),
    single=Constants(
        log=(0.6666666269302368, 0.40000972151756287, 0.2849878966808319, 0.2427894026041031),
        half_root=0x3F350400,
        log2_e=(1.4423828125, 0.00031222839606925845),
        log10_e=(0.4342041015625, 9.038033749675378e-05),
        log10_2=(0.301025390625, 4.605039066518657e-06),
    ),
)


def exponent_and_rest(x: Any, *, normal: bool = False) -> tuple[Any, Any]:
    """K and m of x = 2ᵏ·m with m from √½ to √2, of a positive number, which is not subnormal if ``normal``."""
    precision, half_root = PRECISIONS.of(x), CONSTANTS.of(x).half_root
    places = precision.fraction_bits
    offset: Any = precision.first_whole + precision.bias
    if not normal:
        tiny = x < precision.least_normal
        x, offset = where(tiny, x * ldexp(1.0, places + 2), x), where(tiny, offset + (places + 2.0), offset)
    u = add_bits(x, precision.pattern(1.0) - half_root)
    k = or_bits(shift_down(u, places), precision.pattern(precision.first_whole)) - offset
    return k, add_bits(and_bits(u, (1 << places) - 1), half_root)


class Reduced(NamedTuple):
    """ln x = k·ln 2 + f − half + rest, half = f²/2; s as above."""

    k: Any
    f: Any
    half: Any
    s: Any
    rest: Any


def reduced(x: Any, *, normal: bool = False) -> Reduced:
    """Of a positive number."""
    k, m = exponent_and_rest(x, normal=normal)
    f = m - 1.0
    s = f / (2.0 + f)
    z = s * s
    half = (0.5 * f) * f
    return Reduced(k, f, half, s, s * (half + z * polynomial(z, CONSTANTS.of(x).log)))


def at_the_ends(x: Any, value: Any) -> Any:
    """A logarithm where x is positive and finite; −∞ for zero, NaN for negative numbers, ∞ and NaN unchanged."""
    value = where(x < INFINITY, value, x)
    if is_single(x):  # where a NaN keeps its bits
        return where(equal(x, 0.0), -INFINITY, where(x < 0.0, NAN, value))
    return where(x > 0.0, value, where(equal(x, 0.0), -INFINITY, NAN))


@elementary
def log(x: Any) -> Any:
    """Natural logarithm of x, subnormal numbers included; −∞ for zero, NaN for negative numbers (fdlibm's algorithm).

    Example:
        >>> print(log(2.0))
        0.6931471805599453
    """
    p, ln2 = reduced(x), EXPONENTIAL.of(x).ln2
    return at_the_ends(x, p.k * ln2[0] - ((p.half - (p.rest + p.k * ln2[1])) - p.f))


@elementary
def log1p(x: Any) -> Any:
    """Natural logarithm of 1 + x, accurate also where x is small; −∞ for −1, NaN below."""
    u = 1.0 + x
    one = u - x
    lost = (1.0 - one) + (x - (u - one))  # 1 + x = u + lost (Knuth)
    p = reduced(u, normal=True)
    # The derivative, (1 − s)/(1 + s), is 1 − 2s + 2s² to a hundredth, and lost is that small beside the result.
    lost = (lost * power_of_two(1.0 - p.k)) * (0.5 - (p.s - p.s * p.s))
    ln2 = EXPONENTIAL.of(x).ln2
    value = p.k * ln2[0] - ((p.half - (p.rest + (p.k * ln2[1] + lost))) - p.f)
    return at_the_ends(u, either_bits(value, sign_of(x)))


@elementary
def logaddexp(x: Any, y: Any) -> Any:
    """ln(eˣ + eʸ), without overflow in between; where it is near zero it has the error of a sum of numbers of the size of x."""
    less = x < y
    a, b = where(less, y, x), where(less, x, y)
    return where(equal(a, b), a + 0.6931471805599453, a + log1p(exp(b - a)))


def _in_base(x: Any, factor: tuple[float, float], unit: tuple[float, float]) -> Any:
    """A logarithm to a base b, given 1/ln b and log_b 2, each in two parts."""
    p = reduced(x)
    upper, _ = halves(p.f - p.half)
    lower = ((p.f - upper) - p.half) + p.rest
    s, lost = fast_sum(p.k * unit[0], upper * factor[0])
    lower = (lower * (factor[0] + factor[1]) + upper * factor[1]) + p.k * unit[1]
    return at_the_ends(x, s + (lost + lower))


@elementary
def log2(x: Any) -> Any:
    """Logarithm to base 2; exact for powers of 2. See ``log``."""
    return _in_base(x, CONSTANTS.of(x).log2_e, (1.0, 0.0))


@elementary
def log10(x: Any) -> Any:
    """Logarithm to base 10. See ``log``."""
    return _in_base(x, CONSTANTS.of(x).log10_e, CONSTANTS.of(x).log10_2)
