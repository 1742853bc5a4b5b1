"""Runs with adaptive steps, by the core or by the reference."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from math import prod
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import numpy as np

from ... import _core
from ...base.arrays import Array, Whole
from ...model.methods import Method
from ...model.parameters import rows
from ...model.systems import System
from .by_tape import blocks_of, evaluated, rows_of, tried_attempt
from .plan import Plan, model

if TYPE_CHECKING:
    from ...reference.adaptive import Attempted, Extension, Jumps, Pace

#: The numbers of a ``Pace`` that are not of a group of components; those of groups follow: ``SCALES`` of each, the
#: largest sizes first, and two tolerances if groups have their own. Last are those that a series keeps of each number of the
#: state.
PACE_NUMBERS, SCALES = 20, 3
#: Places among them; the counts are of accepted, rejected and extra steps.
TIME, STEP, TARGET, EXTRA, HELD, RELATIVE, ABSOLUTE, LASTS, ERROR = 0, 1, 2, 3, 4, 5, 6, 7, 18
INTERVAL, UNTIL, MOST_STEP, WALL, COUNTS, WORK = 9, 10, 11, 12, slice(15, 18), 19
#: The first step if the state does not determine one, in units of time; in a run shorter than SHORT this part of its time. So
#: steps of longer runs do not depend on the saved times.
BLIND = 1.0 / (1 << 20)
SHORT = 32.0 * BLIND
#: The least absolute tolerance, 1024 times the smallest number above zero. A state that grows from zero under a smooth push
#: begins with numbers of few bits, whose relative error cannot be small.
LEAST = 2.0**-1064
#: Errors of steps add up, and the number of steps of second order grows as the third root of the tolerance falls: the error of a
#: run goes by the power 2/3 of it. So below this one the tolerance of such a step is multiplied by the root of its share of this,
#: but by no less than the second number, which makes three times as many steps, and not to less than the third: else they would
#: soon be a million.
SECOND_ORDER, LEAST_SHARE, LEAST_OF_A_STEP = 1e-3, 2.0**-5, 1e-13
#: How many waypoints are kept of a member, and the most numbers of them; of larger batches there are none.
WAYPOINTS = 2
MOST_IN_WAYPOINTS = 1 << 21
#: The status of a member that has no room to save another step.
FULL = -1


class Tolerances(NamedTuple):
    """The tolerances of a step: numbers over the batch, or with one for each group along the first axis.

    Without ``absolute`` the error is relative to the largest length of a group so far.
    """

    relative: Array
    absolute: Array | None
    of_groups: bool = False

    def of_steps(self, method: Method) -> Tolerances:
        """The tolerances of single steps, in proportion to which errors of runs are: SECOND_ORDER and less for that order."""
        if method.order != 2:
            return self
        share = np.sqrt(np.clip(self.relative / SECOND_ORDER, LEAST_SHARE**2, 1.0))
        relative = np.maximum(share * self.relative, np.minimum(self.relative, LEAST_OF_A_STEP))
        if self.absolute is None:
            return self._replace(relative=relative)
        absolute: Any = self.absolute
        if self.of_groups:  # whose axis comes before those of members
            axes = max(share.ndim, absolute.ndim)
            share, absolute = (each.reshape(*each.shape, *[1] * (axes - each.ndim)) for each in (share, absolute))
        return self._replace(relative=relative, absolute=share * absolute)


class Pacing(NamedTuple):
    """When the state is saved, ascending, the most attempts of a member, and whether members have yet to begin.

    ``at`` and ``jumps``, the times that no step crosses, are the same for all members or one for each, shape (times, *batch).
    Every ``every``-th accepted step of a member is saved, 0 for none. The core has ``room`` for this many steps of each member,
    and a member that has filled it ends with the status ``FULL``. ``waypoints`` asks for where members stood on the way; or it is
    those that a run that goes on has. ``is_part`` is whether others follow the last time, which is then one as the others.
    """

    at: Array
    budget: int
    begins: bool = False
    jumps: Array | None = None
    every: int = 0
    room: int = 0
    waypoints: bool | Array = False
    is_part: bool = False


class CorePacing(NamedTuple):
    """``Pacing`` as the core takes it: rows of one number for all or for each member; jumps twice, before and after.

    ``extends`` is whether states before the last time are those of the continuous extension of the method.
    """

    at: Array
    jumps: Array
    budget: int
    begins: bool
    every: int = 0
    extends: bool = False
    is_part: bool = False


def jumps_of(plan: Plan, pacing: Pacing) -> Jumps | None:
    """The times that no step crosses."""
    from ...reference import adaptive

    if pacing.jumps is None or not len(pacing.jumps):
        return None
    read = None
    if plan.single:  # samples are looked up at times of float64
        of_samples = plan.system.jumps(-np.inf, np.inf) if plan.system.all_inputs() else np.empty(0)
        read = ~np.isin(pacing.jumps, -of_samples if plan.backward else of_samples)
    return adaptive.Jumps.around(pacing.jumps, plan.t0, read)


def pacing_of_core(plan: Plan, pacing: Pacing) -> CorePacing:
    """``pacing`` as the core takes it."""
    jumps = jumps_of(plan, pacing)
    both = np.empty((0, 1)) if jumps is None else np.concatenate([_rows(jumps.before, plan), _rows(jumps.after, plan)])
    at, within = _rows(pacing.at, plan), looks_within(plan, pacing)
    return CorePacing(at, both, pacing.budget, pacing.begins, pacing.every, within, pacing.is_part)


def looks_within(plan: Plan, pacing: Pacing) -> bool:
    """True if states are those of the continuous extension of the method, if they are within a step."""
    return (len(pacing.at) > 1 or pacing.is_part) and extends(plan)


def _rows(times: Array, plan: Plan) -> Array:
    """Times as rows of one number for all, or one for each member."""
    width = plan.members if times.ndim > 1 else 1
    of_each = np.broadcast_to(times, (len(times), *plan.batch)) if times.ndim > 1 else times
    return np.ascontiguousarray(of_each.reshape(len(times), width), dtype=np.float64)


class KeptSteps(NamedTuple):
    """The saved states after accepted steps, as many as each member has.

    Attributes:
        counts: the number of each member, shape (members,).
        t: their times, shape (room, members).
        v: velocities, shape (room, *block, members).
        y: coordinates, likewise.
    """

    counts: Whole
    t: Array
    v: Array
    y: Array


class AdaptiveArrays(NamedTuple):
    """The arrays that a run with a tolerance reads and fills, for the core.

    Attributes:
        v: rows of v, of one number for each member or one for all.
        y: rows of y, likewise.
        paces: the step-size controllers at the start, shape (numbers, members), or (…, 1) if they are the same for all.
        saved_v: velocities at the times of ``at``, shape (times, *block, *batch); NaN from where a member stopped.
        saved_y: coordinates, likewise.
        last_state: the states of members at the end, at their own times, shape (numbers of v and y, members).
        last_paces: the step-size controllers at the end, as ``paces``.
        status: how members ended, shape (members,).
        trail: None; or times and steps to try next, shape (2, times, members). Attempts are then made one by one, and the states
            before the first and after each are saved.
        steps: None; or the saved steps.
        waypoints: None; or room for where members stood at their last waypoints, shape (waypoints, numbers, members).
    """

    v: Array
    y: Array
    paces: Array
    saved_v: Array
    saved_y: Array
    last_state: Array
    last_paces: Array
    status: Whole
    trail: Array | None = None
    steps: KeptSteps | None = None
    waypoints: Array | None = None


class Adapted(NamedTuple):
    """Saved states, and for each member at the end its state, the numbers of its ``Pace`` and the status.

    ``evaluations`` is the number of function evaluations of an attempt, ``steps`` the saved steps or None. ``waypoints`` is where
    members stood after the last two numbers of accepted steps that are powers of two, 256 or more, shape (2, numbers, members):
    v and y before the step to there, v and y after it, and the numbers of the ``Pace``; zeros of members that did not come so
    far, and None if it was not asked for.
    """

    v: Array
    y: Array
    last_v: Array
    last_y: Array
    paces: Array
    status: Whole
    evaluations: int
    steps: KeptSteps | None = None
    waypoints: Array | None = None


def room_for_waypoints(pacing: Pacing, state: int, pace: int, members: int) -> Array | None:
    """Room for the waypoints of all members, two states and a pace each; None if they are not asked for, or are too many."""
    if isinstance(pacing.waypoints, np.ndarray):
        return pacing.waypoints
    numbers = 2 * state + pace
    if not pacing.waypoints or WAYPOINTS * numbers * members > MOST_IN_WAYPOINTS:
        return None
    room = np.empty((WAYPOINTS, numbers, members))
    room[:, 2 * state + COUNTS.start] = 0.0  # of no accepted steps: there is none
    return room


def groups_of(plan: Plan) -> int:
    """The number of groups of components of a plan."""
    return sum(plan.acceptance.counts(prod(plan.system.v_shape), prod(plan.system.y_shape)))


def pace_numbers(plan: Plan) -> int:
    """The number of numbers of a member's ``Pace``."""
    return PACE_NUMBERS + plan.acceptance.numbers(prod(plan.system.v_shape), prod(plan.system.y_shape))


