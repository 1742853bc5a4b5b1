"""The function of an event as operations, which are the same for every member and state."""

from __future__ import annotations

import inspect
from collections.abc import Iterator, Sequence
from itertools import count
from math import prod
from typing import Any

import numpy as np

from .. import _core, engine
from .._checks import Array
from ..equations.namespace import rebound
from ..equations.trace import kind_of, run_by, scalars
from ..equations.values import Scalar, objects
from ..errors import ArgumentError, TraceError
from ..reference.replayed import Operations
from ..systems import System
from .event import Event


class Quantity:
    """The quantity of an event, for a system whose parameters are known.

    Args:
        event: what it is.
        system: what moves.
        given: the parameters of the system that are numbers, by name, with one batch axis.
    """

    def __init__(self, event: Event, system: System, given: dict[str, Any]) -> None:
        self.event, self.v_shape, self.y_shape = event, system.v_shape, system.y_shape
        self.has_v = prod(system.v_shape) > 0
        self._parameters = self._named(system, given)
        self._quick_sines = bool(getattr(getattr(system, "definition", None), "quick_sines", False))
        self._shapes = {name: given[name].shape[:-1] for name in self._parameters}
        made = [self._operations_of() for _ in range(2)]
        if made[0].lines != made[1].lines:
            raise TraceError(
                f"events: {event.name}: expected the same operations at every call, got others: an event may not draw random "
                f"numbers or count its calls"
            )
        self._operations = made[0]

    def _named(self, system: System, given: dict[str, Any]) -> list[str]:
        """The parameters of the system that the function takes."""
        event, state = self.event, ("t", "v", "y") if self.has_v else ("t", "y")
        own = list(inspect.signature(event.function).parameters.values())
        head, rest = own[: len(state)], own[len(state) :]
        expected = f"({', '.join(state)}, *, …)"
        if len(head) < len(state) or any(each.kind not in (each.POSITIONAL_ONLY, each.POSITIONAL_OR_KEYWORD) for each in head):
            why = f", since {system.kind_name} has velocities" if self.has_v and len(head) == 2 else ""
            raise ArgumentError(f"events: {event.name}: expected a function {expected}{why}, got ({', '.join(map(str, own))})")
        taken = []
        for each in rest:
            if each.name in given and each.kind not in (each.POSITIONAL_ONLY, each.VAR_POSITIONAL, each.VAR_KEYWORD):
                taken.append(each.name)
            elif each.default is each.empty:
                known = ", ".join(given) or "none"
                raise ArgumentError(
                    f"events: {event.name}: expected a function {expected} whose further arguments are parameters of "
                    f"{system.kind_name} that do not change with the time, got {each}. Known: {known}."
                )
        return taken

    def _operations_of(self) -> Operations:
        """Its operations, of which the time is the first number of the state."""
        tape = _core.Tape()
        numbers, state = map(tape.param, count()), map(tape.state, count())
        t = next(state)
        parameters = {name: _symbols(shape, numbers) for name, shape in self._shapes.items()}
        return Operations(*tape.operations([self.on(tape, t, state, parameters)]))

    def on(self, tape: _core.Tape, t: _core.Symbol, state: Iterator[_core.Symbol], parameters: dict[str, Any]) -> _core.Symbol:
        """The same on a tape."""
        blocks = [_symbols(self.v_shape, state), _symbols(self.y_shape, state)][0 if self.has_v else 1 :]
        name = f"events: {self.event.name}"
        made = objects(run_by(rebound(self.event.function), name, self._quick_sines, Scalar(t), *blocks, **parameters))
        if made.ndim or not isinstance(made[()], (Scalar, int, float)):
            got = f"an array of shape {made.shape}" if made.ndim else kind_of(made[()])
            raise TraceError(f"{name}: expected one number, whose changes of sign are the event, got {got}")
        value = made[()].value if isinstance(made[()], Scalar) else made[()]
        return value if isinstance(value, _core.Symbol) else tape.number(float(value))

    def with_parameters(self, tape: _core.Tape, places: dict[str, int]) -> _core.Symbol:
        """The same as the core computes it: parameters are those from these places on."""
        parameters = {name: _symbols(shape, map(tape.param, count(places[name]))) for name, shape in self._shapes.items()}
        return self.on(tape, tape.time(), map(tape.state, count()), parameters)

    def __call__(self, t: Array, v: Array, y: Array, given: dict[str, Any]) -> Array:
        """The quantity of states whose axes are the block's first; times and parameters broadcast over the others."""
        state = [t, *_rows(v, self.v_shape), *_rows(y, self.y_shape)] if self.has_v else [t, *_rows(y, self.y_shape)]
        numbers = [each for name in self._parameters for each in _rows(given[name], given[name].shape[:-1])]
        with np.errstate(all="ignore"):
            made = self._operations(state, numbers)[0]
        return np.broadcast_to(np.asarray(made, dtype=np.float64), y.shape[len(self.y_shape) :])


def watched(quantities: Sequence[Quantity], plan: engine.Plan) -> engine.Watched:
    """What the core computes them by, for members of this plan."""
    places, rows = {}, 0
    for name, value in plan.system.parameters(plan.batch):
        if isinstance(value, np.ndarray):
            places[name], rows = rows, rows + len(value)
    tape = _core.Tape()
    words = {1: "rising", -1: "falling", 0: "both"}
    made = [(words[each.event.direction], each.with_parameters(tape, places)) for each in quantities]
    return engine.Watched(tape.equations([], [], made), len(made))


def _symbols(shape: tuple[int, ...], symbols: Iterator[Any]) -> Any:
    made = np.empty(shape, dtype=object)
    for index in np.ndindex(*shape):
        made[index] = next(symbols)
    return scalars(made, len(shape))


def _rows(block: Array, shape: tuple[int, ...]) -> list[Array]:
    """The numbers of a block, each over all states."""
    return [block[index] for index in np.ndindex(*shape)]
