"""A run with events and fixed steps: some steps of some members at a time, with events searched between all states."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from math import prod
from typing import Any

import numpy as np

from ...base import checks
from ...base.arrays import Array, Whole
from .. import engine
from ..engine.direct import run_by_core
from ..result import Status
from . import by_core
from .collected import Collected, Known
from .event import Event, names_of_changing
from .parts import At, Changes
from .resets import Resets, Stretch
from .traced import watched

#: Members × steps × numbers of a state that are searched together: a megabyte, which stays in a cache.
NUMBERS_AT_ONCE = 1 << 17
#: Groups of members are small enough for at least this many steps of each to be searched together.
LEAST_STEPS = 16
#: Few steps are made first, since a member may stop early; then four times as many together each time, up to the most.
FIRST_STEPS, MOST_STEPS = 64, 1 << 13


def advanced(plan: engine.Plan, at: At) -> engine.Outcome:
    """Steps of some members from where they are, with states in float64, as quantities are."""
    out = engine.advance(plan, at.slot, at.y, at.bad, carried=at.carried)
    return out._replace(**{name: getattr(out, name).astype(np.float64, copy=False) for name in ("v", "y", "slot")})


def check_room(events: Sequence[Event], plan: engine.Plan) -> None:
    """Raise if all occurrences that may be kept would not fit in memory."""
    numbers = 3 + prod(plan.system.v_shape) + prod(plan.system.y_shape)
    rows = sum(numbers * min(event.most, int(event.terminal) or plan.steps) for event in events)
    checks.fits("the events", rows, plan.batch, "keep fewer of each by Event(…, most=…) or split the batch")


class Run:
    """A run with events, in place of ``engine.advance``.

    Args:
        events: the events.
        v: velocities at the start, or what the method carries, shape (*block, *batch).
        y: coordinates, likewise.
        before: first bad steps of earlier runs, as of ``engine.advance``.
        carried: whether ``v`` is what the method carries.
    """

    def __init__(self, events: Sequence[Event], v: Array, y: Array, before: Whole | None, carried: bool) -> None:
        self._events, self._start = events, (v, y, before, carried)
        self._driver: _Driver | None = None

    def advance(self, plan: engine.Plan) -> engine.Outcome:
        """Make the run."""
        check_room(self._events, plan)
        self._driver = (_Resetting if any(event.then for event in self._events) else _Driver)(plan, self._events)
        return self._driver.run(*self._start)

    def write_to(self, run: Any) -> None:
        """Write events, and the times and statuses of members that they stopped, to the result."""
        assert self._driver is not None
        run.events, run.stopped_at = self._driver.occurrences(), self._driver.stops()
        run.changed_by = names_of_changing(self._events)
        if run.stopped_at is not None and (stopped := ~np.isnan(run.stopped_at)).any():
            run.status = np.where(stopped, Status.EVENT, run.status).astype(np.int8)
            run.encounter = run.overshoots = None  # these go through all of the steps
        self._driver.write_rests(run)


class _Driver(Collected):
    """The run of all members."""

    def __init__(self, plan: engine.Plan, events: Sequence[Event]) -> None:
        super().__init__(plan, events)
        total = plan.members
        self.saves = plan.saves
        blocks = plan.system.v_shape, plan.system.y_shape
        self.saved = tuple(np.empty((len(self.saves), *shape, total)) for shape in blocks)
        self.slot = np.empty((*plan.slot_shape[: plan.slot_axes], total))
        self.first_bad = np.full(total, -1, dtype=np.int64)
        self.done = 0

    def run(self, v: Array, y: Array, before: Whole | None, carried: bool) -> engine.Outcome:
        plan, total = self.plan, self.plan.members
        numbers = max(1, prod(plan.system.v_shape) + prod(plan.system.y_shape))
        axes = v.ndim - len(plan.batch)  # of v, or of the slot if carried
        v, y = v.reshape(*v.shape[:axes], total), y.reshape(*plan.system.y_shape, total)
        bad = self.first_bad.copy() if before is None else before.reshape(-1)
        size = max(1, NUMBERS_AT_ONCE // numbers)
        self.cover(plan.t0 + plan.first * plan.dt, plan.t0 + (plan.first + plan.steps) * plan.dt)
        if (looked := self._sought()) is not None:
            return self._by_core(looked, v, y, bad, carried)
        if not carried:
            self._begin(v, y)
        for first in range(0, total, size):
            index = np.arange(first, min(first + size, total))
            self._group(index, At(v[..., index], y[..., index], bad[index], carried), size)
        self._rest(size)
        return self._outcome()

    def _sought(self) -> by_core.Sought | None:
        """The events as the core takes them; None where it cannot look for them."""
        return by_core.sought(self)

    def _by_core(self, sought: by_core.Sought, v: Array, y: Array, bad: Whole, carried: bool) -> engine.Outcome:
        """The run by the core, which looks for the events itself."""
        plan, batch = self.plan._replace(record=()), self.plan.batch
        if sought.repeats and not plan.begins:
            noticing = watched(self.quantities, self.members.plan(np.arange(min(2, plan.members))))
            plan = plan._replace(watched=None if noticing.quantities.reads_time else noticing)
        v, y = v.reshape((*v.shape[:-1], *batch)), y.reshape((*y.shape[:-1], *batch))
        out = run_by_core(plan, engine.model(plan), v, y, bad.reshape(batch), carried, make=partial(by_core.made, self, sought))
        if plan.progress is not None:
            plan.progress(1.0)
        return out

    def _begin(self, v: Array, y: Array) -> None:
        """Begin at these states."""

    def _rest(self, size: int) -> None:
        """Go on with members that were put off."""

    def _group(self, index: Whole, at: At, most: int, done: int = 0) -> None:
        """All further steps of some members; those that stop leave the group."""
        plan, piece = self.plan, FIRST_STEPS
        some = self.members.plan(index)
        while done < plan.steps and len(index):
            now = some._replace(first=plan.first + done, record=(), progress=None)
            size = max(1, most // LEAST_STEPS)
            if len(index) > size:  # too few states of so many members fit
                for first in range(0, len(index), size):
                    these = np.arange(first, min(first + size, len(index)))
                    self._group(index[these], at.some(these), most, done)
                return
            now = now._replace(steps=min(max(1, min(piece, most // len(index), MOST_STEPS)), plan.steps - done), every=1)
            out = advanced(now, at)
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

    def _save(self, done: int, steps: int, index: Whole, *states: Array) -> None:
        """Save the states at the steps of ``saves``."""
        first, last = np.searchsorted(self.saves, done, "left"), np.searchsorted(self.saves, done + steps, "right")
        if first == last:
            return
        where, members = self.saves[first:last] - done, slice(index[0], index[-1] + 1)
        for saved, state in zip(self.saved, states, strict=True):
            if len(index) == index[-1] + 1 - index[0]:
                saved[first:last, ..., members] = state[where]
            else:
                saved[first:last][..., index] = state[where]

    def _may(self, now: engine.Plan, index: Whole, out: engine.Outcome) -> tuple[Known, list[Any]]:
        """A function that gives these steps, and in which of them each event may change its sign."""
        v, y = states = tuple(np.moveaxis(each, 0, axes) for each, axes in zip((out.v, out.y), now.block_axes, strict=True))
        t: Any = now.t0 + ((now.first + np.arange(now.steps + 1)) * now.dt)[:, np.newaxis]
        parameters = self.members.numbers(index)
        g = [quantity(t, v, y, parameters) for quantity in self.quantities]
        may = [self.may_change(e, index, t, each) for e, each in enumerate(g)]
        if (out.first_bad >= 0).any():
            ends = now.first + np.arange(1, now.steps + 1)[:, np.newaxis]
            may = [each & ((out.first_bad < 0) | (ends < out.first_bad)) for each in may]

        def known(e: int, row: Whole, place: Whole) -> Changes:
            begins, ends = ([each[..., row + later, place] for each in states] for later in (0, 1))
            number = now.first + row
            low, high, h = np.zeros(len(row)), np.ones(len(row)), np.full(len(row), now.dt)
            begin, end = (now.t0_of(place) + (number + later) * now.dt for later in (0, 1))
            values = g[e][row, place], g[e][row + 1, place]
            return Changes(row, place, index[place], number, begin, h, end, low, high, *values, *begins, *ends)

        return known, may

    def _look(self, now: engine.Plan, index: Whole, out: engine.Outcome, done: int) -> Any:
        """Find the events within these steps. Returns which members stop."""
        known, may = self._may(now, index, out)
        stops = self.take(index, now.steps, [self.changes(e, each, known) for e, each in enumerate(may)])
        if stops is None:
            return np.zeros(len(index), dtype=bool)
        after = np.searchsorted(self.saves, done + stops.row, "right")
        for place in np.unique(after[stops.which]):
            these = stops.which & (after == place)
            for saved, state in zip(self.saved, (stops.at.v, stops.at.y), strict=True):
                saved[place:][..., index[these]] = state[..., these]
        return stops.which

    def write_rests(self, run: Any) -> None:
        """Write which members came to rest at an event."""

    def _outcome(self) -> engine.Outcome:
        """The outcome as of a run without events, without the sum of a control."""
        batch, blocks = self.plan.batch, (self.plan.system.v_shape, self.plan.system.y_shape)
        of_slot = self.plan.slot_shape[: self.plan.slot_axes]
        shapes = (len(self.saves), *blocks[0]), (len(self.saves), *blocks[1]), of_slot
        v, y, slot = (
            each.reshape((*shape, *batch)).astype(self.plan.dtype, copy=False)
            for each, shape in zip((*self.saved, self.slot), shapes, strict=True)
        )
        first_bad = self.first_bad.reshape(batch)
        diverged = bool((first_bad >= 0).any())
        return engine.Outcome(v, y, slot, first_bad, {}, None, diverged)


class _Resetting(_Driver):
    """A run with events that change the state: the steps of a group end at its first such event and go on from there."""

    def __init__(self, plan: engine.Plan, events: Sequence[Event]) -> None:
        super().__init__(plan, events)
        self.resets = Resets(self)
        self.rests = np.full(plan.members, -1)
        #: Members that events let go later: where they are then, and how many steps are made before.
        self.later: list[tuple[Whole, At, int]] = []

    def _sought(self) -> by_core.Sought | None:
        return by_core.sought(self, self.resets.new_states)

    def _by_core(self, sought: by_core.Sought, v: Array, y: Array, bad: Whole, carried: bool) -> engine.Outcome:
        out = super()._by_core(sought, v, y, bad, carried)
        self.resets.take(self.rested, self.rests)
        return out._replace(work=None)

    def _begin(self, v: Array, y: Array) -> None:
        plan = self.plan
        t = np.broadcast_to(plan.t0 + plan.first * plan.dt, plan.batch).reshape(-1)
        self.resets.begin(t, np.full(plan.members, plan.dt), v, y)

    def _rest(self, size: int) -> None:
        while self.later:
            index, at, done = self.later.pop()
            self._group(index, at, size, done)

    def _group(self, index: Whole, at: At, most: int, done: int = 0) -> None:
        plan, piece, some = self.plan, FIRST_STEPS, self.members.plan(index)
        while done < plan.steps and len(index):
            size = max(1, most // LEAST_STEPS)
            if len(index) > size:
                for first in range(0, len(index), size):
                    these = np.arange(first, min(first + size, len(index)))
                    self._group(index[these], at.some(these), most, done)
                return
            steps = min(max(1, min(piece, most // len(index), MOST_STEPS)), plan.steps - done)
            now = some._replace(first=plan.first + done, steps=steps, every=1, record=(), progress=None)
            out = advanced(now, at)
            before = self.before[:, index]
            known, may = self._may(now, index, out)
            steps_of = [known(e, *np.nonzero(each)) for e, each in enumerate(may)]
            changes, held = zip(*(self.resets.within(e, each) for e, each in enumerate(steps_of)), strict=True)
            # All members go to the end of the first step in which one of them stops or goes on from another state.
            ends = [each.some(self.ends(e, each.member)) for e, each in enumerate(changes)]
            ends += [each.some(where) for each, where in zip(steps_of, held, strict=True)]
            fresh = self.resets.fresh(index)
            row = 0 if fresh.any() else min([steps, *(each.row.min() for each in ends if len(each.row))])
            at_event: Any = fresh & (row == 0)
            for each in ends:
                at_event[each.place[each.row == row]] = True
            now = now._replace(steps=min(row + 1, steps))
            if now.steps < steps:
                self.before[:, index] = before
                out = advanced(now, at)
                known, _ = self._may(now, index, out)
            self.take(
                index, now.steps, [each.some((each.row < row) | ((each.row == row) & ~at_event[each.place])) for each in changes]
            )
            others, t = np.flatnonzero(~at_event), now.t0 + (now.first + now.steps) * now.dt
            t = np.broadcast_to(t, now.batch)[others]
            self.resets.leave(index[others], t, out.v[-1][..., others], out.y[-1][..., others])
            slot: Array = out.slot
            gone: Any = np.zeros(len(index), dtype=bool)
            if row < steps:
                slot, gone = self._through(now, index, out, known, np.flatnonzero(at_event), row)
            later = int(done > 0)  # the start is saved already, and a state that is computed from a carry differs from it
            self._save(done + later, now.steps - later, index, out.v[later:], out.y[later:])
            at = At(slot, out.y[-1], out.first_bad, True)
            self.slot[..., index], self.first_bad[index] = at.slot, at.bad
            if gone.any():
                self._stay(index, gone, out, done + row)
                self.done += int(gone.sum()) * (plan.steps - done - now.steps)
                self._wait(index[gone], out.v[-1][..., gone], out.y[-1][..., gone], done + now.steps)
                index, at = index[~gone], at.some(~gone)
                some = self.members.plan(index) if len(index) else some
            self.done += now.steps * len(gone)
            done, piece = done + now.steps, 2 * now.steps if row < steps else 4 * piece
            if plan.progress is not None:
                plan.progress(self.done / (plan.steps * plan.members))

    def _wait(self, index: Whole, v: Array, y: Array, done: int) -> None:
        """Go on later with members at rest, from the first step at whose end the event that holds them does so no longer."""
        plan, held = self.plan, np.flatnonzero(self.resets.may_go_on(self.rests, index))
        h = np.full(len(index), plan.dt)
        while len(held) and done < plan.steps:
            steps = min(max(1, NUMBERS_AT_ONCE // (len(held) * max(1, len(v) + len(y)))), MOST_STEPS, plan.steps - done)
            places, numbers = np.tile(held, steps), plan.first + done + np.arange(steps)[:, np.newaxis]
            t0, of_all = plan.t0_of(index[held]), (steps, len(held))
            starts, t = (np.broadcast_to(t0 + (numbers + later) * plan.dt, of_all).reshape(-1) for later in (0, 1))
            state = v[..., places], y[..., places]
            holds = self.resets.holds(self.rests[index[places]], index[places], t, h[places], *state)
            for _, timed in self.timed:
                holds &= timed.after(index[places], self.way * starts)[0] > self.way * t
            holds = holds.reshape(steps, len(held))
            first = np.where(holds.all(axis=0), steps, np.argmin(holds, axis=0))
            for step in np.unique(first[first < steps]):
                some = held[first == step]
                member, begin = index[some], done + int(step)
                slot: Array = v[..., some]
                if plan.method.begins:
                    anew = self.members.plan(member)._replace(first=plan.first + begin)
                    slot = engine.to_slot(anew, v[..., some], y[..., some])
                self.later.append((member, At(slot, y[..., some], np.full(len(some), -1), True), begin))
                self.rests[member], self.stopped_at[member] = -1, np.nan
                self.done -= len(some) * (plan.steps - begin)
            held, done = held[first == steps], done + steps

    def _through(
        self, now: engine.Plan, index: Whole, out: engine.Outcome, known: Known, which: Whole, row: int
    ) -> tuple[Array, Any]:
        """Take some members through the last of these steps. Returns what all carry then, and which of them stop."""
        step = known(0, np.full(len(which), row), which)
        member = index[which]
        end = now.t0_of(which) + (step.step + 1) * now.dt
        states = step.v, step.y, step.v_end, step.y_end
        arrived = self.resets.through(Stretch(member, step.step, step.t, end - step.t, *states, self.resets.at[:, member]))
        out.v[-1][..., which], out.y[-1][..., which] = arrived.v, arrived.y
        self.resets.at[:, member], self.before[:, member] = arrived.at, np.nan
        gone, self.rests[member] = ~np.isnan(arrived.t), arrived.rests
        self.stopped_at[member[gone]] = arrived.t[gone]
        slot = out.slot
        if now.method.begins:
            anew = self.members.plan(member)._replace(first=now.first + now.steps)
            slot[..., which] = engine.to_slot(anew, arrived.v, arrived.y)
        else:
            slot = out.v[-1]
        stops = np.zeros(len(index), dtype=bool)
        stops[which[gone]] = True
        return slot, stops

    def _stay(self, index: Whole, gone: Any, out: engine.Outcome, step: int) -> None:
        """Save the states of members that stop in this step, also for all later saves."""
        place = int(np.searchsorted(self.saves, step, "right"))
        for saved, state in zip(self.saved, (out.v[-1], out.y[-1]), strict=True):
            saved[place:][..., index[gone]] = state[..., gone]
        self.first_bad[index[gone]], self.slot[..., index[gone]] = -1, np.nan

    def write_rests(self, run: Any) -> None:
        rests = (self.rests >= 0).reshape(self.plan.batch)
        if rests.any():
            run.status = np.where(rests, Status.REST, run.status).astype(np.int8)
            run.findings += (self.resets.of_rest(self.rests, self.stopped_at),)
