"""Runs with a tolerance, which end steps at jumps of the inputs and save states at requested times."""

from collections.abc import Callable
from typing import Any, NamedTuple, Self

import numpy as np

from ...base.arrays import Array, Whole
from ..bits import where
from . import waypoints as passed
from .controller import MAX_FACTOR, MIN_FACTOR, MOVES, Pace

OK, BUDGET, UNDERFLOW, NOT_FINITE = 0, 2, 3, 4


def waiting(
    t0: Any, first: Any, tolerance: tuple[Any, Any, float], samples: tuple[float, float], most_step: Any = np.inf, groups: int = 2
) -> Pace:
    """The pace of a member before its first step. ``begin`` adds what depends on its state.

    ``first`` is the first trial step. If it is negative, ``begin`` chooses one, which is ``-first`` where all rates are zero.
    ``tolerance`` is ``relative``, ``absolute`` and ``lasts`` of a ``Pace``, ``samples`` its ``interval`` and ``until``.
    """
    counts = *tolerance, t0, *samples, most_step, np.inf, 1.0, MAX_FACTOR
    return Pace(t0, first, t0, 0.0, 0.0, *counts, 0.0, 0.0, 0.0, 0.0, 0.0, *np.zeros((3, groups)))


class Jumps(NamedTuple):
    """The jumps that no step crosses. A step ends just before a jump, and the next one begins just after it.

    Attributes:
        before: the ends of steps before the jumps, ascending along the first axis, for all members or for each.
        after: the beginnings of steps after the jumps, likewise.
    """

    before: Array
    after: Array

    @classmethod
    def around(cls, times: Array, t0: Any, in_single: Any = None) -> Self:
        """Bracket each jump by some rounding errors of its time. Jumps before the start t0 and infinite ones do not count.

        Times of stages are rounded to the larger of the times at both ends of a step, so they stay on their side. ``in_single``
        are the jumps that rates compare with times of float32.
        """
        size = np.maximum(np.abs(times), np.abs(t0))
        rounding = np.spacing(size)
        if in_single is not None:
            with np.errstate(over="ignore", invalid="ignore"):
                rounding = np.where(in_single, np.spacing(size.astype(np.float32)), rounding)
        margin = np.where(np.isfinite(times), 4.0 * rounding, 0.0)
        before, after = times - margin, times + margin
        gone = after < t0
        return cls(np.where(gone, -np.inf, before), np.where(gone, -np.inf, after))

    def begun(self, t0: Any) -> Any:
        """The time at which steps start: t0, or just after a jump at t0."""
        before, after = (each if each.ndim > 1 else each.reshape(-1, *(1 for _ in np.shape(t0))) for each in self)
        return np.where((before <= t0) & (t0 <= after), after, t0).max(axis=0)

    def passed(self, t: Any) -> Any:
        """The number of jumps at or before t."""
        if self.before.ndim == 1:
            return np.searchsorted(self.before, t, side="right")
        return np.count_nonzero(self.before <= t, axis=0)

    def left(self, t: Any) -> Any:
        """The time from which a step begins that goes on from t: just after a jump for which a step ended there."""
        passed = self.passed(t)
        return np.where(passed > 0, np.maximum(t, self._of_each(t, self.after, np.maximum(passed - 1, 0))), t)

    def wall(self, t: Any) -> Any:
        """The next time at which a step from t must end, infinite if there is none."""
        return self._of_each(t, self.before, self.passed(t))

    def crossed(self, pace: Pace, *, series: bool) -> Pace:
        """The pace, where members at a wall continue just after it with a new trial step."""
        there = pace.t >= pace.wall
        if not np.any(there):
            return pace
        passed = self.passed(pace.t)
        t = np.where(there, self._of_each(pace.t, self.after, np.maximum(passed - 1, 0)), pace.t)
        least = MOVES * np.abs(t)
        first = MIN_FACTOR * pace.h
        return pace._replace(
            t=t,
            wall=np.where(there, self.wall(t), pace.wall),
            h=pace.h if series else np.where(there, np.where(first < least, least, first), pace.h),
            before=np.where(there, MIN_FACTOR * pace.before if series else 1.0, pace.before),
            most=np.where(there, MAX_FACTOR, pace.most),
        )

    @staticmethod
    def _of_each(t: Any, times: Array, place: Any) -> Any:
        """The time at an index of each member; infinite past the last."""
        shape = np.shape(t)
        rows = np.broadcast_to(times.reshape(len(times), *(times.shape[1:] or len(shape) * (1,))), (len(times), *shape))
        ended = np.concatenate([rows, np.full((1, *shape), np.inf)])
        return np.take_along_axis(ended, np.asarray(place, dtype=np.intp)[np.newaxis], 0)[0]


