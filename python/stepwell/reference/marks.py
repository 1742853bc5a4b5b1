"""Marks: which values on a tape are sin x, log x and so on, of which arguments.

Such a function consists of sums, products, roundings and operations on bits. Its value is accurate to the last bits, but a
derivative operation by operation would be wrong, since roundings and operations on bits have none. So ``stepwell.derivatives``
must know that a value is sin x, to use cos x. The functions note that while they are traced:

    with recording() as marks:
        ...  # trace something that calls functions decorated with @differentiable

Outside of ``recording`` nothing is noted, and on numbers nothing ever is.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from functools import wraps
from typing import Any, NamedTuple, TypeVar

import numpy as np

from .._core import Symbol

#: Values that these functions take besides numbers and symbols, as series: whether some of them are such, and how a function of
#: them is computed, from its name, the function of all kinds, the function itself and its arguments. Their modules add to it.
KINDS: list[tuple[Callable[[Any], bool], Callable[..., Any]]] = []

Function = TypeVar("Function", bound=Callable[..., Any])

#: The decorated functions by name, with which derivatives of others are written.
FUNCTIONS: dict[str, Callable[..., Any]] = {}


class Mark(NamedTuple):
    """The mark of a value: the function and the arguments of which it is the value.

    Attributes:
        name: of the function.
        arguments: symbols, or numbers that are known.
        function: the function itself, if it is decorated.
    """

    name: str
    arguments: tuple[Any, ...]
    function: Callable[..., Any] | None


#: The marks of one tape, by the number of the operation that computes the value.
Marks = dict[int, Mark]

_active: ContextVar[Marks | None] = ContextVar("marks", default=None)


@contextmanager
def recording(marks: Marks | None = None) -> Iterator[Marks]:
    """Note functions that are called with symbols, in a new table or in this one. All symbols must be of one tape."""
    table: Marks = {} if marks is None else marks
    before = _active.set(table)
    try:
        yield table
    finally:
        _active.reset(before)


def active() -> Marks | None:
    """The table in use, or None."""
    return _active.get()


def mark(name: str, result: Any, *arguments: Any, function: Callable[..., Any] | None = None) -> Any:
    """Note that ``result`` is the function ``name`` of ``arguments``, number by number, and return it.

    Nothing is noted outside of ``recording``, and of results that are no symbols.
    """
    marks = _active.get()
    if marks is None:
        return result
    if isinstance(result, Symbol) and not any(isinstance(each, np.ndarray) for each in arguments):
        _note(marks, name, result, arguments, function)
    elif np.asarray(result).dtype == object:
        for value, *each in np.broadcast(result, *arguments):
            _note(marks, name, value, tuple(each), function)
    return result


def _note(marks: Marks, name: str, result: Any, arguments: tuple[Any, ...], function: Callable[..., Any] | None) -> None:
    """Note one number's function.

    A value that is older than its arguments was not computed by the function: the tape found it equal to an earlier one, as
    maximum(x, x) equals x. It keeps its derivative, and a value that has a mark keeps that, for the same reason.
    """
    if isinstance(result, Symbol) and all(each.id < result.id for each in arguments if isinstance(each, Symbol)):
        marks.setdefault(result.id, Mark(name, arguments, function))


def differentiable(name: str, *, general: bool = True) -> Callable[[Function], Function]:
    """Decorate a function over arrays and symbols, all arguments numbers, so that its values are marked.

    Args:
        name: the function's name in the table of derivatives, ``stepwell.reference.tape.rules``.
        general: whether derivatives of functions in other files may be written with this one.
    """

    def decorate(function: Function) -> Function:
        @wraps(function)
        def marked(*arguments: Any) -> Any:
            for among, function_of in KINDS:
                if among(arguments):
                    return function_of(name, marked, function, arguments)
            value = function(*arguments)
            return value if _active.get() is None else mark(name, value, *arguments, function=function)

        if general or name not in FUNCTIONS:
            FUNCTIONS[name] = marked
        return marked  # type: ignore[return-value]

    return decorate
