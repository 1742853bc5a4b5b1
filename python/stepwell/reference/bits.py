"""What a step does with numbers beside arithmetic and square roots: comparisons, choices, operations on their bits.

On numbers NumPy does it. The elements of an array of objects do it themselves: symbols, which write the tape of a step, and
numbers that count what is done to them. So what a step executes has no ``if`` on a number, and takes all this from here.
"""

import operator
from typing import Any

import numpy as np


def _objects(*given: Any) -> bool:
    """Whether any of these is made of objects."""
    return any(np.asarray(each).dtype == object for each in given)


def _asked(name: str, given: Any, *more: Any) -> Any:
    """The method of that name, applied to every element."""
    return np.frompyfunc(lambda each, *rest: getattr(each, name)(*rest), 1 + len(more), 1)(given, *more)


def is_single(x: Any) -> bool:
    """Whether these are symbols of a tape of float32."""
    return bool(_objects(x)) and any(getattr(each, "single", False) for each in np.asarray(x).flat)


def _bits(x: Any) -> Any:
    return np.asarray(x, dtype=np.float64).view(np.uint64)


def _number(bits: Any) -> Any:
    return np.asarray(bits).view(np.float64)


def less(a: Any, b: Any) -> Any:
    """Whether a < b. For a > b exchange them."""
    return np.frompyfunc(operator.lt, 2, 1)(a, b) if _objects(a, b) else np.less(a, b)


def at_most(a: Any, b: Any) -> Any:
    """Whether a ≤ b."""
    return np.frompyfunc(operator.le, 2, 1)(a, b) if _objects(a, b) else np.less_equal(a, b)


def where(truth: Any, yes: Any, no: Any) -> Any:
    """One of two numbers."""
    return _asked("choose", truth, yes, no) if _objects(truth) else np.where(truth, yes, no)


def clamp(x: Any, least: float, most: float) -> Any:
    """X held between two constants; a NaN stays one."""
    x = where(less(x, least), least, x)
    return where(less(most, x), most, x)


def and_bits(x: Any, bits: int) -> Any:
    """The bits of x that a constant has too."""
    return _asked("and_bits", x, bits) if _objects(x) else _number(_bits(x) & np.uint64(bits))


def or_bits(x: Any, bits: int) -> Any:
    """The bits of x and those of a constant."""
    return _asked("or_bits", x, bits) if _objects(x) else _number(_bits(x) | np.uint64(bits))


def add_bits(x: Any, whole: int) -> Any:
    """The bits of x as a whole number, and another added."""
    return _asked("add_bits", x, whole) if _objects(x) else _number(_bits(x) + np.uint64(whole))


def shift_up(x: Any, places: int) -> Any:
    """The bits of x, moved up."""
    return _asked("shift_up", x, places) if _objects(x) else _number(_bits(x) << np.uint64(places))


def shift_down(x: Any, places: int) -> Any:
    """The bits of x, moved down."""
    return _asked("shift_down", x, places) if _objects(x) else _number(_bits(x) >> np.uint64(places))


def turn_sign(x: Any, y: Any) -> Any:
    """X, its sign turned where the lowest bit of y is set."""
    if _objects(x, y):
        return _asked("xor_bits", x, _asked("shift_up", y, 31 if is_single(y) else 63))
    return _number(_bits(x) ^ (_bits(y) << np.uint64(63)))