def low_numbers(plan: Plan) -> int:
    """How many numbers of the state a member's ``Pace`` keeps more digits of: all by a series, else none."""
    return plan.acceptance.compensated * (prod(plan.system.v_shape) + prod(plan.system.y_shape))


def own_tolerances(paces: Any, groups: int, low: int) -> Any:
    """The tolerances of groups of their own, the relative ones and then the absolute ones; no rows if they have none.

    ``low`` is how many numbers stand behind them.
    """
    return paces[PACE_NUMBERS + SCALES * groups : len(paces) - low]


def paces(
    plan: Plan, first: Array | None, tolerances: Tolerances, most_step: Array | None = None, pacing: Pacing | None = None
) -> Array:
    """The step-size controllers before members begin, shape (numbers, *batch), or (numbers,) if they are the same for all.

    From ``pacing`` they need the length of the run, for a first step that the state does not determine, and a jump at the start.
    """
    from ...reference import adaptive  # only such runs need it

    t0, groups, own = plan.t0, groups_of(plan), []
    relative, absolute = tolerances.relative, np.maximum(LEAST, 0.0 if tolerances.absolute is None else tolerances.absolute)
    if tolerances.of_groups:
        absolute = np.broadcast_to(absolute, relative.shape) if tolerances.absolute is None else absolute
        own = [*relative, *absolute]
        relative, absolute = relative.min(axis=0), absolute.max(axis=0)
    step: Any = first
    if pacing is not None:
        if (jumps := jumps_of(plan, pacing)) is not None:
            t0 = jumps.begun(t0)
        if step is None:
            span = pacing.at[-1] - plan.t0
            if isinstance(span, float):
                step = -BLIND * (float(span) if 0.0 < span < SHORT else 1.0)
            else:
                step = -BLIND * np.where((span > 0.0) & (span < SHORT), span, 1.0)
    each = [-BLIND if step is None else step, relative, absolute, np.inf if most_step is None else most_step, t0]
    h, *both, longest, begin = (_one_number(number) for number in each)
    tolerance = both[0], both[1], float(tolerances.absolute is None)
    waiting = adaptive.waiting(begin, h, tolerance, plan.system.samples, longest, groups)
    numbers = [*waiting.numbers, *own, *low_numbers(plan) * [0.0]]
    if not any(getattr(number, "ndim", 0) for number in numbers):  # as ``np.ndim``, in a fifth of the time
        return np.array(numbers, dtype=np.float64)
    out = np.empty((len(numbers), *plan.batch))
    for row, number in zip(out, numbers, strict=True):
        row[...] = number
    return out


