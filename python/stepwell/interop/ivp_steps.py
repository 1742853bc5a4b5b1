"""Single adaptive steps of one trajectory, and the states between their ends, for ``solve_ivp``."""

from __future__ import annotations

from typing import Any

import numpy as np

from .. import _core
from ..analysis.stiffness import HELD_DOWN, Course, stiff_members
from ..base import checks
from ..base.arrays import Array
from ..errors import ArgumentError, ShapeError
from ..model.methods import Method
from ..reference import adaptive
from ..reference.acceptance import Acceptance
from ..reference.adaptive import waypoints
from ..runs import engine
from ..runs.diagnostics import may_be_stiff

#: The most attempts at steps in one run: up to here the counts of the step-size controller are exact.
MAX_ATTEMPTS = 2**53 - 1

#: Why a run ended early, by the status of the core.
FAILURES = {
    adaptive.UNDERFLOW: "Required step size is less than spacing between numbers.",
    adaptive.NOT_FINITE: "No step, however short, gives a finite state.",
}


class Trajectory:
    """One trajectory, advanced step by step. The time of the system grows even if the user integrates backward.

    Attributes:
        times: the start and the ends of the accepted steps.
        states: the states at these times.
        pace: the state of the step-size controller.
        status: the status of the core: ``adaptive.OK`` at the end, ``adaptive.BUDGET`` before it.
        extra_steps: the number of extra steps for states between the ends of steps.
    """

    def __init__(self, system: Any, method: Method, span: tuple[float, float], y: Array, tolerance: tuple[Array, Array]) -> None:
        relative, absolute = tolerance
        of_groups = relative.ndim > 0 or absolute.ndim > 0
        if of_groups:
            relative, absolute = (np.broadcast_to(each, (len(y),)) for each in tolerance)
        acceptance = Acceptance(tuple(range(len(y))), own=of_groups)
        self._plan = engine.Plan(system, method, (), 1.0, span[0], threads=1, acceptance=acceptance)
        self._model = engine.model(self._plan)
        self.method, self.begin, self.end = method, *span
        self._v = np.empty(0)
        self.times, self.states = [span[0]], [y]
        tolerances = engine.Tolerances(relative, absolute, of_groups)
        pacing = engine.Pacing(np.array([span[1]]), MAX_ATTEMPTS, waypoints=not method.is_always_stable)
        self._tolerance, self._last = float(relative.min()), y
        self._waypoints = engine.room_for_waypoints(pacing, len(y), engine.pace_numbers(self._plan), 1)
        self.pace: Any = engine.begun(self._plan, engine.paces(self._plan, None, tolerances, None, pacing), self._v, y)
        self.status = adaptive.BUDGET
        self.extra_steps = 0

    def limited(self, first_step: float | None, max_step: float) -> None:
        """Set the first trial step and the longest step."""
        first = self.pace.h if first_step is None else np.asarray(first_step)
        self.pace = self.pace._replace(h=np.minimum(first, max_step), most_step=np.asarray(max_step))

    @property
    def evaluations(self) -> int:
        """Function evaluations so far."""
        attempts = self.pace.accepted + self.pace.rejected + self.pace.extra_steps
        return self.method.attempt_evaluations * (int(attempts) + self.extra_steps)

    def advance(self) -> bool:
        """Make one accepted step, by as many attempts as it takes. Return whether there was one."""
        while self.status == adaptive.BUDGET:
            accepted = float(self.pace.accepted)
            attempts = int(accepted + self.pace.rejected) + 1
            saved, last = self._continued(self.pace, self.states[-1], np.array([self.end]), attempts)
            self._last = last
            if self._waypoints is not None and waypoints.is_near(int(self.pace.accepted)):
                waypoints.keep(self._waypoints, accepted, self.pace, self._v, last)
            if self.status == adaptive.OK:
                self.times.append(self.end)
                self.states.append(saved[0])
                return True
            if self.pace.accepted > accepted:
                self.times.append(float(self.pace.t))
                self.states.append(last)
                return True
        return False

    def advance_to_the_end(self, times: Array) -> Array:
        """Continue to the end; return the states at these ascending times, up to the last one reached."""
        saved, self._last = self._continued(self.pace, self.states[-1], times, MAX_ATTEMPTS, self._waypoints)
        return saved[: len(times) if self.status == adaptive.OK else int((times <= float(self.pace.t)).sum())]

    def state(self, t: float) -> Array:
        """The state at one time."""
        state: Array = self.at(np.array([t]))[:, 0]
        return state

    def at(self, times: Array) -> Array:
        """The states at times from the start to the end of the steps so far, shape (n, times).

        Each is computed by a step of the method from the end of a step before it, so its error is that of a shorter step.
        """
        states = np.empty((len(self.states[0]), len(times)))
        if not len(times):
            return states
        ends = np.array(self.times)
        steps = np.clip(np.searchsorted(ends, times, side="right") - 1, 0, len(ends) - 1)
        on_end = ends[steps] == times
        for k in np.flatnonzero(on_end):
            states[:, k] = self.states[steps[k]]
        for i in np.unique(steps[~on_end]):
            within = np.flatnonzero((steps == i) & ~on_end)
            targets, places = np.unique(times[within], return_inverse=True)
            states[:, within] = self._within(int(i), targets).T[:, places.reshape(-1)]
        return states

    def _within(self, i: int, times: Array) -> Array:
        """The states at ascending times within a step, by extra steps from its start."""
        longer = 2.0 * (times[-1] - self.times[i])
        pace = self.pace._replace(t=self.times[i], h=longer, held=1.0, extra=0.0)
        before = self.pace, self.status
        saved, _ = self._continued(pace, self.states[i], times, MAX_ATTEMPTS)
        self.pace, self.status = before
        self.extra_steps += len(times)
        return saved

    def stiffness(self, way: float) -> str:
        """That stability held down the steps, and what to do, in words; "" if it did not. ``way`` is −1 where time runs back."""
        if self._waypoints is None or not may_be_stiff(int(self.pace.accepted), len(self.states[0])):
            return ""
        status = np.asarray(adaptive.OK if self.status == adaptive.BUDGET else self.status)  # an event may have ended it
        course = Course(self._plan, self._tolerance, None, status, engine.numbers_of(self.pace), self._v, self._last, way)
        stiff = stiff_members(course, self._waypoints)
        return "" if stiff is None else f"{HELD_DOWN} the run: {stiff.why}"

    def _continued(self, pace: Any, y: Array, times: Array, attempts: int, passed: Array | None = None) -> tuple[Array, Array]:
        """Continue from a state of the controller and a state; return the states at these times, and the last state.

        ``passed`` gets where the trajectory stands on the way.
        """
        n = len(y)
        saved_v, saved_y = np.empty((len(times), 0)), np.empty((len(times), n))
        last, status = np.empty((n, 1)), np.empty(1, dtype=np.int64)
        paces = engine.numbers_of(pace).reshape(-1, 1)
        last_paces = np.empty_like(paces)
        arrays = engine.AdaptiveArrays(
            np.empty((0, 1)), y.reshape(n, 1), paces, saved_v, saved_y, last, last_paces, status, None, None, passed
        )
        _core.adapt(self._model, self._plan, engine.pacing_of_core(self._plan, engine.Pacing(times, attempts)), arrays)
        self.pace, self.status = engine.pace_of(self._plan, last_paces.reshape(-1)), int(status[0])
        return saved_y, last.reshape(n)


