"""Runs by the Rust core or by the NumPy reference, in direct or matrix form.

A slot is the array that contains a block between steps: v for most methods, the carry for those that have one. Code above this
folder works with states, code below with slots.
"""

from __future__ import annotations

import os
import threading

from ... import _core
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
from .direct import to_slot
from .forms import advance, model
from .plan import Arrays, Outcome, Plan, Watched, pushes

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