def _one_number(number: Any) -> Any:
    """An array of one number as that number."""
    if isinstance(number, float):
        return float(number)
    return np.asarray(number).item() if np.size(number) == 1 else number


def begun(plan: Plan, paces: Array, v: Array, y: Array) -> Pace:
    """The step-size controllers at the first step, by the reference, from those before members begin."""
    from ...reference import adaptive

    system, pace = attempted_system(plan), pace_of(plan, paces)
    moves = adaptive.SINGLE_MOVES if plan.single else adaptive.MOVES
    groups, series = plan.acceptance.groups, plan.method.has_series
    return adaptive.begin(system.unit, pace, v, y, plan.block_axes, groups, series=series, moves=moves)


def begun_again(plan: Plan, numbers: Array, t: Array, v: Array, y: Array) -> Array:
    """The numbers of members that begin again at these times, with their tolerances and counts."""
    from ...reference import adaptive

    pace, zero = pace_of(plan, numbers), np.zeros(plan.batch)
    anew = pace._replace(t=t, h=zero - BLIND, target=t, extra=zero, held=zero, begin=t, wall=zero + np.inf)
    anew = anew._replace(before=zero + 1.0, most=zero + adaptive.MAX_FACTOR, low=0.0 * np.asarray(pace.low))
    return numbers_of(begun(plan, numbers_of(anew), v, y))


