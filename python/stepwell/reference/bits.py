"""Operations of a step beside arithmetic: comparisons, selections, roots, operations on bits.

Each takes numbers, NumPy's arrays, symbols of a tape, and arrays of symbols. NumPy computes those of numbers; symbols, and other
objects in an array, have methods for them. A step uses these functions in place of ``if``, which symbols do not allow.
"""

from __future__ import annotations

import operator
import struct
from math import ldexp
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np

#: Masks of the bits of a number: its sign, and all others. Tapes of float32 have their own.
SIGN, NOT_SIGN = 1 << 63, (1 << 63) - 1


class Precision:
    """The floating-point format of a precision.

    Attributes:
        number: NumPy's type of the numbers.
        bits: NumPy's type of a whole number with as many bits.
        fraction_bits: the number of bits of the fraction, which are the lowest; the exponent is above them.
        sign_place: the position of the sign bit.
        all_bits: the number with all bits set, which stands for true.
        upper_half: a mask of all bits but the lower half of the digits. A product of two numbers cut by it is exact.
        bias: the exponent bits of 1.
        lowest_bit: the number with only the lowest bit set.
        least_normal: the least normal number above zero.
        first_whole: in numbers from this one to its double the low bits hold a whole number.
        magic: adding a number to this one rounds it to a whole number, which is then in the low bits.
    """

    def __init__(self, number: type, bits: type, fraction_bits: int, formats: tuple[str, str]) -> None:
        size = 8 * np.dtype(bits).itemsize
        self.number, self.bits, self.fraction_bits = number, bits, fraction_bits
        self.sign_place, self.all_bits = size - 1, (1 << size) - 1
        self.upper_half = self.all_bits & -(1 << (fraction_bits + 2) // 2)
        self._formats = formats
        bias = (1 << size - fraction_bits - 2) - 1
        self.bias, self.least_normal = float(bias), ldexp(1.0, 1 - bias)
        self.lowest_bit = self.constant(1)
        self.first_whole = ldexp(1.0, fraction_bits)
        self.magic = 1.5 * self.first_whole

    def bits_of(self, x: Any) -> Any:
        """The bits of numbers, as whole numbers."""
        return np.asarray(x, dtype=self.number).view(self.bits)

    def number_of(self, bits: Any) -> Any:
        """The numbers of these bits."""
        return np.asarray(bits, dtype=self.bits).view(self.number)

    def mask(self, truth: Any) -> Any:
        """All bits set where the condition is true, none elsewhere."""
        return self.number_of(np.where(truth, self.bits(self.all_bits), self.bits(0)))

    def pattern(self, x: float) -> int:
        """The bits of one number, rounded to this precision."""
        bits: int = struct.unpack(self._formats[1], struct.pack(self._formats[0], x))[0]
        return bits

    def constant(self, bits: int) -> float:
        """The one number of these bits."""
        x: float = struct.unpack(self._formats[0], struct.pack(self._formats[1], bits))[0]
        return x


DOUBLE = Precision(np.float64, np.uint64, 52, ("<d", "<Q"))
SINGLE = Precision(np.float32, np.uint32, 23, ("<f", "<I"))

T = TypeVar("T")


class PerPrecision(NamedTuple, Generic[T]):
    """A pair of values, for float64 and for float32."""

    double: T
    single: T

    def of(self, x: Any) -> T:
        """The value for the precision of these numbers or symbols."""
        return self.single if is_single(x) else self.double


PRECISIONS = PerPrecision(DOUBLE, SINGLE)


def is_symbol(x: Any) -> bool:
    """True for a value on a tape."""
    return hasattr(x, "and_bits")


def is_single(x: Any) -> bool:
    """True for symbols on a tape of float32."""
    if not isinstance(x, np.ndarray):
        return bool(getattr(x, "single", False))
    return x.dtype == object and any(getattr(each, "single", False) for each in x.flat)


def _objects(*values: Any) -> bool:
    return any(is_symbol(each) or np.asarray(each).dtype == object for each in values)


def _call(method: str, x: Any, *others: Any) -> Any:
    """Call a method of each element."""
    if is_symbol(x) and not any(isinstance(each, np.ndarray) for each in others):
        return getattr(x, method)(*others)
    return np.frompyfunc(lambda each, *rest: getattr(each, method)(*rest), 1 + len(others), 1)(x, *others)


def less(a: Any, b: Any) -> Any:
    """True where a < b. For a > b exchange them."""
    return np.frompyfunc(operator.lt, 2, 1)(a, b) if _objects(a, b) else np.less(a, b)


def at_most(a: Any, b: Any) -> Any:
    """True where a ≤ b."""
    return np.frompyfunc(operator.le, 2, 1)(a, b) if _objects(a, b) else np.less_equal(a, b)


def equal(a: Any, b: Any) -> Any:
    """True where a = b; false of a NaN, as all comparisons are."""
    return _call("equals", a, b) if _objects(a) else np.equal(a, b)


def where(truth: Any, yes: Any, no: Any) -> Any:
    """The first number where the comparison is true, else the second."""
    return _call("choose", truth, yes, no) if _objects(truth) else np.where(truth, yes, no)


def clamp(x: Any, least: float, most: float) -> Any:
    """Clamp x to these bounds; NaN stays NaN."""
    x = where(less(x, least), least, x)
    return where(less(most, x), most, x)


def sqrt(x: Any) -> Any:
    """√x, correctly rounded."""
    return _call("sqrt", x) if _objects(x) else np.sqrt(x)


def mul_add(x: Any, y: Any, z: Any) -> Any:
    """x·y + z, rounded once."""
    from .fma import fma  # only what is fused needs it

    return _call("mul_add", x, y, z) if _objects(x) else fma(x, y, z)


def mul_sub_from(x: Any, y: Any, z: Any) -> Any:
    """The number z − x·y, rounded once."""
    return _call("mul_sub_from", x, y, z) if _objects(x) else mul_add(-x, y, z)


def floor(x: Any) -> Any:
    """The largest whole number not above x."""
    return _call("floor", x) if _objects(x) else np.floor(x)


def and_bits(x: Any, bits: int) -> Any:
    """Bitwise and of x and a constant."""
    return _call("and_bits", x, bits) if _objects(x) else DOUBLE.number_of(DOUBLE.bits_of(x) & np.uint64(bits))


def or_bits(x: Any, bits: int) -> Any:
    """Bitwise or of x and a constant."""
    return _call("or_bits", x, bits) if _objects(x) else DOUBLE.number_of(DOUBLE.bits_of(x) | np.uint64(bits))


def add_bits(x: Any, whole: int) -> Any:
    """The sum of the bits of x, as a whole number, and a constant."""
    return _call("add_bits", x, whole) if _objects(x) else DOUBLE.number_of(DOUBLE.bits_of(x) + np.uint64(whole))


def sub_bits_from(x: Any, whole: int) -> Any:
    """A constant as a whole number, less the bits of x."""
    return _call("sub_bits_from", x, whole) if _objects(x) else DOUBLE.number_of(np.uint64(whole) - DOUBLE.bits_of(x))


def shift_up(x: Any, places: int) -> Any:
    """The bits of x shifted to higher places."""
    return _call("shift_up", x, places) if _objects(x) else DOUBLE.number_of(DOUBLE.bits_of(x) << np.uint64(places))


def shift_down(x: Any, places: int) -> Any:
    """The bits of x shifted to lower places."""
    return _call("shift_down", x, places) if _objects(x) else DOUBLE.number_of(DOUBLE.bits_of(x) >> np.uint64(places))


def either_bits(x: Any, y: Any) -> Any:
    """Bitwise or of x and y."""
    return x | y if _objects(x) else DOUBLE.number_of(DOUBLE.bits_of(x) | DOUBLE.bits_of(y))


def turn_bits(x: Any, y: Any) -> Any:
    """Bitwise exclusive or of x and y."""
    return _call("xor_bits", x, y) if _objects(x) else DOUBLE.number_of(DOUBLE.bits_of(x) ^ DOUBLE.bits_of(y))


def turn_sign(x: Any, y: Any) -> Any:
    """Change the sign of x where the lowest bit of y is set."""
    if _objects(x, y):
        return _call("xor_bits", x, _call("shift_up", y, PRECISIONS.of(y).sign_place))
    return turn_bits(x, shift_up(y, 63))


def magnitude(x: Any) -> Any:
    """|x|."""
    return and_bits(x, NOT_SIGN)


def sign_of(x: Any) -> Any:
    """Zero with the sign of x."""
    return and_bits(x, SIGN)
