"""A control in the printed form that is too strong for the step: it overshoots."""

from __future__ import annotations

from math import prod

import numpy as np

from ...base.arrays import Array
from ...base.reprs import of_member
from ...errors import ControlWarning
from ...model.controls import EnergyControl
from ...model.systems import NBody, System
from .. import encounters
from ..finding import Finding, only
from . import Case, when


def of_run(case: Case) -> Finding | None:
    """The members of a run that overshoot from its start on."""
    plan, v = case.request.plan, case.request.v
    if case.request.carried and plan.keeps:  # behind the velocities stand the blocks that a method keeps
        v = v[: prod(plan.system.v_shape)].reshape(*plan.system.v_shape, *plan.batch)
    return next(iter(of_a_strong_control(case.run.system, v, case.request.y, case.run.dt)), None)


def of_a_strong_control(system: System, v: Array, y: Array, dt: float) -> list[Finding]:
    """The members that overshoot from this state on."""
    batch, overshoots = y.shape[len(system.y_shape) :], getattr(system.keeper, "overshoots", None)
    if overshoots is None:
        return []
    with np.errstate(all="ignore"):
        about = overshoots(dt, lambda: system.uncontrolled.reference_at_step(1.0, batch).energies(v, y)[1])
    return [] if about is None else [Finding(ControlWarning, about[0], np.broadcast_to(about[1], batch))]


def of_later_steps(case: Case) -> Finding | None:
    """When h·C·K of bodies passed 1 after the start, from where on they overshoot.

    The saved states are checked, then every state of the first such member, or of the first that diverged.
    """
    run, start, bodies = case.run, case.start, case.run.system
    control = bodies.control
    if not (isinstance(bodies, NBody) and isinstance(control, EnergyControl) and control.form == "printed"):
        return None
    if start is None or run.overshoots is None:
        return None
    with np.errstate(all="ignore"):
        gain = run.dt * np.asarray(control.gain)
        began = gain * bodies.kinetic(np.broadcast_to(start[0], run.y.shape[1:]))
        if (began >= 1.0).any():
            return None
        saved = (gain * bodies.kinetic(np.moveaxis(run.v, 0, 2)) >= 1.0).any(axis=0)
    over = saved | (run.status != 0)
    if not over.any():
        return None
    index = tuple(np.argwhere(over)[0].tolist())
    overshoot = run.overshoots(index, encounters.MAX_RERUN)
    if overshoot is None:
        return None
    step, strength = overshoot
    text = (
        f"gain: h·C·K = {strength:.3g} at {when(run, step, index)}{of_member(index)}, expected below 1: "
        f'from there on the printed form overshoots and may overflow; use a smaller gain or step, or form="limited"'
    )
    return Finding(ControlWarning, text, only(run.status.shape, index))
