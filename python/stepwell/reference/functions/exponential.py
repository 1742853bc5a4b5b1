"""Exponential functions.

x is reduced by n·ln 2 to r in [−ln 2/2, ln 2/2], where eʳ = 1 + r + r²/2 + r³·Q(r) with one polynomial Q, without a division.
``docs/coefficients.py`` finds the coefficients.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import ldexp
from typing import Any, NamedTuple

from ..bits import PRECISIONS, PerPrecision, clamp, either_bits, is_single, shift_up, sign_of, where
from .elementary import elementary
from .pieces import by_parity, fast_sum, halves, polynomial, power_of_two

#: By so many powers of two ``scaled`` raises what is small.
RAISED = PerPrecision(double=100, single=64)


class Constants(NamedTuple):
    """Constants of one precision.

    Attributes:
        log2_e: 1/ln 2.
        ln2: ln 2; n times the first part, of 33 or 15 bits, is exact.
        ln2_upper: ln 2 again, the first part of 26 or 12 bits.
        exp: (eʳ − 1 − r − r²/2)/r³.
        exp_short: (eʳ − 1 − r)/r².
        exp2: (2ʳ − 1 − r·ln 2)/r².
        underflow_until: up to here eˣ rounds to 0.
        minus_one_until: up to here eˣ − 1 rounds to −1.
        overflow_from: from here on both are infinite.
        lowest_power_of_two: up to here a power of 2 is 0.
        highest_power_of_two: from here on it is infinite.
    """

    log2_e: float
    ln2: tuple[float, float]
    ln2_upper: tuple[float, float]
    exp: tuple[float, ...]
    exp_short: tuple[float, ...]
    exp2: tuple[float, ...]
    underflow_until: float
    minus_one_until: float
    overflow_from: float
    lowest_power_of_two: float
    highest_power_of_two: float


_EXP = (
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
CONSTANTS = PerPrecision(
    double=Constants(
        log2_e=1.4426950408889634,
        ln2=(0.6931471806019545, -4.2009150726810846e-11),
        ln2_upper=(0.6931471824645996, -1.904654299957768e-09),
        exp=_EXP,
        exp_short=(0.5, *_EXP),
        exp2=(
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
        ),
        underflow_until=-746.0,
        minus_one_until=-40.0,
        overflow_from=710.0,
        lowest_power_of_two=-1080.0,
        highest_power_of_two=1025.0,
    ),
    single=Constants(
        log2_e=1.4426950408889634,
        ln2=(0.693145751953125, 1.428606765330187e-06),
        ln2_upper=(0.693115234375, 3.194618329871446e-05),
        exp=(0.1666666716337204, 0.04166645556688309, 0.008333197794854641, 0.0013935758033767343, 0.0001995340862777084),
        exp_short=(0.5, 0.1666651964187622, 0.04166640341281891, 0.008368822745978832, 0.0013940529897809029),
        exp2=(0.24022650718688965, 0.05550360679626465, 0.009618077427148819, 0.0013390871463343501, 0.0001545635750517249),
        underflow_until=-105.0,
        minus_one_until=-18.0,
        overflow_from=89.0,
        lowest_power_of_two=-152.0,
        highest_power_of_two=129.0,
    ),
)


class Reduced(NamedTuple):
    """x = n·ln 2 + upper − lower, and r is upper − lower, rounded; n stands in the low bits of ``turn``, and z is r²."""

    n: Any
    turn: Any
    upper: Any
    lower: Any
    r: Any
    z: Any

    def rest(self) -> Any:
        """eʳ = 1 + upper + rest."""
        return self.z * sum_of_powers(self.r, self.z, CONSTANTS.of(self.r).exp_short) - self.lower

    def accurate_rest(self) -> Any:
        """The rest, accurate where 1 + upper cancels: r²/2 by itself has one rounding less than within the polynomial."""
        exp = CONSTANTS.of(self.r).exp
        return (0.5 * self.z + (self.z * self.r) * sum_of_powers(self.r, self.z, exp)) - self.lower


def sum_of_powers(x: Any, z: Any, coefficients: Sequence[float]) -> Any:
    """A polynomial; z is x². The few terms of float32 are summed one after the other."""
    return polynomial(x, coefficients) if is_single(x) else by_parity(x, z, coefficients)


def magic(x: Any, low: Any) -> Any:
    """The number to which a whole number n is added for ``scaled``: an exponent's bits stand in the low ones of the sum."""
    precision, raised = PRECISIONS.of(x), RAISED.of(x)
    return where(low, precision.magic + (precision.bias + raised), precision.magic + (precision.bias - 1.0))


