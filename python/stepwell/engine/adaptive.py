"""Runs with adaptive steps, by the core or by the reference."""

from __future__ import annotations

from functools import partial
from math import prod
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from .. import _core
from .._checks import Array, Shape
from ..method_records import Method
from ..reference.types import Whole
from ..systems import System
from ..systems.base import rows
from .by_tape import blocks_of, evaluated, rows_of
from .plan import Plan, model

if TYPE_CHECKING:
    from ..reference.adaptive import Pace

#: How many numbers say where a member stands: those of a ``Pace``.
PACE_NUMBERS = 20
#: Places among them; the counts are of accepted, rejected and extra steps.
TIME, STEP, TARGET, HELD, RELATIVE, ABSOLUTE, COUNTS, WORK = 0, 1, 2, 4, 5, 6, slice(15, 18), 19


class Pacing(NamedTuple):
    """When the state is asked for, ascending, the most attempts of a member, and whether members have yet to begin."""

    at: Array
    budget: int
    begins: bool = False


class AdaptiveArrays(NamedTuple):
    """What a run with a tolerance begins with and what it fills, for the core.

    Attributes:
        v: rows of v, of one number for each member or one for all.
        y: rows of y, likewise.
        paces: where members stand at the start, shape (numbers of a ``Pace``, members), or (…, 1) where that is the same for all.
        saved_v: velocities at the asked times, shape (times, *block, *batch); NaN from where a member stopped.
        saved_y: coordinates, likewise.
        last_state: the state where members stand at the end, shape (numbers of v and y, members).
        last_paces: where they stand, as ``paces``.
        status: how they ended, shape (members,).
        trail: None; or times and steps to try next, shape (2, times, members), where attempts are made one by one until the asked
            time, and what is kept is where members stand before the first and after each.
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


class Adapted(NamedTuple):
    """Saved states, and of each member at the end the state, the numbers of its ``Pace`` and the status.

    ``evaluations`` is how many function evaluations an attempt takes.
    """

    v: Array
    y: Array
    last_v: Array
    last_y: Array
    paces: Array
    status: Whole
    evaluations: int


def paces(plan: Plan, first: Array | None, relative: Array, absolute: Array | None) -> Array:
    """Where members stand before they begin, shape (numbers of a ``Pace``, *batch), or (numbers,) if it is the same for all.

    Without ``absolute`` the relative error is one of the longest that a block has been.
    """
    from ..reference import adaptive  # only such runs need it

    given: list[Any] = [0.0 if each is None else each.item() if each.size == 1 else each for each in (first, relative, absolute)]
    step, *tolerance = given
    waiting = adaptive.waiting(plan.t0, step, (*tolerance, float(absolute is None)), plan.system.samples)
    if all(type(each) is float for each in given):
        return np.array(waiting)
    numbers = np.empty((PACE_NUMBERS, *plan.batch))
    for row, number in zip(numbers, waiting, strict=True):
        row[...] = number
    return numbers


def begun(plan: Plan, paces: Array, v: Array, y: Array) -> Pace:
    """Where members stand at the start, by the reference; of them it is known where they stand before."""
    from ..reference import adaptive

    system, pace = plan.system.alone(1.0, plan.batch), pace_of(paces, plan.batch)
    return adaptive.begin(system, pace, v, y, plan.block_axes, series=plan.method.has_series)


def pace_of(numbers: Array, batch: Shape) -> Pace:
    """Where the members of a batch stand, from the numbers of each, or those of all."""
    from ..reference import adaptive

    return adaptive.Pace(*numbers if numbers.shape[1:] == batch else (np.broadcast_to(row, batch) for row in numbers))


def evaluations(method: Method, system: System, *, order: int = 0, paced: bool = False) -> int:
    """Function evaluations of a step, or of an attempt at an adaptive one by a series of that order.

    Of a series: operations of all coefficients of the rates over those of one evaluation, rounded up. All operations count alike.

    Raises:
        UnsupportedError: if the series of the system is too long.
    """
    if method.has_series:
        batch = system.batch if system.control is None else np.broadcast_shapes(system.batch, system.control.batch)
        plan = Plan(system, method, batch, 1.0, order=order)
        return _core.series_evaluations(model(plan), attempts=paced)
    return method.attempt_evaluations if paced else method.evaluations


def attempts(method: Method, system: Any, block_axes: tuple[int, int], order: int = 0) -> Any:
    """An attempt at an adaptive step by the reference: a function of a pace, a budget, v and y."""
    from ..reference import adaptive, series_pace

    steps: Any = method.steps
    if method.has_series:
        return partial(series_pace.attempt, order or steps.ORDER, system, block_axes)
    assert method.error_order is not None
    return partial(adaptive.attempt, steps, system, method.error_order, block_axes)


def evaluated_attempt(plan: Plan, budget: int) -> Any:
    """An attempt at an adaptive step."""
    made = evaluated(plan, "attempt", budget)

    def attempt(pace: Pace, budget: int, v: Array, y: Array) -> tuple[Pace, Array, Array]:
        out = made([*rows_of(plan, v, y), *np.broadcast_arrays(*pace)], None)
        return (pace_of(out[-len(pace) :], plan.batch), *blocks_of(v, y, out))

    return attempt


def attempt_by_numpy(plan: Plan, budget: int) -> Any:
    """The same, by the tape if it has to be."""
    from ..reference import adaptive

    if plan.by_tape:
        return evaluated_attempt(plan, budget)
    system = adaptive.Attempted(plan.system.alone(1.0, plan.batch), plan.system.control)
    return attempts(plan.method, system, plan.block_axes, plan.order)


def adapt(plan: Plan, pacing: Pacing, paces: Array, v: Array, y: Array) -> Adapted:
    """Go on from where members stand, of whom ``paces`` has the numbers of each or those of all."""
    if plan.backend == "numpy":
        return _adapt_by_numpy(plan, pacing, paces, v, y)
    times, n_v, members = len(pacing.at), prod(plan.system.v_shape), plan.members
    saved_v, saved_y = np.empty((times, *v.shape)), np.empty((times, *y.shape))
    last = np.empty((n_v + prod(plan.system.y_shape), members))
    last_paces, status = np.empty((PACE_NUMBERS, members)), np.empty(plan.batch, dtype=np.int64)
    before = paces.reshape(PACE_NUMBERS, paces.size // PACE_NUMBERS)
    rows_v, rows_y = rows(v, plan.batch), rows(y, plan.batch)
    arrays = AdaptiveArrays(rows_v, rows_y, before, saved_v, saved_y, last, last_paces, status.reshape(-1))
    spec = model(plan)
    if not _core.adapt(spec, plan, pacing, arrays):  # an attempt is not one tape: the reference finds the start
        before = np.array(begun(plan, paces, v, y)).reshape(PACE_NUMBERS, members)
        _core.adapt(spec, plan, pacing._replace(begins=False), arrays._replace(paces=before))
    series = plan.method.has_series
    each = _core.series_evaluations(spec, attempts=True) if series else plan.method.attempt_evaluations
    last_v, last_y = last[:n_v].reshape(v.shape), last[n_v:].reshape(y.shape)
    return Adapted(saved_v, saved_y, last_v, last_y, last_paces.reshape(PACE_NUMBERS, *plan.batch), status, each)


def _adapt_by_numpy(plan: Plan, pacing: Pacing, paces: Array, v: Array, y: Array) -> Adapted:
    """The same by the reference."""
    from ..reference import adaptive

    pace = begun(plan, paces, v, y) if pacing.begins else pace_of(paces, plan.batch)
    attempt = attempt_by_numpy(plan, pacing.budget)
    out = adaptive.run(attempt, v, y, pace, at=pacing.at.tolist(), budget=pacing.budget)
    each = evaluations(plan.method, plan.system, order=plan.order, paced=True)
    return Adapted(out.v, out.y, out.last_v, out.last_y, np.array(np.broadcast_arrays(*out.pace)), out.status, each)
