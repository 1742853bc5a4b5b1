"""Runs with fixed steps."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from .. import _core
from ..base import buffer_pool, checks
from ..base.arrays import Array
from ..model.systems import NBody
from . import engine
from .request import Request
from .result import Run


def fixed_run(request: Request) -> Run:
    """Compute the run, without its diagnostics."""
    plan, v, y, carried, method = request.plan, request.v, request.y, request.carried, request.plan.method
    make: Callable[[engine.Plan], engine.Outcome] = partial(engine.advance, v=v, y=y, before=request.before, carried=carried)
    with_events = None
    if request.events is not None:
        from .events import driver  # imported late: only runs with events need it

        with_events = driver.Run(request.events, v, y, request.before, carried)
        make = with_events.advance
    if request.progress:
        from ..base.progress import bar

        with bar(f"{method.title}, {plan.steps} steps") as shown:
            out = make(plan._replace(progress=shown))
    else:
        out = make(plan)
    collides, alone = isinstance(request.system, NBody), plan.of_core()  # the rates of bodies do not depend on the time
    finds: dict[str, Any] = {}
    if collides:
        from . import encounters  # only such runs need it

        # ``collisions`` and ``encounters`` need the start later, and the user may change the arrays meanwhile.
        v, y = _small_copy(v), _small_copy(y)
        finds = {
            "collision": partial(encounters.collision, alone, v, y, carried),
            "encounter": partial(encounters.of_member, alone, v, y, carried, plan.steps),
            "overshoots": partial(encounters.overshoots, alone, v, y, carried, plan.steps),
        }
    run = Run(
        t=_times(plan),
        v=out.v,
        y=out.y,
        # Status.OK is 0 and Status.DIVERGED 1
        status=np.asarray(out.first_bad >= 0).view(np.int8) if out.diverged else np.zeros(plan.batch, np.int8),
        first_bad_step=out.first_bad,
        carry=out.slot if plan.begins else None,
        system=request.system,
        method=method,
        dt=plan.dt,
        t0=plan.t0.copy() if isinstance(plan.t0, np.ndarray) else plan.t0,
        start_step=plan.first,
        steps=plan.steps,
        start=request.start,
        fused=plan.fused,
        **finds,
        recorded=out.recorded,
        work=out.work,
        force=plan.force,
        options=request.going_on,
    )
    if with_events is not None:
        with_events.write_to(run)
    if later := [name for name in request.record if name not in run.recorded]:
        from .engine.recorded import recorded  # imported late: only runs that record need it

        run.recorded |= recorded(run.system, later, run.dt, run.v, run.y, plan.backend)
    return run


def _times(plan: engine.Plan) -> Array:
    """The times t0 + k·dt of the saved states."""
    if plan.every is None:
        return np.array([plan.t0 + (plan.first + plan.steps) * plan.dt])
    t: Array = buffer_pool.empty((plan.save_count,))
    _core.times(plan.of_core(), t)
    return plan.t0 + t.reshape(-1, *(1,) * len(plan.batch)) if isinstance(plan.t0, np.ndarray) else t


def _small_copy(array: Array) -> Array:
    """A copy that is as small in memory: the array before it was broadcast is copied, and broadcast again."""
    own = checks.once_of(array).copy()
    return own if own.shape == array.shape else np.broadcast_to(own, array.shape)
