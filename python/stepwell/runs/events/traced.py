"""The function of an event as operations, the same for every member and state."""

from __future__ import annotations

import inspect
from collections.abc import Iterator, Sequence
from contextlib import suppress
from itertools import count
from math import prod
from typing import Any

import numpy as np

from ... import _core
from ...base import checks
from ...base.arrays import Array
from ...errors import ArgumentError, TraceError, UnsupportedError
from ...model.equations.namespace import rebound
from ...model.equations.recognised import Unknown, identity
from ...model.equations.trace import kind_of, run_function, scalars
from ...model.equations.values import Scalar, Truth, objects
from ...model.systems import System
from ...reference.marks import recording
from ...reference.tape.modes import directional
from .. import engine
from .evaluated import Evaluated
from .event import Event

#: The slope of a quantity without derivative is its change over this share of a step, divided by the share: half of the digits
#: are roundings.
SHORT = 2.0**-26


#: The parameters that a function takes, and their shapes for one member.
Shapes = dict[str, tuple[int, ...]]

#: The operations of quantities, of those that the core watches and of new states, and how many of each are remembered.
KNOWN: dict[Any, tuple[Shapes, Evaluated, Evaluated | None, bool]] = {}
WATCHED: dict[Any, engine.Watched] = {}
NEW_STATES: dict[Any, tuple[Shapes, Evaluated]] = {}
MOST_KNOWN = 256


def remember(known: dict[Any, Any], key: Any, value: Any) -> None:
    """Remember a value, and forget all others if there are too many."""
    if len(known) >= MOST_KNOWN:
        known.clear()
    known[key] = value


def _quick_sines(system: System) -> bool:
    return bool(getattr(getattr(system, "definition", None), "quick_sines", False))


def _shapes(values: dict[str, Any]) -> tuple[Any, ...]:
    return tuple((name, value.shape[:-1]) for name, value in values.items())


def parameters_of(function: Any, name: str, system: System, values: dict[str, Any]) -> Shapes:
    """The parameters of the system that a function of a state takes; ``values`` are those of the system by name."""
    state = ("t", "v", "y") if prod(system.v_shape) > 0 else ("t", "y")
    own = list(inspect.signature(function).parameters.values())
    head, rest = own[: len(state)], own[len(state) :]
    expected = f"({', '.join(state)}, *, …)"
    if len(head) < len(state) or any(each.kind not in (each.POSITIONAL_ONLY, each.POSITIONAL_OR_KEYWORD) for each in head):
        why = f", since {system.kind_name} has velocities" if len(state) == 3 and len(head) == 2 else ""
        raise ArgumentError(f"{name}: expected a function {expected}{why}, got ({', '.join(map(str, own))})")
    checks.argument_order(name, function, state)
    taken = []
    for each in rest:
        if each.name in values and each.kind not in (each.POSITIONAL_ONLY, each.VAR_POSITIONAL, each.VAR_KEYWORD):
            taken.append(each.name)
        elif each.default is each.empty:
            known = ", ".join(values) or "none"
            raise ArgumentError(
                f"{name}: expected a function {expected} whose further arguments are parameters of "
                f"{system.kind_name} that do not change with the time, got {each}. Known: {known}."
            )
    return {each: values[each].shape[:-1] for each in taken}


