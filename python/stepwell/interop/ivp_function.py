"""The right-hand side of ``solve_ivp`` as a system: any callable ``fun(t, y, *args)``."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from inspect import Parameter, Signature
from types import CellType, FunctionType, MethodType
from typing import Any, NamedTuple

import numpy as np

from .._core import Symbol
from ..base import checks
from ..errors import ArgumentError, DTypeError, TraceError
from ..model.equations.definition import Definition
from ..model.equations.namespace import rebound
from ..model.equations.recognised import Unknown, identity
from ..model.systems import System
from ..reference.marks import Marks
from ..runs.request import Request

#: A function, its further arguments, the length of the state, and whether the function takes it as a column.
Reads = tuple[Any, tuple[Any, ...], int, bool]
#: The numbers among what a function reads that are parameters of its system: further arguments by their places, and captured
#: variables by their names.
Numbers = dict[Any, Any]


class RightHandSide:
    """The function that ``stepwell.system`` runs in place of ``fun``: with its further arguments, and the shapes of SciPy."""

    def __init__(self, reads: Reads, numbers: Numbers) -> None:
        self.reads, fun = reads, reads[0]
        named = [Parameter(name, Parameter.KEYWORD_ONLY, default=each) for name, each in named_parameters(numbers).items()]
        self.__signature__ = Signature([Parameter(name, Parameter.POSITIONAL_OR_KEYWORD) for name in "ty"] + named)
        self._places = list(numbers)
        function = plain_function(fun)
        self.__code__ = getattr(function, "__code__", None)  # by which an error finds its line
        self.__module__, self.__name__ = __name__, getattr(function, "__name__", type(fun).__name__)
        self.__qualname__ = self.__name__

    def __call__(self, t: Any, y: Any, **numbers: Any) -> Any:
        """The rates of a state."""
        fun, args, size, vectorized = with_numbers(self.reads, dict(zip(self._places, numbers.values(), strict=True)))
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
        numbers: those that are parameters of the system.
        requests: the runs that were made of it, without their starts, by what was asked for; and of calls in which equations were
            found to be stiff, by these and the start, the run that was taken.
    """

    reads: Reads
    system: System
    numbers: Numbers
    requests: dict[Any, Request]

    def of_numbers(self, request: Request) -> Request:
        """A run of the system with other numbers, of this one."""
        if request.system is self.system:
            return request
        return request._replace(system=self.system, plan=request.plan._replace(system=self.system))


#: The systems of functions that are recognised, and the most that is remembered of them, and of each.
_KNOWN: dict[Any, Known] = {}
MOST_KNOWN = 64
#: Functions whose numbers are no parameters.
_AS_THEY_ARE: dict[Any, bool] = {}


def remember(memory: dict[Any, Any], key: Any, value: Any) -> None:
    """Keep a value for later calls."""
    if len(memory) >= MOST_KNOWN:
        memory.clear()
    memory[key] = value


def known(fun: Any, args: tuple[Any, ...], size: int, vectorized: bool) -> Known:
    """The system of a function, traced unless that was done before of all that it reads: see ``recognised``."""
    reads = fun, args, size, vectorized
    numbers = numbers_of(reads)
    try:
        if numbers and (found := _found(_key(reads, numbers))) is not None:
            system = found.system.with_arguments(named_parameters(numbers))
            return found._replace(reads=reads, system=system, numbers=numbers)
        if (found := _found(_key(reads, {}))) is not None:
            return found
        numbers = {} if _key(reads, numbers) in _AS_THEY_ARE else numbers
    except Unknown:
        numbers = {}  # which is traced at each call anyway
    if not callable(fun):
        raise DTypeError(f"fun: expected a function fun(t, y), got {checks.short(fun)} ({type(fun).__name__})")
    if not isinstance(fun, type):
        takes("fun", fun, args)
    traceable(fun)
    for some in (numbers, {}) if numbers else ({},):  # a function may do with a number what is not possible with any
        try:
            definition = Definition(RightHandSide(reads, some), 1, 1, ((0,), (size,)))
            system = definition().for_state_shapes(None, np.empty(size))
        except TraceError as error:
            if some:
                continue
            raise TraceError(f"fun: {error}") from error
        if some and (_raises_to(system) or not _agrees(system, reads, some)):
            continue
        break
    found = Known(reads, system, some, {})
    with suppress(Unknown):
        remember(_KNOWN, _key(reads, some), found)
        if numbers and not some:
            remember(_AS_THEY_ARE, _key(reads, numbers), True)
    return found


