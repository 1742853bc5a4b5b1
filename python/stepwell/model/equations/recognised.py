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
from types import BuiltinFunctionType, CellType, CodeType, FunctionType, ModuleType
from typing import Any
from weakref import WeakKeyDictionary, ref

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


class Reading:
    """The objects that a function reads, and its identity, which holds as long as they are the very same.

    That is seen in a microsecond; to find the identity anew takes some tens of them.
    """

    def __init__(self) -> None:
        self.identity: Any = None
        #: The function; and all functions that are read while it is, each with its code and its defaults.
        self.function: Any = None
        self.functions: list[FunctionType] = []
        self.defaults: list[tuple[CodeType, Any, Any]] = []
        #: Dictionaries with a name and the object under it, and captured variables with their objects.
        self.names: list[tuple[dict[str, Any], str, Any]] = []
        self.cells: list[tuple[CellType, Any]] = []
        #: Whether none of the objects can be changed in place.
        self.is_fixed = True

    def holds(self, function: Any) -> bool:
        """True if it is of this function, which still reads the same objects, none of which can be changed in place."""
        if not self.is_fixed or self.function is None or self.function() is not function:
            return False
        for names, name, value in self.names:
            if names.get(name, _MISSING) is not value:
                return False
        for each, (code, defaults, keywords) in zip((function, *self.functions), self.defaults, strict=True):
            if each.__code__ is not code or each.__defaults__ is not defaults or each.__kwdefaults__ is not keywords:
                return False
            if each.__dict__:
                return False
        try:
            return all(cell.cell_contents is value for cell, value in self.cells)
        except ValueError:  # an empty cell
            return False


_MISSING = object()
#: What functions read that were recognised before, and the most of them.
_READ: WeakKeyDictionary[FunctionType, Reading] = WeakKeyDictionary()
MOST_READ = 256


def identity(function: Any) -> Any:
    """A value that is equal for functions that compute the same; the very same object while a function reads the same objects.

    Raises:
        Unknown: if something that the function reads may change unseen.
    """
    return reading(function).identity


def reading(function: Any) -> Reading:
    """The objects that a function reads, with its identity.

    Raises:
        Unknown: if something that the function reads may change unseen.
    """
    known = _READ.get(function) if type(function) is FunctionType else None
    if known is not None and known.holds(function):
        return known
    anew = Reading()
    anew.identity = _of(function, anew)
    if type(function) is FunctionType:
        # Known weakly, so that it can be forgotten when it is gone.
        anew.function, anew.functions = ref(function), anew.functions[1:]
        if len(_READ) >= MOST_READ:
            _READ.clear()
        _READ[function] = anew
    return anew


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


def _of(value: Any, reading: Reading) -> Any:
    kind = type(value)
    if kind is float:
        return value.hex()
    if value is None or kind in (int, bool, str, bytes):
        return kind, value
    if kind is FunctionType:
        return _of_function(value, reading)
    if isinstance(value, np.generic) and value.dtype.kind in "biuf":
        return value.dtype.str, value.tobytes()
    if kind is tuple and len(value) <= MOST_ITEMS:
        return kind, *(_of(each, reading) for each in value)
    if isinstance(value, (BuiltinFunctionType, np.ufunc)) or any(value is each for each in MODULES):
        return id(value)
    # NumPy's functions that are written in Python or dispatch to other types.
    if getattr(value, "__module__", "").partition(".")[0] == "numpy" and callable(value) and not isinstance(value, type):
        return id(value)
    reading.is_fixed = False
    if kind is np.ndarray and value.dtype.kind in "biuf" and value.nbytes <= MOST_BYTES:
        return value.dtype.str, value.shape, value.tobytes()
    if kind is list and len(value) <= MOST_ITEMS:
        return kind, *(_of(each, reading) for each in value)
    if kind is dict and len(value) <= MOST_ITEMS:
        return kind, *((_of(key, reading), _of(each, reading)) for key, each in value.items())
    if kind is partial:
        return kind, *(_of(each, reading) for each in (value.func, value.args, value.keywords))
    raise Unknown


def _of_function(function: FunctionType, reading: Reading) -> Any:
    for i, each in enumerate(reading.functions):
        if each is function:
            return "again", i
    keywords = function.__kwdefaults__
    reading.functions.append(function)
    reading.defaults.append((function.__code__, function.__defaults__, keywords))
    names = function.__globals__
    builtins = names.get("__builtins__")
    known = vars(builtins) if isinstance(builtins, ModuleType) else builtins or {}
    reading.names.append((names, "__builtins__", names.get("__builtins__", _MISSING)))
    read = []
    for name in _names(function.__code__):
        reading.names.append((names, name, names.get(name, _MISSING)))
        if name in names:
            read.append((name, _of(names[name], reading)))
            continue
        reading.names.append((known, name, known.get(name, _MISSING)))
        value = known.get(name)  # of Python; classes of errors read nothing but their arguments
        if not (value in PURE or (isinstance(value, type) and issubclass(value, BaseException))):
            raise Unknown
    cells = function.__closure__ or ()
    try:
        reading.cells += [(cell, cell.cell_contents) for cell in cells]
    except ValueError:  # an empty cell
        raise Unknown from None
    captured = tuple(_of(cell.cell_contents, reading) for cell in cells)
    by_name = []
    if keywords is not None:
        reading.names += [(keywords, name, value) for name, value in keywords.items()]
        by_name = [(name, _of(value, reading)) for name, value in keywords.items()]
    own = _of(vars(function), reading) if vars(function) else None
    return function.__code__, tuple(read), captured, _of(function.__defaults__, reading), tuple(by_name), own
