"""Runs by the Rust core or by the NumPy reference, in direct or matrix form.

A slot is the array that contains a block between steps: v for most methods, the carry for those that have one. Code above this
folder works with states, code below with slots.
"""

from __future__ import annotations

import os
import threading

from ... import _core
from ...base.arrays import Array, Whole
from .adaptive import (
    ABSOLUTE,
    BLIND,
    COUNTS,
    ERROR,
    EXTRA,
    FULL,
    HELD,
    INTERVAL,
    LASTS,
    LEAST,
    MOST_STEP,
    PACE_NUMBERS,
    RELATIVE,
    SCALES,
    STEP,
    TARGET,
    TIME,
    UNTIL,
    WALL,
    WAYPOINTS,
    WORK,
    Adapted,
    AdaptiveArrays,
    CorePacing,
    KeptSteps,
    Pacing,
    Tolerances,
    adapt,
    attempt_by_numpy,
    attempted_system,
    attempts,
    begun,
    begun_again,
    evaluations,
    evaluations_of_attempt,
    extends,
    groups_of,
    jumps_of,
    low_numbers,
    numbers_of,
    own_tolerances,
    pace_numbers,
    pace_of,
    paces,
    pacing_of_core,
)
from .direct import advance_direct, first_bad_steps, to_slot
from .plan import Arrays, Outcome, Plan, Watched, pushes
from .plan import model as model_of_operations

__all__ = [
    "ABSOLUTE",
    "BLIND",
    "COUNTS",
    "ERROR",
    "EXTRA",
    "FULL",
    "HELD",
    "INTERVAL",
    "LASTS",
    "LEAST",
    "MOST_STEP",
    "PACE_NUMBERS",
    "RELATIVE",
    "SCALES",
    "STEP",
    "TARGET",
    "TIME",
    "UNTIL",
    "WALL",
    "WAYPOINTS",
    "WORK",
    "Adapted",
    "AdaptiveArrays",
    "Arrays",
    "CorePacing",
    "KeptSteps",
    "Outcome",
    "Pacing",
    "Plan",
    "Tolerances",
    "Watched",
    "adapt",
    "advance",
    "attempt_by_numpy",
    "attempted_system",
    "attempts",
    "begun",
    "begun_again",
    "evaluations",
    "evaluations_of_attempt",
    "extends",
    "groups_of",
    "jumps_of",
    "low_numbers",
    "model",
    "numbers_of",
    "own_tolerances",
    "pace_numbers",
    "pace_of",
    "paces",
    "pacing_of_core",
    "pushes",
    "to_slot",
]

if hasattr(os, "register_at_fork"):
    #: Whether there was another thread when the process forked: what it was compiling or had locked stays so in the child.
    _others: list[bool] = []
    os.register_at_fork(
        before=lambda: _others.append(threading.active_count() > 1),
        after_in_parent=lambda: _others.clear(),
        after_in_child=lambda: _core.forget() if _others.pop() else None,
    )


def model(plan: Plan) -> _core.ModelSpec:
    """The model of a plan, as the core takes it."""
    if plan.method.is_exact:
        from . import linear  # only such runs need it

        spec: _core.ModelSpec = linear.exact_model(plan)
        return spec
    return model_of_operations(plan)


def advance(plan: Plan, v: Array, y: Array, before: Whole | None = None, *, carried: bool = False) -> Outcome:
    """Make the run. ``v`` is what the method carries if ``carried``; v and y have the shape of a block and the batch.

    ``before`` has the first bad steps of earlier runs, −1 for members that were finite so far.
    """
    if plan.form == "direct":
        return advance_direct(plan, v, y, before, carried=carried)
    from . import linear  # only such runs need it

    return linear.by_matrix(plan, v, y, first_bad_steps(plan, before), carried)
