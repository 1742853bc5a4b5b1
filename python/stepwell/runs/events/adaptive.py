"""A run with events and adaptive steps: some attempts are made at a time, and events are searched between their states.

An event that changes the state ends a part of the member's run. The next part begins from the new state as a run does, with a
new first step; only the sizes to which errors are relative are those of all parts.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from math import prod
from typing import Any

import numpy as np

from ...base import checks
from ...base.arrays import Array, Whole
from ...reference.adaptive import sizes
from .. import engine
from ..result import Status
from . import by_core
from .attempts import Attempts, attempted
from .collected import AT_START, Collected, Stops
from .event import Event, names_of_changing
from .parts import Changes, Located
from .resets import LARGEST_RATIO, MOST_IN_A_STEP, NO_TIME, SETTLED, Resets
from .traced import Quantity
from .trials import AdaptiveTrials

#: As ``engine.adapt``, for members of a whole run and with the times at which they stop.
Keep = Callable[..., engine.Adapted]

#: Numbers of the states that are searched together: a megabyte, which stays in a cache.
NUMBERS_AT_ONCE = 1 << 17
#: Few attempts are made first, since a member may stop early; then twice as many together each time, up to the most.
FIRST_ATTEMPTS, MOST_ATTEMPTS = 16, 1 << 10
#: Groups of members are small enough for at least this many attempts of each to be searched together.
LEAST_ATTEMPTS = 16
#: Times between changes of the state that shrink geometrically have a limit. A member is set to it when no more than this share
#: of its time is left until then; and also, however they shrink, when the last one is less than NO_FLIGHT of its time.
LEFT_OF_SERIES, NO_FLIGHT = 2.0**-20, 2.0**-44
#: A member whose state was changed within this share of its time so far as often as it may be within a step of fixed length is
#: at rest, by whatever events: these follow each other within no time, or are too many to be followed.
RECENT = 2.0**-10
#: Before the first step this share of the run is taken as the length of a step.
SHARE_OF_RUN = 2.0**-10
#: Where an event holds a member, this many times of the rest of the run are looked at for whether it lets it go.
LOOKS = 1 << 10


class AdaptiveRun:
    """A run with events, in place of ``engine.adapt``: first the events are found, up to where each member stops.

    Then the run is made up to there as without events, and returns the same states and counts.
    """

    def __init__(self, events: Sequence[Event], keep: Keep | None = None) -> None:
        self._events, self._keep = events, keep
        self._driver: _Driver | None = None

    def adapt(self, plan: engine.Plan, pacing: engine.Pacing, paces: Array, v: Array, y: Array) -> engine.Adapted:
        """Make the run."""
        numbers = 3 + prod(plan.system.v_shape) + prod(plan.system.y_shape)
        rows = sum(numbers * min(event.most, int(event.terminal) or pacing.budget) for event in self._events)
        checks.fits("the events", rows, plan.batch, "keep fewer of each by Event(…, most=…) or split the batch")
        driver = self._begun(plan, pacing, paces)
        looked = driver.sought()
        # The first step of a series that goes on is made before it is looked at.
        is_seen = pacing.begins or not plan.method.has_series
        in_lanes = looked is not None and self._keep is None and is_seen and driver.goes_in_lanes()
        out = driver.made(looked, paces, v, y) if in_lanes and looked is not None else None
        if out is None:
            driver = self._begun(plan, pacing, paces) if in_lanes else driver
            driver.locator = None if looked is None else partial(by_core.located, driver, looked)
            out = driver.run(paces, v, y)
        if plan.progress is not None:
            plan.progress(1.0)
        return out

    def _begun(self, plan: engine.Plan, pacing: engine.Pacing, paces: Array) -> _Driver:
        """A driver that has not found anything."""
        changing = any(event.then for event in self._events)
        self._driver = (_Resetting if changing else _Driver)(plan, self._events, pacing, paces)
        self._driver.keep = self._keep
        return self._driver

    def write_to(self, run: Any) -> None:
        """Write events, and the times and statuses of members that they stopped, to the result."""
        assert self._driver is not None
        by_themselves, stops = run.stopped_at, self._driver.stops()
        run.events, run.changed_by = self._driver.occurrences(), names_of_changing(self._events)
        if stops is not None:
            run.status = np.where(np.isnan(stops), run.status, Status.EVENT).astype(np.int8)
            run.stopped_at = stops if by_themselves is None else np.where(np.isnan(stops), by_themselves, stops)
        self._driver.write_rests(run)


class _Driver(Collected):
    """The run of all members."""

    #: Makes the run and saves states of its steps; None if steps are not saved.
    keep: Keep | None = None

    def __init__(self, plan: engine.Plan, events: Sequence[Event], pacing: engine.Pacing, paces: Array) -> None:
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
        if not pacing.begins:
            rows = np.broadcast_to(paces.reshape(self.numbers, -1), (self.numbers, total))
            # A held step was searched before, up to the last time of the run that goes on.
            self.since, self.begin = np.where(rows[engine.HELD] > 0.0, rows[engine.TARGET], -np.inf), rows[engine.TIME]
        self.cover(self.begin, self.end)

    def run(self, paces: Array, v: Array, y: Array) -> engine.Adapted:
        """Find all events, then make the run up to where members stop."""
        everyone = np.arange(self.plan.members)
        self._search(everyone, paces, v, y)
        return self.stepped(self.plan, self.pacing, everyone, paces, v, y)

    def sought(self) -> by_core.Sought | None:
        """The events as the core takes them; None where it cannot look for them."""
        return by_core.sought(self)

    def goes_in_lanes(self) -> bool:
        """True if the core may make this run with its events."""
        return True

    def made(self, sought: by_core.Sought, paces: Array, v: Array, y: Array) -> engine.Adapted | None:
        """The run by the core; None if it is to be made here.

        Its events are those of the steps without saved times. An extra step to a saved time with too large an error makes the
        next ones shorter, so that events of such members are found here.
        """
        out = engine.adapt(self.plan, self.pacing, paces, v, y, make=partial(by_core.adapted, self, sought))
        others = np.flatnonzero(self.other_steps)
        if len(others) and any(event.terminal or event.then for event in self.events):
            return None
        if len(others):
            for entries in self.entries:
                entries[:] = [each.some(~self.other_steps[each.member]) for each in entries]
            self.count[:, others] = 0
            self._search(others, paces, v, y)
        return out

    def _search(self, index: Whole, paces: Array, v: Array, y: Array) -> None:
        """Find the events of some members, from the start of the run."""
        system, total = self.plan.system, self.plan.members
        rows = np.broadcast_to(paces.reshape(self.numbers, -1), (self.numbers, total))
        blocks = v.reshape(*system.v_shape, total), y.reshape(*system.y_shape, total)
        v, y = (block[..., index] for block in blocks)
        self.look(index, rows[:, index], v, y, self.pacing.begins)

    def look(self, index: Whole, paces: Array, v: Array, y: Array, begins: bool) -> None:
        """Find the events of some members, from where they stand."""
        numbers = 2 + prod(self.plan.system.v_shape) + prod(self.plan.system.y_shape)
        size = max(1, NUMBERS_AT_ONCE // (numbers * LEAST_ATTEMPTS))
        for first in range(0, len(index), size):
            some = slice(first, first + size)
            most = max(1, NUMBERS_AT_ONCE // numbers)
            self._group(index[some], paces[:, some], v[..., some], y[..., some], most, begins)

    def _group(self, index: Whole, paces: Array, v: Array, y: Array, most: int, begins: bool) -> None:
        """All attempts of some members; those that stop, or are at the end, leave the group."""
        together = FIRST_ATTEMPTS
        some = self.members.plan(index)._replace(progress=None)
        while len(index):
            attempts = max(1, min(together, most // len(index), MOST_ATTEMPTS))
            jumps = self.jumps if self.jumps is None or self.jumps.ndim == 1 else self.jumps[:, index]
            out = attempted(some, self.end[index], attempts, self.pacing.budget, begins, np.ascontiguousarray(paces), v, y, jumps)
            before = np.zeros((2, len(index))) if begins else paces[engine.COUNTS][:2]
            longest = paces[engine.PACE_NUMBERS : engine.PACE_NUMBERS + engine.groups_of(self.plan)]
            stopped = self._look(some, index, out, before, longest, not begins)
            after = out.paces[engine.COUNTS][:2].sum(axis=0)
            # Members make no further attempt if none is left, or if a step no longer moves the time.
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

    def _look(self, now: engine.Plan, index: Whole, out: Attempts, before: Array, longest: Array, goes_on: bool) -> Any:
        """Find the events within these steps. Returns which members stop."""
        v, y = states = tuple(np.moveaxis(each, 0, axes) for each, axes in zip((out.v, out.y), now.block_axes, strict=True))
        parameters, h = self.members.numbers(index), out.lengths(now)
        g = [self.quantity(e, out.t, v, y, parameters) for e in range(len(self.events))]
        may, moves = [self.may_change(e, index, out.t, each) for e, each in enumerate(g)], out.t[1:] > out.t[:-1]
        for e in (e for e, each in enumerate(self.quantities) if isinstance(each, Quantity)):
            may[e] |= self.may_bend(e, index, out.t, h, v, y, g[e])
        self.looks(index, out, may)
        if not np.any([each.any() for each in may]):
            return np.zeros(len(index), dtype=bool)
        taken = np.concatenate([np.zeros((1, len(index))), np.cumsum(moves, axis=0)]) + before[0]

        def known(e: int, row: Whole, place: Whole) -> Changes:
            begins, ends = ([each[..., row + later, place] for each in states] for later in (0, 1))
            step, places = taken[row, place].astype(np.int64), (row, place)
            low, high, values = np.zeros(len(row)), np.ones(len(row)), (g[e][places], g[e][row + 1, place])
            time = out.t[places], h[places], out.t[row + 1, place]
            return Changes(row, place, index[place], step, *time, low, high, *values, *begins, *ends)

        changes = [self.parts(e, known(e, *np.nonzero(each & moves))) for e, each in enumerate(may)]
        # Steps that go beyond the end, or began before this run, are in it only in part.
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
        for all_stops, state in zip(self.stop_state, (stops.at.v, stops.at.y), strict=True):
            all_stops[..., whose] = state[..., which]
        row = stops.row[which]
        self.attempts[whose] = before.sum(axis=0)[which] + row + 1
        self.steps[whose] = taken[row + 1, np.flatnonzero(which)]
        self.left(whose, np.flatnonzero(which), row, longest, out, stops)
        return which

    def looks(self, index: Whole, out: Attempts, may: list[Any]) -> None:
        """Mark steps in ``may`` that are searched whatever the values at their ends are."""

    def parts(self, e: int, steps: Changes) -> Changes:
        """Where one event changes its sign in these steps."""
        return self.within(e, steps)[0]

    def left(self, member: Whole, place: Whole, row: Whole, longest: Array, out: Attempts, stops: Stops) -> None:
        """Note members that stop in these steps; ``longest`` are the largest sizes of each group before them."""

    def write_rests(self, run: Any) -> None:
        """Write which members came to rest at an event."""

    def stepped(self, plan: engine.Plan, pacing: engine.Pacing, index: Whole, paces: Array, v: Array, y: Array) -> engine.Adapted:
        """The run of some members as without events; those that stopped make attempts only up to their stop."""
        stopped_at = self.stopped_at[index]
        stopped, plan = ~np.isnan(stopped_at), plan._replace(progress=None)
        adapt = engine.adapt if self.keep is None else partial(self.keep, index=index, until=stopped_at)
        if not stopped.any():
            return adapt(plan, pacing, paces, v, y)
        batch, total, rejected = plan.batch, plan.members, 1 + engine.COUNTS.start
        # Attempts that they may not make any more count as rejected before.
        spare = np.where(stopped, pacing.budget - self.attempts[index], 0.0)
        start_paces = np.broadcast_to(paces.reshape(self.numbers, -1), (self.numbers, total)).copy()
        start_paces[rejected] += spare
        out = adapt(plan, pacing, start_paces.reshape(self.numbers, *batch), v, y)
        last, status = out.paces.reshape(self.numbers, total).copy(), out.status.reshape(total).copy()
        last[rejected] -= spare
        last[engine.TIME, stopped], last[engine.WORK, stopped] = stopped_at[stopped], np.nan
        last[engine.COUNTS.start, stopped] = self.steps[index[stopped]]
        status[stopped] = 0
        at = pacing.at if pacing.at.ndim == 1 else np.broadcast_to(pacing.at, (len(pacing.at), *batch))
        later = (at.reshape(len(at), -1) >= stopped_at) & stopped
        states = []
        for saved, at_end, all_stops in zip((out.v, out.y), (out.last_v, out.last_y), self.stop_state, strict=True):
            stop = all_stops[..., index]
            block = saved.reshape(len(pacing.at), *stop.shape)
            np.copyto(block, stop, where=np.expand_dims(later, tuple(range(1, stop.ndim))))
            ends = np.where(stopped, stop, np.reshape(at_end, stop.shape))
            states.append((block.reshape(saved.shape), ends.reshape(saved.shape[1:])))
        (saved_v, last_v), (saved_y, last_y) = states
        paces, status = last.reshape(self.numbers, *batch), status.reshape(batch)
        return out._replace(v=saved_v, y=saved_y, last_v=last_v, last_y=last_y, paces=paces, status=status)


class _Resetting(_Driver):
    """A run with events that change the state, part by part: members with a changed state make their next parts together."""

    def __init__(self, plan: engine.Plan, events: Sequence[Event], pacing: engine.Pacing, paces: Array) -> None:
        super().__init__(plan, events, pacing, paces)
        self._resets, total = Resets(self), plan.members
        #: The time and the state at the start of each member's part, the length of its last part, the ratio to that before.
        self._start, self._flight, self._ratio = (np.full(total, np.nan) for _ in range(3))
        self._state = tuple(np.full_like(each, np.nan) for each in self.stop_state)
        self._longest = np.zeros((engine.groups_of(plan), total))
        #: Of members whose part ended in these steps: what occurs there, as of ``Stops``, and the lengths of their steps.
        self._sides, self._sizes = (np.zeros((len(events), total)) for _ in range(2))
        self._due, self._lengths = np.zeros((len(events), total), dtype=bool), np.zeros(total)
        self._shares, self._steps = np.full(total, np.nan), np.zeros(total, dtype=np.int64)
        #: When the count of recent changes began, and that count.
        self._recent, self._changes = np.array(self.begin, dtype=np.float64), np.zeros(total, dtype=np.int64)
        #: The number of the event at which a member is at rest; else −1.
        self._rests = np.full(total, -1)

    def sought(self) -> by_core.Sought | None:
        return by_core.sought(self, self._resets.new_states, self.jumps)

    def goes_in_lanes(self) -> bool:
        """A control's sum would end at a change."""
        return self.plan.system.control is None

    def made(self, sought: by_core.Sought, paces: Array, v: Array, y: Array) -> engine.Adapted | None:
        try:
            out = super().made(sought, paces, v, y)
        except by_core.NoBeginningError:
            return None
        self._resets.take(self.rested, self._rests)
        return out

    def run(self, paces: Array, v: Array, y: Array) -> engine.Adapted:
        system, total, batch = self.plan.system, self.plan.members, self.plan.batch
        shapes, times = (system.v_shape, system.y_shape), len(self.pacing.at)
        if self.pacing.begins:
            self._start[:] = np.broadcast_to(self.plan.t0, batch).reshape(-1)
            begins = [block.reshape(*shape, total) for block, shape in zip((v, y), shapes, strict=True)]
            self._state = tuple(block.copy() for block in begins)
            self._resets.begin(self._start, SHARE_OF_RUN * (self.end - self._start), *begins)
        out = super().run(paces, v, y)
        saved = [np.array(each).reshape(times, *shape, total) for each, shape in zip((out.v, out.y), shapes, strict=True)]
        ends = [np.array(each).reshape(*shape, total) for each, shape in zip((out.last_v, out.last_y), shapes, strict=True)]
        rows, status = out.paces.reshape(self.numbers, total).copy(), out.status.reshape(total).copy()
        at, index = np.broadcast_to(self.pacing.at.reshape(times, -1), (times, total)), self._going_on(np.arange(total))

        def keep(index: Whole, since: Array, states: Sequence[Array], last: Sequence[Array]) -> None:
            later = at[:, index] >= since
            for all_saved, all_ends, state, end in zip(saved, ends, states, last, strict=True):
                where = np.expand_dims(later, tuple(range(1, all_ends.ndim)))
                all_saved[..., index], all_ends[..., index] = np.where(where, state, all_saved[..., index]), end

        while len(index):
            self._go_on_anew(index)
            over = ~np.isnan(self.stopped_at[index])
            there = [each[..., index[over]] for each in self.stop_state]
            keep(index[over], self._start[index[over]], there, there)
            rows[engine.TIME, index[over]] = self.stopped_at[index[over]]
            free, wakes = self._let_go(index)
            index, later = index[~over | free], index[wakes]
            if not len(index):
                index = later
                continue
            v, y = (each[..., index] for each in self._state)
            since = self._start[index]  # a part that begins at a jump begins just after it
            plan, pacing, pace = self._begun(index, np.ascontiguousarray(at[:, index]), rows[:, index], v, y)
            self.look(index, pace, v, y, begins=False)
            part = self.stepped(plan, pacing, index, pace, v, y)
            keep(index, since, (part.v, part.y), (part.last_v, part.last_y))
            rows[:, index], status[index] = part.paces, part.status
            index = np.sort(np.concatenate([self._going_on(index), later]))
        return out._replace(
            v=saved[0].reshape(out.v.shape),
            y=saved[1].reshape(out.y.shape),
            last_v=ends[0].reshape(out.last_v.shape),
            last_y=ends[1].reshape(out.last_y.shape),
            paces=rows.reshape(out.paces.shape),
            status=status.reshape(batch),
        )

    def _going_on(self, index: Whole) -> Whole:
        """Which of these members ended a part: at an event that changes the state, or that stops them."""
        on: Whole = index[self._due[:, index].any(axis=0)]
        return on

    def _go_on_anew(self, index: Whole) -> None:
        """Change the states of these members, which then go on, or are at rest, or stop."""
        t, v, y = self.stopped_at[index], *(each[..., index] for each in self.stop_state)
        ended = Located(index, self._steps[index], self._shares[index], t, v, y)
        known = self._sides[:, index], self._due[:, index], self._sizes[:, index]
        v, y, at, event, stops, circles = self._resets.happen(ended, self._lengths[index], *known, self._resets.at[:, index])
        with np.errstate(all="ignore"):
            returned = ((self._resets.at[:, index] != 0.0) & (at != 0.0)).any(axis=0)
            flight, since = np.where(returned, t - self._start[index], np.nan), t - self.begin[index]
            ratio = flight / self._flight[index]
            rest_of_series = np.where(ratio < 1.0, ratio / (1.0 - ratio), 0.0)
            settled = (np.abs(ratio - self._ratio[index]) <= SETTLED) & (ratio <= LARGEST_RATIO)
            settled &= flight * rest_of_series <= LEFT_OF_SERIES * since
            in_no_time = (flight <= NO_FLIGHT * since) | (ended.share <= AT_START)
            anew = t - self._recent[index] > RECENT * since
            self._recent[index] = np.where(anew, t, self._recent[index])
            self._changes[index] = np.where(anew, 0, self._changes[index] + 1)
            often = (self._changes[index] > MOST_IN_A_STEP) & ~(settled | in_no_time | circles)
            self._resets.often_since[index[often]] = self._recent[index[often]]
            rests = (settled | in_no_time | circles | often) & ~stops & (event >= 0)
            limit = np.where(settled, rest_of_series, 0.0)
            self._flight[index], self._ratio[index] = flight, ratio
            for block, earlier in zip((v, y), self._state, strict=True):
                block[...] = np.where(settled, block + (block - earlier[..., index]) * limit, block)
                earlier[..., index] = block
        self._rests[index[rests]] = event[rests]
        limit = np.where(settled, t + flight * limit, t)
        self.stopped_at[index] = np.where(rests | stops, np.minimum(limit, self.end[index]), np.nan)
        for all_stops, block in zip(self.stop_state, (v, y), strict=True):
            all_stops[..., index] = block
        self._start[index], self._resets.at[:, index], self.before[:, index] = t, at, np.nan
        self._due[:, index], self.since[index] = False, -np.inf

    def _let_go(self, index: Whole) -> tuple[Any, Any]:
        """Which of these members, if they are at rest, an event lets go before the end, and which meet a known time before.

        It is seen at some times, evenly apart, and at jumps, whether it does.
        """
        looked = np.flatnonzero(self._resets.may_go_on(self._rests, index))
        free, wakes = np.zeros((2, len(index)), dtype=bool)
        for place in looked:
            member = index[place : place + 1]
            begin, end = self.stopped_at[member], self.end[member]
            nexts = {e: float(timed.after(member, begin)[0][0]) for e, timed in self.timed}
            first = min(nexts.values(), default=np.inf)
            wakes[place] = first <= end[0]
            end = np.minimum(end, first)
            times = begin + (end - begin) * np.linspace(0.0, 1.0, LOOKS + 1)[1:]
            if self.jumps is not None:
                jumps = self.jumps if self.jumps.ndim == 1 else self.jumps[:, member[0]]
                times = np.sort(np.concatenate([times, np.nextafter(jumps[(jumps >= begin) & (jumps < end)], np.inf)]))
            many = np.repeat(member, len(times))
            of_all = self._rests[many], many
            state = self._state[0][..., many], self._state[1][..., many]
            holds = self._resets.holds(*of_all, times, self._lengths[many], *state)
            if holds.all():
                if wakes[place]:
                    v, y, numbers = *(each[..., member] for each in self._state), self.members.numbers(member)
                    for e in range(len(self.events)):
                        self._sides[e, member] = np.sign(self.quantity(e, end, v, y, numbers))
                        self._due[e, member] = nexts.get(e) == first
                    self._shares[member], self.stopped_at[member], self._rests[member] = 1.0, end, -1
                    self._sizes[:, member] = 0.0
                continue
            wakes[place] = False
            first = int(np.argmin(holds))
            last = times[first - 1 : first] if first else begin
            now = self._state[0][..., member], self._state[1][..., member]
            within = times[first : first + 1] - last
            share = self._resets.let_go(self._rests[member], member, last, within, self._lengths[member], *now)
            self._resets.led_back[self._rests[member], member] = self._resets.lain[self._rests[member], member] = False
            self._start[member], free[place] = last + share * within, True
            self._rests[member], self._flight[member], self.stopped_at[member] = -1, np.nan, np.nan
        return free, wakes

    def _begun(self, index: Whole, at: Array, rows: Array, v: Array, y: Array) -> tuple[engine.Plan, engine.Pacing, Array]:
        """Plan, pacing and paces of these members at the start of their next parts."""
        plan = self.members.plan(index)
        jumps = self.jumps if self.jumps is None or self.jumps.ndim == 1 else self.jumps[:, index]
        pacing = self.pacing._replace(at=at, begins=False, jumps=jumps)
        if (walls := engine.jumps_of(plan, pacing)) is not None:
            self._start[index] = walls.begun(self._start[index])
        pace = engine.begun_again(plan, rows, self._start[index], v, y)
        longest = slice(engine.PACE_NUMBERS, engine.PACE_NUMBERS + len(self._longest))
        pace[longest] = np.maximum(pace[longest], self._longest[:, index])
        return plan, pacing, pace

    def looks(self, index: Whole, out: Attempts, may: list[Any]) -> None:
        at = self._resets.at[:, index]
        if at.any():
            first = out.t[:-1] == self._start[index]
            for e, each in enumerate(may):
                each |= first & (at[e] != 0.0)

    def parts(self, e: int, steps: Changes) -> Changes:
        begins, zero = steps.t == self._start[steps.member], steps.g == 0.0
        side = np.where(begins | zero, self._resets.at[e, steps.member], 0.0)
        parts, stuck = self._resets.from_side(e, steps, side, zero & (~begins | self._resets.lain[e, steps.member]))
        led_back = np.flatnonzero((side != 0.0) & self._resets.led_back[e, steps.member])
        stuck = np.union1d(stuck, led_back)
        soon = (self._side(e, parts) != 0.0) & (parts.high <= NO_TIME)
        which = np.flatnonzero(soon & ~np.isin(parts.member, steps.member[stuck]))
        some = parts.some(which)
        leaves = ~self._resets.bounces(e, some.t, some.h, (some.v, some.y), some.member, self._resets.at[e, some.member])
        self._resets.at[e, some.member[leaves]] = 0.0
        stays = np.delete(np.arange(len(soon)), which[leaves])
        parts, soon = parts.some(stays), soon[stays]
        if not len(stuck) and not soon.any():
            return parts
        # A member that returns in no time is at the event where its step begins, and nothing else happens to it before.
        back = (steps.some(stuck), parts.some(soon))
        there = Changes(*(np.concatenate(pair, axis=-1) for pair in zip(*back, strict=True)))
        none = np.zeros(len(there.t))
        side = self._resets.at[e, there.member]
        there = there._replace(low=none, high=none + AT_START, g=side, v_end=there.v, y_end=there.y)
        parts = parts.some(~soon)
        together = Changes(*(np.concatenate(pair, axis=-1) for pair in zip(there, parts, strict=True)))
        return together.some(np.lexsort((together.high, together.row, together.place)))

    def _side(self, e: int, steps: Changes) -> Array:
        """The side from which members came to an event that changed the state where their steps begin; else 0."""
        return np.where(steps.t == self._start[steps.member], self._resets.at[e, steps.member], 0.0)

    def end_at(self, at: Located, due: Any) -> None:
        """Nothing yet: the run is made up to there first."""

    def left(self, member: Whole, place: Whole, row: Whole, longest: Array, out: Attempts, stops: Stops) -> None:
        self._sides[:, member], self._due[:, member] = stops.side[:, place], stops.due[:, place]
        self._sizes[:, member] = stops.size[:, place]
        self._shares[member], self._steps[member] = stops.at.share[place], stops.at.step[place]
        plan = self.plan
        self._lengths[member] = out.lengths(plan)[row, place]
        v, y = (np.moveaxis(each, 0, axes) for each, axes in zip((out.v, out.y), plan.block_axes, strict=True))
        so_far = np.maximum.accumulate(sizes(v, y, plan.block_axes, plan.acceptance.groups), axis=1)
        self._longest[:, member] = np.maximum(longest[:, place], so_far[:, row, place])

    def write_rests(self, run: Any) -> None:
        rests = (self._rests >= 0).reshape(self.plan.batch)
        if rests.any():
            run.status = np.where(rests, Status.REST, run.status).astype(np.int8)
            run.findings += (self._resets.of_rest(self._rests, self.stopped_at),)