def attempted_system(plan: Plan) -> Attempted:
    """The NumPy reference of the system for attempts, scaled to a step of 1, or of −1 if its time runs backward."""
    from ...reference import adaptive

    s = plan.stepped.reference_at_step(-1.0 if plan.backward else 1.0, plan.batch)
    return adaptive.Attempted(adaptive.Backward(s) if plan.backward else s, plan.system.parts(plan.batch, plan.force))


def pace_of(plan: Plan, numbers: Array) -> Pace:
    """The ``Pace`` of the members of a plan, from numbers of each or of all."""
    from ...reference import adaptive

    batch = plan.batch
    rows = numbers if numbers.shape[1:] == batch else [np.broadcast_to(row, batch) for row in numbers]
    return adaptive.Pace.of(list(rows), groups_of(plan), low_numbers(plan))


def numbers_of(pace: Pace) -> Array:
    """The numbers of a pace, of each member."""
    return np.array(np.broadcast_arrays(*pace.numbers))


def evaluations(method: Method, system: System, *, order: int = 0, paced: bool = False) -> int:
    """Function evaluations of a step, or of an attempt at an adaptive one, with a series of this order.

    For a series it is the operations of all coefficients of the rates over those of one evaluation, rounded up.

    Raises:
        UnsupportedError: if the series of the system is too long.
    """
    if method.has_series:
        batch = system.batch if system.control is None else np.broadcast_shapes(system.batch, system.control.batch)
        plan = Plan(system.out_of_the_loop(), method, batch, 1.0, order=order)
        return _core.series_evaluations(model(plan.of_core()), attempts=paced)
    return method.attempt_evaluations if paced else method.evaluations


def attempts(plan: Plan, system: Any) -> Any:
    """An attempt at an adaptive step by the reference: a function of a pace, a budget, v and y."""
    from ...reference import adaptive, series_pace

    steps: Any = plan.method.steps
    if plan.method.has_series:
        return partial(series_pace.attempt, plan.order or steps.ORDER, system, plan.block_axes, plan.acceptance)
    assert plan.method.error_order is not None
    return partial(adaptive.attempt, steps, system, plan.method.error_order, plan.block_axes, plan.acceptance)


