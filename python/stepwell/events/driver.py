"""A run with events: some steps of some members at a time, all of whose states are looked at."""

from __future__ import annotations

from collections.abc import Sequence
from math import prod
from typing import Any

import numpy as np

from .. import _checks, engine
from .._checks import Array
from ..reference.events import crosses
from ..reference.types import Whole
from ..result import Status
from .collected import Collected
from .event import Event
from .parts import At, Changes
from .traced import watched

#: Members × steps × numbers of a state that are looked at together: a megabyte, which stays in a cache.
NUMBERS_AT_ONCE = 1 << 17
#: Members are cut into groups such that at least so many steps of each group are looked at together.
LEAST_STEPS = 16
#: The first steps are few, then four times as many are made together each time, up to the most: a member may stop early.
FIRST_STEPS, MOST_STEPS = 64, 1 << 13
#: Where the core notices changes of sign, so many steps are made at once; those of a member that has one are repeated.
#: Twice as many the next time if fewer than this share of the members had one, half as many if more than that had.
WATCHED_STEPS, FEW_NOTICED, MANY_NOTICED = 64, 1 / 16, 1 / 4
#: If so many have one in so few steps, all states are looked at from there on.
TOO_MANY_NOTICED = 1 / 2
#: All states of fewer members than these are looked at: a repetition would take longer than that.
FEW_MEMBERS = 64
#: Where states are saved more often than after so many steps, all are looked at instead.
LEAST_BETWEEN_SAVES = 32


def check_room(events: Sequence[Event], plan: engine.Plan) -> None:
    """Raise if what may be kept of the events would not fit in memory."""
    numbers = 3 + prod(plan.system.v_shape) + prod(plan.system.y_shape)
    rows = sum(numbers * (1 if event.terminal else min(event.most, plan.steps)) for event in events)
    _checks.fits("the events", rows, plan.batch, "keep fewer of each by Event(…, most=…) or split the batch")


class Run:
    """A run with events, in place of ``engine.advance``.

    Args:
        events: what was asked for.
        v: velocities at the start, or what the method carries, shape (*block, *batch).
        y: coordinates, likewise.
        before: first bad steps of earlier runs, as of ``engine.advance``.
        carried: whether ``v`` is what the method carries.
    """

    def __init__(self, events: Sequence[Event], v: Array, y: Array, before: Whole | None, carried: bool) -> None:
        self._events, self._start = events, (v, y, before, carried)
        self._driver: _Driver | None = None

    def made(self, plan: engine.Plan) -> engine.Outcome:
        """Make it."""
        check_room(self._events, plan)
        self._driver = _Driver(plan, self._events)
        return self._driver.run(*self._start)

    def tell(self, run: Any) -> None:
        """Give the result what was found."""
        assert self._driver is not None
        run.events, run.stopped_at = self._driver.occurrences(), self._driver.stops()
        if run.stopped_at is not None and (stopped := ~np.isnan(run.stopped_at)).any():
            run.status = np.where(stopped, Status.EVENT, run.status).astype(np.int8)
            run.encounter = run.overshoots = None  # these go through all of the steps


