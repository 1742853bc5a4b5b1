"""Invariants of users' own systems: quantities that are constant in the exact solution. Their gradients come from their tapes."""

from __future__ import annotations

from collections.abc import Callable, Collection
from functools import cached_property
from itertools import count
from math import prod
from types import FunctionType
from typing import Any, NamedTuple

import numpy as np

from ... import _core
from ...errors import ArgumentError, UnsupportedError
from ...reference.marks import recording
from ...reference.tape.replay import Replay
from .of_state import arguments_in_place, parameters_of
from .series import MarkedReplay, TracedFunction, symbols


class Invariant(NamedTuple):
    """A quantity that is constant in the exact solution.

    Attributes:
        name: the name of the function.
        function: a function of v and y, or of y alone in a first-order system, and of parameters of the system by name.
        parameters: the names of these parameters.
        takes_time: whether the function takes the time before the state, as rates do. It may not depend on the time.
    """

    name: str
    function: Callable[..., Any]
    parameters: tuple[str, ...]
    takes_time: bool = False


def invariant(system: str, state: tuple[str, ...], parameters: Collection[str], function: Any) -> Invariant:
    """The invariant that a function declares, for a system of this name, state and parameters; see ``Definition.invariant``."""
    if not isinstance(function, FunctionType):
        raise ArgumentError(f"{system}: expected a function as an invariant, got {type(function).__name__}")
    in_place = arguments_in_place(function)
    # The time is one more argument before the parameters.
    takes_time = len(in_place) > len(state) and in_place[len(state)].name not in parameters
    expected = f"({', '.join(state)}, *, …) or (t, {', '.join(state)}, *, …)"
    names = parameters_of(system, ("t", *state) if takes_time else state, parameters, function, expected)
    return Invariant(function.__name__, function, names, takes_time)


class Traced:
    """An invariant of a system of known shapes: its value and its gradient as operations, of float32 if ``single``."""

    def __init__(self, invariant: Invariant, equations: TracedFunction, *, single: bool = False) -> None:
        self.invariant, self.equations = invariant, equations
        shapes = equations.own_shapes
        if changing := [each for each in invariant.parameters if shapes[each] is None]:
            raise ArgumentError(
                f"{equations.name}: {invariant.name}: expected parameters that are constant, got {', '.join(changing)}, which "
                f"changes with the time"
            )
        self._tape = _core.Tape(single=single)
        numbers = map(self._tape.param, count())
        parameters = {each: symbols(shapes[each], numbers) for each in invariant.parameters}
        state = map(self._tape.state, count())
        v, y = symbols(equations.v_shape, state), symbols(equations.y_shape, state)
        with recording() as self._marks:
            value = equations.of_state(invariant, self._tape.time(), v, y, parameters)
        self._value = value if isinstance(value, _core.Symbol) else self._tape.number(float(value))
        self._state = [*v.flat, *y.flat]
        self._of_value = MarkedReplay(self._tape, [self._value], self._marks)
        if any(name == "time" for name, *_ in self._of_value.lines):
            raise ArgumentError(
                f"{equations.name}: {invariant.name}: expected a quantity of the state and the parameters, got one that depends "
                f"on the time t"
            )

    @cached_property
    def _of_gradient(self) -> Replay:
        from ...reference.tape.modes import gradient  # slow to import, and only controls and projections need it

        along = gradient(self._tape, self._value, self._state, self._marks)
        # What algebraic equations determine follows from the others.
        mass, zero = self.equations.mass_matrix, self._tape.number(0.0)
        for place in () if mass is None else (number for number, row in enumerate(mass.rows) if not row):
            if along[place].id != zero.id:
                raise UnsupportedError(
                    f"control: expected an invariant of numbers that have a rate, and {self.invariant.name} of "
                    f"{self.equations.name} depends on y[{place}], which an algebraic equation determines"
                )
        square = along[0] * along[0]
        for each in along[1:]:
            square = square + each * each
        return MarkedReplay(self._tape, [*along, square], self._marks)

    @cached_property
    def _in_single(self) -> Traced:
        return Traced(self.invariant, self.equations, single=True)

    def value(self, v: Any, y: Any, values: dict[str, Any]) -> Any:
        """The value of the invariant for a state."""
        traced = self._in_single if _are_single(v, y) else self
        return traced._replayed(traced._of_value, v, y, values)[0]

    def gradient(self, v: Any, y: Any, values: dict[str, Any]) -> tuple[list[Any], list[Any], Any]:
        """The derivatives by the numbers of v and of y, and the sum of their squares."""
        traced = self._in_single if _are_single(v, y) else self
        *along, square = traced._replayed(traced._of_gradient, v, y, values)
        n_v = prod(self.equations.v_shape)
        return along[:n_v], along[n_v:], square

    def _replayed(self, operations: Replay, v: Any, y: Any, values: dict[str, Any]) -> list[Any]:
        equations = self.equations
        state = [*_numbers(v, equations.v_shape), *_numbers(y, equations.y_shape)]
        numbers: list[Any] = []
        for name in self.invariant.parameters:
            value = np.asarray(values[name])
            numbers += _numbers(value, value.shape[: equations.own_axes(name)])
        with np.errstate(all="ignore"):
            return operations(state, numbers)


def _are_single(*blocks: Any) -> bool:
    """True if the blocks hold symbols of float32."""
    of_symbols = (np.asarray(block) for block in blocks)
    return any(getattr(each, "single", False) for block in of_symbols if block.dtype == object for each in block.flat)


def _numbers(block: Any, shape: Any) -> list[Any]:
    """The numbers of a block, each an array over the batch or a symbol."""
    block = np.asarray(block)
    return [block[index] for index in np.ndindex(*shape)]
