"""The decorator of elementary functions.

A function is written for arrays of float64 or for symbols; ``elementary`` wraps it, so that it takes all that users may pass.
Inside the function there are no numbers of Python. Sums, products, quotients and comparisons are operators; all else is in
``reference/bits.py``.
"""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import numpy as np

from ...base.checks import numbers
from ...errors import ShapeError
from ..bits import is_symbol
from ..marks import KINDS, mark

F = TypeVar("F", bound=Callable[..., Any])

#: Functions without a mark: those with another name for users, and those of products alone, which are differentiated as such.
NAMES, UNMARKED = {"any_power": "power"}, {"of", "deg2rad", "rad2deg"}


def symbol_of(values: Sequence[Any]) -> Any:
    """The first symbol among these, or None."""
    return next((each for each in values if is_symbol(each)), None)


def lifted(symbol: Any, name: str, value: Any) -> Any:
    """A number as a constant on the tape of a symbol; a symbol is returned unchanged."""
    return value if is_symbol(value) else symbol.number(float(numbers(name, value, finite=False)))


def as_array(name: str, value: Any) -> Any:
    """A list as an array, any other value unchanged."""
    if not isinstance(value, (list, tuple)):
        return value
    try:
        return np.asarray(value)
    except ValueError as error:
        raise ShapeError(f"{name}: expected a number or a regular array, got {type(value).__name__} ({error})") from None


def shape_of(names: Sequence[str], values: Sequence[Any]) -> tuple[int, ...]:
    """The shape to which all values broadcast."""
    shapes = [each.shape if isinstance(each, np.ndarray) else () for each in values]
    try:
        return np.broadcast_shapes(*shapes)
    except ValueError:
        raise ShapeError(f"{', '.join(names)}: expected shapes that broadcast, got {' and '.join(map(str, shapes))}") from None


def one_by_one(values: Sequence[Any]) -> bool:
    """True if some values are arrays of symbols, or arrays beside a symbol."""
    kinds = [each.dtype == object for each in values if isinstance(each, np.ndarray)]
    return any(kinds) or (bool(kinds) and symbol_of(values) is not None)


def elementary(f: F) -> F:
    """A function of symbols, of numbers, and of arrays of either, which broadcast.

    If any argument is a symbol, numbers become symbols of its tape. Infinities and NaN are treated like any number, without a
    warning. If users know the function by this name, its symbols are marked as its values, for differentiation.
    """
    signature = inspect.signature(f)
    names = tuple(signature.parameters)

    @functools.wraps(f)
    def of_anything(*values: Any, **named: Any) -> Any:
        if named or len(values) != len(names):
            values = signature.bind(*values, **named).args
        for among, function_of in KINDS:
            if among(values):
                return function_of(NAMES.get(f.__name__, f.__name__), of_anything, of_anything, values)
        values = tuple(map(as_array, names, values))
        shape = shape_of(names, values)
        if one_by_one(values):
            return np.frompyfunc(of_anything, len(values), 1)(*values)
        if (symbol := symbol_of(values)) is not None:
            value = f(*(lifted(symbol, *pair) for pair in zip(names, values, strict=True)))
            return (
                value if f.__name__ in UNMARKED else mark(NAMES.get(f.__name__, f.__name__), value, *values, function=of_anything)
            )
        arrays = [numbers(*pair, finite=False) for pair in zip(names, values, strict=True)]
        with np.errstate(all="ignore"):
            return f(*(np.atleast_1d(each) for each in arrays)).reshape(shape)[()]

    return of_anything  # type: ignore[return-value]
