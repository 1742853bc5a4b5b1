"""The right-hand side of ``solve_ivp`` as a system: any callable ``fun(t, y, *args)``, forward or backward in time."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from functools import partial
from types import FunctionType, MethodType
from typing import Any

import numpy as np

from ..base import checks
from ..errors import ArgumentError, DTypeError, TraceError
from ..model.equations.definition import Definition
from ..model.equations.namespace import rebound


class RightHandSide:
    """The function that ``stepwell.system`` runs in place of ``fun``: with its further arguments, and backward in time if asked.

    Args:
        fun: a function, a method, a ``functools.partial`` or another callable.
        args: its arguments after t and y.
        size: length of the state.
        vectorized: whether it expects the state as a column.
        backward: whether the time of the system is −t, for runs from a later to an earlier time.
    """

    def __init__(self, fun: Callable[..., Any], args: tuple[Any, ...], size: int, *, vectorized: bool, backward: bool) -> None:
        self._call, self._size, self._vectorized, self._backward = traceable(fun), size, vectorized, backward
        self._args = args
        function = plain_function(fun)
        self.__code__ = getattr(function, "__code__", None)  # by which an error finds its line
        self.__name__ = self.__qualname__ = getattr(function, "__name__", type(fun).__name__)

    def __call__(self, t: Any, y: Any) -> Any:
        """The rates of a state."""
        rates = self._call(-t if self._backward else t, y[:, np.newaxis] if self._vectorized else y, *self._args)
        shape = np.shape(rates)
        if shape == () and self._size == 1:
            rates = [rates]
        elif len(shape) == 2 and shape[1] == 1:
            rates = [row[0] for row in rates]
        return [-each for each in rates] if self._backward else rates

    def system(self) -> Any:
        """The system of these rates.

        Raises:
            TraceError: if the function does what cannot be traced.
        """
        try:
            return Definition(_named(self), 1, 1, ((0,), (self._size,)))().for_state_shapes(None, np.empty(self._size))
        except TraceError as error:
            raise TraceError(f"fun: {error}") from error


def _named(rates: RightHandSide) -> Any:
    """With what a definition reads of a function."""
    rates.__module__ = __name__
    return rates


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
