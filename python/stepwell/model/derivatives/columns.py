"""A system together with the derivatives of its motion: by the start, and by its parameters."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import prod
from typing import Any

import numpy as np

from ... import _core
from ...base import checks
from ...base.arrays import Array, Shape
from ...errors import UnsupportedError
from ...reference.acceptance import NO_GROUP, Acceptance
from ...reference.signal import converted
from ...reference.tape.evaluate import Evaluation
from ...reference.tape.modes import directional
from ...reference.traced import Tracer
from ..equations.series import MarkedReplay, derivatives_of_functions
from ..inputs import Input
from ..parameters import CoreParameters, flat
from ..systems import System
from ..systems.own import RATES, OwnSystem
from .traced import Traced

#: The most operations of the rates and of the rates of all columns together.
MAX_OPERATIONS = 100_000


class _Rates:
    """The rates, scaled to a step: a function of the rows of a state and the time returns those of all rows."""

    def __init__(self, h: Any, rates: Callable[[Sequence[Any], Any], Sequence[Any]], rows_of_v: int) -> None:
        self.h, self.rates, self.rows_of_v = h, rates, rows_of_v

    def dv(self, t: Any, v: Any, y: Any) -> Any:
        return self._scaled(t, v, y)[: self.rows_of_v]

    def dy(self, t: Any, v: Any, y: Any) -> Any:
        return self._scaled(t, v, y)[self.rows_of_v :]

    def velocity(self, d: Any) -> Any:
        """The v whose increment of y is d, of a system of second order."""
        return d / self.h

    def _scaled(self, t: Any, v: Any, y: Any) -> Any:
        rows = [*v, *y]
        kind = float if isinstance(self.h, float) and all(np.asarray(each).dtype != object for each in (t, *rows)) else object
        rates = np.empty((len(rows), *np.broadcast_shapes(*map(np.shape, rows))), dtype=kind)
        for i, rate in enumerate(self.rates(rows, t)):
            rates[i] = self.h * rate
        return rates


class Differentiated(System):
    """A system ``of`` which further rows, with rates of their own, are stepped with the state."""

    kernel = "equations"
    of: System

    def _take(self, traced: Traced, rates: list[Any], dy: list[Any] | None) -> None:
        """Take the rates of all rows of v, then of y; ``dy`` are those of y, or None where they are v."""
        self._tape, self._rates = traced.tape, rates
        functions = derivatives_of_functions(traced.tape, traced.marks)
        self._replay = MarkedReplay(traced.tape, rates, traced.marks)
        self._core = traced.tape.equations(rates[: self.v_shape[0]], dy, [], None, functions)

    def reference(self, h: Any, **parameters: Any) -> Any:  # type: ignore[override]  # made as by a class
        """The rates of symbols and series."""
        numbers: list[Any] = []

        def collected(each: Any) -> Any:
            numbers.extend(each.reshape(-1))
            return each

        for value in parameters.values():  # in the order in which they were numbered
            converted(value, collected, lambda table: table)
        return _Rates(h, lambda rows, t: self._replay(rows, numbers, t), self.v_shape[0])

    def equation_parameters(self, batch: Shape) -> dict[str, Any]:
        """The parameters of the system."""
        return self.of.own_parameters(batch)

    def parameters(self, batch: Shape, *, series: bool = False, single: bool = False) -> CoreParameters:
        """The operations of all rates, and the parameters of the system."""
        values = {name: value for name, value in self.own_parameters(batch).items() if name != RATES and not callable(value)}
        return [(RATES, self._core), *flat(values, batch)]

    def reference_at_step(self, h: float, batch: Shape) -> Any:
        """The rates by NumPy."""
        tracer = Tracer(self.of, _core.Tape())
        for value in self.own_parameters(batch).values():
            tracer.symbols(value, batch)  # which collects their numbers
        evaluation = Evaluation(self._tape, self._rates, dict(enumerate(tracer.numbers)), tracer.tables)
        return _Rates(h, lambda rows, t: evaluation(rows, t), self.v_shape[0])

    @property
    def chooses(self) -> bool:
        """True if the rates of the system are made of pieces."""
        return self.of.chooses

    @property
    def reads_time(self) -> bool:
        """True if the rates of the system depend on the time."""
        return self.of.reads_time

    @property
    def switches_by_time(self) -> bool:
        """True if the time alone chooses between pieces of the rates."""
        return self.of.switches_by_time

    def switching_times(self, begin: float, end: float) -> Array:
        """The times at which it does."""
        return self.of.switching_times(begin, end)

    def given_inputs(self) -> dict[str, Input]:
        """The inputs of the system."""
        return self.of.given_inputs()


class Columns(Differentiated):
    """A system with columns, each a derivative of its state: v is v and the columns' part of it, and so is y.

    A column is a vector like (v, y). In a block the state comes first, then the first number of all columns, then the second, and
    so on. The rate of a column is J·column + ∂f/∂p, with the Jacobian J of the rates f, for the parameter p of the column. A
    method that makes its steps of sums of rates makes of this the exact derivative of its step of the system, rounding aside.
    With a tolerance accepted steps are held: columns are the derivative of these steps, which may be too long for the columns
    where the motion comes to rest.

    Args:
        system: the system, with the shapes of its state.
        by: what the columns are derivatives by: "v" and "y" at the start, and names of parameters; each number of these has one.
        free: the number of columns before these, along directions at the start that are not chosen here.
    """

    def __init__(self, system: System, by: Sequence[str] = (), free: int = 0) -> None:
        if system.keeper is not None or system.around:
            raise UnsupportedError(
                f"expected a system whose steps are made of its rates alone, got {system!r}; what is around it acts otherwise"
            )
        self.of, self.by, self.batch = system, tuple(by), system.batch
        self.second_order, self.velocity_term = system.second_order, system.velocity_term
        self.numbers = prod(system.v_shape), prod(system.y_shape)
        parameters = parameters_of(system)
        blocks = {"v": system.v_shape, "y": system.y_shape}
        self.own = {name: blocks[name] if name in blocks else parameters[name].shape for name in self.by}
        #: The numbers of parameters that the columns are derivatives by; None for columns by the start.
        seeds: list[int | None] = [None for _ in range(free)]
        for name, shape in self.own.items():
            seeds += prod(shape) * [None] if name in blocks else parameters[name].reshape(-1).tolist()
        self.columns = len(seeds)
        n_v, n_y = self.numbers
        self.v_shape, self.y_shape = (n_v * (1 + self.columns),), (n_y * (1 + self.columns),)
        traced = Traced(system, "rates", places=[self.row(i) for i in range(n_v + n_y)])
        operations = (1 + 3 * self.columns) * len(traced.tape)
        if operations > MAX_OPERATIONS:
            raise UnsupportedError(
                f"expected at most {MAX_OPERATIONS:,} operations for the rates of the system and of its columns, got about "
                f"{operations:,} for {self.columns} columns of {system!r}; ask for fewer"
            )
        rates, rows_of_v = self._differentiated(traced, seeds), self.v_shape[0]
        is_plain = isinstance(system, OwnSystem) and system.equations is not None and system.equations.second_order
        self._take(traced, rates, None if is_plain else rates[rows_of_v:])
        #: Whether a rate is written with the velocity, if only times zero.
        self.reads_v = bool(self._core.reads_v)

    @property
    def groups(self) -> tuple[int, ...]:
        """The groups of the system, and none for the columns: steps with a tolerance are those of the system alone."""
        n_v, n_y = self.numbers
        groups = Acceptance(self.of.groups).of_numbers(n_v, n_y)
        return groups[:n_v] + (NO_GROUP,) * (n_v * self.columns) + groups[n_v:] + (NO_GROUP,) * (n_y * self.columns)

    def row(self, number: int, column: int | None = None) -> int:
        """The row of a number of the state, or of a column."""
        n_v, n_y = self.numbers
        begin, size, number = (0, n_v, number) if number < n_v else (self.v_shape[0], n_y, number - n_v)
        return begin + (number if column is None else size + number * self.columns + column)

    def _differentiated(self, traced: Traced, seeds: Sequence[int | None]) -> list[Any]:
        """The rates of all rows."""
        tape, rates = traced.tape, [traced.tape.number(0.0)] * (self.v_shape[0] + self.y_shape[0])
        for i, root in enumerate(traced.roots):
            rates[self.row(i)] = root
        one = tape.number(1.0)
        for j, parameter in enumerate(seeds):
            along = [(each, tape.state(self.row(i, j))) for i, each in enumerate(traced.state)]
            along += [] if parameter is None else [(tape.param(parameter), one)]
            for i, rate in enumerate(directional(tape, traced.roots, along, traced.marks)):
                rates[self.row(i, j)] = rate
        return rates

    def beside(self, v: Array, y: Array, batch: Shape) -> tuple[Array, Array]:
        """The blocks at the start: those of the system, of shape (*block, *batch), with columns that begin as derivatives do.

        Free columns are zero.
        """
        n = sum(self.numbers)
        begin = np.zeros((n, self.columns))
        column = self.columns - sum(map(prod, self.own.values()))
        for name, shape in self.own.items():
            if name in ("v", "y"):
                first = 0 if name == "v" else self.numbers[0]
                for i in range(prod(shape)):
                    begin[first + i, column + i] = 1.0
            column += prod(shape)
        both = []
        for block, shape, rows in (
            (v, self.of.v_shape, begin[: self.numbers[0]]),
            (y, self.of.y_shape, begin[self.numbers[0] :]),
        ):
            alone = checks.spread(block, shape, batch).reshape(prod(shape), *batch)
            columns = np.broadcast_to(rows.reshape(-1, *len(batch) * (1,)), (rows.size, *batch))
            both.append(np.concatenate([alone, columns]))
        return both[0], both[1]

    def apart(self, v: Array, y: Array) -> tuple[Array, Array, dict[str, tuple[Array, Array]]]:
        """The blocks of the system, of states saved along the first axis, and the derivatives of both by each name of ``by``.

        Their shapes are (saved, *block, *own, *batch), with the axes of what they are derivatives by.
        """
        alone: list[Array] = []
        derivatives: dict[str, list[Array]] = {name: [] for name in self.by}
        for block, shape in ((v, self.of.v_shape), (y, self.of.y_shape)):
            n, behind = prod(shape), (len(block), *block.shape[2:])
            alone.append(block[:, :n].reshape(behind[0], *shape, *behind[1:]))
            columns = block[:, n:].reshape(behind[0], *shape, self.columns, *behind[1:])
            column = self.columns - sum(map(prod, self.own.values()))
            for name, own in self.own.items():
                some = columns[(slice(None), *len(shape) * (slice(None),), slice(column, column + prod(own)))]
                derivatives[name].append(some.reshape(behind[0], *shape, *own, *behind[1:]))
                column += prod(own)
        return alone[0], alone[1], {name: (each[0], each[1]) for name, each in derivatives.items()}

    def repr_arguments(self) -> list[str]:
        """The system, and what the columns are derivatives by."""
        return [repr(self.of), repr(self.by) if self.by else str(self.columns)]


def parameters_of(system: System) -> dict[str, Any]:
    """The parameters whose numbers reach the rates as they are: arrays of the places of their symbols, of the shape of each."""
    places: dict[str, Any] = {}
    tracer = Tracer(system, _core.Tape())
    for name, value in system.own_parameters(system.batch).items():
        first = len(tracer.numbers)
        symbols = tracer.symbols(value, system.batch)
        if isinstance(symbols, np.ndarray) and system.direct().get(name, ("",))[0] == name:
            places[name] = first + np.arange(symbols.size).reshape(symbols.shape)
    return places