def evaluated_attempt(plan: Plan, budget: int) -> Any:
    """An attempt at an adaptive step."""
    next_rows = evaluated(plan, "attempt", budget)

    def attempt(pace: Pace, budget: int, v: Array, y: Array) -> tuple[Pace, Array, Array]:
        numbers = np.broadcast_arrays(*pace.numbers)
        out = next_rows([*rows_of(plan, v, y), *numbers], None)
        return (pace_of(plan, out[-len(numbers) :]), *blocks_of(v, y, out))

    return attempt


def attempt_by_numpy(plan: Plan, budget: int) -> Any:
    """An attempt at an adaptive step by NumPy: by the tape where that is needed, else by the reference."""
    if plan.single:
        return tried_attempt(plan)
    if plan.by_tape:
        return evaluated_attempt(plan, budget)
    return attempts(plan, attempted_system(plan))


def extends(plan: Plan) -> bool:
    """True if states within a step are those of the continuous extension of the method.

    Else each takes a step of its own: where it owes more than the extension knows of, as a projection and amounts that do not
    become negative do; and in float32, where the roundings of stages, times weights of some hundreds, are as large as tolerances.
    """
    keeper = plan.system.keeper
    projects = keeper is not None and not getattr(keeper, "acts_on_rates", True)
    return plan.method.extension_evaluations > 0 and not (plan.single or plan.acceptance.positive or projects)


def extension_by_numpy(plan: Plan) -> Any:
    """A function of a pace, v, y and a time within the held step: the state there, and whether it is as good as a step's."""
    from ...reference import adaptive

    n, steps, system = prod(plan.system.v_shape) + prod(plan.system.y_shape), plan.method.steps, attempted_system(plan)
    next_rows = evaluated(plan, "extension") if plan.by_tape else None

    def made(pace: Pace, v: Array, y: Array) -> Extension:
        if next_rows is None:
            return adaptive.extension(cast("Any", steps), system, plan.block_axes, plan.acceptance, pace, v, y)
        numbers = np.broadcast_arrays(*pace.numbers)
        *rows, step, changes = next_rows([*rows_of(plan, v, y), *numbers], None)
        terms = np.array(rows[n + len(numbers) :])
        powers = [blocks_of(v, y, terms[first : first + n]) for first in range(0, len(terms), n)]
        return adaptive.Extension(powers, step, changes > 0.0)

    def state(pace: Pace, v: Array, y: Array, t: Any) -> tuple[Array, Array, Any]:
        terms, step, changes = made(pace, v, y)
        return *adaptive.within(terms, v, y, (t - pace.t) * (1.0 / step)), ~changes

    return state


