"""A run with events and adaptive steps: attempts are made some at a time, and the states between them are looked at."""

from __future__ import annotations

from collections.abc import Sequence
from math import prod
from typing import Any

import numpy as np

from .. import _checks, engine
from .._checks import Array
from ..errors import UnsupportedError
from ..reference.types import Whole
from ..result import Status
from .attempts import Attempts, attempted
from .collected import Collected
from .event import Event
from .parts import Changes
from .trials import AdaptiveTrials

#: Numbers of the states of members that are looked at together: a megabyte, which stays in a cache.
NUMBERS_AT_ONCE = 1 << 17
#: The first attempts of members are few, then twice as many are made together each time, up to the most: a member may stop early.
FIRST_ATTEMPTS, MOST_ATTEMPTS = 16, 1 << 10
#: Members are cut into groups such that at least so many attempts of each group are looked at together.
LEAST_ATTEMPTS = 16


class AdaptiveRun:
    """A run with events, in place of ``engine.adapt``: first the events are found, up to where each member stops.

    Then the run is made as without events, to there, so that all that it returns is the same.
    """

    def __init__(self, events: Sequence[Event]) -> None:
        if changing := [each for each in events if each.then is not None]:
            raise UnsupportedError(
                f"events: with steps chosen by a tolerance no event changes the state, got {changing[0]!r}; give dt= and steps=, "
                f"or stop at it by terminal=True and begin a new run from the state there"
            )
        self._events = events
        self._driver: _Driver | None = None

    def adapt(self, plan: engine.Plan, pacing: engine.Pacing, paces: Array, v: Array, y: Array) -> engine.Adapted:
        """Make it."""
        numbers = 3 + prod(plan.system.v_shape) + prod(plan.system.y_shape)
        rows = sum(numbers * min(event.most, int(event.terminal) or pacing.budget) for event in self._events)
        _checks.fits("the events", rows, plan.batch, "keep fewer of each by Event(…, most=…) or split the batch")
        self._driver = driver = _Driver(plan, self._events, pacing)
        driver.run(paces, v, y)
        out = driver.stepped(paces, v, y)
        if plan.progress is not None:
            plan.progress(1.0)
        return out

    def tell(self, run: Any) -> None:
        """Give the result what was found."""
        assert self._driver is not None
        by_themselves, stops = run.stopped_at, self._driver.stops()
        run.events = self._driver.occurrences()
        if stops is not None:
            run.status = np.where(np.isnan(stops), run.status, Status.EVENT).astype(np.int8)
            run.stopped_at = stops if by_themselves is None else np.where(np.isnan(stops), by_themselves, stops)


