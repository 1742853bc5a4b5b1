"""Elementary functions of float32, of symbols only: for numbers of 32 bits steps exist as tapes alone.

They go the ways of the functions of float64 with shorter polynomials. ``docs/numerics.md`` says how accurate each is.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ...errors import UnsupportedError
from .operations import (
    SINGLE,
    add_bits,
    and_bits,
    either_bits,
    equal,
    magnitude,
    or_bits,
    shift_down,
    shift_up,
    sign_of,
    turn_bits,
    where,
)
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


def _reduced(x: Any) -> tuple[Any, Any, Any, Any]:
    """Of |x| = n·π/2 + r: a number in whose low bits n stands, whether n is odd, sin r and cos r; NaN if |x| is too large."""
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
    sine = r + ((z * r) * polynomial(z, SIN) + tail * cosine)
    cosine = cosine + (((1.0 - cosine) - half) + ((z * z) * polynomial(z, COS) - r * tail))
    return turn, equal(and_bits(turn, 1), ODD), sine, cosine


def sin(x: Any) -> Any:
    """Sin x; NaN beyond 2²¹."""
    turn, odd, sine, cosine = _reduced(x)
    return turn_bits(where(odd, cosine, sine), sign_of(turn_bits(shift_up(turn, 30), x)))


def cos(x: Any) -> Any:
    """Cos x; NaN beyond 2²¹."""
    turn, odd, sine, cosine = _reduced(x)
    return turn_bits(where(odd, sine, cosine), sign_of(shift_up(add_bits(turn, 1), 30)))


def exp(x: Any) -> Any:
    """Exponential of x, subnormal results included."""
    x = where(x < UNDERFLOW_UNTIL, x.number(UNDERFLOW_UNTIL), x)
    x = where(x > OVERFLOW_FROM, x.number(OVERFLOW_FROM), x)
    n = (x * LOG2_E + MAGIC) - MAGIC
    upper, lower = x - n * LN2[0], n * LN2[1]
    r = upper - lower
    s, lost = fast_sum(1.0, upper)
    value = s + (lost + ((r * r) * polynomial(r, EXP) - lower))
    # No single number of normal size is 2ⁿ for all n, so there are two factors.
    low = x < 0.0
    first = shift_up(n + where(low, x.number(MAGIC + BIAS + 64.0), x.number(MAGIC + BIAS - 1.0)), 23)
    return (value * first) * where(low, x.number(2.0**-64), x.number(2.0))


def log(x: Any) -> Any:
    """Ln x, subnormal numbers included; −∞ of 0, NaN of negative numbers."""
    tiny = x < LEAST_NORMAL
    normal, offset = where(tiny, x * 2.0**25, x), where(tiny, x.number(TWO_23 + BIAS + 25.0), x.number(TWO_23 + BIAS))
    u = add_bits(normal, TO_ONE)
    k = or_bits(shift_down(u, 23), TWO_23_BITS) - offset
    f = add_bits(and_bits(u, MANTISSA), HALF_ROOT) - 1.0
    s = f / (2.0 + f)
    z = s * s
    half = (0.5 * f) * f
    rest = s * (half + z * polynomial(z, LOG))
    value = k * LN2[0] - ((half - (rest + k * LN2[1])) - f)
    value = where(x < INFINITY, value, x)  # infinity and NaN
    return where(equal(x, 0.0), x.number(-INFINITY), where(x < 0.0, x.number(NAN), value))


def round(x: Any) -> Any:
    """The whole number nearest to x; the even one if two are equally near."""
    y = magnitude(x)
    return either_bits(where(y < TWO_23, (y + TWO_23) - TWO_23, y), sign_of(x))


#: The functions of float32 by name.
FUNCTIONS: dict[str, Callable[..., Any]] = {"cos": cos, "exp": exp, "log": log, "round": round, "sin": sin}
#: Those whose text is right for numbers of any precision: comparisons, choices, signs, single operations and products.
OF_ANY = {"abs", "ceil", "copysign", "deg2rad", "equal", "floor", "greater", "greater_equal", "less", "less_equal", "maximum"}
OF_ANY |= {"minimum", "not_equal", "of", "rad2deg", "sign", "sqrt", "square", "trunc"}
#: Names by which users know functions that are called otherwise here.
NAMES = {"any_power": "power, but with exponents that are multiples of ½ from −16 to 16,"}


def version(name: str, function: Callable[..., Any]) -> Callable[..., Any]:
    """The function of that name for float32; raise if there is none."""
    if name in OF_ANY:
        return function
    if name in FUNCTIONS:
        return FUNCTIONS[name]
    known = ", ".join(sorted((OF_ANY | set(FUNCTIONS)) - {"of"}))
    raise UnsupportedError(
        f"dtype: {NAMES.get(name, name)} has no version of float32; there are {known}, and powers by products; write it with "
        f"these, or use dtype='float64'"
    )


SINGLE.append(version)
