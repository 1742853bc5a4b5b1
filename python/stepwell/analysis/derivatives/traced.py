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
from ...model.methods import Method
from ...model.systems import System
from ...reference.marks import Marks, recording
from ...reference.tape.evaluate import Evaluation
from ...reference.tape.modes import directional, jacobian
from ...reference.traced import Tracer

#: Operations whose values change in time; and those of which no value is the same in one region and another beyond it.
CHANGING = ("time", "sample")
SMOOTH = {"constant", "parameter", "state", "time", "step", "add", "subtract", "multiply", "divide", "negate", "square root"}

#: At so many places derivatives are compared.
PLACES = 3

#: The most systems whose derivatives are kept: a search for a limit needs the same ones many times.
MAX_KEPT = 8

#: The most lines of a tape times numbers of a state up to which each element of a matrix has lines of its own, and those known to
#: be zero have none. Longer tapes are differentiated in one direction, which NumPy evaluates for all directions at once.
MAX_WHOLE = 20_000


class Traced:
    """Values that depend on a system's state, on a tape of their own.

    Attributes:
        system: whose state it is.
        tape: the tape of all values.
        marks: the functions on it.
        state: the symbols of a member's numbers, v first.
        roots: the values.
        length: how many numbers a state has.
    """

    def __init__(self, system: System, what: str, method: Method | None = None) -> None:
        self.system = system
        self.tape = Tape()
        self.marks: Marks = {}
        self.length = prod(system.v_shape) + prod(system.y_shape)
        self.state = [self.tape.state(i) for i in range(self.length)]
        tracer = Tracer(system, self.tape)
        with recording(self.marks):
            self.roots = _roots(tracer, what, method)[: self.length]
        if len(self.roots) != self.length:
            raise ShapeError(f"system: expected {self.length} rates, one for each number of a state, got {len(self.roots)}")
        self.numbers = dict(enumerate(tracer.numbers))
        self.tables = tracer.tables

    def evaluation(self, roots: Sequence[Symbol]) -> Evaluation:
        """Values on the tape, to be computed."""
        return Evaluation(self.tape, roots, self.numbers, self.tables)

    def rows(self, v: Array, y: Array) -> list[Array]:
        """The numbers of a state, one after the other, each of the shape of the batch."""
        blocks = ((v, self.system.v_shape), (y, self.system.y_shape))
        return [row for block, shape in blocks for row in block.reshape(prod(shape), *block.shape[len(shape) :])]

    def jacobian(self) -> Evaluation:
        """The values' derivatives with respect to the state, row after row, and behind them the values."""
        rows = jacobian(self.tape, self.roots, self.state, self.marks)
        return self.evaluation([each for row in rows for each in row] + self.roots)

    def tangent(self) -> Evaluation:
        """The values, and their derivatives along a change of the state whose numbers come behind the state's own.

        The sum that a control accumulates has a place behind those, so the changes begin at number ``room``.
        """
        changes = [self.tape.state(self.room + i) for i in range(self.length)]
        pairs = zip(self.state, changes, strict=True)
        return self.evaluation(self.roots + directional(self.tape, self.roots, pairs, self.marks))

    def along(self, directions: int) -> list[Symbol]:
        """The values, and their derivatives along several changes of the state: of a value in each direction, then of the next.

        The numbers of the changes come behind the state's own in the same order. The sum that a control accumulates has the first
        place behind the state, too, but no value depends on it.
        """
        first = self.length
        changes = [[self.tape.state(first + i * directions + j) for i in range(self.length)] for j in range(directions)]
        each = [directional(self.tape, self.roots, zip(self.state, change, strict=True), self.marks) for change in changes]
        return self.roots + [derivative for of_one in zip(*each, strict=True) for derivative in of_one]

    @property
    def room(self) -> int:
        """The number of the state at which the changes begin."""
        return self.length + 1


def _roots(tracer: Tracer, what: str, method: Method | None) -> list[Symbol]:
    """The symbols of the rates at step 1, of a step's next slots, or of what finishes a slot."""
    found: list[Symbol]
    if method is None:
        if tracer.system.stick_friction is not None:
            raise UnsupportedError(
                f"rates: {tracer.system!r} has friction that sticks; what it does depends on the step, so there are no rates "
                f"without one"
            )
        s, (v, y, _) = tracer.scaled(1.0), tracer.state()
        t = tracer.tape.time()
        found = tracer.flat(*_wide(tracer.system, s.dv(t, v, y), s.dy(t, v, y)))
    elif what == "step":
        found = tracer.step(method)
    else:
        found = tracer.slot(method, what, 0)
    return found