class _Driver(Collected):
    """The run of all members."""

    def __init__(self, plan: engine.Plan, events: Sequence[Event], pacing: engine.Pacing) -> None:
        super().__init__(plan, events, AdaptiveTrials)
        #: The time at which each member is at the end.
        self.pacing, self.end = pacing, np.broadcast_to(pacing.at[-1], plan.batch).reshape(-1)
        self.numbers = engine.pace_numbers(plan)
        self.jumps = pacing.jumps
        if self.jumps is not None and self.jumps.ndim > 1:
            self.jumps = np.broadcast_to(self.jumps, (len(self.jumps), *plan.batch)).reshape(len(self.jumps), -1)
        total, blocks = plan.members, (plan.system.v_shape, plan.system.y_shape)
        #: Of members that stopped: their states, and how many attempts they had made and steps they had taken by then.
        self.stop_state = tuple(np.full((*shape, total), np.nan) for shape in blocks)
        self.attempts, self.steps = np.zeros(total), np.zeros(total)
        self.begin, self.since = np.broadcast_to(plan.t0, plan.batch).reshape(-1), np.full(total, -np.inf)
        self.reached = np.array(self.begin, dtype=np.float64)

    def run(self, paces: Array, v: Array, y: Array) -> None:
        """Find all events."""
        system, total = self.plan.system, self.plan.members
        paces = np.broadcast_to(paces.reshape(self.numbers, -1), (self.numbers, total))
        v, y = v.reshape(*system.v_shape, total), y.reshape(*system.y_shape, total)
        if not self.pacing.begins:
            # A step that is held has been looked at before, up to the last time of the run that goes on.
            self.since = np.where(paces[engine.HELD] > 0.0, paces[engine.TARGET], -np.inf)
            self.begin = paces[engine.TIME]
        numbers = 2 + prod(system.v_shape) + prod(system.y_shape)
        size = max(1, NUMBERS_AT_ONCE // (numbers * LEAST_ATTEMPTS))
        for first in range(0, total, size):
            index = np.arange(first, min(first + size, total))
            self._group(index, paces[:, index], v[..., index], y[..., index], max(1, NUMBERS_AT_ONCE // numbers))

    def _group(self, index: Whole, paces: Array, v: Array, y: Array, most: int) -> None:
        """All attempts of some members; those that stop, or are at the end, leave the group."""
        begins, together = self.pacing.begins, FIRST_ATTEMPTS
        some = self.members.plan(index)._replace(progress=None)
        while len(index):
            attempts = max(1, min(together, most // len(index), MOST_ATTEMPTS))
            jumps = self.jumps if self.jumps is None or self.jumps.ndim == 1 else self.jumps[:, index]
            out = attempted(some, self.end[index], attempts, self.pacing.budget, begins, np.ascontiguousarray(paces), v, y, jumps)
            before = np.zeros((2, len(index))) if begins else paces[engine.COUNTS][:2]
            stopped = self._look(some, index, out, before, not begins)
            after = out.paces[engine.COUNTS][:2].sum(axis=0)
            # Members that make no attempt cannot, or may not: they are out of attempts, or a step no longer moves the time.
            on = (
                ~stopped & (out.t[-1] < self.end[index]) & (after - before.sum(axis=0) == attempts) & (after < self.pacing.budget)
            )
            self.reached[index] = np.where(on, out.t[-1], self.end[index])
            index, paces, v, y = index[on], out.paces[:, on], out.v[-1][..., on], out.y[-1][..., on]
            begins, together = False, 2 * together
            if not on.all():
                some = self.members.plan(index)._replace(progress=None)
            if self.plan.progress is not None:
                gone = np.mean(self.reached - self.begin) / max(np.mean(self.end - self.begin), np.finfo(float).tiny)
                self.plan.progress(min(0.99, max(0.0, float(gone))))

    def _look(self, now: engine.Plan, index: Whole, out: Attempts, before: Array, goes_on: bool) -> Any:
        """Find the events within these steps; which of the members stop."""
        v, y = states = tuple(np.moveaxis(each, 0, axes) for each, axes in zip((out.v, out.y), now.block_axes, strict=True))
        given, h = self.members.numbers(index), out.lengths(now)
        g = [self.quantity(e, out.t, v, y, given) for e in range(len(self.events))]
        may = [self.may_change(e, index, each) for e, each in enumerate(g)]
        if not np.any([each.any() for each in may]):
            return np.zeros(len(index), dtype=bool)
        moves = out.t[1:] > out.t[:-1]
        taken = np.concatenate([np.zeros((1, len(index))), np.cumsum(moves, axis=0)]) + before[0]

        def known(e: int, row: Whole, place: Whole) -> Changes:
            begins, ends = ([each[..., row + later, place] for each in states] for later in (0, 1))
            step, places = taken[row, place].astype(np.int64), (row, place)
            low, high, values = np.zeros(len(row)), np.ones(len(row)), (g[e][places], g[e][row + 1, place])
            return Changes(row, place, index[place], step, out.t[places], h[places], low, high, *values, *begins, *ends)

        changes = [self.changes(e, each & moves, known) for e, each in enumerate(may)]
        # Of steps that go beyond the end, or began before this run, only a part is in it.
        partial = out.t[1:] > self.end[index]
        if goes_on:
            partial |= out.t[:-1] < self.since[index]
        for e, each in enumerate(changes):
            beyond = np.flatnonzero(partial[each.row, each.place])
            if len(beyond):
                t, who = self.located(e, each.some(beyond)).t, each.member[beyond]
                inside = (t <= self.end[who]) & (t > self.since[who])
                changes[e] = each.some(np.delete(np.arange(len(each.row)), beyond[~inside]))
        stops = self.take(index, len(h), changes)
        if stops is None:
            return np.zeros(len(index), dtype=bool)
        which, whose = stops.which, index[stops.which]
        for kept, state in zip(self.stop_state, (stops.v, stops.y), strict=True):
            kept[..., whose] = state[..., which]
        self.attempts[whose] = (before.sum(axis=0) + stops.step + 1)[which]
        self.steps[whose] = taken[(stops.step + 1)[which], np.flatnonzero(which)]
        return which

    def stepped(self, paces: Array, v: Array, y: Array) -> engine.Adapted:
        """The run as without events; members that stop make no more attempts than up to there."""
        stopped = ~np.isnan(self.stopped_at)
        plan, pacing = self.plan._replace(progress=None), self.pacing
        if not stopped.any():
            return engine.adapt(plan, pacing, paces, v, y)
        batch, total, rejected = plan.batch, plan.members, 1 + engine.COUNTS.start
        # What they may not make any more counts as if it had been rejected before.
        spare = np.where(stopped, pacing.budget - self.attempts, 0.0)
        given = np.broadcast_to(paces.reshape(self.numbers, -1), (self.numbers, total)).copy()
        given[rejected] += spare
        out = engine.adapt(plan, pacing, given.reshape(self.numbers, *batch), v, y)
        last, status = out.paces.reshape(self.numbers, total).copy(), out.status.reshape(total).copy()
        last[rejected] -= spare
        last[engine.TIME, stopped], last[engine.WORK, stopped] = self.stopped_at[stopped], np.nan
        last[engine.COUNTS.start, stopped] = self.steps[stopped]
        status[stopped] = 0
        at = pacing.at if pacing.at.ndim == 1 else np.broadcast_to(pacing.at, (len(pacing.at), *batch))
        later = (at.reshape(len(at), -1) >= self.stopped_at) & stopped
        states = []
        for saved, at_end, stop in zip((out.v, out.y), (out.last_v, out.last_y), self.stop_state, strict=True):
            kept = saved.reshape(len(pacing.at), *stop.shape)
            np.copyto(kept, stop, where=np.expand_dims(later, tuple(range(1, stop.ndim))))
            ends = np.where(stopped, stop, np.reshape(at_end, stop.shape))
            states.append((kept.reshape(saved.shape), ends.reshape(saved.shape[1:])))
        (saved_v, last_v), (saved_y, last_y) = states
        paces, status = last.reshape(self.numbers, *batch), status.reshape(batch)
        return out._replace(v=saved_v, y=saved_y, last_v=last_v, last_y=last_y, paces=paces, status=status)
