"""States between accepted steps: each is computed by a step of the method from the end of the step before it."""

from __future__ import annotations

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

#: So many states are computed by one call of the core.
AT_ONCE = 1 << 17


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
    paces = paces.copy()
    paces[engine.COUNTS], paces[engine.EXTRA] = 0.0, 0.0
    # A step that goes beyond the time is held, and only the extra step to there is made.
    paces[engine.TIME], paces[engine.STEP], paces[engine.HELD] = since, 2.0 * (times - since), 1.0
    groups, low = engine.groups_of(plan), engine.low_numbers(plan)
    # Sizes are those of the states, and a series has no more digits of them.
    paces[engine.PACE_NUMBERS : engine.PACE_NUMBERS + groups], paces[len(paces) - low :] = 0.0, 0.0
    pacing = pacing._replace(at=times[np.newaxis], begins=False, every=0, waypoints=False)
    out = engine.adapt(plan, pacing, paces, np.ascontiguousarray(v), np.ascontiguousarray(y))
    return out.v[0], out.y[0]


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
    steps, at_once = np.where(np.isnan(ends[:-1]), np.inf, ends[:-1]), max(AT_ONCE // max(total, 1), 1)
    for first in range(0, flat.size, at_once):
        part = slice(first, first + at_once)
        step, member, when = _places(steps, flat[part])
        since = np.where(when < over[member], steps[step, member], when)
        step = np.where(when < over[member], step, len(steps))
        start = [np.moveaxis(block[step, ..., member], 0, -1).astype(np.float64) for block in saved]
        of_them = pacing if jumps is None else pacing._replace(jumps=jumps[:, member])
        made = by_steps(members.plan(member), of_them, rows[:, member], since, when, *start)
        for block, some, shape in zip(at, made, shapes, strict=True):
            block[part] = np.moveaxis(some.reshape(*shape, len(flat[part]), total), len(shape), 0)
    v, y = (block.reshape((*times.shape, *shape, *batch))[()] for block, shape in zip(at, shapes, strict=True))
    return v, y


def _places(ends: Array, times: Array) -> tuple[Whole, Whole, Array]:
    """For each time and member, one after the other: after which step it is, the member, and the time."""
    steps = np.stack([np.searchsorted(ends[:, member], times, side="right") - 1 for member in range(ends.shape[1])], axis=1)
    return steps.reshape(-1), np.tile(np.arange(ends.shape[1]), len(times)), np.repeat(times, ends.shape[1])