def numbers_of(reads: Reads) -> Numbers:
    """The finite floats among further arguments and captured variables of a function."""
    fun, args, *_ = reads
    every: list[tuple[Any, Any]] = list(enumerate(args))
    if isinstance(fun, FunctionType):
        for name, cell in zip(fun.__code__.co_freevars, fun.__closure__ or (), strict=True):
            with suppress(ValueError):  # an empty cell
                every.append((name, cell.cell_contents))
    return {place: float(each) for place, each in every if type(each) in (float, np.float64) and np.isfinite(each)}


def named_parameters(numbers: Numbers) -> Numbers:
    """The numbers by the names of parameters."""
    return {f"args_{place}" if isinstance(place, int) else f"captured_{place}": each for place, each in numbers.items()}


def with_numbers(reads: Reads, numbers: Numbers) -> Reads:
    """The objects that a function reads, with others in place of its numbers."""
    fun, args, size, vectorized = reads
    args = tuple(numbers.get(i, each) for i, each in enumerate(args))
    if any(isinstance(place, str) for place in numbers):
        names, cells = fun.__code__.co_freevars, fun.__closure__
        cells = tuple(CellType(numbers[name]) if name in numbers else cell for name, cell in zip(names, cells, strict=True))
        again = FunctionType(fun.__code__, fun.__globals__, fun.__name__, fun.__defaults__, cells)
        again.__kwdefaults__ = fun.__kwdefaults__
        vars(again).update(vars(fun))
        fun = again
    return fun, args, size, vectorized


def _key(reads: Reads, numbers: Numbers) -> Any:
    """A key of what a function reads; of its numbers, that they are."""
    fun, *others = with_numbers(reads, dict.fromkeys(numbers, "number"))
    return identity(fun), identity(tuple(others)), *numbers


def _found(key: Any) -> Known | None:
    found = _KNOWN.get(key)
    # What the one of the earlier call reads may have changed since.
    if found is None or _key(found.reads, dict.fromkeys(key[2:])) != key:
        return None
    return found


def _raises_to(system: Any) -> bool:
    """True if rates raise to a power that is a parameter: to a known one, a product takes a tenth of the time."""
    marks: Marks = {}
    system._rates(marks)
    return any(mark.name == "power" and isinstance(mark.arguments[1], Symbol) for mark in marks.values())


def _agrees(system: Any, reads: Reads, numbers: Numbers) -> bool:
    """True if rates are those of the function: it may ask what kind of objects its numbers are.

    The numbers are others than those of the call, so that it follows from the function alone.
    """
    size = reads[2]
    for shift, y in ((0.3, np.linspace(0.5, 1.5, size)), (-1.7, np.linspace(-1.25, 0.75, size))):
        others = {place: shift + math.sqrt(2.0 + i) for i, place in enumerate(numbers)}
        fun, args, _, vectorized = with_numbers(reads, others)
        with np.errstate(all="ignore"):
            try:
                expected = np.asarray(fun(0.375, y[:, np.newaxis] if vectorized else y, *args), np.float64).reshape(-1)
            except Exception:  # whatever a function raises where it is not defined
                return False
            rates = system.with_arguments(named_parameters(others)).reference_at_step(1.0, ()).dy(0.375, np.zeros(0), y)
            rates = np.broadcast_to(rates, (size,))
            if expected.shape != (size,) or not np.allclose(rates, expected, rtol=1e-9, atol=1e-12, equal_nan=True):
                return False
    return True


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
    """The further arguments of a function."""
    if args is None:
        return ()
    if isinstance(args, (tuple, list)) or (isinstance(args, np.ndarray) and args.ndim):
        return tuple(checks.several("args", args, "arguments"))
    raise ArgumentError(f"args: expected a tuple such as args=(a,), got {checks.short(args)}")


def takes(argument: str, function: Any, args: tuple[Any, ...]) -> None:
    """Raise if a function cannot be called with a time, a state and the further arguments."""
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
