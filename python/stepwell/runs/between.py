"""States between accepted steps: each is computed by a step of the method from the end of the step before it."""

from __future__ import annotations

from collections.abc import Callable
from math import prod
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base import checks
from ..base.arrays import Array, Whole
from ..errors import ArgumentError, UnsupportedError
from . import continuation, engine
from .events.members import Members
from .options import Options
from .request import Request

if TYPE_CHECKING:
    from .result import Run

#: So many states are computed by one call of the core, and so many of one step together.
AT_ONCE, AT_ONCE_IN_A_STEP = 1 << 17, 64
#: The length of a step is the difference of its ends, give or take as many roundings.
ROUNDINGS = 3


def by_steps(
    plan: engine.Plan, pacing: engine.Pacing, paces: Array, since: Array, times: Array, v: Array, y: Array
) -> tuple[Array, Array]:
    """The states at times by steps from earlier ones, all at once, as members of a batch along one axis.

    Args:
        plan: that of these members.
        pacing: whose jumps no step crosses.
        paces: their step-size controllers, shape (numbers, members), which have their tolerances.
        since: when the steps begin, shape (members,).
        times: when they end, likewise.
        v: velocities at the beginning, shape (*block, members).
        y: coordinates there, likewise.
    """
    if (jumps := engine.jumps_of(plan, pacing)) is not None:
        since = jumps.left(since)
    # A step that goes beyond the time is held, and only the extra step to there is made.
    paces = _held(plan, paces, since, 2.0 * (times - since))
    pacing = pacing._replace(at=times[np.newaxis], begins=False, every=0, waypoints=False)
    out = engine.adapt(plan, pacing, paces, np.ascontiguousarray(v), np.ascontiguousarray(y))
    return out.v[0], out.y[0]


def by_extension(
    plan: engine.Plan, pacing: engine.Pacing, paces: Array, since: Array, ends: Array, at: Array, v: Array, y: Array
) -> tuple[Array, Array]:
    """The states at times within accepted steps, which are members of a batch, by the continuous extension of the method.

    Args:
        plan: that of these steps.
        pacing: whose jumps no step crosses.
        paces: their step-size controllers, shape (numbers, steps).
        since: when the steps begin, shape (steps,).
        ends: when they end, likewise.
        at: the times, ascending, shape (times, steps). States at times that are not before the end are NaN.
        v: velocities at the beginning, shape (*block, steps).
        y: coordinates there, likewise.
    """
    if (jumps := engine.jumps_of(plan, pacing)) is not None:
        since = jumps.left(since)
    h = ends - since
    for _ in range(ROUNDINGS):  # until the step ends there to the bit
        h = np.where(since + h < ends, np.nextafter(h, np.inf), np.where(since + h > ends, np.nextafter(h, 0.0), h))
    paces = _held(plan, paces, since, h)
    # No step is made: what is not within these is out of reach.
    at = np.concatenate([np.maximum(at, since), ends[np.newaxis]])
    pacing = pacing._replace(at=at, begins=False, every=0, waypoints=False, budget=0)
    out = engine.adapt(plan, pacing, paces, np.ascontiguousarray(v), np.ascontiguousarray(y))
    return out.v[:-1], out.y[:-1]


def reach_of(paces: Array, last: Array) -> Array:
    """Where the last steps of trajectories end that came to these times: behind them, if they are held."""
    beyond = np.minimum(paces[engine.TIME] + paces[engine.STEP], paces[engine.WALL])
    return np.where(paces[engine.HELD] > 0.0, beyond, last)


def _held(plan: engine.Plan, paces: Array, since: Array, h: Array) -> Array:
    """The paces of members that hold a step of this length."""
    paces = paces.copy()
    paces[engine.COUNTS], paces[engine.EXTRA] = 0.0, 0.0
    paces[engine.TIME], paces[engine.STEP], paces[engine.HELD] = since, h, 1.0
    groups, low = engine.groups_of(plan), engine.low_numbers(plan)
    # Sizes are those of the states, and a series has no more digits of them.
    paces[engine.PACE_NUMBERS : engine.PACE_NUMBERS + groups], paces[len(paces) - low :] = 0.0, 0.0
    return paces


def within_steps(
    plan_of: Callable[[Whole], engine.Plan],
    pacing_of: Callable[[Whole], engine.Pacing],
    paces: Array,
    steps: tuple[Whole, Array, Array],
    times: Array,
    start: Callable[[Whole], tuple[Array, Array]],
) -> list[Array]:
    """The states at times, each within a step: of the continuous extension, or by a step of the method from where it begins.

    Args:
        plan_of: the plan of the trajectories with these numbers, as members of a batch.
        pacing_of: their pacing.
        paces: the step-size controllers of all trajectories, shape (numbers, trajectories).
        steps: of each time the number of its trajectory, and when its step begins and ends, shape (times,); NaN where that is not
            known, so that only a step of the method will do.
        times: the times, likewise.
        start: the states at the beginnings of the steps of the times with these numbers, v and y, shape (*block, times).

    Returns:
        v and y, shape (*block, times).
    """
    member, since, ends = steps
    plan, begins = plan_of(member[:1]), times <= since
    known = np.isfinite(ends) & engine.extends(plan) & ~begins
    order = np.lexsort((times, since, member))
    order = order[known[order]]
    new = np.ones(len(order), dtype=bool)
    new[1:] = (np.diff(member[order]) != 0) | (np.diff(since[order]) != 0.0)
    # Of a step with many times some at a time, so that steps with few of them are not in the way of those with many.
    count = np.arange(len(order)) - np.maximum.accumulate(np.where(new, np.arange(len(order)), 0))
    new |= count % AT_ONCE_IN_A_STEP == 0
    first, column = order[new], np.cumsum(new) - 1
    row, is_left = count % AT_ONCE_IN_A_STEP, ~known & ~begins
    shapes = plan.system.v_shape, plan.system.y_shape
    out = [np.empty((*shape, len(times))) for shape in shapes]
    for to, block in zip(out, start(np.flatnonzero(begins)), strict=True):
        to[..., begins] = block
    if len(first):
        at = np.repeat(ends[first][np.newaxis], row.max() + 1, axis=0)
        at[row, column] = times[order]
        which = member[first]
        made = by_extension(plan_of(which), pacing_of(which), paces[:, which], since[first], ends[first], at, *start(first))
        for to, block in zip(out, made, strict=True):
            to[..., order] = np.moveaxis(block[row, ..., column], 0, -1)
            # Where a number changes much in a step, states take steps, which may have to be shorter.
            is_left |= known & np.isnan(to).any(axis=tuple(range(to.ndim - 1)))
    others = np.flatnonzero(is_left)
    if len(others):
        which = member[others]
        made = by_steps(plan_of(which), pacing_of(which), paces[:, which], since[others], times[others], *start(others))
        for to, block in zip(out, made, strict=True):
            to[..., others] = block
    return out


