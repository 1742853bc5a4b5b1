"""Events that change the state: a step with such events is made in parts, each from the state after the last event."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ...base.arrays import Array, Whole
from ...base.reprs import first_of, share
from ...errors import EventWarning
from ..findings import Finding
from .collected import Collected
from .parts import Changes
from .traced import NewState

#: A member whose state was changed more often than this within one step is at rest.
MOST_IN_A_STEP = 1000
#: Times between changes of the state shrink geometrically if their ratios differ by no more than this. The member is then set to
#: the limit of the geometric series of times and states, if that is within the step.
SETTLED, LARGEST_RATIO = 2.0**-30, 1.0 - 2.0**-20
#: If less than this share of a step is left after an event, that event is not searched there, since the motion may be less than
#: roundings. The search goes on from the start of the next step, as from where the state was changed.
LEAST_LEFT = 2.0**-36
#: A member that returns to an event within this share of its step does so in no time.
NO_TIME = 2.0**-100
#: After an event changed its state, a member is still at the event if |g| is at most this many times its value before, or the
#: share ``LEAST_LEFT`` of its values at the ends of the step. Else its state is elsewhere, as that of a neuron after a spike.
AT = 8.0
#: Whether an event leads a member back to itself is tested with the state this share of a step later.
FURTHER = 2.0**-10


#: Velocities and coordinates of some members.
State = tuple[Array, Array]


class Stretch(NamedTuple):
    """Members within a step, from a time on, as they move without a further event.

    Attributes:
        member: the members.
        step: the numbers of their steps.
        t: where the stretches begin.
        h: their lengths.
        v: velocities at their start, shape (*block, n).
        y: coordinates there.
        v_end: velocities at their end.
        y_end: coordinates there.
        at: for each event the side from which members came that are at it since it changed their state; 0 for others.
    """

    member: Whole
    step: Whole
    t: Array
    h: Array
    v: Array
    y: Array
    v_end: Array
    y_end: Array
    at: Array

    def some(self, which: Any) -> Stretch:
        """Some of them."""
        parts: Any = (each[..., which] for each in self)
        return Stretch(*parts)


class Ahead(NamedTuple):
    """What ends some stretches: the share of each, infinite if nothing does, whether the run stops there, and the state after it.

    ``event`` is the number of the event that changed the state, −1 without one.
    """

    share: Array
    stops: Any
    t: Array
    v: Array
    y: Array
    at: Array
    event: Whole


class Arrived(NamedTuple):
    """Where members are at the end of a step with events, or where they stopped before.

    Attributes:
        v: velocities, shape (*block, n).
        y: coordinates.
        at: for each event the side from which members came that are still at it.
        stops: which members a terminal event stopped.
        rests: for members at rest the number of the event that holds them or changes their state again and again, else −1.
        t: the time at which members stopped or came to rest, NaN for others.
    """

    v: Array
    y: Array
    at: Array
    stops: Any
    rests: Whole
    t: Array


class Resets:
    """Steps with events that change the state, of the members of a run or a world."""

    def __init__(self, run: Collected) -> None:
        parameters = run.members.numbers(slice(None))
        #: The direction of time.
        self._run, self._way = run, 1.0 if run.plan.dt > 0.0 else -1.0
        self._new_states = {
            e: NewState(event, run.plan.system, parameters) for e, event in enumerate(run.events) if event.then is not None
        }
        #: For each event the side from which members came that are at it since it changed their state in the last step.
        self.at = np.zeros((len(run.events), run.plan.members))
        #: Which members at an event it leads back to where they are.
        self.led_back = np.zeros(self.at.shape, dtype=bool)

    def begin(self, t: Array, h: Array, v: Array, y: Array) -> None:
        """Treat members that begin at an event with a direction as if it had changed their state: a ball lies on the ground.

        ``h`` is the approximate length of their steps.
        """
        numbers, everyone = self._run.members.numbers(slice(None)), np.ones(self.at.shape[1], dtype=bool)
        g = [self._run.quantity(e, t, v, y, numbers) for e in range(len(self._run.events))]
        self.begin_again(t, h, v, y, g, [everyone] * len(g), everyone)

    def begin_again(self, t: Array, h: Array, v: Array, y: Array, g: list[Array], changed: list[Any], moved: Any) -> None:
        """``begin`` for members that were moved, with their quantities, and for each event the members whose quantity changed."""
        run = self._run
        for e, new_state in self._new_states.items():
            there = np.where(g[e] == 0.0, -float(run.events[e].direction), 0.0)
            self.at[e] = np.where(changed[e], there, self.at[e])
            who = np.flatnonzero(moved & ((self.at[e] != 0.0) | (changed[e] & (g[e] == 0.0))))
            if len(who):
                before = v[..., who], y[..., who]
                after = new_state(run.sign * t[who], *before, run.members.numbers(who))
                side = self.at[e, who]
                if run.events[e].direction == 0:  # they can only be held on the side from which they would go on
                    side = np.where(side == 0.0, -np.sign(run.slope(e, who, t[who], h[who], *after)), side)
                self.led_back[e, who] = self._leads_back(e, t[who], h[who], before, after, who, side)
                self.at[e, who] = np.where(self.led_back[e, who], side, self.at[e, who])

    def changes(self, e: int) -> bool:
        """Whether an event changes the state."""
        return e in self._new_states

    def new_states(
        self, t: Array, h: Array, v: Array, y: Array, member: Whole, side: Array, size: Array
    ) -> tuple[Array, Array, Array, Whole]:
        """The states from which members go on, the sides from which they came to events where they still are, the last events.

        Args:
            t: the times of the events.
            h: the lengths of their steps.
            v: their velocities then, shape (*block, n).
            y: their coordinates.
            member: the members.
            side: for each event the sign of g before it if it changes the state of a member, else 0.
            size: for each event the largest |g| at the ends of the step.

        Returns:
            v, y, for each event its ``side`` if the new state is at the event, else 0, and the number of the last event.
        """
        run, before, at, event = self._run, (v, y), np.zeros_like(side), np.full(len(member), -1)
        v, y = v.copy(), y.copy()
        acting = [(e, who) for e in self._new_states if len(who := np.flatnonzero(side[e]))]
        for e, who in acting:
            state = v[..., who], y[..., who]
            v[..., who], y[..., who] = self._new_states[e](run.sign * t[who], *state, run.members.numbers(member[who]))
            event[who] = e
        for e, who in acting:
            numbers, old, new = run.members.numbers(member[who]), *((a[..., who], b[..., who]) for a, b in (before, (v, y)))
            there, now = (np.abs(run.quantity(e, t[who], *state, numbers)) for state in (old, new))
            at[e, who] = np.where(now <= np.maximum(AT * there, LEAST_LEFT * size[e, who]), side[e, who], 0.0)
            self.led_back[e, member[who]] = self._leads_back(e, t[who], h[who], old, new, member[who], at[e, who])
        return v, y, at, event

    def _leads_back(self, e: int, t: Array, h: Array, old: State, new: State, member: Whole, side: Array) -> Any:
        """Whether an event holds members where they are, such as the event of an empty tank that sets a level below zero to zero.

        It holds them if it changes their states by roundings only, the motion leads across it, and its change of the state after
        that leads them back by at least half of the way. A kick of zero also leaves a state as it is, but leads nothing back.
        """
        run, holds = self._run, side != 0.0
        if not holds.any():
            return holds
        numbers, rates = run.members.numbers(member), run.trials.rates(member, t, h, *new)
        with np.errstate(all="ignore"):
            for before, after, change in zip(old, new, rates, strict=True):
                same = np.abs(after - before) <= LEAST_LEFT * (np.abs(after) + np.abs(change))
                holds &= same.all(axis=tuple(range(same.ndim - 1)))
            v, y = (block + FURTHER * change for block, change in zip(new, rates, strict=True))
            t_further = t + FURTHER * h
            back = self._new_states[e](run.sign * t_further, v, y, numbers)
            g = run.quantity(e, t, *new, numbers)
            g_further, g_back = (run.quantity(e, t_further, *state, numbers) for state in ((v, y), back))
            across = side * (g - g_further)
            return holds & (across > 0.0) & (side * (g_back - g_further) >= 0.5 * across)

    def through(self, stretch: Stretch) -> Arrived:
        """Make one step of some members again, with its events."""
        n, end, step, way = len(stretch.member), stretch.t + stretch.h, np.abs(stretch.h), self._way
        v, y, at = stretch.v_end.copy(), stretch.y_end.copy(), np.zeros_like(stretch.at)
        times, stops, rests, live = np.full(n, np.nan), np.zeros(n, dtype=bool), np.full(n, -1), np.arange(n)
        flight, ratio = np.full(n, np.nan), np.full(n, np.nan)
        for resets in range(MOST_IN_A_STEP + 1):
            ahead, returns = self._ahead(stretch, step[live])
            with np.errstate(all="ignore"):
                last, flight = (
                    flight,
                    np.where(((stretch.at != 0.0) & (ahead.at != 0.0)).any(axis=0), ahead.t - stretch.t, np.nan),
                )
                before, ratio = ratio, flight / last
                rest_of_series = ratio / (1.0 - ratio)
                limit = ahead.t + flight * rest_of_series
                settled = (
                    (np.abs(ratio - before) <= SETTLED)
                    & (ratio <= LARGEST_RATIO)
                    & (way * limit < way * end[live])
                    & (returns < 0)
                )
            if settled.any():
                which = settled & (ahead.share < np.inf) & ~ahead.stops
                returns = np.where(which, ahead.event, returns)
                v_limit, y_limit = (
                    np.where(which, now + (now - earlier) * rest_of_series, earlier)
                    for now, earlier in ((ahead.v, stretch.v), (ahead.y, stretch.y))
                )
                stretch = stretch._replace(t=np.where(which, limit, stretch.t), v=v_limit, y=y_limit)
            if resets == MOST_IN_A_STEP:
                returns = np.where((ahead.share < np.inf) & ~ahead.stops, ahead.event, returns)
            rest, stop = returns >= 0, (returns < 0) & ahead.stops
            goes_on, arrives = (returns < 0) & (ahead.share < np.inf) & ~stop, (returns < 0) & ~(ahead.share < np.inf)
            for which, t, state in (
                (rest, stretch.t, (stretch.v, stretch.y)),
                (stop, ahead.t, (ahead.v, ahead.y)),
                (arrives, np.full(len(live), np.nan), (stretch.v_end, stretch.y_end)),
            ):
                who = live[which]
                times[who], v[..., who], y[..., who] = t[which], state[0][..., which], state[1][..., which]
            rests[live[rest]], stops[live[stop]] = returns[rest], True
            at[:, live[rest]] = stretch.at[:, rest]
            soon = np.abs(stretch.h) < LEAST_LEFT * step[live]
            at[:, live[arrives & soon]] = stretch.at[:, arrives & soon]
            if not goes_on.any():
                break
            live, flight, ratio = live[goes_on], flight[goes_on], ratio[goes_on]
            stretch = self._anew(stretch.member[goes_on], stretch.step[goes_on], end[live], ahead, goes_on)
        return Arrived(v, y, at, stops, rests, times)

    def _anew(self, member: Whole, step: Whole, end: Array, ahead: Ahead, which: Any) -> Stretch:
        """The rest of the steps, from the new states on."""
        t, v, y = ahead.t[which], ahead.v[..., which], ahead.y[..., which]
        h = self._way * np.maximum(self._way * (end - t), 0.0)
        # Where nothing is left of a step, Verlet would divide by its length.
        v_end, y_end = (np.where(h == 0.0, *each) for each in zip((v, y), self._run.trials.step(member, t, h, v, y), strict=True))
        return Stretch(member, step, t, h, v, y, v_end, y_end, ahead.at[:, which])

    def _ahead(self, stretch: Stretch, step: Array) -> tuple[Ahead, Whole]:
        """Note what happens up to the first end of each stretch. Returns the ends, and the event that holds a member, else −1."""
        run, n = self._run, len(stretch.member)
        share, returns, rows = np.full(n, np.inf), np.full(n, -1), np.arange(n)
        numbers, located, sizes = run.members.numbers(stretch.member), [], []
        ones, zeros = np.ones(n), np.zeros(n)
        for e, quantity in enumerate(run.quantities):
            g = quantity(stretch.t, stretch.v, stretch.y, numbers)
            g_end = quantity(stretch.t + stretch.h, stretch.v_end, stretch.y_end, numbers)
            head = zeros.astype(np.int64), rows, stretch.member, stretch.step, stretch.t, stretch.h
            whole = Changes(*head, zeros, ones, g, g_end, stretch.v, stretch.y, stretch.v_end, stretch.y_end)
            looked = np.flatnonzero(~((stretch.at[e] != 0.0) & (np.abs(stretch.h) < LEAST_LEFT * step)))
            changes, stuck = run.within(e, whole.some(looked), stretch.at[e, looked])
            if e in self._new_states:
                returns[looked[stuck]] = e
                returns[(stretch.at[e] != 0.0) & self.led_back[e, stretch.member]] = e
            occurs = run.located(e, changes)
            if e in self._new_states:  # in no time
                again = (stretch.at[e, changes.place] != 0.0) & (
                    self._way * (occurs.t - stretch.t[changes.place]) <= NO_TIME * step[changes.place]
                )
                returns[changes.place[again]] = e
            located.append((occurs, changes.place, np.sign(changes.g)))
            sizes.append(np.maximum(np.abs(g), np.abs(g_end)))
            ends = run.ends(e, occurs.member)
            np.minimum.at(share, changes.place[ends], occurs.share[ends])
        share[returns >= 0] = -np.inf  # nothing happens before
        stops, t, v, y = np.zeros(n, dtype=bool), stretch.t.copy(), stretch.v.copy(), stretch.y.copy()
        for e, (occurs, place, _) in enumerate(located):
            here = run.ends(e, occurs.member) & (occurs.share == share[place])
            t[place[here]], v[..., place[here]], y[..., place[here]] = occurs.t[here], occurs.v[..., here], occurs.y[..., here]
            stops[place[here]] |= e not in self._new_states
        side = np.zeros_like(stretch.at)
        for e, (occurs, place, before) in enumerate(located):
            run.note(e, occurs.some(occurs.share <= share[place]))
            if e in self._new_states:
                here = (occurs.share == share[place]) & ~stops[place]
                side[e, place[here]] = before[here]
        v, y, at, event = self.new_states(t, self._way * step, v, y, stretch.member, side, np.array(sizes))
        share[returns >= 0] = np.inf
        return Ahead(share, stops, t, v, y, at, event), returns

    def of_rest(self, rests: Whole, times: Array) -> Finding:
        """A finding of members at rest: each one's event by its number, −1 for others, and since when."""
        batch, is_at_rest = self._run.plan.batch, (rests >= 0).reshape(self._run.plan.batch)
        first = int(np.argmin(np.where(rests >= 0, self._way * times, np.inf)))
        some, place = int(is_at_rest.sum()), tuple(int(i) for i in np.unravel_index(first, batch)) if batch else ()
        if self.led_back[rests[first], first]:
            why = "its change of the state leads back onto it, and the motion across it, so that it does not go on"
        else:
            why = "changes of its state follow each other within no time, so that it does not go on by them"
        text = (
            f"{share(some, batch, is_at_rest.size)} came to rest at event {self._run.events[rests[first]].name}"
            f"{first_of(some, place, is_at_rest.size) or ','} at t = {self._run.sign * times[first]:.9g}: {why}"
        )
        return Finding(EventWarning, text, is_at_rest)