def scaled(x: Any, n: Any, turn: Any, low: Any) -> Any:
    """x·2ⁿ, rounded once, for |x| near 1 and all n at which it is not 0 or infinite; ``turn`` is n + ``magic(x, low)``.

    No single number of normal size is 2ⁿ for all of these, so there are two factors: one of them is 2 or a small power of it.
    ``low`` is true where n < 0, perhaps also where n = 0. In float32 n is rounded first, and ``turn`` is made here.
    """
    if is_single(x):
        turn = n + magic(x, low)
    return (x * shift_up(turn, PRECISIONS.of(x).fraction_bits)) * where(low, ldexp(1.0, -RAISED.of(x)), 2.0)


def reduced(x: Any, below: float | None = None) -> Reduced:
    """Of a number for which n is far below ``Precision.first_whole``; it is ``low`` for ``scaled`` if it is below a bound."""
    constants = CONSTANTS.of(x)
    to_whole = PRECISIONS.of(x).magic if below is None or is_single(x) else magic(x, x < below)
    turn = x * constants.log2_e + to_whole
    n = turn - to_whole
    upper, lower = x - n * constants.ln2[0], n * constants.ln2[1]
    r = upper - lower
    return Reduced(n, turn, upper, lower, r, r * r)


@elementary
def exp(x: Any) -> Any:
    """Exponential of x, eˣ, subnormal results included.

    Example:
        >>> print(exp(1.0))
        2.718281828459045
    """
    constants = CONSTANTS.of(x)
    x = clamp(x, constants.underflow_until, constants.overflow_from)
    p = reduced(x, below=0.0)
    rest = p.rest()
    s, lost = fast_sum(1.0, p.upper)
    return scaled(s + (lost + rest), p.n, p.turn, x < 0.0)


@elementary
def expm1(x: Any) -> Any:
    """Exponential of x less 1, eˣ − 1, also where that is small."""
    constants = CONSTANTS.of(x)
    y = clamp(x, constants.minus_one_until, constants.overflow_from)
    p = reduced(y, below=0.25)  # small y are not halved: they may be subnormal
    # eˣ − 1 = 2ⁿ·((1 − 2⁻ⁿ) + (eʳ − 1)); for the largest n half of 2¹⁻ⁿ is still a number.
    one, one_rest = fast_sum(1.0, -0.5 * power_of_two(1.0 - p.n))
    s, lost = fast_sum(one, p.upper)
    # Just above ln 2/2 the rounding error of r matters.
    rest = p.accurate_rest() + (p.r * ((p.upper - p.r) - p.lower) + one_rest)
    return either_bits(scaled(s + (lost + rest), p.n, p.turn, y < 0.25), sign_of(x))


def exp2_of_sum(x: Any, tail: Any) -> Any:
    """Two to the power x + tail, for an x up to a bit beyond the exponents of numbers, and a small tail: below 1/4 in float32."""
    constants, low = CONSTANTS.of(x), x < 0.0
    if is_single(x):  # the tail is not small beside 1/2, so n is that of the sum
        to_whole = PRECISIONS.of(x).magic
        turn = (x + tail) + to_whole
    else:
        to_whole = magic(x, low)
        turn = x + to_whole
    n = turn - to_whole
    upper = x - n  # exact
    r = upper + tail
    r1, _ = halves(r)
    r2 = (upper - r1) + tail
    first, second = constants.ln2_upper
    s, lost = fast_sum(1.0, r1 * first)
    z = r * r
    rest = (r2 * (first + second) + r1 * second) + z * by_parity(r, z, constants.exp2)
    return scaled(s + (lost + rest), n, turn, low)


@elementary
def exp2(x: Any) -> Any:
    """Two to the power x; exact for whole x."""
    constants = CONSTANTS.of(x)
    return exp2_of_sum(clamp(x, constants.lowest_power_of_two, constants.highest_power_of_two), 0.0)
