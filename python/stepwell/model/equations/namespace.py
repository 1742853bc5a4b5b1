"""The names ``np`` and ``math`` within a user's function.

Most of NumPy's functions leave the result to the type of their arguments. ``np.array`` does not, and ``math`` accepts floats
only. So in a user's function, and in the functions of its module that it calls, ``np`` and ``math`` are modules that accept
scalars and arrays of symbols.
"""

from __future__ import annotations

import builtins
import math
from contextlib import suppress
from types import CellType, FunctionType, ModuleType
from typing import Any

import numpy as np

from .arrays import ELEMENTWISE, elementwise_named
from .values import Operators, array


def _holds(x: Any) -> bool:
    """True if a value is or contains one that is not known yet."""
    if isinstance(x, Operators):
        return True
    if isinstance(x, np.ndarray):
        return x.dtype == object and any(isinstance(each, Operators) for each in x.flat)
    return isinstance(x, (list, tuple)) and any(map(_holds, x))


def _array(value: Any, *rest: Any, **options: Any) -> Any:
    return array(value) if _holds(value) else np.array(value, *rest, **options)


def _asarray(value: Any, *rest: Any, **options: Any) -> Any:
    if isinstance(value, Operators):
        return value
    return array(value) if _holds(value) else np.asarray(value, *rest, **options)


class _Module:
    """A module with some names replaced."""

    def __init__(self, module: ModuleType, names: dict[str, Any]) -> None:
        self._module, self._names = module, names

    def __getattr__(self, name: str) -> Any:
        names = object.__getattribute__(self, "_names")
        return names[name] if name in names else getattr(object.__getattribute__(self, "_module"), name)


#: Functions of ``math`` that have another name in NumPy.
OF_MATH = {"asin": "arcsin", "acos": "arccos", "atan": "arctan", "atan2": "arctan2", "pow": "power", "fabs": "abs"}


def _of_math(name: str, function: Any) -> Any:
    numpy_name = OF_MATH.get(name, name)

    def of_any(*arguments: Any) -> Any:
        return elementwise_named(numpy_name, *arguments) if any(map(_holds, arguments)) else function(*arguments)

    return of_any


_NUMPY = _Module(
    np,
    {
        "array": _array,
        "asarray": _asarray,
        "asanyarray": _asarray,
        "ascontiguousarray": _asarray,
        "float64": lambda x: x if _holds(x) else np.float64(x),
    },
)
_MATH = _Module(
    math,
    {name: _of_math(name, getattr(math, name)) for name in dir(math) if name in ELEMENTWISE or name in OF_MATH},
)
#: The modules that replace ``np`` and ``math``.
_MEANING: dict[int, Any] = {
    id(np): _NUMPY,
    id(math): _MATH,
    id(np.array): _array,
    id(np.asarray): _asarray,
} | {id(getattr(math, name)): meant for name, meant in _MATH._names.items()}


def rebound(function: Any, seen: dict[int, Any] | None = None) -> Any:
    """A copy of a function with ``np`` and ``math`` replaced, also in the functions of its module that it calls."""
    if not isinstance(function, FunctionType):
        return function
    seen = {} if seen is None else seen
    if id(function) in seen:
        return seen[id(function)]
    names = {**function.__globals__}
    closure = tuple(CellType() for _ in function.__closure__ or ())
    again = FunctionType(function.__code__, names, function.__name__, function.__defaults__, closure)
    again.__kwdefaults__ = function.__kwdefaults__
    vars(again).update(vars(function))
    seen[id(function)] = again

    def meant(value: Any) -> Any:
        if id(value) in _MEANING:
            return _MEANING[id(value)]
        if isinstance(value, FunctionType) and value.__globals__ is function.__globals__:
            return rebound(value, seen)
        return value

    for name in _names_of(function.__code__):
        if name in names:
            names[name] = meant(names[name])
    names["__builtins__"] = builtins
    for cell, old in zip(closure, function.__closure__ or (), strict=True):
        with suppress(ValueError):  # an empty cell: the name is bound later
            cell.cell_contents = meant(old.cell_contents)
    return again


def _names_of(code: Any) -> set[str]:
    """The names in a function's code and in the code of the functions within it."""
    names = set(code.co_names)
    for each in code.co_consts:
        if hasattr(each, "co_names"):
            names |= _names_of(each)
    return names