def adapt(plan: Plan, pacing: Pacing, paces: Array, v: Array, y: Array, *, make: Callable[..., bool] | None = None) -> Adapted:
    """Step every member to its last time; ``paces`` has a column for each member, or one for all. ``make`` makes the steps."""
    make = _adapt_by_core if make is None else make
    if plan.backend == "numpy":
        return _adapt_by_numpy(plan, pacing, paces, v, y)
    times, n_v, members, numbers = len(pacing.at), prod(plan.system.v_shape), plan.members, pace_numbers(plan)
    saved = times if plan.observer is None else 1  # with an observer only the last one
    saved_v, saved_y = np.empty((saved, *v.shape)), np.empty((saved, *y.shape))
    last = np.empty((n_v + prod(plan.system.y_shape), members))
    last_paces, status = np.empty((numbers, members)), np.empty(plan.batch, dtype=np.int64)
    before = paces.reshape(numbers, paces.size // numbers)
    rows_v, rows_y = rows(v, plan.batch), rows(y, plan.batch)
    steps = None
    if pacing.every:
        blocks = (np.empty((pacing.room, *shape, members)) for shape in (plan.system.v_shape, plan.system.y_shape))
        steps = KeptSteps(np.zeros(members, np.int64), np.empty((pacing.room, members)), *blocks)
    waypoints = room_for_waypoints(pacing, len(last), numbers, members)
    ends = status.reshape(-1)
    arrays = AdaptiveArrays(rows_v, rows_y, before, saved_v, saved_y, last, last_paces, ends, None, steps, waypoints)
    core_pacing, core_plan = pacing_of_core(plan, pacing), plan._replace(t0=0.0)
    spec = model(core_plan)
    if not make(spec, core_plan, core_pacing, arrays):  # an attempt is not one tape: the reference finds the start
        before = numbers_of(begun(plan, paces, v, y)).reshape(numbers, members)
        make(spec, core_plan, core_pacing._replace(begins=False), arrays._replace(paces=before))
    each = evaluations_of_attempt(plan)
    last_v, last_y = last[:n_v].reshape(v.shape), last[n_v:].reshape(y.shape)
    paces = last_paces.reshape(numbers, *plan.batch)
    return Adapted(saved_v, saved_y, last_v, last_y, paces, status, each, steps, waypoints)


def _adapt_by_core(model: _core.ModelSpec, plan: Plan, pacing: CorePacing, arrays: AdaptiveArrays) -> bool:
    """Make the run by the core, or on the device of the plan: see ``_core.adapt``."""
    if plan.device is None:
        return _core.adapt(model, plan, pacing, arrays)
    from ...device import adaptive  # only such runs need it

    return adaptive.adapt(plan.device, model, plan, pacing, arrays)


def evaluations_of_attempt(plan: Plan) -> int:
    """Function evaluations of an attempt of a plan."""
    if plan.method.has_series:
        return _core.series_evaluations(model(plan._replace(t0=0.0)), attempts=True)
    return plan.method.attempt_evaluations


def _adapt_by_numpy(plan: Plan, pacing: Pacing, paces: Array, v: Array, y: Array) -> Adapted:
    """``adapt`` by the reference."""
    from ...reference import adaptive

    pace = begun(plan, paces, v, y) if pacing.begins else pace_of(plan, paces)
    attempt, jumps = attempt_by_numpy(plan, pacing.budget), jumps_of(plan, pacing)
    series, numbers = plan.method.has_series, prod(plan.system.v_shape) + prod(plan.system.y_shape)
    waypoints = room_for_waypoints(pacing, numbers, pace_numbers(plan), plan.members)
    at, budget, every = pacing.at, pacing.budget, pacing.every
    extension = extension_by_numpy(plan) if looks_within(plan, pacing) else None
    kept: dict[str, Any] = {"every": every, "waypoints": waypoints, "extension": extension, "is_part": pacing.is_part}
    out = adaptive.run(attempt, v, y, pace, at=at, budget=budget, jumps=jumps, series=series, **kept)
    each = evaluations_of_attempt(plan)
    steps = _gathered(plan, out.steps) if pacing.every else None
    paces = numbers_of(out.pace)
    return Adapted(out.v, out.y, out.last_v, out.last_y, paces, out.status, each, steps, waypoints)


def _gathered(plan: Plan, steps: Sequence[tuple[Any, Any, Array, Array]]) -> KeptSteps:
    """The saved steps of each member, one after the other."""
    members, shapes = plan.members, (plan.system.v_shape, plan.system.y_shape)
    count = np.zeros(members, np.int64)
    room = max((int(n) for n in np.sum([np.reshape(saved, -1) for saved, *_ in steps], axis=0)), default=0) if steps else 0
    out = KeptSteps(count, np.empty((room, members)), *(np.empty((room, *shape, members)) for shape in shapes))
    for saved, t, v, y in steps:
        index = np.flatnonzero(saved)
        out.t[count[index], index] = np.reshape(t, -1)[index]
        for to, block, shape in zip((out.v, out.y), (v, y), shapes, strict=True):
            to[count[index], ..., index] = np.moveaxis(block.reshape(*shape, members)[..., index], -1, 0)
        count[index] += 1
    return out
