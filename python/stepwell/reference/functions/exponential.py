"""Exponential functions.

x is reduced by n·ln 2 to r in [−ln 2/2, ln 2/2], where eʳ = 1 + r + r²/2 + r³·Q(r) with one polynomial Q, without a division.
``docs/coefficients.py`` finds the coefficients.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from ..bits import either_bits, sign_of, where
from .elementary import elementary
from .pieces import MAGIC, by_parity, fast_sum, halves, magic, power_of_two, scaled

#: ln 2; n times the first part, of 33 bits, is exact.
LN2 = (0.6931471806019545, -4.2009150726810846e-11)
#: ln 2 again, the first part of 26 bits.
LN2_UPPER = (0.6931471824645996, -1.904654299957768e-09)
LOG2_E = 1.4426950408889634
#: (eʳ − 1 − r − r²/2)/r³.
EXP = (
    0.16666666666666685,
    0.041666666666666685,
    0.008333333333315955,
    0.001388888888887332,
    0.00019841269898657093,
    2.4801587349060595e-05,
    2.7557232875898035e-06,
    2.755725199229993e-07,
    2.511265401198411e-08,
    2.0921702372435563e-09,
)
#: (2ʳ − 1 − r·ln 2)/r².
EXP2 = (
    0.24022650695910136,
    0.05550410866482164,
    0.009618129107592436,
    0.0013333558146401475,
    0.00015403530459036856,
    1.5252733847353264e-05,
    1.3215434398659551e-06,
    1.0178054454579838e-07,
    7.073924586475366e-09,
    4.456232717843695e-10,
)
#: Up to the first number eˣ rounds to 0, up to the second eˣ − 1 rounds to −1; from the last on both are infinite.
UNDERFLOW_UNTIL, MINUS_ONE_UNTIL, OVERFLOW_FROM = -746.0, -40.0, 710.0
#: Up to the first a power of 2 is 0, from the second on it is infinite.
LOWEST_POWER_OF_TWO, HIGHEST_POWER_OF_TWO = -1080.0, 1025.0


def held(x: Any, least: float, most: float) -> Any:
    """X limited to two constants; a NaN remains one."""
    x = where(x < least, least, x)
    return where(most < x, most, x)


class Reduced(NamedTuple):
    """x = n·ln 2 + upper − lower, and r is upper − lower, rounded; n stands in the low bits of ``turn``, and z is r²."""

    turn: Any
    n: Any
    upper: Any
    lower: Any
    r: Any
    z: Any

    @property
    def rest(self) -> Any:
        """Accurate where 1 + upper cancels: eʳ = 1 + upper + rest."""
        return (0.5 * self.z + (self.z * self.r) * by_parity(self.r, self.z, EXP)) - self.lower


def reduced(x: Any, to_whole: Any = MAGIC) -> Reduced:
    """Of a number that is small enough for n to be far below 2²⁰; ``to_whole`` is added to round, as ``MAGIC`` is."""
    turn = x * LOG2_E + to_whole
    n = turn - to_whole
    upper, lower = x - n * LN2[0], n * LN2[1]
    r = upper - lower
    return Reduced(turn, n, upper, lower, r, r * r)


@elementary
def exp(x: Any) -> Any:
    """Exponential of x, eˣ, subnormal results included.

    Example:
        >>> print(exp(1.0))
        2.718281828459045
    """
    x = held(x, UNDERFLOW_UNTIL, OVERFLOW_FROM)
    low = x < 0.0
    p = reduced(x, magic(low))
    rest = p.z * by_parity(p.r, p.z, (0.5, *EXP)) - p.lower
    s, lost = fast_sum(1.0, p.upper)
    return scaled(s + (lost + rest), p.turn, low)


@elementary
def expm1(x: Any) -> Any:
    """Exponential of x less 1, eˣ − 1, also where that is small."""
    y = held(x, MINUS_ONE_UNTIL, OVERFLOW_FROM)
    low = y < 0.25  # small y are not halved: they may be subnormal
    p = reduced(y, magic(low))
    # eˣ − 1 = 2ⁿ·((1 − 2⁻ⁿ) + (eʳ − 1)); for n = 1024 half of 2¹⁻ⁿ is still a number.
    one, one_rest = fast_sum(1.0, -0.5 * power_of_two(1.0 - p.n))
    s, lost = fast_sum(one, p.upper)
    # Just above ln 2/2 the rounding error of r matters.
    rest = p.rest + (p.r * ((p.upper - p.r) - p.lower) + one_rest)
    return either_bits(scaled(s + (lost + rest), p.turn, low), sign_of(x))


def exp2_of_sum(x: Any, tail: Any, low: Any) -> Any:
    """Two to the power x + tail, for |x| below 1100 and a tail that is small beside it; ``low`` is whether x is below 0."""
    to_whole = magic(low)
    turn = x + to_whole
    upper = x - (turn - to_whole)  # exact
    r = upper + tail
    r1, _ = halves(r)
    r2 = (upper - r1) + tail
    s, lost = fast_sum(1.0, r1 * LN2_UPPER[0])
    z = r * r
    rest = (r2 * (LN2_UPPER[0] + LN2_UPPER[1]) + r1 * LN2_UPPER[1]) + z * by_parity(r, z, EXP2)
    return scaled(s + (lost + rest), turn, low)


@elementary
def exp2(x: Any) -> Any:
    """Two to the power x; exact for whole x."""
    x = held(x, LOWEST_POWER_OF_TWO, HIGHEST_POWER_OF_TWO)
    return exp2_of_sum(x, 0.0, x < 0.0)
