"""Amounts that became negative in a run with adaptive steps, though their equations keep them from it.

Where no rate is negative at an amount of 0 while the others are positive, as in reactions and populations, no solution leaves the
positive ones. A run may: an amount that falls far below the tolerated error has any sign, and a negative one may grow, up to an
equilibrium that looks like any other.
"""

from __future__ import annotations

from math import prod
from typing import Any

import numpy as np

from ..base.arrays import Array, Whole
from ..base.reprs import first_of, share
from ..errors import AccuracyWarning
from ..reference import adaptive
from . import engine
from .events.members import Members
from .findings import Finding
from .positive import name_of
from .request import Request
from .result import Run

#: Errors of many steps add up to so many times the tolerated one of a step, but to no more than this part of a size.
BEYOND, PART = 100.0, 0.01
#: Rates are looked at in so many states, whose numbers are from the first to the second of these parts of the largest one.
LOOKED_AT, LEAST_PART, MOST_PART = 64, 1e-4, 1e4
#: Members are looked at so many at a time.
AT_ONCE = 256


def of_negative_amounts(run: Run, request: Request) -> Finding | None:
    """The finding for members that ended at a negative amount, beyond what is tolerated, which their equations do not reach."""
    plan, end = request.plan, run.controller_state
    assert end is not None
    if prod(plan.system.v_shape) or not plan.system.groups or plan.backward or not (end.y < 0.0).any():
        return None
    if plan.system.mass_matrix is not None:  # what algebraic equations give is no rate
        return None
    if plan.system.reads_time or plan.system.all_inputs():  # rates at one time say nothing of those at another
        return None
    n, size = prod(plan.system.y_shape), run.status.size
    first = np.broadcast_to(request.y, (*plan.system.y_shape, *run.status.shape)).reshape(n, size)
    last = end.y.reshape(n, size)
    beyond = last < -_allowed(plan, end.pace)
    members = np.flatnonzero(beyond.any(axis=0) & (first >= 0.0).all(axis=0))
    ends = np.broadcast_to(run.t[-1], run.status.shape).reshape(-1)
    some = [members[i : i + AT_ONCE] for i in range(0, members.size, AT_ONCE)]
    members = members[
        np.concatenate([*(_stay_positive(plan, each, ends[each], last[:, each]) for each in some), np.empty(0, bool)])
    ]
    if not members.size:
        return None
    one = int(members[0])
    place = int(np.argmin(np.where(beyond[:, one], last[:, one], 0.0)))
    whole = np.zeros(size, dtype=bool)
    whole[members] = True
    whole = whole.reshape(run.status.shape)
    index = tuple(np.argwhere(whole)[0].tolist())
    who = f"{share(members.size, whole.shape, size)}{first_of(members.size, index, size)}"
    text = (
        f"{name_of(run.system, place)} ends at {last[place, one]:.3g} in {who}, which no solution reaches: no rate of these "
        f"equations is negative where its number is 0. A number fell far below the tolerated error, which is relative to its "
        f"largest size so far, and took the wrong sign; give positive=True"
    )
    return Finding(AccuracyWarning, text, whole)


def _allowed(plan: engine.Plan, pace: Array) -> Array:
    """How far below zero errors may have led each number of each member, by the largest sizes so far."""
    numbers = engine.pace_of(plan, pace)
    n = prod(plan.system.y_shape)
    count = sum(plan.acceptance.counts(0, n))
    _, tolerated = adaptive.tolerated(numbers, numbers.h, (0, count), numbers.longest, numbers.longest, adaptive.ROUNDING)
    allowed = np.maximum(tolerated, np.minimum(BEYOND * tolerated, PART * numbers.longest))
    return np.asarray(allowed).reshape(count, plan.members)[list(plan.acceptance.groups)]


def _stay_positive(plan: engine.Plan, members: Whole, t: Array, y: Array) -> Any:
    """Of which members no rate of a number that is 0 is negative in states of positive numbers, far smaller and far larger."""
    n, count = y.shape
    parts = LEAST_PART * (MOST_PART / LEAST_PART) ** np.random.default_rng(n).random((n, LOOKED_AT))
    states, looks = np.repeat(parts, n, axis=1), np.arange(n * LOOKED_AT)
    zero = np.tile(np.arange(n), LOOKED_AT)
    states[zero, looks] = 0.0
    several = Members(plan._replace(progress=None)).plan(np.repeat(members, looks.size))
    unit: Any = engine.attempted_system(several).unit
    state = (np.abs(y).max(axis=0)[:, np.newaxis] * states[:, np.newaxis]).reshape(*plan.system.y_shape, -1)
    with np.errstate(all="ignore"):
        rates = unit.dy(np.repeat(t, looks.size), np.zeros((0, state.shape[-1])), state)
    rates = np.broadcast_to(rates, state.shape).reshape(n, count, looks.size)
    return (rates[zero, :, looks] >= 0.0).all(axis=0)
