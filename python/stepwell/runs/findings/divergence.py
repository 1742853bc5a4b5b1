"""Members that left the range of finite numbers by fixed steps."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...errors import DivergenceWarning
from ...model.methods import Method
from ...model.systems import NBody
from .. import encounters
from ..finding import Finding, Named, named
from . import Case, time_of, when


def of_run(case: Case) -> Finding | None:
    """The members that diverged in this run."""
    run, request, before = case.run, case.request, case.request.before
    bad = run.first_bad_step >= 0 if before is None else (run.first_bad_step >= 0) & (before < 0)
    if not bad.any():
        return None
    step = int(run.first_bad_step[bad].min())
    who = named(bad, tuple(np.argwhere(bad & (run.first_bad_step == step))[0].tolist()))
    why = ""
    if run.collision is not None and (step - run.start_step) * run.v[-1].size // bad.size <= encounters.MAX_RERUN:
        pair = run.collision(who.place, step)
        if pair.distance < np.inf:
            why = f"; bodies {pair.bodies[0]} and {pair.bodies[1]} were {pair.distance:.3g} apart before it"
    if not request.carried and step == run.start_step + 1 and not why:
        from .stops import not_finite, of_derivatives, rates_of  # only runs that diverged at once need it

        system, start = run.system, (run.status.shape, run.t0 + run.start_step * run.dt, (request.v, request.y))
        wrong = not_finite(system, rates_of(system, *start), who.place)
        if wrong := wrong or of_derivatives(system, run.method, *start, who.place):
            why = f"; {wrong} at the start, t = {time_of(run, run.start_step, who.place):g}"
    if run.method.splits and isinstance(run.system, NBody) and run.system.force == "newton":
        why += "; a step is too long for Kepler's motion on an orbit there, so take shorter steps, or dop853 with a tolerance"
    return diverged(bad, who, f" at {when(run, step, who.place)}", run.method, run.dt, why)


def diverged(members: Any, who: Named, where: str, method: Method, dt: float, why: str = "") -> Finding:
    """The finding of members that diverged there."""
    text = f"{who.share} diverged{who.first}{where}, by {method.name} with dt = {dt:g}{why}"
    return Finding(DivergenceWarning, text, members)
