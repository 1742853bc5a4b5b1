"""Operations on numbers that a step needs beside arithmetic: comparisons, choices, roots, operations on bits.

Each takes numbers, NumPy's arrays, symbols of a tape, and arrays of symbols. On numbers NumPy does it; symbols, and whatever else
stands in an array of objects, do it themselves. So what a step executes has no ``if`` on a number, and takes all this from here.
"""

from __future__ import annotations

import operator
import struct
from math import ldexp
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np

#: Of a number's bits: its sign, and all others. A tape of float32 has its own in their place.
SIGN, NOT_SIGN = 1 << 63, (1 << 63) - 1


class Precision:
    """Numbers of one size and their bits.

    Attributes:
        number: NumPy's type of them.
        bits: NumPy's type of a whole number of as many bits.
        fraction_bits: how many of the lowest bits are the fraction. Those of the exponent are above them.
        sign_place: which bit is the sign.
        all_bits: what is true as a number: all bits are set.
        upper_half: all bits but the lower half of the digits. A product of two numbers that are cut to these is exact.
        bias: the exponent's bits of 1.
        lowest_bit: the number with only the lowest bit set.
        least_normal: the least normal number above zero.
        first_whole: from here to its double the low bits of a number hold a whole number.
        magic: a number added to this is rounded to a whole one, which then stands in the low bits.
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
        """All bits where it is true, none elsewhere."""
        return self.number_of(np.where(truth, self.bits(self.all_bits), self.bits(0)))

    def pattern(self, x: float) -> int:
        """The bits of one number, which is rounded to this size."""
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
    """What is different for numbers of 64 bits and of 32."""

    double: T
    single: T

    def of(self, x: Any) -> T:
        """That of the precision of these numbers or symbols."""
        return self.single if is_single(x) else self.double


PRECISIONS = PerPrecision(DOUBLE, SINGLE)


def is_symbol(x: Any) -> bool:
    """Whether this is a value on a tape."""
    return hasattr(x, "and_bits")


def is_single(x: Any) -> bool:
    """Whether these are symbols of a tape of float32."""
    if not isinstance(x, np.ndarray):
        return bool(getattr(x, "single", False))
    return x.dtype == object and any(getattr(each, "single", False) for each in x.flat)


def _objects(*values: Any) -> bool:
    return any(is_symbol(each) or np.asarray(each).dtype == object for each in values)


def _call(method: str, x: Any, *others: Any) -> Any:
    """A method of every element."""
    if is_symbol(x) and not any(isinstance(each, np.ndarray) for each in others):
        return getattr(x, method)(*others)
    return np.frompyfunc(lambda each, *rest: getattr(each, method)(*rest), 1 + len(others), 1)(x, *others)


def less(a: Any, b: Any) -> Any:
    """Whether a < b. For a > b exchange them."""
    return np.frompyfunc(operator.lt, 2, 1)(a, b) if _objects(a, b) else np.less(a, b)


def at_most(a: Any, b: Any) -> Any:
    """Whether a ≤ b."""
    return np.frompyfunc(operator.le, 2, 1)(a, b) if _objects(a, b) else np.less_equal(a, b)


def equal(a: Any, b: Any) -> Any:
    """Whether a = b; false of a NaN, as all comparisons are."""
    return _call("equals", a, b) if _objects(a) else np.equal(a, b)


def where(truth: Any, yes: Any, no: Any) -> Any:
    """One of two numbers, chosen by a comparison."""
    return _call("choose", truth, yes, no) if _objects(truth) else np.where(truth, yes, no)


def clamp(x: Any, least: float, most: float) -> Any:
    """The number of these bounds that is nearest to x, or x between them; a NaN stays one."""
    x = where(less(x, least), least, x)
    return where(less(most, x), most, x)


def sqrt(x: Any) -> Any:
    """√x, correctly rounded."""
    return _call("sqrt", x) if _objects(x) else np.sqrt(x)


def floor(x: Any) -> Any:
    """The largest whole number not above x."""
    return _call("floor", x) if _objects(x) else np.floor(x)


def and_bits(x: Any, bits: int) -> Any:
    """The bits of x that a constant has too."""
    return _call("and_bits", x, bits) if _objects(x) else DOUBLE.number_of(DOUBLE.bits_of(x) & np.uint64(bits))


def or_bits(x: Any, bits: int) -> Any:
    """The bits of x and those of a constant."""
    return _call("or_bits", x, bits) if _objects(x) else DOUBLE.number_of(DOUBLE.bits_of(x) | np.uint64(bits))


def add_bits(x: Any, whole: int) -> Any:
    """The bits of x as a whole number, and a constant added."""
    return _call("add_bits", x, whole) if _objects(x) else DOUBLE.number_of(DOUBLE.bits_of(x) + np.uint64(whole))


def shift_up(x: Any, places: int) -> Any:
    """The bits of x, moved up."""
    return _call("shift_up", x, places) if _objects(x) else DOUBLE.number_of(DOUBLE.bits_of(x) << np.uint64(places))


def shift_down(x: Any, places: int) -> Any:
    """The bits of x, moved down."""
    return _call("shift_down", x, places) if _objects(x) else DOUBLE.number_of(DOUBLE.bits_of(x) >> np.uint64(places))


def either_bits(x: Any, y: Any) -> Any:
    """The bits of x and those of y."""
    return x | y if _objects(x) else DOUBLE.number_of(DOUBLE.bits_of(x) | DOUBLE.bits_of(y))


def turn_bits(x: Any, y: Any) -> Any:
    """The bits that one of x and y has, but not both."""
    return _call("xor_bits", x, y) if _objects(x) else DOUBLE.number_of(DOUBLE.bits_of(x) ^ DOUBLE.bits_of(y))


def turn_sign(x: Any, y: Any) -> Any:
    """X, its sign turned where the lowest bit of y is set."""
    if _objects(x, y):
        return _call("xor_bits", x, _call("shift_up", y, PRECISIONS.of(y).sign_place))
    return turn_bits(x, shift_up(y, 63))


def magnitude(x: Any) -> Any:
    """|x|."""
    return and_bits(x, NOT_SIGN)


def sign_of(x: Any) -> Any:
    """−0 or +0, as the sign of x is."""
    return and_bits(x, SIGN)
