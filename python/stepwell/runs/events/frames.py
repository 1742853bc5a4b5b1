"""Events of a world, searched for after each step. A step is repeated in parts if an event changes the state."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ... import _core
from ...base import checks
from ...base.arrays import Array, Whole
from ...errors import UnsupportedError
from .. import engine
from ..occurrences import Occurrences
from . import by_core
from .collected import Collected
from .event import Event
from .members import Members
from .parts import Changes
from .resets import Resets, Stretch
from .trials import Trials

#: The times of events are found for so many steps ahead.
STEPS_AHEAD = 1 << 10


class Frames(Collected):
    """Steps a world with events; used in place of the core's world.

    Args:
        plan: the world's plan; ``force`` is the world's array, which the user changes.
        events: the events.
        v: velocities, stepped in place.
        y: coordinates, stepped in place.
        loop: the core's world.
    """

    def __init__(
        self,
        plan: engine.Plan,
        events: Sequence[Event],
        v: Array,
        y: Array,
        loop: _core.World,
    ) -> None:
        if stops := [each for each in events if each.terminal]:
            raise UnsupportedError(
                f"events: no event stops a member of a world, got {stops[0]!r}; read world.events after a step, and write "
                f"into world.v and world.y"
            )
        super().__init__(plan, events)
        self._blocks, self._loop = (v, y), loop
        #: Takes the parameters that were written to, if they live.
        self.refresh: Callable[[], object] | None = None
        self._occurrences: dict[str, Occurrences] | None = None
        self._all = np.arange(plan.members)
        self._resets = Resets(self) if any(event.then for event in events) else None
        #: The events at which members are at rest, −1 for others; and the state and quantities after the last call.
        self._rests = np.full(plan.members, -1)
        self._left: tuple[list[Array], list[Array]] | None = None
        #: Whether the core looks for events; what it looks for, None where that has changed; and the force that it knows.
        self._by_core = not plan.single
        self._sought: by_core.Sought | None = None
        self._force: Array | None = None

    def renew(self, plan: engine.Plan) -> None:
        """Go on with other parameters."""
        self.plan, self.members, self._sought = plan, Members(plan), None
        self.trials = Trials(plan, self.members)

    def step(self, n: int = 1) -> bool:
        """Make n steps in place. ``World.events`` returns their events. Whether a number of the state is not finite then."""
        n = checks.count("n", n, 0)
        if self.refresh is not None:
            self.refresh()
        self.clear()
        self._occurrences = None
        begin = self.plan.t0 + self._loop.step_number * self.plan.dt
        for _, timed in self.timed:
            if not timed.covers(begin, begin + n * self.plan.dt):
                timed.cover(begin, begin + max(n, STEPS_AHEAD) * self.plan.dt)
                self._sought = None
        if self._by_core and (sought := self._looked_for()) is not None:
            diverged, found = self._loop.step_and_look(n, sought)
            by_core.take(self, found)
            return diverged
        g = self._quantities(self._loop.step_number)
        self._start_from(g)
        for _ in range(n):
            step, before = self._loop.step_number, [each.copy() for each in self._blocks]
            self._loop.step(1)
            after = self._quantities(self._loop.step_number)
            t: Any = self.plan.t0 + np.array([[step], [step + 1]]) * self.plan.dt
            may = [self.may_change(e, self._all, t, np.stack(ends)) for e, ends in enumerate(zip(g, after, strict=True))]
            if np.any(may) or (self._rests >= 0).any() or (self._resets is not None and self._resets.fresh(self._all).any()):
                g = self._after_a_step(step, may, g, after, before)
            else:
                g = after
        for e in range(len(self.events)):
            self.locate_waiting(e)
        self._left = [each.copy() for each in self._blocks], g
        return not all(np.isfinite(each).all() for each in self._blocks)

    def _looked_for(self) -> by_core.Sought | None:
        """The events as the core takes them; None if it cannot look for them, which stays so."""
        force = self.plan.force
        if force is not None and not np.array_equal(force, np.nan if self._force is None else self._force, equal_nan=True):
            self._with_force()
            self._force, self._sought = np.array(force), None
        if self._sought is None:
            self._sought = by_core.sought(self, {} if self._resets is None else self._resets.new_states)
            self._by_core = self._sought is not None
        return self._sought

    def _with_force(self) -> None:
        """Make trials with the force as it is now: the user may have changed it since the last call."""
        plan = self.plan._replace(force=np.array(self.plan.force))
        self.members = Members(plan)
        self.trials = Trials(plan, self.members)

    def _start_from(self, g: list[Array]) -> None:
        """Begin a call with these quantities. The search starts anew for members that the user moved since the last call."""
        t = np.full(len(self._all), self.plan.t0 + self._loop.step_number * self.plan.dt)
        h, (v, y) = np.full(len(self._all), self.plan.dt), self._flat(self._blocks)
        if self._left is None:
            if self._resets is not None:
                self._resets.begin(t, h, v, y)
            return
        blocks, last = self._left
        moved = np.zeros(len(self._all), dtype=bool)
        for now, then in zip(self._flat(self._blocks), self._flat(blocks), strict=True):
            moved |= (now != then).any(axis=tuple(range(now.ndim - 1)))
        self.before[:, moved] = np.nan
        self._rests[moved] = -1
        if self._resets is not None:
            changed = [now != then for now, then in zip(g, last, strict=True)]
            self._resets.begin_again(t, h, v, y, g, changed, moved)

    @property
    def last_occurrences(self) -> dict[str, Occurrences]:
        """The occurrences in the last call."""
        if self._occurrences is None:
            self._occurrences = self.occurrences()
        return self._occurrences

    def _quantities(self, step: int) -> list[Array]:
        """The quantities of all members at the present state."""
        t: Any = np.array(self.plan.t0 + step * self.plan.dt)
        parameters = self.members.numbers(slice(None))
        v, y = self._flat(self._blocks)
        return [quantity(t, v, y, parameters).copy() for quantity in self.quantities]  # copies, because the world steps in place

    def _flat(self, blocks: Sequence[Array]) -> tuple[Array, ...]:
        """Blocks with one axis for all members."""
        shapes = self.plan.system.v_shape, self.plan.system.y_shape
        return tuple(
            each.reshape(*shape, len(self._all)).astype(np.float64, copy=False)
            for each, shape in zip(blocks, shapes, strict=True)
        )

    def _after_a_step(self, step: int, may: list[Any], g: list[Array], after: list[Array], before: list[Array]) -> list[Array]:
        """Process the events of a step. Returns the quantities at its end."""
        if self.plan.force is not None:
            self._with_force()
        states = *self._flat(before), *self._flat(self._blocks)
        finite = np.logical_and.reduce([np.isfinite(each).all(axis=tuple(range(each.ndim - 1))) for each in states[2:]])
        t, end = (self.plan.t0 + each * self.plan.dt for each in (step, step + 1))

        def known(e: int, row: Whole, place: Whole) -> Changes:
            number, times, lengths, ends = (np.full(len(place), each) for each in (step, t, self.plan.dt, end))
            low, high, values = np.zeros(len(row)), np.ones(len(row)), (g[e][place], after[e][place])
            v, y, v_end, y_end = (each[..., place] for each in states)
            return Changes(row, place, place, number, times, lengths, ends, low, high, *values, v, y, v_end, y_end)

        rests = self._rests >= 0
        steps_of = [known(e, *np.nonzero(each & finite & ~rests)) for e, each in enumerate(may)]
        if self._resets is None:
            self.take(self._all, 1, [self.within(e, each)[0] for e, each in enumerate(steps_of)])
            return after
        changes, held = zip(*(self._resets.within(e, each) for e, each in enumerate(steps_of)), strict=True)
        goes_through = (self._resets.fresh(self._all) | rests) & finite
        for e, (each, where) in enumerate(zip(changes, held, strict=True)):
            goes_through[each.place[self.ends(e, each.member)]] = True
            goes_through[steps_of[e].place[where]] = True
        self.take(self._all, 1, [each.some(~goes_through[each.place]) for each in changes])
        index, others = np.flatnonzero(goes_through), np.flatnonzero(~goes_through)
        self._resets.leave(others, np.full(len(others), end), *(each[..., others] for each in states[2:]))
        if not len(index):
            return after
        ends, lengths = np.full(len(index), end), np.full(len(index), self.plan.dt)
        lying = self._resets.holds(self._rests[index], index, ends, lengths, *(each[..., index] for each in states[:2]))
        v, y = (each[..., index].copy() for each in states[:2])  # members at rest stay at rest
        for _, timed in self.timed:
            lying &= timed.after(index, np.full(len(index), self.way * t))[0] > self.way * end
        if not lying.all():
            moves = index[~lying]
            begin = np.full(len(moves), t)
            v_now, y_now, v_end, y_end = (each[..., moves] for each in states)
            steps, at = np.full(len(moves), step), self._resets.at[:, moves]
            arrived = self._resets.through(Stretch(moves, steps, begin, end - begin, v_now, y_now, v_end, y_end, at))
            v[..., ~lying], y[..., ~lying] = arrived.v, arrived.y
            self._resets.at[:, moves], self._rests[moves] = arrived.at, arrived.rests
        self._write(step + 1, index, v, y)
        self.before[:, index] = np.nan
        return self._quantities(step + 1)

    def _write(self, step: int, index: Whole, v: Array, y: Array) -> None:
        """Write the states of these members at this step, and leave the carry of the others as it is."""
        carry = self._loop.carry() if self.plan.method.begins else None
        for block, new in zip(self._blocks, (v, y), strict=True):
            block.reshape(*new.shape[:-1], len(self._all))[..., index] = new
        if carry is not None:
            slot = carry.reshape(*self.plan.slot_shape[: self.plan.slot_axes], len(self._all))
            slot[..., index] = engine.to_slot(self.members.plan(index)._replace(first=step), v, y)
            self._loop.carry_on(carry)
