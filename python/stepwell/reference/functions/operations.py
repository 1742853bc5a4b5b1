"""The operations of the elementary functions: those that arrays and the symbols of a tape both have.

``elementary`` wraps a function of such values so that it accepts all that users may pass. Inside it all values are arrays of
float64, or all are symbols; none is a number of Python. Sums, products, quotients and comparisons are operators.
"""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import numpy as np

from ...base.checks import numbers
from ...errors import ShapeError
from ..marks import KINDS, mark

F = TypeVar("F", bound=Callable[..., Any])

#: Functions without a mark: those with another name for users, and those of products alone, which are differentiated as such.
NAMES, UNMARKED = {"any_power": "power"}, {"of", "deg2rad", "rad2deg"}
#: The function of float32 by its name and that of float64; its module, which is made of the operations below, puts it here.
SINGLE: list[Callable[[str, Callable[..., Any]], Callable[..., Any]]] = []
#: Of a number's bits: its sign, and all others.
SIGN, NOT_SIGN = 1 << 63, (1 << 63) - 1


def is_symbol(value: Any) -> bool:
    """Whether this is a value on a tape."""
    return hasattr(value, "and_bits")


def symbol_of(given: Sequence[Any]) -> Any:
    """The first symbol among these, or None."""
    return next((each for each in given if is_symbol(each)), None)


def lifted(symbol: Any, name: str, value: Any) -> Any:
    """A number, as one on the tape of a symbol; a symbol stays one."""
    return value if is_symbol(value) else symbol.number(float(numbers(name, value, finite=False)))


def as_array(name: str, value: Any) -> Any:
    """A list as an array, any other value unchanged."""
    if not isinstance(value, (list, tuple)):
        return value
    try:
        return np.asarray(value)
    except ValueError as error:
        raise ShapeError(f"{name}: expected a number or a regular array, got {type(value).__name__} ({error})") from None


def shape_of(names: Sequence[str], given: Sequence[Any]) -> tuple[int, ...]:
    """The shape to which all broadcast."""
    shapes = [each.shape if isinstance(each, np.ndarray) else () for each in given]
    try:
        return np.broadcast_shapes(*shapes)
    except ValueError:
        raise ShapeError(f"{', '.join(names)}: expected shapes that broadcast, got {' and '.join(map(str, shapes))}") from None


def one_by_one(given: Sequence[Any]) -> bool:
    """Whether there are arrays whose elements are symbols, or arrays beside a symbol."""
    kinds = [each.dtype == object for each in given if isinstance(each, np.ndarray)]
    return any(kinds) or (bool(kinds) and symbol_of(given) is not None)


def elementary(f: F) -> F:
    """A function of symbols, of numbers, and of arrays of either, which broadcast.

    If any argument is a symbol, numbers become symbols of its tape. Infinities and NaN are treated like any number, without a
    warning. If users know the function by this name, its symbols are marked as its values, for differentiation.
    """
    signature = inspect.signature(f)
    names = tuple(signature.parameters)

    @functools.wraps(f)
    def of_anything(*given: Any, **named: Any) -> Any:
        if named or len(given) != len(names):
            given = signature.bind(*given, **named).args
        for among, function_of in KINDS:
            if among(given):
                return function_of(NAMES.get(f.__name__, f.__name__), of_anything, of_anything, given)
        given = tuple(map(as_array, names, given))
        shape = shape_of(names, given)
        if one_by_one(given):
            return np.frompyfunc(of_anything, len(given), 1)(*given)
        if (symbol := symbol_of(given)) is not None:
            value = _of_symbols(symbol, f)(*(lifted(symbol, *pair) for pair in zip(names, given, strict=True)))
            return (
                value if f.__name__ in UNMARKED else mark(NAMES.get(f.__name__, f.__name__), value, *given, function=of_anything)
            )
        arrays = [numbers(*pair, finite=False) for pair in zip(names, given, strict=True)]
        with np.errstate(all="ignore"):
            return f(*(np.atleast_1d(each) for each in arrays)).reshape(shape)[()]

    return of_anything  # type: ignore[return-value]


def _of_symbols(symbol: Any, f: Callable[..., Any]) -> Callable[..., Any]:
    """The function for symbols of the precision of this one."""
    if not getattr(symbol, "single", False):
        return f
    return SINGLE[0](f.__name__, f)


def _bits(x: Any) -> Any:
    return np.asarray(x, dtype=np.float64).view(np.uint64)


def _number(bits: Any) -> Any:
    return bits.view(np.float64)


def where(truth: Any, yes: Any, no: Any) -> Any:
    """One of two numbers, chosen by a comparison."""
    return truth.choose(yes, no) if is_symbol(truth) else np.where(truth, yes, no)


def equal(x: Any, y: Any) -> Any:
    """Whether x = y; false of a NaN, as all comparisons are."""
    return x.equals(y) if is_symbol(x) else np.equal(x, y)


def sqrt(x: Any) -> Any:
    """√x, correctly rounded."""
    return x.sqrt() if is_symbol(x) else np.sqrt(x)


def floor(x: Any) -> Any:
    """The largest whole number not above x."""
    return x.floor() if is_symbol(x) else np.floor(x)


def and_bits(x: Any, bits: int) -> Any:
    """The bits of x that a constant has too."""
    return x.and_bits(bits) if is_symbol(x) else _number(_bits(x) & np.uint64(bits))


def or_bits(x: Any, bits: int) -> Any:
    """The bits of x and those of a constant."""
    return x.or_bits(bits) if is_symbol(x) else _number(_bits(x) | np.uint64(bits))


def either_bits(x: Any, y: Any) -> Any:
    """The bits of x and those of y."""
    return x | y if is_symbol(x) else _number(_bits(x) | _bits(y))


def turn_bits(x: Any, y: Any) -> Any:
    """The bits that one of x and y has, but not both."""
    return x.xor_bits(y) if is_symbol(x) else _number(_bits(x) ^ _bits(y))


def add_bits(x: Any, whole: int) -> Any:
    """The bits of x as a whole number, and a constant added."""
    return x.add_bits(whole) if is_symbol(x) else _number(_bits(x) + np.uint64(whole))


def shift_up(x: Any, places: int) -> Any:
    """The bits of x, moved up."""
    return x.shift_up(places) if is_symbol(x) else _number(_bits(x) << np.uint64(places))


def shift_down(x: Any, places: int) -> Any:
    """The bits of x, moved down."""
    return x.shift_down(places) if is_symbol(x) else _number(_bits(x) >> np.uint64(places))


def magnitude(x: Any) -> Any:
    """|x|."""
    return and_bits(x, NOT_SIGN)


def sign_of(x: Any) -> Any:
    """−0 or +0, as the sign of x is."""
    return and_bits(x, SIGN)
