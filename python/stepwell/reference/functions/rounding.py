"""Rounding, choices, signs and remainders. All of these are exact."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...base.checks import numbers, short
from ...errors import DTypeError
from .. import bits
from ..bits import PRECISIONS, either_bits, equal, is_symbol, magnitude, sign_of, turn_bits
from ..bits import where as choose
from .elementary import as_array, elementary, lifted, one_by_one, shape_of, symbol_of
from .pieces import NAN, halves


@elementary
def floor(x: Any) -> Any:
    """The largest whole number not above x."""
    return bits.floor(x)


@elementary
def ceil(x: Any) -> Any:
    """The smallest whole number not below x."""
    return -bits.floor(-x)


@elementary
def trunc(x: Any) -> Any:
    """X without its fraction."""
    return either_bits(bits.floor(magnitude(x)), sign_of(x))


@elementary
def round(x: Any) -> Any:
    """The whole number nearest to x; the even one if two are equally near."""
    y, whole = magnitude(x), PRECISIONS.of(x).first_whole
    return either_bits(choose(y < whole, (y + whole) - whole, y), sign_of(x))


@elementary
def abs(x: Any) -> Any:
    """|x|."""
    return magnitude(x)


@elementary
def sign(x: Any) -> Any:
    """−1, 0 or 1, the sign of x; NaN for a NaN."""
    return choose(x < 0.0, -1.0, choose(x > 0.0, 1.0, x + 0.0))


@elementary
def copysign(x: Any, y: Any) -> Any:
    """|x| with the sign of y, zeros included. The sign of a computed NaN may differ between machines, so y must not be one."""
    return either_bits(magnitude(x), sign_of(y))


@elementary
def minimum(x: Any, y: Any) -> Any:
    """The smaller of x and y; NaN if one is."""
    return choose(equal(x, x), choose(x < y, x, y), x)


@elementary
def maximum(x: Any, y: Any) -> Any:
    """The larger of x and y; NaN if one is."""
    return choose(equal(x, x), choose(y < x, x, y), x)


def clip(x: Any, low: Any, high: Any) -> Any:
    """X limited to two bounds: ``minimum(maximum(x, low), high)``."""
    return minimum(maximum(x, low), high)


@elementary
def mod(x: Any, y: Any) -> Any:
    """The remainder of x after subtraction of whole multiples of y, with the sign of y, as ``x % y`` in Python.

    Exact if it has at most 53 bits and |x/y| is below 2⁵², of float32 24 bits and 2²³; NaN from there on.

    Example:
        >>> print(mod(-7.0, 3.0))
        2.0
    """
    a, b = magnitude(x), magnitude(y)
    n = bits.floor(a / b)  # perhaps one too many
    (n1, n2), (b1, b2) = halves(n), halves(b)
    r = (((a - n1 * b1) - n1 * b2) - n2 * b1) - n2 * b2
    r = choose(r < 0.0, r + b, r)
    r = choose(n < PRECISIONS.of(x).first_whole, r, NAN)
    r = choose(a < b, a, r)  # also of an infinite b
    # Now r is |x| mod |y|. With the sign of x it is one y too far from zero if that is not the sign of y.
    r = turn_bits(r, sign_of(x))
    apart = turn_bits(r, sign_of(y)) < 0.0
    return choose(equal(r, 0.0), sign_of(y), choose(apart, r + y, r))


remainder = mod


def where(condition: Any, x: Any, y: Any) -> Any:
    """X where the condition is true, else y. Both are computed.

    Args:
        condition: a comparison, of numbers or of symbols, or several joined by ``&``, ``|`` and ``~``; or a bool.
        x: a number, a symbol, or an array.
        y: the same.

    Returns:
        The elements of one or the other, of the shape to which all three broadcast.

    Raises:
        DTypeError: the condition is not made of truths, or x or y not of numbers.
        ShapeError: their shapes do not broadcast.
    """
    names = ("condition", "x", "y")
    arguments = tuple(map(as_array, names, (condition, x, y)))
    shape_of(names, arguments)
    if one_by_one(arguments):
        return np.frompyfunc(where, 3, 1)(*arguments)
    condition, x, y = arguments
    if is_symbol(condition):
        return condition.choose(lifted(condition, "x", x), lifted(condition, "y", y))
    if np.asarray(condition).dtype != bool:
        raise DTypeError(f"condition: expected a comparison or truths, got {type(condition).__name__} {short(condition)}")
    symbol = symbol_of(arguments)
    if symbol is not None:
        return lifted(symbol, "x", x) if condition else lifted(symbol, "y", y)
    return np.where(condition, numbers("x", x, finite=False), numbers("y", y, finite=False))[()]
