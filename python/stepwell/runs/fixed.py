"""Runs with steps of one length."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from .. import _core
from ..base import buffer_pool, checks
from ..base.arrays import Array
from ..model.systems import NBody
from . import encounters, engine
from .request import Request
from .result import Run


def fixed_run(request: Request) -> Run:
    """Make the run; its diagnostics are for others."""
    plan, v, y, carried, how = request.plan, request.v, request.y, request.carried, request.plan.method
    make: Callable[[engine.Plan], engine.Outcome] = partial(engine.advance, v=v, y=y, before=request.before, carried=carried)
    ended = None
    if request.events is not None:
        from .events import driver  # only such runs need it

        ended = driver.Run(request.events, v, y, request.before, carried)
        make = ended.made
    if request.progress:
        from ..base.progress import bar

        with bar(f"{how.title}, {plan.steps} steps") as shown:
            out = make(plan._replace(progress=shown))
    else:
        out = make(plan)
    collides, alone = isinstance(request.system, NBody), plan.of_core()  # bodies know no time
    if collides:
        v, y = _kept(v), _kept(y)  # for ``collisions`` and ``encounters``; the arrays that were given are the user's to change
    run = Run(
        t=_times(plan),
        v=out.v,
        y=out.y,
        # Status.OK is 0 and Status.DIVERGED 1
        status=np.asarray(out.first_bad >= 0).view(np.int8) if out.diverged else np.zeros(plan.batch, np.int8),
        first_bad_step=out.first_bad,
        carry=None if how.carry is None else out.slot,
        system=request.system,
        method=how,
        dt=plan.dt,
        t0=plan.t0,
        start_step=plan.first,
        steps=plan.steps,
        start=request.start,
        fused=plan.fused,
        collision=partial(encounters.collision, alone, v, y, carried) if collides else None,
        encounter=partial(encounters.of_member, alone, v, y, carried, plan.steps) if collides else None,
        overshoots=partial(encounters.overshoots, alone, v, y, carried, plan.steps) if collides else None,
        recorded=out.recorded,
        work=out.work,
        force=plan.force,
    )
    if ended is not None:
        ended.tell(run)
    for name in request.record:
        if name not in run.recorded:
            run.recorded[name] = run.quantity(name)
    return run


def _times(plan: engine.Plan) -> Array:
    """t0 + k·dt of every saved state; there may be millions of them."""
    if plan.every is None:
        return np.array([plan.t0 + (plan.first + plan.steps) * plan.dt])
    t: Array = buffer_pool.empty((plan.kept,))
    _core.times(plan.of_core(), t)
    return plan.t0 + t.reshape(-1, *(1,) * len(plan.batch)) if isinstance(plan.t0, np.ndarray) else t


def _kept(array: Array) -> Array:
    """A copy that is as small as what it was spread from."""
    own = checks.once_of(array).copy()
    return own if own.shape == array.shape else np.broadcast_to(own, array.shape)
