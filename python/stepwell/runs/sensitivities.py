"""Runs with the derivatives of their states by parameters and by the start: those of the computed steps, beside these."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base import checks
from ..base.immutable import FixedDict, changed
from ..errors import UnsupportedError
from ..model.derivatives.columns import Columns
from ..model.systems import Sampled, System
from . import engine
from .engine.recorded import recorded

if TYPE_CHECKING:
    from .request import Request
    from .result import Run


#: The columns of systems that were differentiated last, by their structure: in a fit only numbers change.
_kept: dict[Any, Columns] = {}
MOST_KEPT = 16


def _columns(system: System, names: tuple[str, ...]) -> Columns:
    """The system with its columns, differentiated once for systems of one structure."""
    if (structure := system.structure()) is None:
        return Columns(system, names)
    key = structure, system.v_shape, system.y_shape, names
    if (known := _kept.get(key)) is None:
        if len(_kept) >= MOST_KEPT:
            _kept.clear()
        _kept[key] = known = Columns(system, names)
    return changed(known, of=system, batch=system.batch)


def run_of(request: Request, names: tuple[str, ...], step: Callable[[Request], Run]) -> Run:
    """The requested run, and ``run.sensitivity``; ``step`` makes a run of a request."""
    plan, system = request.plan, request.system
    columns = _columns(plan.system, names)
    if plan.method.needs_acceleration and columns.reads_v:
        raise UnsupportedError(
            f"sensitivity: {plan.method.name} needs forces that do not depend on the velocity, and the rates of {system!r} are "
            f"written with it; use false_euler"
        )
    control = request.step_control
    saved = plan.save_count if control is None else len(control.times)
    checks.fits(
        "the saved states and their derivatives",
        saved * sum(columns.numbers) * (1 + columns.columns),
        plan.batch,
        "keep fewer states, ask for fewer derivatives, or split the batch",
    )
    v, y = columns.beside(request.v, request.y, plan.batch)
    n_v = columns.numbers[0]
    positive = tuple(columns.row(place) for place in plan.acceptance.positive)
    wide = plan._replace(system=columns, record=(), acceptance=plan.acceptance._replace(groups=columns.groups, positive=positive))
    if plan.force is not None:
        force = plan.force.reshape(n_v, *plan.batch)
        wide = wide._replace(force=np.concatenate([force, np.zeros((len(v) - n_v, *plan.batch))]))
    if control is not None:
        low, low_of_all = engine.low_numbers(plan), engine.low_numbers(wide)
        alone = control.paces[: len(control.paces) - low]
        paces = np.concatenate([alone, np.zeros((low_of_all, *alone.shape[1:]))])
        control = control._replace(paces=paces, start=(control.start[0], v, y))
    inner = request._replace(plan=wide, system=columns, v=v, y=y, record=(), step_control=control, options=None)
    run = step(inner)
    run.v, run.y, derivatives = columns.apart(run.v, run.y)
    run.sensitivity = {name: of_y for name, (_, of_y) in derivatives.items()}
    run.sensitivity_of_v = {name: of_v for name, (of_v, _) in derivatives.items()}
    run.system, run.options = system, FixedDict(request.going_on)
    if plan.force is not None:
        run.force = plan.force
    if run.carry is not None:
        run.carry = run.carry[:n_v].reshape(*system.v_shape, *plan.batch)
    if (state := run.controller_state) is not None:
        own_v, own_y, _ = columns.apart(state.v[np.newaxis], state.y[np.newaxis])
        alone, low_rows = np.split(state.pace, [len(state.pace) - engine.low_numbers(wide)])
        if len(low_rows):
            low_rows = low_rows[[columns.row(i) for i in range(sum(columns.numbers))]]
        run.controller_state = state._replace(v=own_v[0], y=own_y[0], pace=np.concatenate([alone, low_rows]))
    if request.record:
        run.recorded = recorded(system, request.record, run.dt, run.v, run.y, plan.backend)
    return run


def check(request: Request) -> None:
    """Raise if a run has something whose derivative is not that of its rates."""
    plan, method = request.plan, request.plan.method
    if request.events is not None:
        raise UnsupportedError("sensitivity: goes without events=, whose times move with what the states are differentiated by")
    if request.system.keeper is not None or request.system.around:
        raise UnsupportedError(
            f"sensitivity: what is around {request.system!r} changes its state otherwise than by its rates, of which derivatives "
            f"are made; leave it out"
        )
    assert request.options is not None
    if request.options.given("resume"):
        raise UnsupportedError("sensitivity: goes without resume=, since the run that goes on has no derivatives to go on from")
    if plan.backend == "numpy" and any(isinstance(each, Sampled) for each in request.system.all_inputs().values()):
        raise UnsupportedError(
            "sensitivity: goes with sampled inputs by backend='rust' only; the reference has no samples of rates"
        )
    if plan.form != "direct" or method.splits or method.is_exact:
        raise UnsupportedError(f"sensitivity: {method.name} steps by matrices or by motions of two bodies, not by rates alone")
    if method.kept:
        raise UnsupportedError(f"sensitivity: {method.name} keeps more than the state between steps; use a method that does not")
    if plan.single or plan.fused:
        raise UnsupportedError(
            "sensitivity: goes with float64 and without fused=; products that derivatives share are not fused, so the states "
            "would be others"
        )
