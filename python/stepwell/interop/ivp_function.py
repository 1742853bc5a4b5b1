"""The right-hand side of ``solve_ivp`` as a system: any callable ``fun(t, y, *args)``."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from functools import partial
from types import FunctionType, MethodType
from typing import Any, NamedTuple

import numpy as np

from ..base import checks
from ..errors import ArgumentError, DTypeError, TraceError
from ..model.equations.definition import Definition
from ..model.equations.namespace import rebound
from ..model.equations.recognised import Unknown, identity
from ..model.systems import System
from ..runs.request import Request


class RightHandSide:
    """The function that ``stepwell.system`` runs in place of ``fun``: with its further arguments, and the shapes of SciPy."""

    def __init__(self, fun: Callable[..., Any], args: tuple[Any, ...], size: int, vectorized: bool) -> None:
        self.reads = fun, args, size, vectorized
        function = plain_function(fun)
        self.__code__ = getattr(function, "__code__", None)  # by which an error finds its line
        self.__module__, self.__name__ = __name__, getattr(function, "__name__", type(fun).__name__)
        self.__qualname__ = self.__name__

    def __call__(self, t: Any, y: Any) -> Any:
        """The rates of a state."""
        fun, args, size, vectorized = self.reads
        rates = traceable(fun)(t, y[:, np.newaxis] if vectorized else y, *args)
        shape = np.shape(rates)
        if shape == () and size == 1:
            return [rates]
        return [row[0] for row in rates] if len(shape) == 2 and shape[1] == 1 else rates


class Known(NamedTuple):
    """The system of a function, and what was read for it.

    Attributes:
        reads: the function, its arguments, the length of the state, and whether it is a column.
        system: its system.
        requests: the runs that were made of it, without their starts, by what was asked for; and of calls in which equations were
            found to be stiff, by these and the start, the run that was taken.
    """

    reads: Any
    system: System
    requests: dict[Any, Request]


#: The systems of functions that are recognised, and the most that is remembered of them, and of each.
_KNOWN: dict[Any, Known] = {}
MOST_KNOWN = 64


def remember(memory: dict[Any, Any], key: Any, value: Any) -> None:
    """Keep a value for later calls."""
    if len(memory) >= MOST_KNOWN:
        memory.clear()
    memory[key] = value


def known(fun: Any, args: tuple[Any, ...], size: int, vectorized: bool) -> Known:
    """The system of a function, traced unless that was done before of all that it reads: see ``recognised``.

    Raises:
        DTypeError: if there is no function that can be traced.
        ArgumentError: if it does not take the arguments.
        TraceError: if the function does what cannot be traced.
    """
    reads = fun, args, size, vectorized
    try:
        key = identity(reads)
        found = _KNOWN.get(key)
        # What the one of the earlier call reads may have changed since.
        if found is not None and identity(found.reads) == key:
            return found
    except Unknown:
        key = None
    if not callable(fun):
        raise DTypeError(f"fun: expected a function fun(t, y), got {checks.short(fun)} ({type(fun).__name__})")
    if not isinstance(fun, type):
        takes("fun", fun, args)
    traceable(fun)
    rates: Any = RightHandSide(fun, args, size, vectorized)
    try:
        system = Definition(rates, 1, 1, ((0,), (size,)))().for_state_shapes(None, np.empty(size))
    except TraceError as error:
        raise TraceError(f"fun: {error}") from error
    found = Known(reads, system, {})
    if key is not None:
        remember(_KNOWN, key, found)
    return found


def plain_function(fun: Any) -> Any:
    """The Python function within a callable, if there is one."""
    if isinstance(fun, partial):
        return plain_function(fun.func)
    if isinstance(fun, MethodType):
        return fun.__func__
    if isinstance(fun, FunctionType):
        return fun
    return vars(type(fun)).get("__call__")


def traceable(fun: Any) -> Callable[..., Any]:
    """The callable with ``np`` and ``math`` replaced in its functions, so that they accept symbols.

    Raises:
        DTypeError: if there is no Python function to trace.
    """
    if isinstance(fun, partial):
        return partial(traceable(fun.func), *fun.args, **fun.keywords)
    if isinstance(fun, FunctionType):
        traced: Callable[..., Any] = rebound(fun)
        return traced
    function = plain_function(fun)
    if not isinstance(function, FunctionType):
        raise DTypeError(
            f"fun: expected a function written in Python, for its operations are recorded, got {checks.short(fun)} "
            f"({type(fun).__name__})"
        )
    return partial(rebound(function), fun.__self__ if isinstance(fun, MethodType) else fun)


def arguments(args: Any) -> tuple[Any, ...]:
    """The further arguments of a function.

    Raises:
        ArgumentError: if they are not a tuple.
    """
    if args is None:
        return ()
    if isinstance(args, (tuple, list)) or (isinstance(args, np.ndarray) and args.ndim):
        return tuple(checks.several("args", args, "arguments"))
    raise ArgumentError(f"args: expected a tuple such as args=(a,), got {checks.short(args)}")


def takes(argument: str, function: Any, args: tuple[Any, ...]) -> None:
    """Raise if a function cannot be called with a time, a state and the further arguments.

    Raises:
        ArgumentError: the parameters of the function, and the number of arguments.
    """
    name = checks.short(getattr(function, "__name__", type(function).__name__))[1:-1]
    try:
        expected = inspect.signature(function)
    except (TypeError, ValueError):  # functions that are not written in Python may have no signature
        return
    try:
        expected.bind(None, None, *args)
    except TypeError as error:
        raise ArgumentError(
            f"{argument}, args: {name}({', '.join(expected.parameters)}) is called with t, y and {len(args)} args, which it does "
            f"not take: {error}"
        ) from None
    checks.argument_order(f"{argument}: {name}", function, ("t", "y"))
