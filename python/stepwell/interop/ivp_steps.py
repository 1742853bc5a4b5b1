"""All accepted steps of one trajectory, and the states between their ends, for ``solve_ivp``."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ..base import checks
from ..base.arrays import Array, Whole
from ..errors import ArgumentError, ShapeError
from ..reference import adaptive
from ..runs import engine
from ..runs.adaptive import of_extra_steps, paces_of
from ..runs.between import reach_of, within_steps
from ..runs.findings.stiffness import HELD_DOWN, Course, may_be_stiff, stiff_members, suspects
from ..runs.request import Request

#: The most attempts at steps in one run: up to here the counts of the step-size controller are exact.
MAX_ATTEMPTS = 2**53 - 1
#: A run that an event may end is made in pieces: the first of so many attempts, each further one of as many as all before it.
FIRST_ATTEMPTS = 256
#: Likewise where another method may be taken, which needs the second waypoint, that of 512 accepted steps.
BEFORE_A_CHECK = 1024
#: A method for stiff equations is taken if it comes as far with the attempts divided by this. One of its attempts takes about as
#: long as one of an explicit method of like accuracy, of up to ten numbers; with more it takes up to three times as long.
PART = 2
#: The core has room for so many numbers of steps, and when it is filled for as many more as there are.
NUMBERS_AT_ONCE = 1 << 18


class Trajectory:
    """One trajectory, by one call of the core, or by one for each piece. Its time is that of the plan, which always grows.

    Attributes:
        end: the last time.
        times: the start and the ends of accepted steps so far, if they are kept.
        states: the states at these times, shape (times, n).
        saved: the states at the times that were asked for, as far as they were reached, shape (times, n).
        status: the status of the core: ``adaptive.OK`` at the end, ``adaptive.BUDGET`` or ``engine.FULL`` before it.
    """

    def __init__(self, request: Request, at: Array, *, keeps: bool, attempts: int) -> None:
        plan, control = request.plan, request.step_control
        assert control is not None
        self.method, self._plan, self._v, self._last, self._paces = plan.method, plan, request.v, request.y, control.paces
        self._pacing = control.pacing._replace(
            at=at, budget=MAX_ATTEMPTS, every=int(keeps), waypoints=not self.method.is_always_stable
        )
        self._attempts, self._each, self._between = attempts, engine.evaluations_of_attempt(plan), 0
        self._of_extra = of_extra_steps(plan, self._each, dense=len(at) > 1)
        self._waypoints: Array | None = None
        #: Where the step ends in which an event ended the trajectory.
        self._end_of_last: float | None = None
        self.end, self.status = float(at[-1]), adaptive.BUDGET
        self.times, self.states, self.saved = np.array([plan.t0]), request.y[np.newaxis], np.empty((0, len(request.y)))

    @property
    def goes_on(self) -> bool:
        """True until it has come to its end or to where no step is possible."""
        return self.status in (adaptive.BUDGET, engine.FULL)

    @property
    def reached(self) -> float:
        """The time that it has reached."""
        return self.end if self.status == adaptive.OK else float(self._paces[engine.TIME])

    @property
    def evaluations(self) -> int:
        """Function evaluations so far."""
        made = paces_of(self._plan, self._paces, self._each, self._of_extra)
        return int(made.evaluations) + self._of_extra * self._between

    def advance(self) -> bool:
        """Make the steps of the next piece. Return whether there was one."""
        if not self.goes_on:
            return False
        room = 1 + min(max(NUMBERS_AT_ONCE // (1 + len(self._last)), len(self.times)), self._attempts)  # one is never filled
        pacing = self._pacing._replace(at=self._pacing.at[len(self.saved) :], budget=self._attempts, room=room)
        out = engine.adapt(self._plan, pacing, self._paces, self._v, self._last)
        self._paces, self._last, self._waypoints, self.status = out.paces, out.last_y, out.waypoints, int(out.status)
        self._pacing = self._pacing._replace(begins=False, waypoints=False if out.waypoints is None else out.waypoints)
        is_done = self.status == adaptive.OK
        if self.status == adaptive.BUDGET:
            self._attempts = min(2 * self._attempts, MAX_ATTEMPTS)
        self.saved = np.concatenate([self.saved, out.y[: None if is_done else np.isfinite(out.y[:, 0]).sum()]])
        if out.steps is not None:
            # A step may pass the end, whose state is another one.
            count = int(np.searchsorted(out.steps.t[: out.steps.counts[0], 0], self.end))
            ends, states = [self.times, out.steps.t[:count, 0]], [self.states, out.steps.y[:count, :, 0]]
            self.times = np.concatenate([*ends, pacing.at[-1:]] if is_done else ends)
            self.states = np.concatenate([*states, out.y[-1:]] if is_done else states)
        return True

    def end_at(self, time: float) -> None:
        """Take back what is after this time; the state there is made by a step of the method."""
        kept = self.times < time
        last = self.stepped(time)[np.newaxis]
        self._end_of_last = self._ends()[kept.sum() - 1]
        self.times, self.states = np.append(self.times[kept], time), np.concatenate([self.states[kept], last])

    def at(self, times: Array) -> Array:
        """The states at times from the start to the end of the steps so far, shape (n, times), by one call of the core.

        They are those of the continuous extension of the method; without one each is computed by a step of it.
        """
        if not len(times):
            return np.empty((len(self._last), 0))
        return self._within(times, self._ends()[np.searchsorted(self.times, times, side="right") - 1])

    def stepped(self, time: float) -> Array:
        """The state at a time by a step of the method from the end of the step before it, shape (n,)."""
        return self._within(np.array([time]), np.array([np.nan]))[:, 0]

    def _ends(self) -> Array:
        """Where the steps end that begin at the times that are kept."""
        last = reach_of(self._paces, self.times[-1]) if self._end_of_last is None else self._end_of_last
        ends = np.append(self.times[1:], np.nan)
        if len(ends) > 1 and self.times[-1] == self.end:
            ends[-2] = last
        return ends

    def _within(self, times: Array, ends: Array) -> Array:
        """The states at times in steps that end there, NaN where that is not known, shape (n, times)."""
        steps = np.searchsorted(self.times, times, side="right") - 1
        since, member = self.times[steps], np.zeros(len(times), np.int64)
        self._between += int((since < times).sum())

        def start(some: Whole) -> tuple[Array, Array]:
            return np.empty((0, len(some))), self.states[steps[some]].T

        def plan_of(member: Whole) -> engine.Plan:
            return self._plan._replace(batch=member.shape)

        paces = self._paces[:, np.newaxis]
        return within_steps(plan_of, lambda _: self._pacing, paces, (member, since, ends), times, start)[1]

    def loses_to(self, requested: Callable[[], Request]) -> bool:
        """True if another method would have come as far with a part of the attempts: see ``PART``."""
        attempts = int(self._paces[engine.COUNTS][:2].sum()) // PART
        if self.status != adaptive.BUDGET or PART * attempts < BEFORE_A_CHECK or self._waypoints is None:
            return False
        if not suspects(self._plan, self._waypoints) or self.reached - self._plan.t0 > attempts * self._paces[engine.MOST_STEP]:
            return False  # so many steps, however long, do not come as far
        other = Trajectory(requested(), self._pacing.at[-1:], keeps=False, attempts=attempts)
        return other.advance() and other.reached >= self.reached

    def stiffness(self) -> str:
        """A warning that stability held down many steps, with advice; "" if it did not."""
        if self._waypoints is None or not may_be_stiff(int(self._paces[engine.COUNTS.start]), len(self._last)):
            return ""
        plan, paces, status = self._plan, self._paces, np.asarray(adaptive.OK if self.goes_on else self.status)
        tolerance, walls, way = float(paces[engine.RELATIVE]), self._pacing.jumps, -1.0 if plan.backward else 1.0
        stiff = stiff_members(Course(plan, tolerance, walls, status, paces, self._v, self._last, way), self._waypoints)
        return "" if stiff is None else f"{HELD_DOWN} the run: {stiff.why}"


class Solution:
    """The states of a trajectory at any time between its ends: ``sol`` of ``solve_ivp``.

    Called with a time it returns the state, shape (n,); with times along one axis, their states, shape (n, times). Each is
    that of the continuous extension of the method, as at ``t_eval``; without one it takes a step of the method from the end of
    the step before it.

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
