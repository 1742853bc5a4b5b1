"""What is found of the events of a run, however its steps are made: counted, located, and kept."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from .. import engine
from .._checks import Array
from ..reference.events import located
from ..reference.types import Whole
from .event import Event
from .members import Members
from .parts import Changes, Found, nothing, ordinals
from .result import Occurrences
from .traced import Quantity
from .trials import Trials

#: So many changes of sign are located together: enough that the calls of NumPy take less time than its work.
LOCATED_AT_ONCE = 1 << 12

#: Makes the changes of sign of one event, in these steps of these members.
Known = Callable[[int, Whole, Whole], Changes]


class Stops(NamedTuple):
    """Which of some members stop, in which of some steps, at which time and in which state."""

    which: Any
    step: Whole
    t: Array
    v: Array
    y: Array


class Collected:
    """The events of all members of a plan."""

    def __init__(self, plan: engine.Plan, events: Sequence[Event], trials: type[Trials] = Trials) -> None:
        self.plan, self.events = plan, events
        self.members = Members(plan)
        self.quantities = [Quantity(event, plan.system, self.members.numbers(slice(None))) for event in events]
        self.trials = trials(plan, self.members)
        self.stopped_at = np.full(plan.members, np.nan)
        self.clear()

    def clear(self) -> None:
        """Forget what was found."""
        self.count = np.zeros((len(self.events), self.plan.members), dtype=np.int64)
        self.found: list[list[Found]] = [[] for _ in self.events]
        self.waiting: list[list[Changes]] = [[] for _ in self.events]

    def take(self, index: Whole, steps: int, changes: list[Any], known: Known) -> Stops | None:
        """Count and keep changes of sign, up to the first terminal event of each member; None if no member stops.

        Args:
            index: the members.
            steps: how many there are.
            changes: of each event, in which steps it is, shape (steps, members).
            known: what is known of such changes; members are counted among these.
        """
        # The step in which a member stops; later ones do not count.
        last = np.full(len(index), steps)
        for each, event in zip(changes, self.events, strict=True):
            if event.terminal:
                last = np.minimum(last, np.where(each.any(axis=0), each.argmax(axis=0), steps))
        stops = last < steps
        if stops.any():
            changes = [each & (np.arange(steps)[:, np.newaxis] <= last) for each in changes]
        in_last: list[tuple[Found, Whole]] = []
        for e, (each, event) in enumerate(zip(changes, self.events, strict=True)):
            step, member = np.nonzero(each)
            if stops.any():
                mine = step == last[member]
                in_last.append((self.located(e, known(e, step[mine], member[mine])), member[mine]))
                step, member = step[~mine], member[~mine]
            if len(step):
                kept = ordinals(member) + self.count[e, index[member]] <= event.most
                self.count[e, index] += np.bincount(member, minlength=len(index))
                self._put_off(e, known(e, step[kept], member[kept]))
        return self._stopped(index, in_last, last, stops) if stops.any() else None

    def _stopped(self, index: Whole, in_last: list[tuple[Found, Whole]], last: Whole, stops: Any) -> Stops:
        """Let members stop at the first terminal event of their last step."""
        end, times = np.full(len(index), np.inf), np.full(len(index), np.nan)
        v, y = (np.empty((*shape, len(index))) for shape in (self.plan.system.v_shape, self.plan.system.y_shape))
        for (each, member), event in zip(in_last, self.events, strict=True):
            if event.terminal:
                first = each.share < end[member]
                ends, who = each.some(first), member[first]
                end[who], times[who], v[..., who], y[..., who] = ends.share, ends.t, ends.v, ends.y
        for e, ((each, member), event) in enumerate(zip(in_last, self.events, strict=True)):
            before_it = each.share <= end[member]  # what comes after the end of a member is not there
            kept = each.some(before_it)
            self.count[e, kept.member] += 1
            self.found[e].append(kept.some(self.count[e, kept.member] <= event.most))
        self.stopped_at[index[stops]] = times[stops]
        return Stops(stops, last, times, v, y)

    def _put_off(self, e: int, changes: Changes) -> None:
        """Locate these with others, as many at once as are quick together."""
        self.waiting[e].append(changes)
        if sum(len(each.member) for each in self.waiting[e]) >= LOCATED_AT_ONCE:
            self.locate_waiting(e)

    def locate_waiting(self, e: int) -> None:
        """Locate what was put off."""
        waiting, self.waiting[e] = self.waiting[e], []
        if waiting:
            together = Changes(*(np.concatenate(each, axis=-1) for each in zip(*waiting, strict=True)))
            for first in range(0, len(together.member), LOCATED_AT_ONCE):
                self.found[e].append(self.located(e, together.some(slice(first, first + LOCATED_AT_ONCE))))

    def located(self, e: int, changes: Changes) -> Found:
        """The places of these changes of sign."""
        member, t, length = changes.member, changes.t, changes.h

        def trial(which: Any, share: Array) -> tuple[Array, Array, Array]:
            index, h = member[which], share * length[which]
            v, y = self.trials.step(index, t[which], h, changes.v[..., which], changes.y[..., which])
            return self.quantities[e](t[which] + h, v, y, self.members.numbers(index)), v, y

        low, high = np.zeros(len(member)), np.ones(len(member))
        share, v, y = located(trial, low, high, changes.g, changes.g_end, changes.v_end, changes.y_end)
        return Found(member, changes.step, share, t + share * length, v, y)

    def stops(self) -> Array | None:
        """When a terminal event stopped each member; None without such events."""
        return self.stopped_at.reshape(self.plan.batch) if any(event.terminal for event in self.events) else None

    def occurrences(self) -> dict[str, Occurrences]:
        """Those of each event, by name."""
        blocks, made = (self.plan.system.v_shape, self.plan.system.y_shape), {}
        for e, (event, count) in enumerate(zip(self.events, self.count, strict=True)):
            self.locate_waiting(e)
            found = self.found[e]
            member, step, _, t, v, y = (np.concatenate(each, axis=-1) for each in zip(nothing(blocks), *found, strict=True))
            order = np.lexsort((step, member))
            v, y = (np.ascontiguousarray(np.moveaxis(each[..., order], -1, 0)) for each in (v, y))
            numbers = count.reshape(self.plan.batch)
            made[event.name] = Occurrences(event.name, numbers, member[order], step[order], t[order], v, y)
        return made
