"""Runs without warnings, for ``integrate`` and for callers that judge a run themselves."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ..base.arrays import Array
from ..model.methods import Method
from ..model.systems import System
from .findings import findings_of
from .fixed import fixed_run
from .options import Options
from .request import Request
from .result import Run


def step(request: Request, waypoints: list[Array] | None = None) -> Run:
    """The requested run, without findings and warnings; ``waypoints`` gets where members with adaptive steps stood on the way."""
    if request.options is not None and (names := request.options["sensitivity"]) is not None:
        from . import sensitivities  # only such runs need it

        sensitivities.check(request)
        return sensitivities.run_of(request, names, step)
    if request.step_control is None:
        return fixed_run(request)
    from .adaptive import adaptive_run  # only such runs need it

    return adaptive_run(request, waypoints)


def noticing(request: Request, heard: Callable[[type[Warning]], bool] = lambda _: True) -> Run:
    """The requested run with its findings; what takes a while to find is searched only if its warning is ``heard``."""
    waypoints: list[Array] = []
    run = step(request, waypoints)
    if findings := findings_of(run, request, heard, waypoints):
        run.findings = findings
    return run


def quietly(system: System, method: str | Method, **options: Any) -> Run:
    """``integrate`` without findings and warnings, for callers that judge a run themselves."""
    return step(Request.of(system, method, Options(**options)))
