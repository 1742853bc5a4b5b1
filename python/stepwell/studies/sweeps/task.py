"""The task of a sweep: for a chunk of members it makes the system, runs it in pieces, and computes the outcomes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from math import gcd, prod
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ... import _core
from ...base import checks
from ...base.arrays import Array
from ...errors import ShapeError, UnsupportedError
from ...model.compatibility import velocities
from ...model.methods import Method
from ...model.systems import System
from ...model.systems.base import a_system
from ...runs import engine
from ...runs.execution import quietly, step
from ...runs.finding import Finding, Found
from ...runs.findings import may_gain
from ...runs.findings.algebraic import lost_equations
from ...runs.findings.gain import gain_of
from ...runs.findings.growth import of_last_piece
from ...runs.findings.negative import of_a_run
from ...runs.findings.strong_control import of_a_strong_control
from ...runs.options import OPTIONS, Options
from ...runs.request import Request
from ...runs.result import Run
from .adaptive import NUMBERS_OF_A_CONTROLLER, Pieces, lost, numbers_of_waypoints
from .axes import OF_THE_RUN
from .exponents import Exponents
from .mixed_steps import Lengths
from .observed import Piece, Rows
from .outcomes import Function, History, Outcome, ReducedOutcome, Results, Variable, together

if TYPE_CHECKING:
    from .on_device import Observing

#: The most steps times members of a piece of a run, after which a sweep can be stopped.
MAX_STEPS_OF_MEMBERS = 50_000_000
#: How many times the numbers of a saved state are in memory: itself, quantities of it, and temporary arrays.
COPIES_OF_A_STATE = 4
#: How many times the numbers of a member are in memory besides: at the start, in the carry, at the end.
COPIES_OF_A_MEMBER = 12

#: Makes a piece of a run: by its number of steps, the interval of the states that it saves, and the arguments of ``integrate``.
Make = Callable[..., Run]


class Stopped(Exception):  # noqa: N818 (not an error)
    """The sweep was stopped while this chunk was computed."""


class Task(NamedTuple):
    """The task of every chunk.

    Attributes:
        system: a system, or a callable that makes one from parameters by name.
        method: the method.
        options: further arguments of ``integrate``, the same for all members.
        transient: the number of steps before the observed ones.
        steps: the number of observed steps.
        observe: the interval of the states that reductions see, in steps.
        every: the interval of the states of a history or of a function's run, in steps; None for only the last one.
        outcomes: the outcomes.
        memory: the bytes that a chunk may take.
        at: with a tolerance, the times of the observed states, which are all that are saved; None with fixed steps.
        looks: whether stiffness is looked for, with a tolerance.
    """

    system: Any
    method: Method
    options: dict[str, Any]
    transient: int
    steps: int
    observe: int
    every: int | None
    outcomes: tuple[Outcome, ...]
    memory: float
    at: Array | None = None
    looks: bool = False

    def kinds(self, kind: type[Outcome]) -> list[Any]:
        """The outcomes of a kind."""
        return [each for each in self.outcomes if isinstance(each, kind)]

    @property
    def single(self) -> bool:
        """True if steps are computed in float32."""
        return self.options.get("dtype") == "float32"

    @property
    def on_device(self) -> bool:
        """True if a device makes the steps, and not the CPU."""
        return bool(self.options.get("device", "cpu") != "cpu")

    def rounded(self, dt: Array) -> Array:
        """The lengths of steps, rounded to the precision of the task."""
        return dt.astype(np.float32).astype(np.float64) if self.single else dt

    @property
    def reductions(self) -> list[ReducedOutcome]:
        """The outcomes that are computed piece by piece."""
        return self.kinds(ReducedOutcome)

    @property
    def between(self) -> int | None:
        """The interval of the states that are saved for reductions; None for only the last one."""
        observed = self.observe if any(each.observes for each in self.reductions) else 0
        history = (self.every or 0) if self.kinds(History) else 0
        return gcd(observed, history) or None

    def numbers(self, system: System) -> float:
        """The numbers of a member in memory while it is computed, without the states of a piece."""
        state = prod(system.v_shape) + prod(system.y_shape)
        numbers = COPIES_OF_A_MEMBER * state + sum(each.numbers for each in self.outcomes)
        saved = 1 if self.every is None else self.steps // self.every + 2
        if self.at is not None:
            saved = self.at.size
            numbers += NUMBERS_OF_A_CONTROLLER + (numbers_of_waypoints(state) if self.looks else 0)
        if "events" in self.options:  # whose run is one piece
            observed = 1 if self.between is None else self.steps // self.between + 2
            numbers += COPIES_OF_A_STATE * state * (observed if self.at is None else saved)
            numbers += sum((3 + state) * each.most for each in self.options["events"])
        if self.kinds(History) or self.kinds(Function):
            numbers += 2 * saved * state
        for each in self.kinds(Exponents):
            k = state if each.exponents == "all" else int(each.exponents)
            numbers += (6 if self.at is None else 12) * state * (k + 1) + 4 * k
        return numbers

    def most_members(self, system: System) -> int:
        """The most members of a chunk whose memory suffices."""
        state = prod(system.v_shape) + prod(system.y_shape)
        least = (
            0 if self.between is None and self.at is None else 3 * COPIES_OF_A_STATE * state
        )  # two states of a piece, and the one before
        return int(self.memory / (8.0 * (self.numbers(system) + least)))

    def states_at_once(self, system: System, members: int) -> int:
        """The most saved states of a piece for which the memory of the chunk suffices."""
        state = prod(system.v_shape) + prod(system.y_shape)
        room = self.memory / (8.0 * members) - self.numbers(system)
        return max(2, int(room / (COPIES_OF_A_STATE * state)))


class Done(NamedTuple):
    """The results of a chunk.

    Attributes:
        results: by name, values of shape (*own axes, members).
        doubt: a message if the numbers are finite but meaningless, or None.
        lost: the number of members whose absolute tolerance is so large that the motion is lost in it.
        found: the members whose adaptive steps stability held down, "stiff"; that grew by fixed steps beyond their stability
            limit, "growth"; and that ended at a negative amount, which no solution reaches, "amounts".
        why_stopped: why the first member stopped before the last time, or "".
    """

    results: Results
    doubt: str | None
    lost: int
    found: Mapping[str, Found | None]
    why_stopped: str


def prepared(task: Task, values: dict[str, Any]) -> tuple[System, dict[str, Any]]:
    """The system of these values, and the arguments of its run."""
    options = {**task.options, **{name: value for name, value in values.items() if name in OF_THE_RUN}}
    parameters = {name: value for name, value in values.items() if name not in OF_THE_RUN}
    system = task.system if isinstance(task.system, System) else task.system(**parameters)
    system = a_system(system).for_state_shapes(options.get("v"), options["y"])
    if set(values) == {"dt"}:
        # Without another argument that has an axis of members, y gets one.
        block = checks.block("y", options["y"], system.y_shape, system.axes)
        if block.shape == system.y_shape:
            options["y"] = np.repeat(block[..., np.newaxis], np.size(options["dt"]), axis=-1)
    return system, options


def run(task: Task, values: dict[str, Any], members: int, stopped: Callable[[], bool] | None = None) -> Done:
    """Compute a chunk of members."""
    with _listening(stopped), np.errstate(all="ignore"):  # the status tells which members diverged
        system, options = prepared(task, values)
        start = options
        make: Make = partial(quietly, system, task.method)
        if task.on_device:
            from . import on_device  # only such sweeps need it

            make = partial(on_device.run, system, task.method)
        if isinstance(dt := options.get("dt"), np.ndarray):
            make = Lengths(system, task.method, options, dt, task.transient + task.steps).make
        for each in _pieces(task, system, make, options, members, task.transient, None, stopped):
            start = _going_on(options, each)
        parts: list[Results] = []
        functions, pieces = task.kinds(Function), Pieces(system, task.method, looks=task.looks)
        if functions:
            saved: dict[str, Any] = {"steps": task.steps, "every": task.every} if task.at is None else {"at": task.at}
            last = pieces.make(**saved, **start)
            _as_many(last, members)
            parts += [each.of_run(last) for each in functions]
        if task.reductions or not functions:
            pieces = Pieces(system, task.method, looks=task.looks)
            last, reduced = _reduced(task, pieces, make, start, members, stopped)
            parts += reduced
        for each in task.kinds(Exponents):
            look = partial(_stop, stopped)
            parts.append(each.of_start(system, task.method, options, task.transient, task.steps, look, task.at))
    status = Variable((), np.array(last.status), "how the member ended")
    about = "first step that was not finite, or −1" if task.at is None else "step at which the member stopped, or −1"
    bad = Variable((), np.array(last.first_bad_step, dtype=np.int64), about)
    parts.append({"status": status, "first_bad_step": bad})
    grown, amounts, gained = _alone(task, options, last, pieces)
    doubt = (last.system.doubt(last.y) or (gained,))[0]
    if task.at is None and last.system.mass_matrix is not None:
        end = last.y[-1], last.t[-1]
        found = lost_equations(last, end, end, np.abs(last.y).max(axis=0), last.status == 0)
        doubt = found[0].message if found else None
    stiff, why = (None, "") if task.at is None else (pieces.stiff(), pieces.why_stopped())
    return Done(together(parts), doubt, lost(last), {"stiff": stiff, "growth": grown, "amounts": amounts}, why)


def _alone(task: Task, options: dict[str, Any], last: Run, pieces: Pieces) -> tuple[Found | None, Found | None, str | None]:
    """The members that by steps alone grew and became negative from the start of the sweep to its end; if any gained energy."""
    if any(event.then for event in options.get("events", ())):
        return None, None, None  # events may change states, so these say nothing about the steps
    system, batch = last.system, last.status.shape
    blocks = (("v", velocities(system, options.get("v")), system.v_shape), ("y", options["y"], system.y_shape))
    v, y = (checks.spread(checks.block(name, block, shape, system.axes), shape, batch) for name, block, shape in blocks)
    if task.at is not None:
        return None, of_a_run(last, y, pieces.plan), None
    steps = task.transient + task.steps
    grown = of_last_piece(last, (v, y), steps)
    gained = gain_of(last, (v, y)) if may_gain(system, task.method, steps) else None
    return grown, of_a_run(last, y) if grown is None else None, None if gained is None else gained.message


def _reduced(
    task: Task, pieces: Pieces, make: Make, start: dict[str, Any], members: int, stopped: Callable[[], bool] | None
) -> tuple[Run, list[Results]]:
    """The last piece of the run, and the results of the reductions."""
    between, reductions = task.between, [(each, each.begin()) for each in task.reductions]
    at, last = 0, None
    if (observing := _observing(task, pieces.system, start)) is not None:
        if task.at is not None:
            last, begin = pieces.make(at=task.at, observer=observing.observer, **start), task.at[0]
        else:
            last = make(steps=task.steps, every=None, observer=observing.observer, record=observing.names, **start)
            begin = last.t0 + last.start_step * last.dt
        _as_many(last, members)
        observing.taken_by(reductions, last, begin)
        return last, [reduction.results() for _, reduction in reductions]
    if task.at is not None:
        for last in _pieces_between_times(task, pieces, start, members, stopped):
            for _, reduction in reductions:
                reduction.see(Piece(last, 0))
        assert last is not None
        return last, [reduction.results() for _, reduction in reductions]
    for each in _pieces(task, pieces.system, make, start, members, task.steps, between, stopped):
        since = 0 if at == 0 else 1
        steps = at + (len(each.t) - 1 if between else 0)  # number of the last saved state
        for outcome, reduction in reductions:
            reduction.see(_thinned(task, outcome, each, at, since))
        at, last = steps + (0 if between else 1), each
    assert last is not None
    return last, [reduction.results() for _, reduction in reductions]


def _observing(task: Task, system: System, start: dict[str, Any]) -> Observing | None:
    """The reductions of the states that a device observes, or None if they are to be seen here."""
    if not task.on_device or "events" in task.options or task.kinds(History):
        return None
    from . import on_device

    # In float32, with adaptive steps and by a transition matrix quantities of states are computed later.
    rows = Rows(system, records=not task.single and task.at is None and not task.method.is_exact)
    observing = on_device.observing(task.reductions, rows, task.observe)
    if observing is None or (task.at is None and on_device.is_of_many_bodies(system, task.method, start)):
        return None
    return observing


def _thinned(task: Task, outcome: Outcome, piece: Run, first: int, since: int) -> Piece:
    """The states of a piece for an outcome: at its interval, counted from the first of all states, and the very last one."""
    interval = task.observe if outcome.observes else (task.every or 0) if isinstance(outcome, History) else 0
    step = interval // (task.between or 1)
    if step <= 1:
        return Piece(piece, since)
    number = first + np.arange(len(piece.t))
    wanted = number % step == 0
    wanted[-1] |= piece.start_step + piece.steps >= task.transient + task.steps
    wanted[:since] = False
    return Piece(piece.select(wanted), 0)


def _pieces(
    task: Task,
    system: System,
    make: Make,
    start: dict[str, Any],
    members: int,
    steps: int,
    between: int | None,
    stopped: Callable[[], bool] | None,
) -> Iterator[Run]:
    """A run of ``steps`` fixed steps in pieces; a piece ends where a state is saved."""
    length = max(1, MAX_STEPS_OF_MEMBERS // members)
    if "events" in start or (task.on_device and between is None):
        # A member that an event stopped cannot be resumed; a run on a device hears by itself that the sweep is stopped.
        length = steps
    elif between is not None:
        length = between * max(1, min(length // between, task.states_at_once(system, members) - 1))
    done, going_on = 0, start
    while done < steps:
        _stop(stopped)
        piece = make(steps=min(length, steps - done), every=between, **going_on)
        _as_many(piece, members)
        done += piece.steps
        if done < steps:
            going_on = _going_on(start, piece)
        yield piece


def _pieces_between_times(
    task: Task, pieces: Pieces, start: dict[str, Any], members: int, stopped: Callable[[], bool] | None
) -> Iterator[Run]:
    """A run with a tolerance in pieces, each with some of its times; its steps do not depend on the pieces."""
    assert task.at is not None
    length = task.at.size if "events" in start else task.states_at_once(pieces.system, members)
    going_on = start
    for first in range(0, task.at.size, length):
        _stop(stopped)
        piece = pieces.make(at=task.at[first : first + length], goes_on=first + length < task.at.size, **going_on)
        _as_many(piece, members)
        if first + length < task.at.size:
            going_on = _going_on(start, piece)
        yield piece


def _going_on(options: dict[str, Any], run: Run) -> dict[str, Any]:
    """The arguments that resume a run; those that it does not carry, such as threads, are repeated."""
    return {"resume": run} | {name: value for name, value in options.items() if OPTIONS[name].given_again}


@contextmanager
def _listening(stopped: Callable[[], bool] | None) -> Iterator[None]:
    """Within this context, runs of this thread end when the sweep is stopped, since Ctrl-C reaches only the main thread."""
    _core.ask(partial(_stop, stopped))
    try:
        yield
    finally:
        _core.ask(None)


def _stop(stopped: Callable[[], bool] | None) -> None:
    if stopped is not None and stopped():
        raise Stopped


def _as_many(run: Run, members: int) -> None:
    """Raise if the batch of a run is another than the members of the chunk."""
    if run.status.shape != (members,):
        raise ShapeError(
            f"axes: expected a run of as many members as axes have values, batch ({members},), got {run.status.shape}; what "
            f"varies from member to member is an axis, and everything else is the same for all"
        )


class Probed(NamedTuple):
    """The results of the first steps of a member: the system, the state after them, and the names of the results of reductions.

    ``findings`` are those of its control, which chunks do not check.
    """

    system: System
    state: tuple[Array, Array]
    names: set[str]
    findings: tuple[Finding, ...] = ()


def probed(task: Task, values: dict[str, Any]) -> Probed:
    """The first steps of one member: they show errors in arguments before any work, and the results that will be computed."""
    system, options = prepared(task, values)
    for each in task.outcomes:
        each.check(system)
    if task.kinds(History) and task.every is None and task.at is None:
        raise UnsupportedError("every: expected how many steps are between the states of a history")
    if task.at is not None:
        few = min(PROBED_STEPS, options.get("max_steps", PROBED_STEPS))
        begun = step(_by_cpu(Request.of(system, task.method, Options(at=task.at, **(options | {"max_steps": few})))))
        _as_many(begun, 1)
        assert begun.controller_state is not None
        return Probed(begun.system, (begun.controller_state.v, begun.controller_state.y), _names(task, begun))
    request = Request.of(system, task.method, Options(steps=min(PROBED_STEPS, task.transient + task.steps), **options))
    first = step(_by_cpu(request))
    _as_many(first, 1)
    strong = of_a_strong_control(request.system, request.v, request.y, request.plan.dt)
    return Probed(first.system, (first.v[-1], first.y[-1]), _names(task, first), tuple(strong))


def _by_cpu(request: Request) -> Request:
    """The request for the CPU: for a few steps of one member no kernel is built, and the bits are the same."""
    plan = request.plan._replace(device=None)
    if request.plan.device is not None:
        from ...device.bodies import takes  # only such sweeps need them
        from ...device.stages import check_length

        model = engine.model(plan.of_core())
        if request.step_control is not None or not takes(model, plan):
            check_length(model)
    return request._replace(plan=plan)


def _names(task: Task, run: Run) -> set[str]:
    """The names of results, except those of functions and of exponents; raise if two are equal."""
    parts: list[Results] = []
    with np.errstate(all="ignore"):
        for outcome in task.reductions:
            reduction = outcome.begin()
            reduction.see(Piece(run, 0))
            parts.append(reduction.results())
    return set(together([*parts, dict.fromkeys(("status", "first_bad_step"), Variable((), np.array(run.status), ""))]))


#: The number of steps whose bits distinguish one sweep from another.
PROBED_STEPS = 3