class Outcome(NamedTuple):
    """Saved states, and the state, pace and status of each member at the end.

    ``steps`` has an entry for each attempt with accepted steps that are recorded: which members made one, the times, v and y.
    """

    v: Array
    y: Array
    last_v: Array
    last_y: Array
    pace: Pace
    status: Whole
    steps: list[tuple[Any, Any, Array, Array]]


def run(
    attempt: Callable[[Pace, int, Array, Array], tuple[Pace, Array, Array]],
    v: Array,
    y: Array,
    pace: Pace,
    *,
    at: Array,
    budget: int,
    jumps: Jumps | None = None,
    series: bool = False,
    every: int = 0,
    waypoints: Array | None = None,
    is_part: bool = False,
    extension: Callable[[Pace, Array, Array, Any], tuple[Array, Array, Any]] | None = None,
) -> Outcome:
    """Continue all members and save their states at the ascending times ``at``. States after a member has stopped are NaN.

    The state at the last time is made by a step of the method to there, unless the run ``is_part`` of another. So are those
    before without ``extension(pace, v, y, t)``, the state at a time within the held step and whether it is as good as a step's.

    ``attempt(pace, budget, v, y)`` is one attempt of all members. Every ``every``-th accepted step is recorded, or none if
    it is 0. ``waypoints`` gets the last waypoints of each member (``waypoints.keep``).
    """
    one, known = np.ones(pace.t.shape), np.zeros(pace.t.shape, dtype=bool)
    at_last: tuple[Array, ...] = v, y
    saved_v, saved_y, steps = [], [], []
    if jumps is not None:
        pace = pace._replace(wall=jumps.wall(pace.t))
    with np.errstate(all="ignore"):
        for target in at:
            within = (pace.held > 0.0) & (target < pace.reach()[0])
            pace = pace._replace(target=target * one, held=where(within, 1.0, 0.0))
            is_last = (target >= at[-1]) & (not is_part)
            there, at_target = np.zeros(pace.t.shape, dtype=bool), (np.full(v.shape, np.nan), np.full(y.shape, np.nan))
            while True:
                while pace.outlook(budget).runs.any():
                    accepted = pace.accepted
                    pace, v, y = attempt(pace, budget, v, y)
                    if waypoints is not None:
                        passed.keep(waypoints, accepted, pace, v, y)
                    if every and (due := (pace.accepted > accepted) & (pace.accepted % every == 0.0)).any():
                        steps.append((due, pace.t, v, y))
                    if jumps is not None:
                        pace = jumps.crossed(pace, series=series)
                waits = (pace.held > 0.0) & ~there
                if np.any(ended := waits & is_last & known):
                    at_target = tuple(where(ended, new, old) for new, old in zip(at_last, at_target, strict=True))
                    there, waits, known = there | ended, waits & ~ended, known & ~ended
                if extension is not None and np.any(waits & ~is_last):
                    *states, holds_good = extension(pace, v, y, target)
                    within_step = waits & ~is_last & holds_good
                    # If the last time is within, the step to there comes first: it may show that the held one missed something.
                    ends = within_step & (at[-1] < pace.reach()[0]) & ~known & (not is_part)
                    if ends.any():
                        pace, *made = attempt(pace._replace(extra=where(ends, at[-1] - pace.t, 0.0)), budget, v, y)
                        at_last = tuple(where(ends, new, old) for new, old in zip(made, at_last, strict=True))
                        known |= ends & (pace.held > 0.0)
                        within_step, waits = within_step & (pace.held > 0.0), waits & (pace.held > 0.0)
                    at_target = tuple(where(within_step, new, old) for new, old in zip(states, at_target, strict=True))
                    there, waits = there | within_step, waits & ~within_step
                extra = pace._replace(extra=where(waits, target - pace.t, 0.0))
                pace, v1, y1 = attempt(extra, budget, v, y) if waits.any() else (pace, v, y)
                arrives = ~there & where(waits, pace.held > 0.0, pace.t >= target)
                at_target = where(arrives, v1, at_target[0]), where(arrives, y1, at_target[1])
                there |= arrives
                if not pace.outlook(budget).runs.any():  # after an extra step that was rejected there are shorter ones
                    break
            saved_v.append(at_target[0])
            saved_y.append(at_target[1])
    spent = pace.accepted + pace.rejected >= budget
    status = np.where(there, OK, np.where(spent, BUDGET, np.where(pace.error < np.inf, UNDERFLOW, NOT_FINITE)))
    return Outcome(np.stack(saved_v), np.stack(saved_y), v, y, pace, status.astype(np.int64), steps)
