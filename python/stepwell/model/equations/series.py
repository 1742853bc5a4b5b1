"""Users' functions in Taylor series: the derivatives of functions that a series needs, and the rates of series."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import count
from math import prod
from typing import Any, Protocol

import numpy as np

from ... import _core
from ...base.arrays import Array, Shape
from ...reference import series
from ...reference.marks import Marks, mark, recording
from ...reference.mass import Mass
from ...reference.tape.replay import Replay

Functions = list[tuple[Any, list[tuple[Any, Any]], tuple[float, float] | None, bool]]


def derivatives_of_functions(tape: Any, marks: Marks) -> Functions:
    """The marked values on a tape, each with its derivatives by the values that it depends on, bounds, and whether it has pieces.

    Derivatives join the tape. If a derivative is a function itself, as the cosine is that of the sine, its own derivative joins,
    too.
    """
    functions: Functions = []
    with recording(marks):
        done: set[int] = set()
        while waiting := [id for id in marks if id not in done]:
            for id in waiting:
                done.add(id)
                mark = marks[id]
                if not series.has_rule(mark):
                    continue
                value, wanted = tape.value(id), [isinstance(each, _core.Symbol) for each in mark.arguments]
                factors = zip(mark.arguments, series.factors(mark, value, wanted), strict=True)
                by = [(of, tape.number(by) if isinstance(by, float) else by) for of, by in factors if by is not None]
                functions.append((value, by, series.BRANCHES.get(mark.name), mark.name in series.PIECES))
    return functions


class _Value:
    """An input whose value is known."""

    def __init__(self, value: Any) -> None:
        self.value = value

    def at(self, t: Any) -> Any:
        return self.value


class Line(int):
    """The number of a line of a tape, in place of its value."""


class MarkedReplay(Replay):
    """The operations of values on a tape, repeated for other operands, with the functions among them marked.

    On series a function follows its own rule, since roundings and operations on bits have none; on symbols its value is marked.
    """

    def __init__(self, tape: Any, values: Sequence[Any], marks: Marks) -> None:
        functions = {id: function for id, function in marks.items() if series.has_rule(function)}
        arguments = [each for function in functions.values() for each in function.arguments if isinstance(each, _core.Symbol)]
        lines, places = tape.operations([*values, *(tape.value(id) for id in functions), *arguments])
        super().__init__(lines, places[: len(values)])
        place = dict(zip([*(each.id for each in values), *functions, *(each.id for each in arguments)], places, strict=True))
        self.functions = {
            place[id]: function._replace(
                arguments=tuple(Line(place[each.id]) if isinstance(each, _core.Symbol) else each for each in function.arguments)
            )
            for id, function in functions.items()
        }
        self.needed = self._needed()

    def _needed(self) -> list[int]:
        """The lines that the values depend on, where a function depends on its arguments and not on its operations."""
        needed: set[int] = set()
        waiting = list(self.places)
        while waiting:
            line = waiting.pop()
            if line not in needed:
                needed.add(line)
                function = self.functions.get(line)
                waiting += (
                    self.lines[line][1] if function is None else [each for each in function.arguments if isinstance(each, Line)]
                )
        return sorted(needed)

    def __call__(self, state: Sequence[Any], numbers: Sequence[Any], t: Any = None) -> list[Any]:
        """The values for numbers, arrays that broadcast, symbols, series, or arrays of series."""
        if not series.among((t, *state)):
            return super().__call__(state, numbers, t)
        batch = np.broadcast_shapes(*(np.shape(each) for each in (t, *numbers, *state)))
        values = np.empty((len(self.places), *batch), dtype=object)
        groups = [[np.broadcast_to(np.asarray(each, dtype=object), batch) for each in group] for group in ((t,), numbers, state)]
        for member in np.ndindex(batch):
            values[(slice(None), *member)] = self._of_series(*([each[member] for each in group] for group in groups))
        return list(values)

    def _of_series(self, t: list[Any], numbers: list[Any], state: list[Any]) -> list[Any]:
        """The values of one member."""
        values: dict[int, Any] = {}
        book = next(each.book for each in (*t, *state) if isinstance(each, series.Series))
        book.ends = True
        for line in self.needed:
            name, of, extra = self.lines[line]
            function = self.functions.get(line)
            if function is not None and function.function is not None:
                arguments = [values[each] if isinstance(each, Line) else each for each in function.arguments]
                values[line] = series.function(function.name, function.function, function.function, arguments)
            elif name in ("state", "parameter"):
                values[line] = (state if name == "state" else numbers)[extra]
            elif name == "time":
                values[line] = t[0]
            else:
                values[line] = series.operation(book, name, [values[each] for each in of], extra)
        return [values[place] for place in self.places]

    def _on_tape(self, values: list[Any], symbol: Any) -> list[Any]:
        """The values on another tape, with functions marked as on this one."""
        on_tape = super()._on_tape(values, symbol)
        for line, function in self.functions.items():
            arguments = [on_tape[each] if isinstance(each, Line) else each for each in function.arguments]
            mark(function.name, on_tape[line], *arguments, function=function.function)
        return on_tape


class TracedFunction(Protocol):
    """The part of ``trace.Equations`` that invariants and Taylor series need.

    Attributes:
        v_shape: shape of a member's velocity block.
        y_shape: shape of a member's coordinate block.
        own_shapes: the lengths of each parameter's own axes; None for a parameter that depends on time.
    """

    v_shape: Shape
    y_shape: Shape
    own_shapes: dict[str, Any]

    @property
    def mass_matrix(self) -> Mass | None:
        """The mass matrix if equations are algebraic."""

    @property
    def name(self) -> str:
        """The name of the function."""

    def own_axes(self, name: str) -> int:
        """How many axes of its own a parameter has."""

    def rates(self, t: Any, v: Array, y: Array, values: dict[str, Any], /) -> tuple[Array, Array]:
        """The rates (v̇, ẏ) of a state."""

    def of_state(self, invariant: Any, t: Any, v: Array, y: Array, values: dict[str, Any], /) -> Any:
        """The value of an invariant at a state."""


def symbols(shape: Shape, following: Any) -> Any:
    """An array of the symbols that follow."""
    block = np.empty(shape, dtype=object)
    for index in np.ndindex(shape):
        block[index] = next(following)
    return block


class OnSeries:
    """The operations of a user's function of the time and the state, carried out on series.

    ``function`` takes the time, both blocks and parameters by name; it returns blocks, and None for one that is not there.
    """

    def __init__(self, equations: TracedFunction, function: Callable[..., Sequence[Any]], values: dict[str, Any]) -> None:
        self.equations = equations
        tape, marks = _core.Tape(), Marks()
        numbers, state = map(tape.param, count()), map(tape.state, count())
        parameters: dict[str, Any] = {}
        for name, value in values.items():
            if hasattr(value, "at"):
                parameters[name] = _Value(next(numbers))
            else:
                own = np.shape(value)[: equations.own_axes(name)]
                parameters[name] = value if callable(value) else symbols(own, numbers)
        v, y = symbols(equations.v_shape, state), symbols(equations.y_shape, state)
        with recording(marks):
            blocks = [block for block in function(tape.time(), v, y, parameters) if block is not None]
        self.shapes = [np.shape(block) for block in blocks]
        roots = [each if isinstance(each, _core.Symbol) else tape.number(float(each)) for block in blocks for each in block.flat]
        self.operations = MarkedReplay(tape, roots, marks)

    def __call__(self, t: Any, v: Any, y: Any, values: dict[str, Any]) -> list[Any]:
        """The blocks for arrays of series whose last axes are those of a batch."""
        equations = self.equations
        v, y, t = (np.asarray(each, dtype=object) for each in (v, y, t))
        rows: list[Any] = []
        for name, value in values.items():
            if hasattr(value, "at"):
                rows.append(np.asarray(value.at(t[()]), dtype=object))
            elif not callable(value):
                own = np.shape(value)[: equations.own_axes(name)]
                rows += [np.asarray(np.asarray(value)[index], dtype=object) for index in np.ndindex(own)]
        state = [block[index] for block, own in ((v, equations.v_shape), (y, equations.y_shape)) for index in np.ndindex(own)]
        state = [np.asarray(each, dtype=object) for each in state]
        batch = np.broadcast_shapes(t.shape, *(each.shape for each in (*rows, *state)))
        results = np.array(self.operations(state, rows, t), dtype=object).reshape((-1, *batch))
        ends = np.cumsum([prod(shape) for shape in self.shapes])
        blocks = zip(np.split(results, ends[:-1]), self.shapes, strict=True)
        return [block.reshape((*shape, *batch)) for block, shape in blocks]
