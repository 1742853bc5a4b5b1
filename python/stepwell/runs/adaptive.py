"""Runs with adaptive steps: every member has steps of its own."""

from __future__ import annotations

from contextlib import nullcontext
from typing import Any

import numpy as np

from ..base.arrays import Array
from . import engine
from .request import Request
from .result import AdaptiveState, Paces, Run


def adaptive_run(request: Request, waypoints: list[Array] | None = None) -> Run:
    """Make the run, without its diagnostics. Where its members stood on the way is added to ``waypoints``, if it is known."""
    assert request.step_control is not None
    plan, (pacing, paces, _, times, every, start), method = request.plan, request.step_control, request.plan.method
    adapt: Any = engine.adapt
    with_events, keeper = None, None
    if waypoints is not None:
        pacing = pacing._replace(waypoints=True)
    if every is not None:
        from .accepted_steps import StepKeeper  # only such runs need it

        keeper = StepKeeper(every)
        adapt = keeper.adapt
    if request.events is not None:
        from .events import adaptive  # only such runs need it

        with_events = adaptive.AdaptiveRun(request.events, None if keeper is None else keeper.adapt)
        adapt = with_events.adapt
    shown: Any = nullcontext(None)
    if request.progress:
        from ..base.progress import bar

        shown = bar(f"{method.title} to t = {times[-1].max():g}")
    with shown as progress:
        out = adapt(plan if progress is None else plan._replace(progress=progress), pacing, paces, request.v, request.y)
    if waypoints is not None and out.waypoints is not None:
        waypoints.append(out.waypoints)
    t, v, y = times[-len(out.v) :].copy(), out.v, out.y  # the request may be remembered
    if keeper is not None:
        t, v, y = keeper.saved(plan, start, (np.broadcast_to(pacing.at[-1], plan.batch), v[-1], y[-1]))
        t = (-1.0 if plan.backward else 1.0) * t
    run = run_of(request, out, t, v, y)
    if every == 1:
        run.has_each_step = True
    if request.record:
        from .engine.recorded import recorded  # only runs that record need it

        run.recorded = recorded(run.system, request.record, run.dt, run.v, run.y, plan.backend)
    if with_events is not None:
        with_events.write_to(run)
    return run


def run_of(request: Request, out: engine.Adapted, t: Array, v: Array, y: Array) -> Run:
    """The run of what the engine made, with these states saved at these times."""
    assert request.step_control is not None
    plan, (pacing, _, t0, times, _, _), method = request.plan, request.step_control, request.plan.method
    of_extra = of_extra_steps(plan, out.evaluations, dense=len(pacing.at) > 1 or not pacing.begins)
    counted, stopped = paces_of(plan, out.paces, out.evaluations, of_extra), np.count_nonzero(out.status) > 0
    control = request.system.control
    run = Run(
        t=t,
        v=v.astype(plan.dtype, copy=False),
        y=y.astype(plan.dtype, copy=False),
        status=out.status.astype(np.int8),
        first_bad_step=np.where(out.status == 0, -1, counted.accepted + 1) if stopped else np.full(plan.batch, -1),
        carry=None,
        system=request.system,
        method=method,
        dt=1.0,
        t0=t0.copy() if t0.ndim else t0.item(),
        start_step=0,
        steps=0,
        start=None,
        paces=counted,
        controller_state=AdaptiveState(out.last_v, out.last_y, _with_target(out.paces, pacing.at[-1]), times[-1], method.name),
        options=request.going_on,
        fused=plan.fused,
        force=plan.force,
        work=None if control is None else out.paces[engine.WORK] / engine.pushes(control, method.attempt_evaluations),
    )
    if stopped:
        run.stopped_at = np.where(out.status == 0, np.nan, counted.t)
    return run


def of_extra_steps(plan: engine.Plan, evaluations: int, *, dense: bool) -> int:
    """Function evaluations of an extra step: those of an attempt, or of the extension in a run with states within steps."""
    return max(evaluations, plan.method.extension_evaluations) if dense and engine.extends(plan) else evaluations


def paces_of(plan: engine.Plan, numbers: Array, evaluations: int, of_extra: int | None = None) -> Paces:
    """The step-size controllers as a run reports them; an attempt makes so many evaluations, an extra step ``of_extra``."""
    accepted, rejected, extra_steps = numbers[engine.COUNTS].astype(np.int64)
    # A series needs no further evaluation for the states within a step, unless operations are fused.
    again = numbers[engine.HELD] > 0.0 if plan.method.has_series and not plan.fused else extra_steps
    sign = -1.0 if plan.backward else 1.0
    made = evaluations * (accepted + rejected) + (evaluations if of_extra is None else of_extra) * again
    return Paces(sign * numbers[engine.TIME], sign * numbers[engine.STEP], accepted, rejected, made)


def _with_target(paces: Array, target: float) -> Array:
    """The paces with another next output time."""
    paces = paces.copy()
    paces[engine.TARGET] = target
    return paces
