"""Where members with adaptive steps stand before and after each of some attempts."""

from __future__ import annotations

from math import prod
from typing import Any, NamedTuple

import numpy as np

from ... import _core
from ...base.arrays import Array, Whole
from ...model.parameters import rows as rows_of
from ...reference.bits import less, where
from .. import engine
from .members import Members

#: This many attempts are made between checks of where members are.
ATTEMPTS = 256


class Attempts(NamedTuple):
    """Some attempts of some members; the first axis is where they stand before the first, and after each.

    Attributes:
        t: times, shape (attempts + 1, members); the same before and after an attempt that was rejected or not made.
        h: the steps to try next, likewise.
        v: velocities, shape (attempts + 1, *block, members).
        y: coordinates, likewise.
        paces: where they stand after the last, shape (numbers of a ``Pace``, members).
    """

    t: Array
    h: Array
    v: Array
    y: Array
    paces: Array

    def lengths(self, plan: engine.Plan) -> Array:
        """How long the steps of the attempts are, shape (attempts, members): a series finds that within the attempt."""
        return self.h[1:] if plan.method.has_series else self.h[:-1]


def attempted(
    plan: engine.Plan,
    until: Any,
    attempts: int,
    budget: int,
    begins: bool,
    paces: Array,
    v: Array,
    y: Array,
    jumps: Array | None = None,
) -> Attempts:
    """Make attempts one by one until each member is at or past a time.

    Unlike a run, which holds it to save states inside it, a member takes its last step even if that passes the time.

    Args:
        plan: of these members, along one axis.
        until: that time.
        attempts: the most attempts of a member here.
        budget: the most attempts of a member, with earlier ones.
        begins: whether members have yet to begin.
        paces: where they stand, shape (numbers of a ``Pace``, members) or (numbers,).
        v: velocities, shape (*block, members).
        y: coordinates, likewise.
        jumps: times that no step crosses, the same for all or shape (jumps, members).
    """
    if plan.backend == "numpy":
        return _by_numpy(plan, until, attempts, budget, begins, paces, v, y, jumps)
    rows, members = attempts + 1, plan.members
    states = tuple(np.empty((rows, *a.shape)) for a in (v, y))
    last = np.empty((prod(plan.system.v_shape) + prod(plan.system.y_shape), members))
    numbers = engine.pace_numbers(plan)
    trail, last_paces = np.empty((2, rows, members)), np.empty((numbers, members))
    before = paces.reshape(numbers, paces.size // numbers)
    arrays = engine.AdaptiveArrays(
        v=rows_of(v, plan.batch),
        y=rows_of(y, plan.batch),
        paces=before,
        saved_v=states[0],
        saved_y=states[1],
        last_state=last,
        last_paces=last_paces,
        status=np.empty(members, dtype=np.int64),
        trail=trail,
    )
    plan_of_core = plan._replace(t0=0.0)
    model = engine.model(plan_of_core)
    pacing = engine.pacing_of_core(plan, engine.Pacing(np.broadcast_to(until, (rows, *np.shape(until))), budget, begins, jumps))
    if not _core.adapt(model, plan_of_core, pacing, arrays):  # an attempt is not one tape: the reference finds the start
        begun = engine.numbers_of(engine.begun(plan, paces, v, y)).reshape(numbers, members)
        _core.adapt(model, plan_of_core, pacing._replace(begins=False), arrays._replace(paces=begun))
    return Attempts(trail[0], trail[1], states[0], states[1], last_paces)


def _by_numpy(
    plan: engine.Plan,
    until: Any,
    attempts: int,
    budget: int,
    begins: bool,
    paces: Array,
    v: Array,
    y: Array,
    jumps: Array | None,
) -> Attempts:
    """``attempted`` by the reference."""
    pace = engine.begun(plan, paces, v, y) if begins else engine.pace_of(plan, paces)
    pace = engine.pace_of(plan, engine.numbers_of(pace))._replace(held=np.zeros(plan.batch))
    walls = engine.jumps_of(plan, engine.Pacing(np.atleast_1d(until), budget, begins, jumps))
    if walls is not None:
        pace = pace._replace(wall=walls.wall(pace.t))
    attempt, series = engine.attempt_by_numpy(plan, budget), plan.method.has_series
    rows = []
    with np.errstate(all="ignore"):
        for done in range(attempts + 1):
            pace = pace._replace(target=where(less(pace.t, until), np.inf, pace.t))
            length = where(less(pace.wall, pace.t + pace.h), pace.wall - pace.t, pace.h)
            rows.append((pace.t, length, v, y))
            if done < attempts and pace.outlook(budget).runs.any():
                pace, v, y = attempt(pace, budget, v, y)
                if walls is not None:
                    pace = walls.crossed(pace, series=series)
    t, h, all_v, all_y = (np.stack(each) for each in zip(*rows, strict=True))
    return Attempts(t, h, all_v, all_y, engine.numbers_of(pace))


def extremes(
    plan: engine.Plan, pacing: engine.Pacing, paces: Array, v: Array, y: Array, index: Whole
) -> tuple[Array, Array, Array]:
    """The least and the largest y of some members at the ends of their steps, which are made again; shape (*block, members).

    And how many attempts were rejected: the run itself has more if a state that it saved within a step caused a rejection.

    Args:
        plan: of the run.
        pacing: likewise.
        paces: where members stand at its start.
        v: velocities there.
        y: coordinates there.
        index: the places of these members in the flattened batch.
    """
    numbers, total, every = engine.pace_numbers(plan), plan.members, Members(plan._replace(progress=None))
    place = np.arange(len(index))
    shapes = plan.system.v_shape, plan.system.y_shape
    v, y = (block.reshape(*shape, total)[..., index] for block, shape in zip((v, y), shapes, strict=True))
    paces = np.broadcast_to(paces.reshape(numbers, -1), (numbers, total))[:, index]
    least, most, rejected = np.array(y), np.array(y), np.zeros(len(index))
    until, jumps, begins = np.broadcast_to(pacing.at[-1], plan.batch).reshape(-1), pacing.jumps, pacing.begins
    while len(index):
        own = jumps
        if jumps is not None and jumps.ndim > 1:
            own = np.broadcast_to(jumps, (len(jumps), *plan.batch)).reshape(len(jumps), -1)[:, index]
        some, end = every.plan(index), until[index]
        before = np.zeros(len(index)) if begins else paces[engine.COUNTS][:2].sum(axis=0)
        out = attempted(some, end, ATTEMPTS, pacing.budget, begins, np.ascontiguousarray(paces), v, y, own)
        ys = np.where((out.t <= end).reshape(len(out.t), *(1,) * len(shapes[1]), -1), out.y, np.nan)
        least[..., place] = np.fmin(least[..., place], np.fmin.reduce(ys, axis=0))
        most[..., place] = np.fmax(most[..., place], np.fmax.reduce(ys, axis=0))
        rejected[place] = out.paces[engine.COUNTS][1]
        after = out.paces[engine.COUNTS][:2].sum(axis=0)
        on = (out.t[-1] < end) & (after - before == ATTEMPTS) & (after < pacing.budget)
        index, place, paces, v, y, begins = index[on], place[on], out.paces[:, on], out.v[-1][..., on], out.y[-1][..., on], False
    return least, most, rejected
