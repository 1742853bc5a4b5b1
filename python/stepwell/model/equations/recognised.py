"""Recognising functions that were traced before, without running them.

Two functions compute the same if their code is equal and so is everything that the code may read: captured variables, globals by
the names in it, defaults, attributes, and the functions among these likewise. Numbers and arrays count by value, so a function
whose global was changed since is another one. A function that reads something that may change unseen, such as an object or a
module other than NumPy and ``math``, is not recognised, and is traced again.
"""

from __future__ import annotations

import dis
import math
from functools import lru_cache, partial
from types import BuiltinFunctionType, CodeType, FunctionType, ModuleType
from typing import Any

import numpy as np

#: Comparing larger arrays, lists and dictionaries takes longer than tracing.
MOST_BYTES, MOST_ITEMS = 1 << 16, 64
#: Modules whose attributes do not change.
MODULES: tuple[ModuleType, ...] = (np, math)
#: Functions of Python that read nothing but their arguments.
PURE = {abs, all, any, bool, divmod, enumerate, float, int, isinstance, len, list, map, max, min, pow, range, reversed, round}
PURE |= {slice, sorted, str, sum, tuple, zip}


class Unknown(Exception):  # noqa: N818 (not an error: the function is traced)
    """Something that a function reads may change unseen."""


def identity(function: Any) -> Any:
    """A value that is equal for functions that compute the same.

    Raises:
        Unknown: if something that the function reads may change unseen.
    """
    return _of(function, [])


@lru_cache(maxsize=1024)
def _names(code: CodeType) -> tuple[str, ...]:
    """The names of globals that code and the functions within it may read."""
    names: set[str] = set()
    for each in dis.get_instructions(code):
        if each.opname == "IMPORT_NAME":
            raise Unknown
        if each.opname in ("LOAD_GLOBAL", "LOAD_NAME"):
            names.add(each.argval)
    for each in code.co_consts:
        if isinstance(each, CodeType):
            names.update(_names(each))
    return tuple(sorted(names))


def _of(value: Any, seen: list[Any]) -> Any:
    kind = type(value)
    if kind is float:
        return value.hex()
    if value is None or kind in (int, bool, str, bytes):
        return kind, value
    if kind is FunctionType:
        return _of_function(value, seen)
    if kind is np.ndarray and value.dtype.kind in "biuf" and value.nbytes <= MOST_BYTES:
        return value.dtype.str, value.shape, value.tobytes()
    if isinstance(value, np.generic) and value.dtype.kind in "biuf":
        return value.dtype.str, value.tobytes()
    if kind in (tuple, list) and len(value) <= MOST_ITEMS:
        return kind, *(_of(each, seen) for each in value)
    if kind is dict and len(value) <= MOST_ITEMS:
        return kind, *((_of(key, seen), _of(each, seen)) for key, each in value.items())
    if kind is partial:
        return kind, *(_of(each, seen) for each in (value.func, value.args, value.keywords))
    if isinstance(value, (BuiltinFunctionType, np.ufunc)) or any(value is each for each in MODULES):
        return id(value)
    # NumPy's functions that are written in Python or dispatch to other types.
    if getattr(value, "__module__", "").partition(".")[0] == "numpy" and callable(value) and not isinstance(value, type):
        return id(value)
    raise Unknown


def _of_function(function: FunctionType, seen: list[Any]) -> Any:
    for i, each in enumerate(seen):
        if each is function:
            return "again", i
    seen.append(function)
    names = function.__globals__
    builtins = names.get("__builtins__")
    known = vars(builtins) if isinstance(builtins, ModuleType) else builtins or {}
    read = []
    for name in _names(function.__code__):
        if name in names:
            read.append((name, _of(names[name], seen)))
        elif not _is_pure(known.get(name)):
            raise Unknown
    try:
        captured = tuple(_of(cell.cell_contents, seen) for cell in function.__closure__ or ())
    except ValueError:  # an empty cell
        raise Unknown from None
    defaults = _of(function.__defaults__, seen), _of(function.__kwdefaults__, seen)
    return function.__code__, tuple(read), captured, defaults, _of(vars(function), seen)


def _is_pure(value: Any) -> bool:
    """Whether a built-in of Python reads nothing but its arguments, as classes of errors do."""
    return value in PURE or (isinstance(value, type) and issubclass(value, BaseException))