class Quantity:
    """The quantity of an event, for a system whose parameters are known.

    Args:
        event: the event.
        system: the system that moves.
        values: the parameters of the system that are numbers, by name, with one batch axis.
        by_core: whether the core computes it.
    """

    def __init__(self, event: Event, system: System, values: dict[str, Any], *, by_core: bool) -> None:
        self._by_core = by_core
        self.event, self.v_shape, self.y_shape = event, system.v_shape, system.y_shape
        self.has_v = prod(system.v_shape) > 0
        self._quick_sines = _quick_sines(system)
        self._n = 1 + self.has_v * prod(self.v_shape) + prod(self.y_shape)
        #: Equal for quantities with the same operations; None if something that the function reads may change unseen.
        self.key: Any = None
        with suppress(Unknown):
            of_function = identity(event.function)
            self.key = (of_function, self.v_shape, self.y_shape, _shapes(values), self._quick_sines, by_core)
        known = KNOWN.get(self.key)
        self._shapes = parameters_of(event.function, f"events: {event.name}", system, values) if known is None else known[0]
        if known is None:
            known = self._shapes, *self._trace()
            if self.key is not None:
                remember(KNOWN, self.key, known)
        #: Whether it depends on the time, and on nothing of the state.
        _, self._value, self._slope, self.of_time_alone = known

    def _trace(self) -> tuple[Evaluated, Evaluated | None, bool]:
        traces = [self._traced() for _ in range(2)]
        if traces[0][0].operations(traces[0][1])[0] != traces[1][0].operations(traces[1][1])[0]:
            raise TraceError(
                f"events: {self.event.name}: expected the same operations at every call, got others: an event may not draw "
                f"random numbers or count its calls"
            )
        of_state = [extra for name, _, extra in traces[0][0].operations(traces[0][1])[0] if name == "state"]
        return Evaluated(*traces[0], self._n, by_core=self._by_core), self._slope_of(), of_state == [0]

    def _traced(self) -> tuple[_core.Tape, list[_core.Symbol]]:
        """The event on a tape; its state begins with the time."""
        tape = _core.Tape()
        numbers, state = map(tape.param, count()), map(tape.state, count())
        t = next(state)
        parameters = {name: _symbols(shape, numbers) for name, shape in self._shapes.items()}
        return tape, [self.on(tape, t, state, parameters)]

    def _slope_of(self) -> Evaluated | None:
        """Its derivative along a change of time and state, which follows the state; None if it has pieces."""
        tape = _core.Tape()
        numbers, n = map(tape.param, count()), self._n
        state = [tape.state(i) for i in range(n)]
        parameters = {name: _symbols(shape, numbers) for name, shape in self._shapes.items()}
        with recording():
            value = self.on(tape, state[0], iter(state[1:]), parameters)
            try:
                slope = directional(tape, [value], zip(state, (tape.state(n + i) for i in range(n)), strict=True))
            except UnsupportedError:
                return None
        return Evaluated(tape, slope, 2 * n, by_core=self._by_core)

    def on(self, tape: _core.Tape, t: _core.Symbol, state: Iterator[_core.Symbol], parameters: dict[str, Any]) -> _core.Symbol:
        """Record the quantity on a tape."""
        blocks = [_symbols(self.v_shape, state), _symbols(self.y_shape, state)][0 if self.has_v else 1 :]
        name = f"events: {self.event.name}"
        result = objects(run_function(rebound(self.event.function), name, self._quick_sines, Scalar(t), *blocks, **parameters))
        if result.ndim or not isinstance(result[()], (Scalar, int, float)):
            got = f"an array of shape {result.shape}" if result.ndim else kind_of(result[()])
            raise TraceError(f"{name}: expected one number, whose changes of sign are the event, got {got}")
        if isinstance(truth := result[()], Truth):
            if truth.margin is None:
                raise TraceError(f"{name}: expected comparisons by <, <=, > and >=, joined by &, | and ~, got another condition")
            result = objects(truth.margin())
        value = result[()].value if isinstance(result[()], Scalar) else result[()]
        return value if isinstance(value, _core.Symbol) else tape.number(float(value))

    def of_time(self, tape: _core.Tape) -> _core.Symbol:
        """Record a quantity of the time alone on a tape with a time."""
        numbers = map(tape.param, count())
        parameters = {name: _symbols(shape, numbers) for name, shape in self._shapes.items()}
        return self.on(tape, tape.time(), map(tape.state, count()), parameters)

    def numbers(self, values: dict[str, Any]) -> list[Array]:
        """The numbers of its parameters, one after the other."""
        return [each for name, shape in self._shapes.items() for each in _rows(values[name], shape)]

    def with_parameters(self, tape: _core.Tape, places: dict[str, int]) -> _core.Symbol:
        """Record the quantity as the core computes it, with each parameter from its place on."""
        parameters = {name: _symbols(shape, map(tape.param, count(places[name]))) for name, shape in self._shapes.items()}
        return self.on(tape, tape.time(), map(tape.state, count()), parameters)

    def __call__(self, t: Array, v: Array, y: Array, values: dict[str, Any]) -> Array:
        """The quantity of states whose first axes are those of a block; times and parameters broadcast over the others."""
        return self._by(self._value, self._rows_of(t, v, y), y, values)

    def slope(self, t: Array, v: Array, y: Array, values: dict[str, Any], h: Array, dv: Array, dy: Array) -> Array:
        """By how much it would change in a step at these rates; from a short step if it has no derivative."""
        if self._slope is not None:
            changes = self._by(self._slope, [*self._rows_of(t, v, y), *self._rows_of(h, dv, dy)], y, values)
        else:
            with np.errstate(all="ignore"):
                there = self(t + SHORT * h, v + SHORT * dv, y + SHORT * dy, values)
                changes = (there - self(t, v, y, values)) / SHORT
        return np.nan_to_num(changes, nan=0.0)

    def _rows_of(self, t: Array, v: Array, y: Array) -> list[Array]:
        return [t, *(_rows(v, self.v_shape) if self.has_v else []), *_rows(y, self.y_shape)]

    @property
    def evaluated(self) -> tuple[Evaluated, Evaluated | None]:
        """The quantity and its derivative along a change of time and state, None without one."""
        return self._value, self._slope

    def _by(self, evaluated: Evaluated, state: list[Array], y: Array, values: dict[str, Any]) -> Array:
        value = evaluated(state, self.numbers(values))[0]
        return np.broadcast_to(np.asarray(value, dtype=np.float64), y.shape[len(self.y_shape) :])