def states(run: Run, t: Any) -> tuple[Array, Array]:
    """Velocities and coordinates of a run at these times, shapes (*t, *block, *batch): see ``Run.__call__``."""
    times = checks.numbers("t", t, unit="units of time")
    if not run.has_each_step:
        raise UnsupportedError(
            "t: the states between are computed from those of all steps, got a run without them; give tolerance= and every=1"
        )
    if run.changed_by:
        raise UnsupportedError(
            f"t: a state between is computed from the step before it, which is not known after {', '.join(run.changed_by)} "
            f"changed the state; ask for the times by at="
        )
    batch, total = run.status.shape, run.status.size
    ends = run.t.reshape(len(run.t), total)
    way = -1.0 if (ends[-1] < ends[0]).any() else 1.0
    ends, flat = way * ends, way * times.reshape(-1)
    begin, end = ends[0].max(initial=-np.inf), ends[-1].min(initial=np.inf)
    if times.size and not (begin <= flat.min() and flat.max() <= end):
        outside = times[(way * times < begin) | (way * times > end)][0]
        raise ArgumentError(f"t: expected times within the run, {way * begin:g} to {way * end:g}, got {outside:g}")
    shapes = run.system.v_shape, run.system.y_shape
    checks.fits("the states", sum(map(prod, shapes)) * flat.size, batch, "ask for fewer times")
    saved = [block.reshape(len(block), *shape, total) for block, shape in zip((run.v, run.y), shapes, strict=True)]
    at = [np.empty((flat.size, *shape, total), run.y.dtype) for shape in shapes]
    before = continuation.of(run, stopped=True)
    request = Request.of(run.system, run.method, Options(resume=before, at=run.t[-1:], device="cpu"))
    assert request.step_control is not None
    pacing, paces = request.step_control.pacing, request.step_control.paces
    members, rows = Members(request.plan), np.broadcast_to(paces.reshape(len(paces), -1), (len(paces), total))
    jumps = None if pacing.jumps is None or pacing.jumps.ndim == 1 else pacing.jumps.reshape(len(pacing.jumps), total)
    over = ends[-1] if run.stopped_at is None else np.where(np.isnan(run.stopped_at), end, way * run.stopped_at).reshape(-1)
    # A held step goes beyond the last time; where an event stopped a trajectory, its step did, and it is not known to where.
    following = np.where(np.isnan(ends[1:]), reach_of(rows, ends[-1]), ends[1:])
    following[-1] = reach_of(rows, ends[-1])
    if run.stopped_at is not None:
        following[:, ~np.isnan(run.stopped_at).reshape(-1)] = np.nan

    def of_them(member: Whole) -> engine.Pacing:
        return pacing if jumps is None else pacing._replace(jumps=jumps[:, member])

    steps, at_once = np.where(np.isnan(ends[:-1]), np.inf, ends[:-1]), max(AT_ONCE // max(total, 1), 1)
    for first in range(0, flat.size, at_once):
        part = slice(first, first + at_once)
        step, member, when = _places(steps, flat[part])
        is_over = ~(when < over[member])
        since = np.where(is_over, when, steps[step, member])
        until = np.where(is_over, np.nan, following[step, member])
        step = np.where(is_over, len(steps), step)

        def start(some: Whole, step: Whole = step, member: Whole = member) -> tuple[Array, Array]:
            v, y = (np.moveaxis(block[step[some], ..., member[some]], 0, -1).astype(np.float64) for block in saved)
            return v, y

        made = within_steps(members.plan, of_them, rows, (member, since, until), when, start)
        for block, some, shape in zip(at, made, shapes, strict=True):
            block[part] = np.moveaxis(some.reshape(*shape, len(flat[part]), total), len(shape), 0)
    v, y = (block.reshape((*times.shape, *shape, *batch))[()] for block, shape in zip(at, shapes, strict=True))
    return v, y


def _places(ends: Array, times: Array) -> tuple[Whole, Whole, Array]:
    """For each time and member, one after the other: after which step it is, the member, and the time."""
    steps = np.stack([np.searchsorted(ends[:, member], times, side="right") - 1 for member in range(ends.shape[1])], axis=1)
    return steps.reshape(-1), np.tile(np.arange(ends.shape[1]), len(times)), np.repeat(times, ends.shape[1])
