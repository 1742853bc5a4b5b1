"""Reductions on a device: which outcomes it computes while it makes the steps, and the run that does so.

States that a device observes stay there; of each member come back the state at the end and a few numbers. So it is for outcomes
that say how (``on_device``), if all of a sweep do that observe anything. Others see saved states, in pieces, as on the CPU.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np

from ...device import bodies
from ...device.reductions import Observer
from ...model.methods import Method
from ...model.systems import System
from ...runs import engine
from ...runs.execution import step
from ...runs.options import Options
from ...runs.request import Request
from ...runs.result import Run
from .observed import Observed, Rows
from .outcomes import ReducedOutcome, Reduction


class Observing(NamedTuple):
    """The reductions that a device makes of the states of a chunk, and the names of quantities that it computes of each."""

    observer: Observer
    names: tuple[str, ...]

    def taken_by(self, reductions: Iterable[tuple[ReducedOutcome, Reduction]], run: Run, begin: Any) -> None:
        """Give each reduction what the device has made in this run; its first state was observed at the time ``begin``."""
        numbers = iter(self.observer.numbers)
        for outcome, reduction in reductions:
            mine = next(numbers) if outcome.observes else np.empty((0, run.status.size))
            reduction.take(Observed(run, mine, begin, run.t[-1]))


def observing(outcomes: Iterable[ReducedOutcome], rows: Rows, every: int) -> Observing | None:
    """The reductions on a device for these outcomes, or None if one of them must see the states, or none observes them."""
    reductions = [each.on_device(rows) for each in outcomes if each.observes]
    if not reductions or None in reductions:
        return None
    return Observing(Observer(every, tuple(reductions), rows.states), tuple(rows.names))


def run(system: System, method: Method, *, observer: Observer | None = None, **options: Any) -> Run:
    """``quietly``, with an observer."""
    request = Request.of(system, method, Options(**options))
    return step(request._replace(plan=request.plan._replace(observer=observer)))


def is_of_many_bodies(system: System, method: Method, start: dict[str, Any]) -> bool:
    """True if a device makes the run by kernels for many bodies, which save states."""
    if system.kernel != "nbody":
        return False
    dt = {name: float(np.ravel(start[name])[0]) for name in ("dt",) if name in start}  # the members may have their own
    plan = Request.of(system, method, Options(steps=1, **(start | dt))).plan
    return bodies.takes(engine.model(plan), plan)