class NewState:
    """The new state that an event gives a member, as operations.

    Args:
        event: the event, with a function ``then``.
        system: the system that moves.
        values: the parameters of the system that are numbers, by name, with one batch axis.
    """

    def __init__(self, event: Event, system: System, values: dict[str, Any], *, by_core: bool) -> None:
        self._name, self._function = f"events: {event.name}: then", event.then
        self._shapes = (system.v_shape, system.y_shape) if prod(system.v_shape) > 0 else (system.y_shape,)
        quick_sines, key = _quick_sines(system), None
        with suppress(Unknown):
            key = (identity(event.then), self._shapes, _shapes(values), quick_sines, by_core)
        known = NEW_STATES.get(key)
        if known is None:
            shapes = parameters_of(event.then, self._name, system, values)
            known = shapes, self._traced(shapes, quick_sines, by_core)
            if key is not None:
                remember(NEW_STATES, key, known)
        #: The new state of a time and a state.
        self._parameters, self.evaluated = known

    def _traced(self, shapes: Shapes, quick_sines: bool, by_core: bool) -> Evaluated:
        tape = _core.Tape()
        numbers, state = map(tape.param, count()), map(tape.state, count())
        t = next(state)
        parameters = {name: _symbols(shape, numbers) for name, shape in shapes.items()}
        blocks = [_symbols(shape, state) for shape in self._shapes]
        result = run_function(rebound(self._function), self._name, quick_sines, Scalar(t), *blocks, **parameters)
        flat = [each for block in self._blocks(result) for each in symbols(tape, block)]
        return Evaluated(tape, flat, 1 + sum(map(prod, self._shapes)), by_core=by_core)

    def numbers(self, values: dict[str, Any]) -> list[Array]:
        """The numbers of its parameters, one after the other."""
        return [each for name, shape in self._parameters.items() for each in _rows(values[name], shape)]

    def _blocks(self, result: Any) -> list[Any]:
        """The blocks that the function returned, broadcast to their shapes."""
        if len(self._shapes) == 2 and not (isinstance(result, (tuple, list)) and len(result) == 2):
            raise TraceError(f"{self._name}: expected the new state (v, y), got {kind_of(result)}")
        blocks = []
        for name, shape, block in zip(
            "vy"[-len(self._shapes) :], self._shapes, result if len(self._shapes) == 2 else [result], strict=True
        ):
            numbers = objects(block)
            wrong = next((each for each in numbers.flat if not isinstance(each, (Scalar, int, float))), None)
            if wrong is not None or numbers.shape not in ((), shape):
                got = f"shape {numbers.shape}" if wrong is None else kind_of(wrong)
                raise TraceError(f"{self._name}: expected a new {name} of shape {shape}, got {got}")
            blocks.append(np.broadcast_to(numbers, shape))
        return blocks

    def __call__(self, t: Array, v: Array, y: Array, values: dict[str, Any]) -> tuple[Array, Array]:
        """The new states of members, whose axis comes last."""
        blocks = (v, y)[-len(self._shapes) :]
        state = [t, *(row for block, shape in zip(blocks, self._shapes, strict=True) for row in _rows(block, shape))]
        results = self.evaluated(state, self.numbers(values))
        new_v, new_y, n = v.copy(), y.copy(), len(results) - prod(self._shapes[-1])
        for block, shape, rows in ((new_v, self._shapes[0], results[:n]), (new_y, self._shapes[-1], results[n:])):
            for index, row in zip(np.ndindex(*shape), rows, strict=False):
                block[index] = row
        return new_v, new_y


def symbols(tape: _core.Tape, block: Any) -> list[_core.Symbol]:
    """The symbols of an array of scalars and numbers."""
    values = [each.value if isinstance(each, Scalar) else each for each in block.flat]
    return [each if isinstance(each, _core.Symbol) else tape.number(float(each)) for each in values]


def watched(quantities: Sequence[Any], plan: engine.Plan) -> engine.Watched:
    """The quantities as the core computes them for members of this plan."""
    places, rows = {}, 0
    for name, value in plan.system.parameters(plan.batch):
        if isinstance(value, np.ndarray):
            places[name], rows = rows, rows + len(value)
    key = tuple(each.key for each in quantities), tuple(places.items())
    if None not in key[0] and key in WATCHED:
        return WATCHED[key]
    tape = _core.Tape()
    quantities_by_name = [(str(e), each.with_parameters(tape, places)) for e, each in enumerate(quantities)]
    made = engine.Watched(tape.equations([], [], quantities_by_name), len(quantities_by_name))
    if None not in key[0]:
        remember(WATCHED, key, made)
    return made


def _symbols(shape: tuple[int, ...], symbols: Iterator[Any]) -> Any:
    block = np.empty(shape, dtype=object)
    for index in np.ndindex(*shape):
        block[index] = next(symbols)
    return scalars(block, len(shape))


def _rows(block: Array, shape: tuple[int, ...]) -> list[Array]:
    """The numbers of a block, each over all states."""
    return [block[index] for index in np.ndindex(*shape)]
