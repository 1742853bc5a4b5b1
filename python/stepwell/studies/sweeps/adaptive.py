"""Sweeps with a tolerance: their arguments, the function evaluations of each member, and which members stopped, and why."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import partial
from math import prod
from typing import Any

import numpy as np

from ...base import checks
from ...base.arrays import Array
from ...errors import ArgumentError, ShapeError, UnsupportedError
from ...model.methods import Method
from ...model.systems import System
from ...reference.acceptance import Acceptance
from ...runs import engine
from ...runs.adaptive_options import check_times
from ...runs.engine import PACE_NUMBERS, WAYPOINTS
from ...runs.execution import step
from ...runs.finding import Found
from ...runs.findings.lost_motion import lost_in_tolerance
from ...runs.findings.stiffness import course_of, may_be_stiff, stiff_members
from ...runs.findings.stops import why_steps_are_short, why_stopped
from ...runs.options import Options
from ...runs.options.checked import Checked
from ...runs.options.tolerance import order_of_series
from ...runs.request import Request
from ...runs.result import Run, Status
from .axes import Grid
from .exponents import Exponents
from .outcomes import OfEnd, Outcome, Results, Variable

#: The numbers of the step-size controller for each member in memory: before, after, and in transfer.
NUMBERS_OF_A_CONTROLLER = 4 * PACE_NUMBERS


class Evaluations(OfEnd):
    """The cost of a member, with a tolerance: ``evaluations``, ``accepted_steps``, ``rejected_steps``.

    They are those of ``run.paces``: function (rate) evaluations of accepted and rejected steps, and of the extra steps for the
    times of ``at``.

    Example:
        >>> axes = {"omega": ("omega", [1.0, 10.0])}
        >>> found = sw.sweep(sw.Oscillator, axes, "dop853", v=0.0, y=1.0, tolerance=1e-9, at=[10.0], outcomes="evaluations")
        >>> bool(found.evaluations[1] > 5 * found.evaluations[0])
        True
    """

    def of_end(self, run: Run) -> Results:
        """The counts of the paces."""
        paces = run.paces
        assert paces is not None
        return {
            "evaluations": Variable((), np.array(paces.evaluations), "function evaluations"),
            "accepted_steps": Variable((), np.array(paces.accepted), "number of accepted steps"),
            "rejected_steps": Variable((), np.array(paces.rejected), "number of rejected steps"),
        }


def arguments(grid: Grid, method: Method, asked: Checked, outcomes: Iterable[Outcome]) -> tuple[dict[str, Any], Array]:
    """Further arguments of ``integrate``, and the times."""
    tolerance = asked["tolerance"]
    varied = {axis.argument: axis for axis in grid.axes}
    if "dt" in varied:
        raise ArgumentError(
            "axes: dt: with a tolerance, dt is the step to try first and nothing else; leave it out, or give one for all by dt="
        )
    if "tolerance" in varied:
        axis = varied["tolerance"]
        if axis.own:
            raise ArgumentError(f"axes: tolerance: expected one number for each member, got shape {axis.values.shape}")
        order_of_series(method, axis.values)
    check_times(tolerance is not None or "tolerance" in varied, asked.options.at)
    times: Array = asked["at"]
    if times.ndim > 1:
        raise ShapeError(f"at: expected times along one axis, the same for all members, got shape {times.shape}")
    _fits_outcomes(outcomes, times)
    return {} if tolerance is None else {"tolerance": _one_for_all(tolerance)}, times


def _one_for_all(tolerance: Any) -> Any:
    """A tolerance, or a pair of tolerances, that are numbers and not arrays."""
    parts = tolerance if isinstance(tolerance, tuple) else (tolerance,)
    numbers = [checks.numbers("tolerance", each, positive=True) for each in parts]
    if (isinstance(tolerance, tuple) and len(parts) != 2) or any(each.ndim for each in numbers):
        raise ShapeError(
            f"tolerance: expected a number, or a pair (relative, absolute), the same for all members, got "
            f"{checks.short(tolerance)}; if it varies, it is an axis"
        )
    parts_of_it = tuple(float(each) for each in numbers)
    return parts_of_it if isinstance(tolerance, tuple) else parts_of_it[0]


def _fits_outcomes(outcomes: Iterable[Outcome], times: Array) -> None:
    for each in outcomes:
        name = type(each).__name__
        if isinstance(each, Exponents) and each.transient >= times.size:
            raise ArgumentError(f"transient: expected fewer intervals than at has times, {times.size}, got {each.transient}")
        if each.observes and times.size < 2:
            raise ArgumentError(
                f"at: expected two or more times, since with a tolerance {name} sees the states at these times and no others, "
                f"got {times.tolist()}"
            )


def refuse(fixed: Mapping[str, Any]) -> None:
    """Raise if there is an argument of a sweep that needs fixed steps."""
    if wrong := [name for name, value in fixed.items() if value is not None]:
        raise ArgumentError(f"{', '.join(wrong)}: works with fixed steps only, and tolerance= or at= was given")


def refuse_fixed(outcomes: Iterable[Outcome]) -> None:
    """Raise if there is an outcome that needs a tolerance."""
    if any(isinstance(each, Evaluations) for each in outcomes):
        raise UnsupportedError(
            "outcomes: Evaluations: with fixed steps every member has the same number, method(…).evaluations a step; it goes "
            "with tolerance= and at="
        )


def lost(run: Run) -> int:
    """The number of members whose absolute tolerance is so large that the motion is lost in it."""
    if run.controller_state is None:
        return 0
    groups = sum(Acceptance(run.system.groups).counts(prod(run.system.v_shape), prod(run.system.y_shape)))
    return int(np.count_nonzero(lost_in_tolerance(run.controller_state.pace, groups)))


def numbers_of_waypoints(state: int) -> int:
    """The numbers of the waypoints of a member in memory, of the last pieces and of all: its state has so many numbers."""
    return 2 * WAYPOINTS * (2 * state + 2 * PACE_NUMBERS)


class Pieces:
    """The pieces of the run of a chunk, and where its members stood on the way if it ``looks`` for stiffness."""

    def __init__(self, system: System, method: Method, *, looks: bool) -> None:
        self.system, self._method, self._looks = system, method, looks
        self._last: tuple[Run, Request] | None = None
        self._waypoints: Array | None = None

    def make(self, *, observer: Any = None, goes_on: bool = False, **options: Any) -> Run:
        """A piece of the run, without findings or warnings; ``observer`` is that of the plan. Others follow if it goes on."""
        waypoints: list[Array] = []
        request = Request.of(self.system, self._method, Options(**options))
        request = request._replace(plan=request.plan._replace(observer=observer))
        if goes_on and request.step_control is not None:
            control = request.step_control
            request = request._replace(step_control=control._replace(pacing=control.pacing._replace(is_part=True)))
        run = step(request, waypoints if self._looks else None)
        self._last = run, request
        if waypoints:
            (rows,) = waypoints
            if self._waypoints is not None:  # a piece may come to none
                numbers = 2 * (run.v[-1].size + run.y[-1].size) // run.status.size
                passed = rows[:, [numbers + engine.COUNTS.start]] > 0.0
                rows = np.where(passed, rows, self._waypoints)
            self._waypoints = rows
        return run

    @property
    def plan(self) -> engine.Plan | None:
        """The plan of the last piece."""
        return None if self._last is None else self._last[1].plan

    def stiff(self) -> Found | None:
        """The members whose steps stability held down, and not the tolerance, or None."""
        if self._last is None or self._waypoints is None:
            return None
        run, request = self._last
        assert run.paces is not None
        if not may_be_stiff(int(run.paces.accepted.max(initial=0)), run.v[-1].size + run.y[-1].size):
            return None
        return stiff_members(course_of(run, request), self._waypoints)

    def why_stopped(self) -> str:
        """Why the first member stopped that did so by itself, in words; "" if none did."""
        assert self._last is not None
        run, request = self._last
        stopped = np.flatnonzero((run.status != Status.OK) & (run.status < Status.EVENT))
        if not stopped.size:
            return ""
        waypoints = [] if self._waypoints is None else [self._waypoints]
        return why_stopped(run, (int(stopped[0]),), partial(why_steps_are_short, run, request, waypoints))
