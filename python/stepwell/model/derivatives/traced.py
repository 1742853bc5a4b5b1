"""A system's rates, and a step of it by a method, traced with their derivatives."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from math import prod
from typing import Any, NamedTuple

import numpy as np

from ..._core import Symbol, Tape
from ...base import checks
from ...base.arrays import Array, Shape
from ...errors import ShapeError, UnsupportedError
from ...reference.marks import Marks, recording
from ...reference.tape.evaluate import Evaluation
from ...reference.tape.modes import directional, jacobian
from ...reference.traced import Tracer
from ..methods import Method
from ..systems import System

#: Operations whose values change in time; and operations without branches, which are analytic: a result of these that is constant
#: in some region is constant everywhere.
CHANGING = ("time", "sample")
SMOOTH = {"constant", "parameter", "state", "time", "step", "add", "subtract", "multiply", "divide", "negate", "square root"}

#: The number of random places at which derivatives are compared.
PLACES = 3

#: The most derivatives that are cached: a search for a limit needs the same ones many times.
MAX_CACHED = 8

#: Jacobians that were derived last, by the operations of their values.
_jacobians: dict[str, Evaluation] = {}

#: Up to this product of the length of a tape and the length of a state, each element of the matrix has operations of its own, and
#: an element known to be zero has none. Longer tapes are differentiated in one direction, and NumPy evaluates that for all
#: directions at once.
MAX_WHOLE = 20_000


class _Placed:
    """A tape whose numbers of the state have other places."""

    def __init__(self, tape: Tape, places: Sequence[int]) -> None:
        self._tape, self._places = tape, places

    def state(self, number: int) -> Symbol:
        return self._tape.state(self._places[number])

    def __getattr__(self, name: str) -> Any:
        return getattr(self._tape, name)


class Traced:
    """Values that depend on a system's state, on a tape of their own, with the functions marked on it.

    ``state`` has the symbols of a member's numbers, v first, at ``places`` of the tape; ``roots`` are those of the values.
    """

    def __init__(self, system: System, what: str, method: Method | None = None, places: Sequence[int] | None = None) -> None:
        self.system = system
        self.tape = Tape()
        self.marks: Marks = {}
        self.length = prod(system.v_shape) + prod(system.y_shape)
        places = range(self.length) if places is None else places
        self.state = [self.tape.state(place) for place in places]
        tracer = Tracer(system, self.tape if places == range(self.length) else _Placed(self.tape, places))
        with recording(self.marks):
            self.roots = _roots(tracer, what, method)[: self.length]
        if len(self.roots) != self.length:
            raise ShapeError(f"system: expected {self.length} rates, one for each number of a state, got {len(self.roots)}")
        self.numbers = dict(enumerate(tracer.numbers))
        self.tables = tracer.tables

    def evaluation(self, roots: Sequence[Symbol]) -> Evaluation:
        """The evaluation of these symbols."""
        return Evaluation(self.tape, roots, self.numbers, self.tables)

    def rows(self, v: Array, y: Array) -> list[Array]:
        """The numbers of a state, one after the other, each of the shape of the batch."""
        return _rows(self.system, v, y)

    def jacobian(self) -> Evaluation:
        """The values' derivatives with respect to the state, row by row, and then the values.

        Derived once for equal operations, whatever their numbers: tracing tells whether they are, in a tenth of the time.
        """
        marked = [(mark.name, [self.tape.value(id), *mark.arguments]) for id, mark in self.marks.items()]
        symbols = [each for _, values in marked for each in values if isinstance(each, Symbol)]
        lines, places = self.tape.operations(self.roots + symbols)
        of_marks = [(name, [isinstance(each, Symbol) or each for each in values]) for name, values in marked]
        key = str((lines, places, of_marks, self.length))
        if (known := _jacobians.get(key)) is None:
            rows = jacobian(self.tape, self.roots, self.state, self.marks)
            known = self.evaluation([each for row in rows for each in row] + self.roots)
            if len(_jacobians) >= MAX_CACHED:
                _jacobians.clear()
            _jacobians[key] = known.of({}, ())  # not a batch's numbers
        return known.of(self.numbers, self.tables)

    def tangent(self) -> Evaluation:
        """The values, and their derivatives along a change of the state.

        The numbers of the change follow those of the state, from number ``room`` on.
        """
        return self.evaluation(self.roots + self.derivatives())

    def derivatives(self) -> list[Symbol]:
        """The derivatives of the values along a change of the state, whose numbers begin at number ``room``."""
        changes = [self.tape.state(self.room + i) for i in range(self.length)]
        return directional(self.tape, self.roots, zip(self.state, changes, strict=True), self.marks)

    def along(self, directions: int) -> list[Symbol]:
        """The values, then the derivatives of the first along each of several changes of the state, of the second, and so on.

        The numbers of the changes follow those of the state, in the same order. The sum that a control accumulates has the first
        place after the state as well, but no value depends on it.
        """
        first = self.length
        changes = [[self.tape.state(first + i * directions + j) for i in range(self.length)] for j in range(directions)]
        each = [directional(self.tape, self.roots, zip(self.state, change, strict=True), self.marks) for change in changes]
        return self.roots + [derivative for of_one in zip(*each, strict=True) for derivative in of_one]

    @property
    def room(self) -> int:
        """The number at which the changes begin: after the state and the sum that a control accumulates."""
        return self.length + 1


def _roots(tracer: Tracer, what: str, method: Method | None) -> list[Symbol]:
    """The symbols of the rates at h = 1, of the slots after a step, or of the state that finishes a slot."""
    if method is None:
        if what == "rates" and tracer.system.mass_matrix is not None:
            raise UnsupportedError(
                f"rates: the algebraic equations of {tracer.system!r} give no rate for what they determine, so there is no "
                f"matrix of rates; steps by implicit methods and consistent_start go without"
            )
        if tracer.system.has_stick_friction:
            raise UnsupportedError(
                f"rates: {tracer.system!r} has friction that sticks; what it does depends on the step, so there are no rates "
                f"without one"
            )
        s, (v, y, _) = tracer.scaled(1.0), tracer.state()
        t = tracer.tape.time()
        dv, dy = np.broadcast_to(s.dv(t, v, y), tracer.system.v_shape), np.broadcast_to(s.dy(t, v, y), tracer.system.y_shape)
        return tracer.flat(dv, dy)
    return tracer.step(method) if what == "step" else tracer.slot(method, what, 0)


def _rows(system: System, v: Array, y: Array) -> list[Array]:
    """The numbers of a state, one after the other, each of the shape of the batch."""
    blocks = ((v, system.v_shape), (y, system.y_shape))
    return [row for block, shape in blocks for row in block.reshape(prod(shape), *block.shape[len(shape) :])]


class Reading(NamedTuple):
    """The dependencies of rates and of their derivatives.

    Attributes:
        time: whether the rates depend on time, explicitly or by samples.
        linear: whether they are linear in the state, with coefficients that do not change in time.
    """

    time: bool
    linear: bool


def reading(system: System) -> Reading:
    """The dependencies of a system's rates and of their derivatives, read from their tape.

    Derivatives that are sums, products and roots of the state are constant if they are equal at places drawn at random: that is
    so where a square of the state has the factor 0, for example.
    """
    traced = Traced(system, "rates")
    if len(traced.tape) * traced.length <= MAX_WHOLE:
        derivatives = [each for row in jacobian(traced.tape, traced.roots, traced.state, traced.marks) for each in row]
    else:
        derivatives = traced.derivatives()
    of_rates, of_derivatives = (traced.tape.operations(roots)[0] for roots in (traced.roots, derivatives))
    timed = any(name in CHANGING for name, _, _ in of_rates)
    if not any(name in CHANGING or (name == "state" and number < traced.room) for name, _, number in of_derivatives):
        return Reading(timed, True)
    if not {name for name, _, _ in of_derivatives} <= SMOOTH:
        return Reading(timed, False)
    drawn, evaluation = np.random.default_rng(PLACES), traced.evaluation(derivatives)
    changed = list(drawn.normal(size=traced.length))
    values = [evaluation([*drawn.normal(size=traced.length), np.zeros(()), *changed], t=drawn.normal()) for _ in range(PLACES)]
    return Reading(timed, all(np.array_equal(a, b) for other in values[1:] for a, b in zip(values[0], other, strict=True)))


class _Cached(NamedTuple):
    """A derivative and what was traced; ``whole`` if each element of the matrix has operations, else it is along a direction.

    With ``what`` "values" it is no derivative but the rates alone.
    """

    system: System
    what: str
    method: Method | None
    evaluation: Evaluation
    whole: bool


#: The derivatives that were traced last.
_last: deque[_Cached] = deque(maxlen=MAX_CACHED)


def _cached(system: System, what: str, method: Method | None) -> _Cached:
    """The derivative, traced unless that of the same system object is still cached.

    An equal system is not enough: a user's function may read other numbers than when it was traced.
    """
    for each in tuple(_last):
        if each.system is system and each.what == what and each.method is method:
            return each
    traced = Traced(system, what, method)
    whole = len(traced.tape) * traced.length <= MAX_WHOLE
    alone = what == "values"
    entry = _Cached(
        system,
        what,
        method,
        traced.evaluation(traced.roots) if alone else traced.jacobian() if whole else traced.tangent(),
        whole,
    )
    _last.append(entry)
    return entry


def matrix(
    system: System, what: str, method: Method | None, members: Shape, v: Array, y: Array, t: Any = 0.0, h: Any = 1.0
) -> tuple[Array, Array]:
    """The derivative of the rates, of a step or of its finish at a state, and the values themselves.

    Args:
        system: the system.
        what: "rates", or "equations", which some may be algebraic; the "step" of a method from slot to slot, or its "finish" from
            slots to states.
        method: the method; None for rates.
        members: the shape to which states, parameters, times and steps broadcast.
        v: the velocities, or what the method carries in place of them, shape (*block, *batch).
        y: the coordinates.
        t: the time, a number or of the shape of the members.
        h: the step, likewise.

    Returns:
        Arrays of shapes (n, n, *members) and (n, *members).
    """
    entry = _cached(system, what, method)
    n = prod(system.v_shape) + prod(system.y_shape)
    rows = _rows(system, v, y)
    nothing = np.zeros(())  # the sum of a control has no influence
    if entry.whole:
        values = np.empty((n * n + n, *members))
        for k, value in enumerate(entry.evaluation([*rows, nothing], t, h)):
            values[k] = value
        return values[: n * n].reshape(n, n, *members), values[n * n :]
    changes = np.eye(n).reshape(n, n, *(1,) * len(members))  # the unit vectors, all directions at once
    derivative, values = np.empty((n, n, *members)), np.empty((n, *members))
    for k, value in enumerate(entry.evaluation([*rows, nothing, *changes], t, h)):
        (values if k < n else derivative)[k % n] = value
    return derivative, values


def rates(system: System, members: Shape, v: Array, y: Array, t: Any = 0.0) -> Array:
    """The rates at a state without their derivatives, shape (n, *members)."""
    evaluation = _cached(system, "values", None).evaluation
    values = np.empty((prod(system.v_shape) + prod(system.y_shape), *members))
    for k, value in enumerate(evaluation([*_rows(system, v, y), np.zeros(())], t, 1.0)):
        values[k] = value
    return values


def of_rates(system: System, members: Shape, t: Any, v: Array, y: Array) -> Array:
    """The derivatives of all rates by all numbers of the state, shape (n, n, *members)."""
    return matrix(system, "rates", None, members, v, y, t)[0]


def stepped(system: System, method: Method, v: Array, y: Array, h: Any) -> Array:
    """The numbers of both blocks after a step from these, at time 0, by the tape of the step, shape (n, *batch)."""
    traced = Traced(system, "step", method)
    rows = _rows(system, v, y)
    values = np.empty((traced.length, *np.broadcast_shapes(rows[0].shape, np.shape(h))))
    for k, value in enumerate(traced.evaluation(traced.roots)([*rows, np.zeros(())], 0.0, h)):
        values[k] = value
    return values


def together(system: System, v: Array, y: Array, **more: Any) -> Shape:
    """The shape to which states, parameters and other values broadcast."""
    batches = {"v": v.shape[len(system.v_shape) :], "y": y.shape[len(system.y_shape) :]}
    return checks.batch_shape({"system": system.batch} | batches | {name: np.shape(each) for name, each in more.items()})
