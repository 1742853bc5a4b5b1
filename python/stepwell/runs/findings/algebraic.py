"""Members that lost their algebraic equations: fixed steps go on where these have no solution, or determine none."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...base import registry
from ...base.arrays import Array
from ...errors import AccuracyWarning
from .. import engine
from ..finding import Finding, named
from ..result import Run
from . import Case

Moment = tuple[Array, Any]


def of_run(case: Case) -> Finding | None:
    """The members of a run of fixed steps that lost their algebraic equations."""
    run = case.run
    start = np.broadcast_to(case.request.y, run.y.shape[1:])
    sizes = np.maximum(np.abs(run.y).max(axis=0), np.abs(start))
    return next(iter(lost_equations(run, (start, run.t0), (run.y[-1], run.t[-1]), sizes, run.status == 0)), None)


def lost_equations(of: Run | engine.Plan, start: Moment, end: Moment, sizes: Array, goes_on: Any) -> list[Finding]:
    """The members that lost them between two moments, of those that go on."""
    broken, crossed = (each & goes_on for each in registry.task("algebraic_lost")(of.system, start, end, sizes))
    lost = broken.any()
    if not (wrong := broken if lost else crossed).any():
        return []
    who, steps = named(wrong), f"steps of {of.dt:g} by {of.method.name}"
    text = (
        f"at the end, t = {end[1]:g}, the algebraic equations do not hold for {who.share}{who.first}; they have no solution "
        f"there, or {steps} lost it: take tolerance=, which stops there, or shorter steps"
        if lost
        else f"at a time on the way, the algebraic equations determined nothing for {who.share}{who.first}; there a solution "
        f"ends, or is one of several, and {steps} went on: take tolerance=, or other equations from there"
    )
    return [Finding(AccuracyWarning, text, wrong)]
