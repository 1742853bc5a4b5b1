"""Where members with adaptive steps stand before and after each of some attempts."""

from __future__ import annotations

from math import prod
from typing import NamedTuple

import numpy as np

from .. import _core, engine
from .._checks import Array
from ..reference import adaptive
from ..reference.bits import less, where
from ..systems.base import rows as rows_of


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
    plan: engine.Plan, until: float, attempts: int, budget: int, begins: bool, paces: Array, v: Array, y: Array
) -> Attempts:
    """Make attempts one by one, of each member until it is at or past a time.

    So the last step of a member is made, where a run would hold it, to save a state within.

    Args:
        plan: of these members, along one axis.
        until: that time.
        attempts: how many, at most.
        budget: the most of a member, with those before.
        begins: whether members have yet to begin.
        paces: where they stand, shape (numbers of a ``Pace``, members) or (numbers,).
        v: velocities, shape (*block, members).
        y: coordinates, likewise.
    """
    if plan.backend == "numpy":
        return _by_numpy(plan, until, attempts, budget, begins, paces, v, y)
    rows, members = attempts + 1, plan.members
    states = tuple(np.empty((rows, *a.shape)) for a in (v, y))
    last = np.empty((prod(plan.system.v_shape) + prod(plan.system.y_shape), members))
    trail, last_paces = np.empty((2, rows, members)), np.empty((engine.PACE_NUMBERS, members))
    before = paces.reshape(engine.PACE_NUMBERS, paces.size // engine.PACE_NUMBERS)
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
    model, pacing = engine.model(plan), engine.Pacing(np.full(rows, until), budget, begins)
    if not _core.adapt(model, plan, pacing, arrays):  # an attempt is not one tape: the reference finds the start
        begun = np.array(engine.begun(plan, paces, v, y)).reshape(engine.PACE_NUMBERS, members)
        _core.adapt(model, plan, pacing._replace(begins=False), arrays._replace(paces=begun))
    return Attempts(trail[0], trail[1], states[0], states[1], last_paces)


def _by_numpy(
    plan: engine.Plan, until: float, attempts: int, budget: int, begins: bool, paces: Array, v: Array, y: Array
) -> Attempts:
    """The same by the reference."""
    pace = engine.begun(plan, paces, v, y) if begins else engine.pace_of(paces, plan.batch)
    pace = adaptive.Pace(*np.broadcast_arrays(*pace))._replace(held=np.zeros(plan.batch))
    attempt = engine.attempt_by_numpy(plan, budget)
    rows = []
    with np.errstate(all="ignore"):
        for done in range(attempts + 1):
            pace = pace._replace(target=where(less(pace.t, until), np.inf, pace.t))
            rows.append((pace.t, pace.h, v, y))
            if done < attempts and pace.outlook(budget).runs.any():
                pace, v, y = attempt(pace, budget, v, y)
    t, h, all_v, all_y = (np.stack(each) for each in zip(*rows, strict=True))
    return Attempts(t, h, all_v, all_y, np.array(np.broadcast_arrays(*pace)))
