"""Users' functions in Taylor series: what a series must know of the functions in the rates, and rates of series."""

from __future__ import annotations

from itertools import count
from typing import Any

import numpy as np

from ... import _core
from ...reference import series
from ...reference.marks import Marks, recording
from ...reference.tape.replay import Replay
from .function import TracedFunction

Functions = list[tuple[Any, list[tuple[Any, Any]], tuple[float, float] | None]]


def derivatives_of_functions(tape: Any, marks: Marks) -> Functions:
    """The marked values on a tape, each with its bounds, the values that it depends on and its derivatives by them.

    Derivatives join the tape. That of a function may be another function, such as the cosine of a sine; then that one's
    derivative joins, too. A remainder a − b·⌊a/b⌋ also depends on a whole number, which shows that it is made of pieces.
    """
    found: Functions = []
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
                if mark.name in ("mod", "remainder"):
                    a, b = (each if isinstance(each, _core.Symbol) else tape.number(each) for each in mark.arguments)
                    by.append(((a / b).floor(), -b))
                found.append((value, by, series.BRANCHES.get(mark.name)))
    return found


class _Told:
    """An input whose value is told."""

    def __init__(self, value: Any) -> None:
        self.value = value

    def at(self, t: Any) -> Any:
        """The value."""
        return self.value


class Rates:
    """The operations of a user's function, carried out on series.

    Args:
        equations: the function.
        given: its parameters by name.
    """

    def __init__(self, equations: TracedFunction, given: dict[str, Any]) -> None:
        self.equations = equations
        tape, marks = _core.Tape(), Marks()
        numbers, state = map(tape.param, count()), map(tape.state, count())

        def symbols(shape: tuple[int, ...], of: Any) -> Any:
            block = np.empty(shape, dtype=object)
            for index in np.ndindex(shape):
                block[index] = next(of)
            return block

        told: dict[str, Any] = {}
        for name, value in given.items():
            if hasattr(value, "at"):
                told[name] = _Told(next(numbers))
            else:
                own = np.shape(value)[: equations.own_axes(name)]
                told[name] = value if callable(value) else symbols(own, numbers)
        v, y = symbols(equations.v_shape, state), symbols(equations.y_shape, state)
        with recording(marks):
            rates = equations.rates(tape.time(), v, y, told)
        roots = [each if isinstance(each, _core.Symbol) else tape.number(float(each)) for block in rates for each in block.flat]
        functions = {id: mark for id, mark in marks.items() if series.has_rule(mark)}
        arguments = [each for mark in functions.values() for each in mark.arguments if isinstance(each, _core.Symbol)]
        lines, places = tape.operations([*roots, *(tape.value(id) for id in functions), *arguments])
        self.operations = Replay(lines, places[: len(roots)])
        place = dict(zip([*(each.id for each in roots), *functions, *(each.id for each in arguments)], places, strict=True))
        self.functions = {
            place[id]: mark._replace(
                arguments=tuple(Line(place[each.id]) if isinstance(each, _core.Symbol) else each for each in mark.arguments)
            )
            for id, mark in functions.items()
        }
        self.needed = self._needed()

    def _needed(self) -> list[int]:
        needed: set[int] = set()
        waiting = list(self.operations.places)
        while waiting:
            line = waiting.pop()
            if line not in needed:
                needed.add(line)
                mark = self.functions.get(line)
                of = (
                    self.operations.lines[line][1]
                    if mark is None
                    else [each for each in mark.arguments if isinstance(each, Line)]
                )
                waiting += of
        return sorted(needed)

    def __call__(self, t: Any, v: Any, y: Any, given: dict[str, Any]) -> tuple[Any, Any]:
        """v̇ and ẏ of arrays of series whose last axes are those of a batch."""
        equations = self.equations
        v, y, t = (np.asarray(each, dtype=object) for each in (v, y, t))
        rows: list[Any] = []
        for name, value in given.items():
            if hasattr(value, "at"):
                rows.append(np.asarray(value.at(t[()]), dtype=object))
            elif not callable(value):
                own = np.shape(value)[: equations.own_axes(name)]
                rows += [np.asarray(np.asarray(value)[index], dtype=object) for index in np.ndindex(own)]
        state = [block[index] for block, own in ((v, equations.v_shape), (y, equations.y_shape)) for index in np.ndindex(own)]
        state = [np.asarray(each, dtype=object) for each in state]
        batch = np.broadcast_shapes(t.shape, *(each.shape for each in (*rows, *state)))
        made = np.empty((len(self.operations.places), *batch), dtype=object)
        for member in np.ndindex(batch):
            values = [[np.broadcast_to(each, batch)[member] for each in group] for group in ([t], rows, state)]
            made[(slice(None), *member)] = self._member(*values)
        n_v = len(state) - int(np.prod(equations.y_shape))
        return made[:n_v].reshape((*equations.v_shape, *batch)), made[n_v:].reshape((*equations.y_shape, *batch))

    def _member(self, t: list[Any], numbers: list[Any], state: list[Any]) -> list[Any]:
        made: dict[int, Any] = {}
        book = next(each.book for each in (*t, *state) if isinstance(each, series.Series))
        for line in self.needed:
            name, of, given = self.operations.lines[line]
            mark = self.functions.get(line)
            if mark is not None and mark.function is not None:
                arguments = [made[each] if isinstance(each, Line) else each for each in mark.arguments]
                made[line] = series.function(mark.name, mark.function, mark.function, arguments)
            elif name in ("state", "parameter"):
                made[line] = (state if name == "state" else numbers)[given]
            elif name == "time":
                made[line] = t[0]
            else:
                made[line] = series.operation(book, name, [made[each] for each in of], given)
        return [made[place] for place in self.operations.places]


class Line(int):
    """A line of a tape, in place of its value."""
