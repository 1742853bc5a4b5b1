"""Short runs of adaptive steps."""

from __future__ import annotations

from math import prod
from typing import Any

import numpy as np

from .. import _core
from ..base.arrays import Array, Shape
from ..base.immutable import changed
from ..model.methods import method
from ..model.systems import NBody, System
from . import engine
from .adaptive import of_extra_steps, paces_of, run_of
from .findings import MANY
from .findings.invariants import LITTLE, judged_by_change, keeps_energy
from .findings.lost_motion import lost_in_tolerance
from .request import Request
from .result import AdaptiveState, Run
from .short import NOT_MADE, TAME, ShortRun


class ShortAdaptiveRun(ShortRun):
    """One with adaptive steps."""

    def __init__(self, system: System, request: Request, core: _core.PreparedAdaptive, is_plain: bool) -> None:
        super().__init__(system, request)
        plan, control = request.plan, request.step_control
        assert control is not None
        times, shape_of_paces = len(control.times), (engine.pace_numbers(plan), *plan.batch)
        self.core = core
        self.keeps_energy = keeps_energy(request.system, None)
        self.shapes = (times, *request.v.shape), (times, *request.y.shape), request.v.shape, request.y.shape, shape_of_paces
        self.evaluations = engine.evaluations_of_attempt(plan)
        self.of_extra = of_extra_steps(plan, self.evaluations, dense=times > 1 or not control.pacing.begins)
        #: Whether the core's checks and that of the absolute tolerance are the only findings possible.
        self.is_plain = is_plain
        is_absolute = not plan.acceptance.own and bool((control.paces[engine.ABSOLUTE] > engine.LEAST).any())
        self.groups = engine.groups_of(plan) if is_absolute else None
        #: All attributes of a run, of which most do not depend on the start.
        self.attributes: dict[str, Any] = {}

    def begin(self, v: Any, y: Any, numbers: list[Array] | None) -> bool:
        """Make the run once, to know all attributes, from this start; returns whether it was made."""
        plan, control = self.request.plan, self.request.step_control
        assert control is not None
        saved_v, saved_y, last_v, last_y, paces = map(np.empty, self.shapes)
        if self.core.run(v, y, saved_v, saved_y, last_v, last_y, paces, numbers) == NOT_MADE:
            return False
        out = engine.Adapted(saved_v, saved_y, last_v, last_y, paces, np.zeros(plan.batch, np.int64), self.evaluations)
        run = run_of(self.request, out, control.times, saved_v, saved_y)
        self.t, self.status, self.first_bad_step = run.t, run.status, run.first_bad_step
        assert run.controller_state is not None
        self.end, self.last = control.pacing.at[-1], run.controller_state[3:]
        self.attributes = vars(run)  # last, since another thread goes on from here as soon as there are some
        return True

    def _made(self, v: Any, y: Any, system: System, numbers: list[Array] | None) -> Run | None:
        if keeps_energy(system, None) != self.keeps_energy:  # damping may be zero in one of them
            return None
        if not self.attributes and not self.begin(v, y, numbers):
            return None
        saved_v, saved_y, last_v, last_y, pace = map(np.empty, self.shapes)
        outcome = self.core.run(v, y, saved_v, saved_y, last_v, last_y, pace, numbers)
        if outcome == NOT_MADE:
            return None
        request = self.request
        paces = paces_of(request.plan, pace, self.evaluations, self.of_extra)
        pace[engine.TARGET] = self.end
        run = object.__new__(Run)
        attributes = run.__dict__
        attributes.update(self.attributes)
        attributes.update(
            t=self.t.copy(), v=saved_v, y=saved_y, status=self.status.copy(), first_bad_step=self.first_bad_step.copy(),
            paces=paces, controller_state=AdaptiveState(last_v, last_y, pace, *self.last), recorded={}, events={},
            system=system,
        )  # fmt: skip
        is_tame = outcome == TAME and self.is_plain
        if not is_tame or (self.groups is not None and lost_in_tolerance(pace, self.groups).any()):
            self._findings(run, v, y, system)
        return run


def short_adaptive_run(own: System, request: Request, shapes: tuple[Shape, Shape]) -> ShortAdaptiveRun | None:
    """The run without its start; None if it cannot be prepared."""
    plan, control, system = request.plan, request.step_control, request.system
    assert control is not None
    if control.every is not None or control.t0.ndim or control.times.ndim > 1 or plan.single:
        return None
    names, quantities = judged_by_change(system, plan.force), None
    if names and not isinstance(system, NBody):
        alone = changed(system.uncontrolled, around=())  # no step is made, so any method will do
        quantities = engine.model(engine.Plan(alone, method("false_euler"), plan.batch, 1.0, record=tuple(names)))
    numbers, core_plan = [prod(system.v_shape), prod(system.y_shape)], plan._replace(t0=0.0)
    core = _core.prepared_adaptive(
        engine.model(core_plan),
        core_plan,
        engine.pacing_of_core(plan, control.pacing),
        control.paces.reshape(len(control.paces), -1),
        list(map(list, shapes)),
        numbers,
        plan.members,
        quantities=quantities,
        has_amounts=not numbers[0] and bool(system.groups) and not plan.backward,
        least_change=LITTLE,
        many=MANY,
    )
    if core is None:
        return None
    is_plain = names is not None and not isinstance(system, NBody) and type(system).doubt is System.doubt
    return ShortAdaptiveRun(own, request, core, is_plain)
