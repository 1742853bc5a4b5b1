"""Findings about a run: a file for each, with its evidence, its threshold and its sentence.

``findings_of`` asks them in turn. A file is imported when a run may have its finding, which few runs do.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from importlib import import_module
from math import prod
from typing import Any, NamedTuple

import numpy as np

from ...base.arrays import Array, Shape
from ...errors import AccuracyWarning, ControlWarning, StiffnessWarning, ToleranceWarning
from ...model.methods import Method
from ...model.systems import NBody, Pendulum, Springs, System
from ..finding import Finding, is_heard, named, warn_of
from ..request import Request
from ..result import Run

__all__ = ["Finding", "findings_of", "is_heard", "warn_of"]

#: Energies are compared in a run of so many function evaluations, beside which that is little work.
FEW_EVALUATIONS = 100
#: In runs of so many adaptive steps it is worthwhile to try some more of them.
MANY = 512
#: The name of the core's kernel for own equations.
KERNEL_OF_EQUATIONS = "equations"

State = tuple[Array, Array]


class Case(NamedTuple):
    """A run after its end."""

    run: Run
    system: System  # of the run
    request: Request
    heard: Callable[[type[Warning]], bool]  # if not, what takes longer than an evaluation is not computed
    start: State | None  # None if events changed the state, or if it began from what a method carries
    changes: bool  # by events
    waypoints: Sequence[Array]  # where members with adaptive steps stood on the way, if it is known
    steps: int  # the most adaptive steps of a member of which it is known
    noticed: list[Finding]  # so far


def findings_of(
    run: Run, request: Request, heard: Callable[[type[Warning]], bool], waypoints: Sequence[Array] = ()
) -> tuple[Finding, ...]:
    """Findings of a run: how it ended, and which numbers mean nothing, as far as that costs little.

    What takes longer than an evaluation of the last state is computed only if its warning is ``heard``. ``waypoints`` is where
    members with adaptive steps stood on the way, if it is known.
    """
    changes = request.events is not None and any(event.then for event in request.events)
    # The energy says nothing where events changed the state, nor where the run began from what a method carries.
    start = None if changes or request.carried or request.before is not None else (request.v, request.y)
    searches, steps = OF_FIXED_STEPS, 0
    if run.paces is not None:
        searches, accepted = OF_ADAPTIVE_STEPS, run.paces.accepted
        if waypoints:
            steps = int(accepted) if not accepted.shape else int(accepted.max(initial=0))
    noticed = list(run.findings)  # of events that it came to rest at
    case = Case(run, run.system, request, heard, start, changes, waypoints, steps, noticed)
    for may_be, place in searches:
        if may_be(case) and (found := _search(place)(case)) is not None:
            noticed.append(found)
    return tuple(noticed)


@cache
def _search(place: str) -> Callable[[Case], Finding | None]:
    module, _, function = place.partition(":")
    search: Callable[[Case], Finding | None] = getattr(import_module(f"{__name__}.{module}"), function or "of_run")
    return search


def time_of(run: Run, step: int, index: Shape) -> float:
    """The time t0 + k·dt of a step of a member."""
    return float(np.broadcast_to(run.t0, run.status.shape)[index]) + step * run.dt


def when(run: Run, step: int, index: Shape) -> str:
    """A step of a member and its time, in words."""
    return f"step {step} (t = {time_of(run, step, index):g})"


def evaluations_of(run: Run) -> int:
    """The least function evaluations of a member."""
    if run.paces is None:
        return run.method.evaluations * run.steps
    counts = run.paces.evaluations
    return int(counts) if counts.ndim == 0 else int(counts.min(initial=2**62))


def another(members: Any, what: str, first: Array, last: Array, followed: str) -> str:
    """A quantity of members is another at the end, in words; ``followed`` says what did not follow what."""
    who = named(members)
    values = f"{who.has}{last[who.place]:.3g} instead of {first[who.place]:.3g}"
    return f"{who.share} {who.have} another {what} at the end: {values}, so {followed}"


def may_have_amounts(system: System) -> bool:
    """True if the numbers of a system may be amounts: its own equations of first order, whose rates do not change by themselves.

    What algebraic equations give is no rate, and rates at one time say nothing of those at another.
    """
    is_own = bool(system.groups) and not prod(system.v_shape) and system.mass_matrix is None
    return is_own and not system.reads_time and not system.all_inputs()


def may_gain(system: System, method: Method, steps: int) -> bool:
    """True if a run of fixed steps is one of a net, to whose energy nothing but an error adds, long enough to check that."""
    return isinstance(system, Springs) and system.keeper is None and method.evaluations * steps >= FEW_EVALUATIONS


def may_pass_barriers(system: System, method: Method, steps: int) -> bool:
    """True if a run of fixed steps may pass a barrier, and is long enough to look for that; most systems have none."""
    has_barriers = isinstance(system, Pendulum) or system.kernel == KERNEL_OF_EQUATIONS
    return method.limit != 0.0 and has_barriers and method.evaluations * steps >= FEW_EVALUATIONS


def _may_be_astray(system: System, method: Method, steps: int) -> bool:
    return type(system).doubt is not System.doubt or may_pass_barriers(system, method, steps)


def finds_growth_only(system: System, method: Method, steps: int) -> bool:
    """True if nothing but growth can be found of a run of fixed steps, from its start, of which all numbers are finite."""
    judged = _may_be_astray(system, method, steps) or may_gain(system, method, steps)
    return not (judged or isinstance(system, NBody) or system.mass_matrix is not None or system.keeper is not None)


Searches = tuple[tuple[Callable[[Case], Any], str], ...]
#: The findings of runs with fixed steps, in the order of their warnings: a condition that is checked in every run, and the file
#: whose ``of_run``, or other function, looks further where it holds.
OF_FIXED_STEPS: Searches = (
    (lambda case: case.system.keeper is not None, "strong_control"),
    (lambda case: np.count_nonzero(case.run.status), "divergence"),
    (lambda case: case.system.mass_matrix is not None and case.heard(AccuracyWarning), "algebraic"),
    (lambda case: may_gain(case.system, case.run.method, case.run.steps) and case.heard(AccuracyWarning), "gain"),
    (lambda case: _may_be_astray(case.system, case.run.method, case.run.steps), "invariants"),
    (lambda case: isinstance(case.system, NBody) and case.run.force is None, "energy"),
    (lambda case: case.system.control is not None and case.heard(ControlWarning), "strong_control:of_later_steps"),
    (lambda case: case.start is not None, "growth"),
    (lambda case: not case.noticed and not case.changes and may_have_amounts(case.system), "negative"),
)
#: The findings of runs with adaptive steps, likewise.
OF_ADAPTIVE_STEPS: Searches = (
    (lambda case: np.count_nonzero(case.run.status), "stops"),
    (lambda case: case.steps >= MANY and case.heard(StiffnessWarning), "stiffness"),
    (lambda case: case.steps >= MANY and case.heard(AccuracyWarning), "amplified"),
    (lambda case: case.steps >= MANY and case.heard(ToleranceWarning), "state_jumps"),
    (lambda case: not case.request.plan.acceptance.own, "lost_motion"),
    (lambda case: not isinstance(case.system, NBody), "invariants"),
    (lambda case: isinstance(case.system, NBody) and case.run.force is None, "energy"),
    (lambda case: not case.changes and may_have_amounts(case.system), "negative"),
)