class Solution:
    """The states of a trajectory at any time between its ends: ``sol`` of ``solve_ivp``.

    Called with a time it returns the state, shape (n,); with times along one axis, their states, shape (n, times). Each is
    computed by a step of the method from the end of the step before it. That takes the function evaluations of a step and has the
    error of a shorter one.

    Attributes:
        ts: the start and the ends of the steps, in the direction of the run.
        t_min: the earliest of these times.
        t_max: the latest of these times.
        n_segments: the number of steps.
    """

    def __init__(self, trajectory: Trajectory, ts: Array, sign: float) -> None:
        self._trajectory, self._sign = trajectory, sign
        self.ts = ts
        self.t_min, self.t_max = float(ts.min()), float(ts.max())
        self.n_segments = len(ts) - 1

    def __call__(self, t: Any) -> Array:
        """The states at these times."""
        times = checks.numbers("t", t, unit="units of time")
        if times.ndim > 1:
            raise ShapeError(f"t: expected a time, or times along one axis, got shape {times.shape}")
        if times.size and not (self.t_min <= times.min() and times.max() <= self.t_max):
            raise ArgumentError(
                f"t: expected times within the solution, from {self.t_min:g} to {self.t_max:g}, got {times.min():g} to "
                f"{times.max():g}"
            )
        states = self._trajectory.at(self._sign * times.reshape(-1))
        return states if times.ndim else states[:, 0]

    def __repr__(self) -> str:
        return f"<states of {self.n_segments} steps from t = {self.ts[0]:g} to {self.ts[-1]:g}>"
