"""Events of a run with fixed or adaptive steps: changes of sign are counted, located and kept."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from ...base.arrays import Array, Whole
from ...reference.events import LEAST_SHARE, Parts, bends, located, may_change, parted
from .. import engine
from ..occurrences import Occurrences
from .event import Event
from .members import Members
from .parts import Changes, Located, is_no_time, nothing, ordinals
from .timed import Timed, Zeros
from .traced import Quantity
from .trials import Trials

#: This many changes of sign are located together: enough for the overhead of NumPy's calls not to count.
LOCATED_AT_ONCE = 1 << 12

#: The slope, towards the side from which it came, that a quantity gets if it begins at zero with slope zero.
LEAST_SLOPE = float(np.finfo(float).tiny)
#: A slope towards the other side counts as zero if it is less than this share of the slope at the end of the step: a bounce
#: without speed leaves such a slope.
NO_SLOPE = 2.0**-24

#: A share of a step that counts as its start, where there is nothing to locate.
AT_START = LEAST_SHARE

#: From an event, the numbers of whole steps and of members among those that are searched, to these steps.
Known = Callable[[int, Whole, Whole], Changes]


class Stops(NamedTuple):
    """Which members end in some steps, in which of these, where they are then, and what occurs there, as ``sides_before`` says.

    ``size`` is for each event the largest |g| at the ends of the part in which it changes its sign.
    """

    which: Any
    row: Whole
    at: Located
    side: Array
    due: Any
    size: Array


class Collected:
    """The events of all members of a plan."""

    def __init__(self, plan: engine.Plan, events: Sequence[Event], trials: type[Trials] = Trials) -> None:
        self.plan, self.events = plan, events
        self.members = Members(plan)
        values, by_core = self.members.numbers(slice(None)), plan.backend == "rust"
        self.trials = trials(plan, self.members)
        self.quantities = [self._quantity(event, values, by_core=by_core) for event in events]
        #: Times of a plan that goes backward are negated, but not in occurrences.
        self.sign = -1.0 if plan.backward else 1.0
        #: The direction of a plan's times.
        self.way = 1.0 if plan.dt > 0.0 else -1.0
        #: What locates changes of sign of an event in place of ``located``: the core.
        self.locator: Callable[[int, Changes], tuple[Array, Array, Array]] | None = None
        self.stopped_at = np.full(plan.members, np.nan)
        #: Each quantity one state before those that are searched next; NaN where it is not known.
        self.before = np.full((len(events), plan.members), np.nan)
        self.clear()

    def _quantity(self, event: Event, values: dict[str, Any], *, by_core: bool) -> Quantity | Timed:
        """The quantity of an event, or its times, if these do not depend on the state."""
        plan, way = self.plan, -1.0 if self.plan.backward or self.plan.dt < 0.0 else 1.0
        if event.times is not None:
            return Timed(event, plan.system, plan.batch, way)
        quantity = Quantity(event, plan.system, values, by_core=by_core)
        if quantity.of_time_alone:
            t0, zeros = float(np.min(plan.t0)), Zeros(quantity, values)
            if zeros.solved(t0 - 1.0, t0 + 1.0) is not None:
                return Timed(event, plan.system, plan.batch, way, zeros)
        return quantity

    @property
    def timed(self) -> list[tuple[int, Timed]]:
        """The events with known times, and their numbers."""
        return [(e, each) for e, each in enumerate(self.quantities) if isinstance(each, Timed)]

    def cover(self, begin: Any, end: Any) -> None:
        """Know the times of events from one time of the plan to another."""
        for _, each in self.timed:
            each.cover(self.sign * float(np.min(begin)), self.sign * float(np.max(end)))

    def clear(self) -> None:
        """Remove all occurrences."""
        #: With adaptive steps by the core: the members whose steps a saved time changed.
        self.other_steps = np.zeros(self.plan.members, dtype=bool)
        #: Of members at rest, by the core, what ``Resets.rested`` takes.
        self.rested: list[tuple[int, int, bool, float, list[bool]]] = []
        self.count = np.zeros((len(self.events), self.plan.members), dtype=np.int64)
        self.entries: list[list[Located]] = [[] for _ in self.events]
        self.waiting: list[list[Changes]] = [[] for _ in self.events]

    def changes(self, e: int, may: Any, known: Known) -> Changes:
        """Where one event changes its sign, in steps in which it may, an array of shape (steps, members)."""
        return self.within(e, known(e, *np.nonzero(may)))[0]

    def within(self, e: int, steps: Changes, at: Array | None = None) -> tuple[Changes, Whole]:
        """The parts of whole steps in which one event changes its sign, and which steps return to it within roundings.

        ``at`` is the side from which members came that begin at the event, where it changed their state; 0 for others.
        """
        member, t, h = steps.member, steps.t, steps.h

        def look(which: Any, share: Array) -> tuple[Array, Array, Array, Array]:
            index, part = member[which], share * h[which]
            v, y = self.trials.step(index, t[which], part, steps.v[..., which], steps.y[..., which])
            there = t[which] + part
            g = self.quantity(e, there, v, y, self.members.numbers(index))
            return g, self.slope(e, index, there, h[which], v, y), v, y

        if not len(member):
            return steps, member
        if isinstance(timed := self.quantities[e], Timed):
            return self._at_times(timed, steps), member[:0]
        slope, slope_end = (
            self.slope(e, member, at_time, h, *state)
            for at_time, state in ((t, (steps.v, steps.y)), (t + h, (steps.v_end, steps.y_end)))
        )
        g = steps.g
        if at is not None:
            lies = (slope == 0.0) | ((slope * at < 0.0) & (np.abs(slope) <= NO_SLOPE * np.abs(slope_end)))
            g, slope = np.where(at != 0.0, 0.0, g), np.where((at != 0.0) & lies, at * LEAST_SLOPE, slope)
        whole = Parts(np.arange(len(t)), steps.low, steps.high, g, steps.g_end, slope, slope_end, steps.v_end, steps.y_end)
        parts, stuck = parted(look, whole)
        if at is not None:
            stuck = stuck[at[stuck] != 0.0]
        if direction := self.events[e].direction:
            parts = parts.some(parts.g_low * direction < 0.0)
        of = steps.some(parts.of)._replace(low=parts.low, high=parts.high, g=parts.g_low, g_end=parts.g_high)
        return of._replace(v_end=parts.v, y_end=parts.y), stuck

    def _at_times(self, timed: Timed, steps: Changes) -> Changes:
        """The times of an event in these steps, as parts without a length."""
        found, of, key = [], np.arange(len(steps.t)), self.way * steps.t
        while len(of):
            key, sign = timed.after(steps.member[of], key)
            inside = key <= self.way * steps.t_end[of]
            of, key = of[inside], key[inside]
            found.append((of, key, sign[inside]))
        of, key, sign = (np.concatenate(each) for each in zip(*found, strict=True))
        here = sign * timed.event.direction <= 0.0
        order = np.flatnonzero(here)[np.lexsort((key[here], of[here]))]
        some, t, sign = steps.some(of[order]), self.way * key[order], sign[order]
        if not len(t):
            return some
        v, y = self.trials.step(some.member, some.t, t - some.t, some.v, some.y)
        at_end = t == some.t_end
        v, y = (np.where(is_no_time(some.t, t), *each) for each in zip((some.v, some.y), (v, y), strict=True))
        v, y = (np.where(at_end, *each) for each in zip((some.v_end, some.y_end), (v, y), strict=True))
        share = np.where(at_end, 1.0, (t - some.t) / some.h)
        return some._replace(low=share, high=share, g=sign, g_end=-sign, v_end=v, y_end=y)

    def quantity(self, e: int, t: Array, v: Array, y: Array, numbers: dict[str, Any]) -> Array:
        """The quantity of one event at times of the plan."""
        return self.quantities[e](self.sign * t, v, y, numbers)

    def may_change(self, e: int, index: Whole, t: Array, g: Array) -> Any:
        """In which steps of these members an event may change its sign, from the times and its values at their ends."""
        if isinstance(timed := self.quantities[e], Timed):
            key = np.broadcast_to(self.way * t, g.shape)
            return timed.after(index, key[:-1])[0] <= key[1:]
        may = may_change(self.before[e, index], g)
        self.before[e, index] = g[-2]
        return may

    def may_bend(self, e: int, index: Whole, t: Array, h: Array, v: Array, y: Array, g: Array) -> Any:
        """In which adaptive steps of these members an event may change its sign twice, from values and slopes at their ends.

        Args:
            e: the number of the event.
            index: the members.
            t: times before the first step and after each, shape (steps + 1, members).
            h: lengths of the steps, shape (steps, members).
            v: velocities at these times, shape (*block, steps + 1, members).
            y: coordinates there.
            g: the quantity there, shape (steps + 1, members).
        """
        many, lengths = np.tile(index, len(t)), np.concatenate([h, h[-1:]])
        flat = (each.reshape(*each.shape[:-2], t.size) for each in (v, y))
        with np.errstate(all="ignore"):
            slope = self.slope(e, many, t.reshape(-1), lengths.reshape(-1), *flat).reshape(t.shape)
            end = slope[1:] * (lengths[:-1] / lengths[1:])
        of, low, high, unused = np.zeros(h.shape, dtype=np.int64), np.zeros(h.shape), np.ones(h.shape), np.zeros((0, *h.shape))
        return bends(Parts(of, low, high, g[:-1], g[1:], slope[:-1], end, unused, unused))

    def slope(self, e: int, index: Any, t: Array, h: Array, v: Array, y: Array) -> Array:
        """By how much the quantity would change in a step at the present rates."""
        rates = self.trials.rates(index, t, h, v, y)
        return self.quantities[e].slope(self.sign * t, v, y, self.members.numbers(index), self.sign * h, *rates)

    def take(self, index: Whole, steps: int, changes: list[Changes]) -> Stops | None:
        """Count and keep changes of sign, up to the first terminal event of each member; None if no member stops.

        Args:
            index: the members.
            steps: the number of steps.
            changes: those of each event, in the order of time of each member.
        """
        # The step in which a member stops; later ones do not count.
        last = np.full(len(index), steps)
        for e, each in enumerate(changes):
            ends = each.some(self.ends(e, each.member))
            np.minimum.at(last, ends.place, ends.row)
        stops = last < steps
        in_last: list[tuple[Located, Changes]] = []
        for e, (each, event) in enumerate(zip(changes, self.events, strict=True)):
            if stops.any():
                mine = each.some(each.row == last[each.place])
                in_last.append((self.located(e, mine), mine))
                each = each.some(each.row < last[each.place])
            if len(each.row):
                within_most = ordinals(each.member) + self.count[e, each.member] <= event.most
                self.count[e, index] += np.bincount(each.place, minlength=len(index))
                self._put_off(e, each.some(within_most))
        return self._stopped(index, in_last, last, stops) if stops.any() else None

    def ends(self, e: int, member: Whole) -> Any:
        """Which of these next occurrences, each member's in the order of time, end its run or change its state."""
        event = self.events[e]
        if event.then is not None:
            return np.ones(len(member), dtype=bool)
        return ordinals(member) + self.count[e, member] >= event.terminal if event.terminal else np.zeros(len(member), dtype=bool)

    def _stopped(self, index: Whole, in_last: list[tuple[Located, Changes]], last: Whole, stops: Any) -> Stops:
        """End members at the first event of their last step that ends them."""
        share, times = np.full(len(index), np.inf), np.full(len(index), np.nan)
        v, y = (np.full((*shape, len(index)), np.nan) for shape in (self.plan.system.v_shape, self.plan.system.y_shape))
        step, size = np.zeros(len(index), dtype=np.int64), np.zeros((len(self.events), len(index)))
        for e, (each, changes) in enumerate(in_last):
            member = changes.place
            first = np.flatnonzero(self.ends(e, each.member))
            first = first[np.unique(member[first], return_index=True)[1]]
            first = first[each.share[first] < share[member[first]]]
            ends, who = each.some(first), member[first]
            share[who], times[who], step[who], v[..., who], y[..., who] = ends.share, ends.t, ends.step, ends.v, ends.y
            np.maximum.at(size[e], member, np.maximum(np.abs(changes.g), np.abs(changes.g_end)))
        at = Located(index, step, share, times, v, y)
        side, due = self.sides_before(in_last, at)
        for e, (each, changes) in enumerate(in_last):
            self.note(e, each.some(each.share < share[changes.place]))  # later ones are not in the run
        self.stopped_at[index[stops]] = times[stops]
        self.end_at(at, due)
        return Stops(stops, last, at, side, due, size)

    def end_at(self, at: Located, due: Any) -> None:
        """The occurrences where members end: all that are due, since nothing changes their states."""
        for e, each in enumerate(due):
            self.note(e, at.some(each))

    def sides_before(self, found: list[tuple[Located, Changes]], at: Located) -> tuple[Array, Any]:
        """For each event the side of its quantity just before an instant of some members, and whether it occurs then.

        Where its change of sign was located at the instant or later, in a part that begins before, the side is that of the part's
        beginning. It occurs if it was located just there, or if its quantity is across or at zero, as it may be by roundings.
        """
        numbers, due = self.members.numbers(at.member), np.zeros((len(self.events), len(at.member)), dtype=bool)
        side = np.array([np.sign(self.quantity(e, at.t, at.v, at.y, numbers)) for e in range(len(self.events))])
        for e, (each, changes) in enumerate(found):
            share, timed = at.share[changes.place], isinstance(self.quantities[e], Timed)
            around = (each.t * self.way <= at.t[changes.place] * self.way if timed else changes.low <= share) & (
                share <= each.share
            )
            around[around] = ordinals(changes.place[around]) == 1
            who, came = changes.place[around], np.sign(changes.g[around])
            due[e, who] = (each.share[around] == at.share[who]) | (came * side[e, who] <= 0.0) | timed
            side[e, who] = came
        return side, due

    def note(self, e: int, entries: Located) -> None:
        """Count these, and keep the first ones."""
        few = ordinals(entries.member) + self.count[e, entries.member] <= self.events[e].most
        np.add.at(self.count[e], entries.member, 1)
        self.entries[e].append(entries.some(few))

    def _put_off(self, e: int, changes: Changes) -> None:
        """Locate these later, with others."""
        self.waiting[e].append(changes)
        if sum(len(each.member) for each in self.waiting[e]) >= LOCATED_AT_ONCE:
            self.locate_waiting(e)

    def locate_waiting(self, e: int) -> None:
        """Locate the changes that wait."""
        waiting, self.waiting[e] = self.waiting[e], []
        if waiting:
            together = Changes(*(np.concatenate(each, axis=-1) for each in zip(*waiting, strict=True)))
            for first in range(0, len(together.member), LOCATED_AT_ONCE):
                self.entries[e].append(self.located(e, together.some(slice(first, first + LOCATED_AT_ONCE))))

    def located(self, e: int, changes: Changes) -> Located:
        """Locate these changes of sign."""
        member, t, length = changes.member, changes.t, changes.h
        if isinstance(timed := self.quantities[e], Timed):
            at = self.way * timed.nearest(member, self.way * (t + changes.high * length))
            return Located(member, changes.step, changes.high, at, changes.v_end, changes.y_end)

        def trial(which: Any, share: Array) -> tuple[Array, Array, Array]:
            index, h = member[which], share * length[which]
            v, y = self.trials.step(index, t[which], h, changes.v[..., which], changes.y[..., which])
            return self.quantity(e, t[which] + h, v, y, self.members.numbers(index)), v, y

        if self.locator is not None and len(member):
            share, v, y = self.locator(e, changes)
        else:
            ends = changes.low, changes.high, changes.g, changes.g_end
            share, v, y = located(trial, *ends, changes.v_end, changes.y_end)
        return Located(member, changes.step, share, t + np.where(share > AT_START, share, 0.0) * length, v, y)

    def stops(self) -> Array | None:
        """When a terminal event stopped each member; None without such events."""
        ends = any(event.terminal or event.then for event in self.events)
        return np.asarray(self.sign * self.stopped_at.reshape(self.plan.batch)) if ends else None

    def occurrences(self) -> dict[str, Occurrences]:
        """The occurrences of each event, by name."""
        blocks, by_name = (self.plan.system.v_shape, self.plan.system.y_shape), {}
        for e, (event, count) in enumerate(zip(self.events, self.count, strict=True)):
            self.locate_waiting(e)
            entries = self.entries[e]
            member, step, share, t, v, y = (np.concatenate(each, axis=-1) for each in zip(nothing(blocks), *entries, strict=True))
            # Shares do not order a step that is made in parts, since each part has its own.
            order = np.lexsort((share, np.sign(self.plan.dt) * t, step, member))
            v, y = (np.ascontiguousarray(np.moveaxis(each[..., order], -1, 0)) for each in (v, y))
            numbers = count.reshape(self.plan.batch)
            by_name[event.name] = Occurrences(event.name, numbers, member[order], step[order], self.sign * t[order], v, y)
        return by_name