class _Driver(Collected):
    """The run of all members."""

    def __init__(self, plan: engine.Plan, events: Sequence[Event]) -> None:
        super().__init__(plan, events)
        total = plan.members
        self.saves = plan.saves
        blocks = plan.system.v_shape, plan.system.y_shape
        self.kept = tuple(np.empty((len(self.saves), *shape, total)) for shape in blocks)
        self.slot = np.empty((*blocks[0], total))
        self.first_bad = np.full(total, -1, dtype=np.int64)
        self.done = 0
        self.watched: engine.Watched | None = None

    def run(self, v: Array, y: Array, before: Whole | None, carried: bool) -> engine.Outcome:
        plan, total = self.plan, self.plan.members
        numbers = max(1, prod(plan.system.v_shape) + prod(plan.system.y_shape))
        v, y = v.reshape(*plan.system.v_shape, total), y.reshape(*plan.system.y_shape, total)
        bad = self.first_bad.copy() if before is None else before.reshape(-1)
        size = max(1, NUMBERS_AT_ONCE // numbers)
        if plan.backend == "rust" and not plan.fused and (plan.every is None or plan.every >= LEAST_BETWEEN_SAVES):
            self.watched = watched(self.quantities, self.members.plan(np.arange(min(2, total))))
        for first in range(0, total, size):
            index = np.arange(first, min(first + size, total))
            self._group(index, At(v[..., index], y[..., index], bad[index], carried), size)
        return self._outcome()

    def _group(self, index: Whole, at: At, most: int, done: int = 0, notices: bool = True) -> None:
        """All further steps of some members; those that stop leave the group."""
        plan, piece, together = self.plan, FIRST_STEPS, WATCHED_STEPS
        some = self.members.plan(index)
        while done < plan.steps and len(index):
            now = some._replace(first=plan.first + done, record=(), progress=None)
            noticing = notices and self.watched is not None and len(index) >= FEW_MEMBERS
            size = max(1, most // LEAST_STEPS)
            if not noticing and len(index) > size:  # too few states of so many members fit
                for first in range(0, len(index), size):
                    these = np.arange(first, min(first + size, len(index)))
                    self._group(index[these], at.some(these), most, done, notices)
                return
            if noticing and done > 0:
                now = now._replace(steps=min(together, self._next_save(done) - done), every=None, watched=self.watched)
                out = engine.advance(now, at.slot, at.y, at.bad, carried=at.carried)
                if out.noticed is None or np.isnan(out.noticed[-1]).any():
                    self.watched = None  # steps too long for one tape
                    continue
                stopped, share = self._look_again(now, index, at, out, done, most)
                if share < FEW_NOTICED:
                    together = min(2 * together, MOST_STEPS)
                elif share > MANY_NOTICED and together > LEAST_STEPS and len(index) * together > most:
                    together //= 2
                elif share > TOO_MANY_NOTICED:
                    notices = False
            else:
                longest = 1 if noticing else min(piece, most // len(index), MOST_STEPS)
                now = now._replace(steps=min(max(1, longest), plan.steps - done), every=1)
                out = engine.advance(now, at.slot, at.y, at.bad, carried=at.carried)
                self._save(done, now.steps, index, out.v, out.y)
                stopped = self._look(now, index, out, done)
            self.done += now.steps * len(index)
            done, piece = done + now.steps, 4 * piece
            at = At(out.slot, out.y[-1], out.first_bad, True)
            self.slot[..., index], self.first_bad[index] = at.slot, at.bad
            if stopped.any():
                self.first_bad[index[stopped]] = -1
                self.slot[..., index[stopped]] = np.nan  # what a method would carry from there on is not known
                self.done += int(stopped.sum()) * (plan.steps - done)
                index, at = index[~stopped], at.some(~stopped)
                if len(index):
                    some = self.members.plan(index)
            if plan.progress is not None:
                plan.progress(self.done / (plan.steps * plan.members))

    def _look_again(self, now: engine.Plan, index: Whole, at: At, out: engine.Outcome, done: int, most: int) -> Any:
        """Repeat the steps of members with a change of sign, to find it; which members stop, and which share was repeated."""
        assert out.noticed is not None
        if done + now.steps == self._next_save(done):
            self._save(done + now.steps, 0, index, out.v, out.y)
        end, given = now.begin + (now.first + now.steps) * now.dt, self.members.numbers(index)
        noticed = out.noticed[-1] > 0.0
        for quantity, event, before in zip(self.quantities, self.events, out.noticed, strict=False):
            noticed |= crosses(before, quantity(np.array(end), out.v[-1], out.y[-1], given), event.direction)
        stopped, where = np.zeros(len(index), dtype=bool), np.flatnonzero(noticed)
        size = max(1, most // now.steps)
        for first in range(0, len(where), size):
            these = where[first : first + size]
            again = self.members.plan(index[these])
            again = now._replace(
                system=again.system, batch=again.batch, force=again.force, begins=again.begins, every=1, watched=None
            )
            then = at.some(these)
            states = engine.advance(again, then.slot, then.y, then.bad, carried=then.carried)
            stopped[these] = self._look(again, index[these], states, done)
        return stopped, len(where) / len(index)

    def _next_save(self, done: int) -> int:
        """The next step after these whose state is kept."""
        return int(self.saves[np.searchsorted(self.saves, done, "right")])

    def _save(self, done: int, steps: int, index: Whole, *states: Array) -> None:
        """Keep those of these states that are asked for."""
        first, last = np.searchsorted(self.saves, done, "left"), np.searchsorted(self.saves, done + steps, "right")
        if first == last:
            return
        where, members = self.saves[first:last] - done, slice(index[0], index[-1] + 1)
        for kept, state in zip(self.kept, states, strict=True):
            if len(index) == index[-1] + 1 - index[0]:
                kept[first:last, ..., members] = state[where]
            else:
                kept[first:last][..., index] = state[where]

    def _look(self, now: engine.Plan, index: Whole, out: engine.Outcome, done: int) -> Any:
        """Find the events within these steps; which of the members stop."""
        v, y = states = tuple(np.moveaxis(each, 0, axes) for each, axes in zip((out.v, out.y), now.block_axes, strict=True))
        t: Any = now.begin + ((now.first + np.arange(now.steps + 1)) * now.dt)[:, np.newaxis]
        given = self.members.numbers(index)
        g = [quantity(t, v, y, given) for quantity in self.quantities]
        changes = [crosses(each[:-1], each[1:], event.direction) for each, event in zip(g, self.events, strict=True)]
        if (out.first_bad >= 0).any():
            ends = now.first + np.arange(1, now.steps + 1)[:, np.newaxis]
            finite = (out.first_bad < 0) | (ends < out.first_bad)
            changes = [each & finite for each in changes]
        stops = self.take(
            index, now.steps, changes, lambda e, step, member: self._changes(now, index, g[e], states, step, member)
        )
        if stops is None:
            return np.zeros(len(index), dtype=bool)
        after = np.searchsorted(self.saves, done + stops.step, "right")
        for place in np.unique(after[stops.which]):
            these = stops.which & (after == place)
            for kept_states, state in zip(self.kept, (stops.v, stops.y), strict=True):
                kept_states[place:][..., index[these]] = state[..., these]
        return stops.which

    def _changes(self, now: engine.Plan, index: Whole, g: Array, states: Any, step: Whole, member: Whole) -> Changes:
        """What is known of the changes of sign of these members in these steps."""
        begins, ends = ([each[..., step + later, member] for each in states] for later in (0, 1))
        numbers = now.first + step
        t: Any = (now.t0 if now.begins is None else now.begins[member]) + numbers * now.dt
        h = np.full(len(step), now.dt)
        return Changes(index[member], numbers, t, h, g[step, member], g[step + 1, member], *begins, *ends)

    def _outcome(self) -> engine.Outcome:
        """As that of a run without events, without what a control added up."""
        batch, blocks = self.plan.batch, (self.plan.system.v_shape, self.plan.system.y_shape)
        v, y = (each.reshape(len(self.saves), *shape, *batch) for each, shape in zip(self.kept, blocks, strict=True))
        first_bad = self.first_bad.reshape(batch)
        diverged = bool((first_bad >= 0).any())
        return engine.Outcome(v, y, self.slot.reshape((*blocks[0], *batch)), first_bad, {}, None, diverged)
