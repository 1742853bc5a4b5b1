"""Amounts that became negative in a run, though their equations keep them from it.

Where no rate is negative at an amount of 0 while the others are positive, as in reactions and populations, no solution leaves the
positive ones. A run may: an amount that is smaller than the error of a step has any sign, and a negative one may grow, up to an
equilibrium that looks like any other.
"""

from __future__ import annotations

import math
from math import prod
from typing import Any

import numpy as np

from ...base.arrays import Array, Whole
from ...errors import AccuracyWarning
from ...model.methods import Method
from ...model.systems import System
from ...reference import adaptive
from .. import engine
from ..events.members import Members
from ..finding import Finding, Found
from ..options.positive import name_of
from ..result import Run
from . import Case, may_have_amounts

#: Errors of many steps add up to so many times the tolerated one of a step, but to no more than this part of a size.
BEYOND, PART = 100.0, 0.01
#: Less than this part of the largest size so far, a molecule of a mole, is nothing.
NOTHING = 2.0**-80
#: Rates are evaluated in this many states, of which the first few show most equations that reach negative numbers.
FEW, PLACES = 2, 64
#: Their numbers are from the first to the second of these parts of the largest one.
LEAST_PART, MOST_PART = 1e-4, 1e4
#: The golden section.
GOLDEN = (math.sqrt(5.0) - 1.0) / 2.0
#: Members are looked at so many at a time.
AT_ONCE = 256


def of_run(case: Case) -> Finding | None:
    """The members of a run that ended at a negative amount."""
    found = of_a_run(case.run, case.request.y, case.request.plan)
    return None if found is None else found.finding()


def of_a_run(run: Run, start: Array, plan: engine.Plan | None = None) -> Found | None:
    """The members of a run that began at amounts ``start`` and ended at a negative one; ``plan`` is that of adaptive steps."""
    end = run.controller_state
    if end is None or plan is None:
        return negative(run.system, run.method, (start, run.y[-1]), run.t[-1])
    if plan.backward or not may_have_amounts(run.system) or not (end.y < 0.0).any():
        return None
    with np.errstate(all="ignore"):
        allowed = _allowed(plan, end.pace)
    return negative(run.system, run.method, (start, end.y), run.t[-1], allowed)


def negative(system: System, method: Method, ends: tuple[Array, Array], t: Any, allowed: Array | None = None) -> Found | None:
    """The members that ended at a negative amount, beyond what is tolerated, which their equations do not reach, or None.

    Args:
        system: the system.
        method: the method.
        ends: the amounts at the start, and at the end, shape (*block, *batch).
        t: the time at the end, one for all members or one for each.
        allowed: how far below zero errors may have led each number of each member; of fixed steps what is lost in rounding.
    """
    start, end = ends
    if not may_have_amounts(system) or not (end < 0.0).any():
        return None
    n, batch = prod(system.y_shape), end.shape[len(system.y_shape) :]
    size = prod(batch)
    first, last = (np.asarray(np.broadcast_to(each, end.shape), np.float64).reshape(n, size) for each in (start, end))
    is_fixed = allowed is None
    if allowed is None:
        allowed = adaptive.ROUNDING * np.maximum(first.max(axis=0), np.abs(last).max(axis=0))
    beyond = last < -allowed
    members = np.flatnonzero(beyond.any(axis=0) & (first >= 0.0).all(axis=0))
    times = np.broadcast_to(t, batch).reshape(-1)
    plan = engine.Plan(system, method, batch, 1.0)
    for begin, end_of_places in ((0, FEW), (FEW, PLACES)):
        some = [members[i : i + AT_ONCE] for i in range(0, members.size, AT_ONCE)]
        stay = [_stay_positive(plan, each, times[each], last[:, each], begin, end_of_places) for each in some]
        members = members[np.concatenate([*stay, np.empty(0, bool)])]
    if not members.size:
        return None
    one = int(members[0])
    place = int(np.argmin(np.where(beyond[:, one], last[:, one], 0.0)))
    why = (
        f"which no solution reaches: no rate of these equations is negative where its number is 0. An error of the steps gave it "
        f"the wrong sign; take {'a shorter step' if is_fixed else 'a smaller tolerance, or give positive=True'}"
    )
    before = f"{name_of(system, place)} ends at {last[place, one]:.3g} in "
    return Found(AccuracyWarning, members, batch, before, "", ",", why)


def _allowed(plan: engine.Plan, pace: Array) -> Array:
    """How far below zero errors may have led each number of each member: by what is tolerated of a number that is zero."""
    numbers = engine.pace_of(plan, pace)
    n = prod(plan.system.y_shape)
    count = sum(plan.acceptance.counts(0, n))
    zero = np.zeros_like(numbers.longest)
    _, tolerated = adaptive.tolerated(numbers, numbers.h, (0, count), zero, zero, adaptive.ROUNDING)
    tolerated = np.maximum(np.maximum(tolerated, adaptive.rounded(numbers, numbers.h)), NOTHING * numbers.longest)
    allowed = np.maximum(tolerated, np.minimum(BEYOND * tolerated, PART * numbers.longest))
    of_none = np.full((1, plan.members), np.inf)  # the last: numbers of no group may be negative
    return np.concatenate([np.asarray(allowed).reshape(count, plan.members), of_none])[list(plan.acceptance.groups)]


def _stay_positive(plan: engine.Plan, members: Whole, t: Array, y: Array, begin: int, end: int) -> Any:
    """Of which members no rate of a number that is 0 is negative in states of positive numbers, far smaller and far larger.

    The states are those from number ``begin`` to ``end`` of all that are drawn.
    """
    n, count = y.shape
    places = np.arange(1.0, 1.0 + n * PLACES).reshape(n, PLACES)[:, begin:end]
    # Squares times an irrational number are spread evenly (Weyl); numpy.random takes some 20 ms to import.
    parts = LEAST_PART * (MOST_PART / LEAST_PART) ** (places * places * GOLDEN % 1.0)
    states, looks = np.repeat(parts, n, axis=1), np.arange(n * (end - begin))
    zero = np.tile(np.arange(n), end - begin)
    states[zero, looks] = 0.0
    several = Members(plan._replace(progress=None)).plan(np.repeat(members, looks.size))
    unit: Any = engine.attempted_system(several).unit
    state = (np.abs(y).max(axis=0)[:, np.newaxis] * states[:, np.newaxis]).reshape(*plan.system.y_shape, -1)
    with np.errstate(all="ignore"):
        rates = unit.dy(np.repeat(t, looks.size), np.zeros((0, state.shape[-1])), state)
    rates = np.broadcast_to(rates, state.shape).reshape(n, count, looks.size)
    return (rates[zero, :, looks] >= 0.0).all(axis=0)