def _wide(system: System, dv: Any, dy: Any) -> tuple[Any, Any]:
    """Rates over whole blocks."""
    return tuple(np.broadcast_to(each, shape) for each, shape in ((dv, system.v_shape), (dy, system.y_shape)))  # type: ignore[return-value]


class Reading(NamedTuple):
    """What rates and their derivatives are computed from.

    Attributes:
        time: whether the rates depend on time, by themselves or by samples.
        linear: whether they are linear in the state, with coefficients that do not change in time.
    """

    time: bool
    linear: bool


def reading(system: System) -> Reading:
    """What a system's rates and their derivatives are computed from, as their tape says.

    Derivatives that are sums, products and roots of the state are the same everywhere if they are so at places drawn at random:
    as where the parameter is zero by which a square of the state is multiplied.
    """
    traced = Traced(system, "rates")
    if len(traced.tape) * traced.length <= MAX_WHOLE:
        derivatives = [each for row in jacobian(traced.tape, traced.roots, traced.state, traced.marks) for each in row]
    else:
        changes = [traced.tape.state(traced.room + i) for i in range(traced.length)]
        derivatives = directional(traced.tape, traced.roots, zip(traced.state, changes, strict=True), traced.marks)
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


class _Kept(NamedTuple):
    """A derivative, and of what; ``whole`` if it has a line for each element of the matrix, else it is in one direction."""

    system: System
    what: str
    method: Method | None
    evaluation: Evaluation
    whole: bool


#: The last derivatives that were asked for.
_last: deque[_Kept] = deque(maxlen=MAX_KEPT)


def _kept(system: System, what: str, method: Method | None) -> _Kept:
    """The derivative, traced anew unless that of this very system object was needed shortly before.

    An equal system is not enough: a user's function may depend on other numbers than when it was traced.
    """
    for each in tuple(_last):
        if each.system is system and each.what == what and each.method is method:
            return each
    traced = Traced(system, what, method)
    whole = len(traced.tape) * traced.length <= MAX_WHOLE
    kept = _Kept(system, what, method, traced.jacobian() if whole else traced.tangent(), whole)
    _last.append(kept)
    return kept


def matrix(
    system: System, what: str, method: Method | None, members: Shape, v: Array, y: Array, t: Any = 0.0, h: Any = 1.0
) -> tuple[Array, Array]:
    """The derivative of what a system does at a state, and what it does there.

    Args:
        system: the system.
        what: "rates", the "step" of a method from slot to slot, or its "finish" from slots to states.
        method: of a step.
        members: the shape to which states, parameters, times and steps broadcast.
        v: the velocities, or what the method carries in place of them, shape (*block, *batch).
        y: the coordinates.
        t: the time, a number or of the shape of the members.
        h: the step, likewise.

    Returns:
        Arrays of shapes (n, n, *members) and (n, *members).
    """
    kept = _kept(system, what, method)
    n = prod(system.v_shape) + prod(system.y_shape)
    blocks = ((v, system.v_shape), (y, system.y_shape))
    rows = [row for block, shape in blocks for row in block.reshape(prod(shape), *block.shape[len(shape) :])]
    nothing = np.zeros(())  # the sum of a control has no influence
    if kept.whole:
        values = np.empty((n * n + n, *members))
        for k, value in enumerate(kept.evaluation([*rows, nothing], t, h)):
            values[k] = value
        return values[: n * n].reshape(n, n, *members), values[n * n :]
    changes = np.eye(n).reshape(n, n, *(1,) * len(members))  # of each number, in every direction at once
    derivative, values = np.empty((n, n, *members)), np.empty((n, *members))
    for k, value in enumerate(kept.evaluation([*rows, nothing, *changes], t, h)):
        (values if k < n else derivative)[k % n] = value
    return derivative, values


def together(system: System, v: Array, y: Array, **more: Any) -> Shape:
    """The shape to which states, parameters and other values broadcast."""
    batches = {"v": v.shape[len(system.v_shape) :], "y": y.shape[len(system.y_shape) :]}
    return checks.batch_shape({"system": system.batch} | batches | {name: np.shape(each) for name, each in more.items()})
