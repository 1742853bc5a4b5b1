"""Events that change the state: a step with such events is made in parts, each from the state after the last event."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ...base.arrays import Array, Whole
from ...errors import EventWarning
from ...reference.events import located
from ..finding import Finding, named
from .collected import AT_START, Collected
from .parts import Changes, Located, is_no_time
from .traced import NewState

#: A member whose state was changed more often than this within one step is at rest.
MOST_IN_A_STEP = 1000
#: Times between changes of the state shrink geometrically if their ratios differ by no more than this. The member is then set to
#: the limit of the geometric series of times and states, if that is within the step.
SETTLED, LARGEST_RATIO = 2.0**-30, 1.0 - 2.0**-20
#: If less than this share of a step is left after an event, that event is not searched there, since the motion may be less than
#: roundings. The search goes on from the start of the next step, as from where the state was changed; and from that state, if the
#: event would have occurred again.
LEAST_LEFT = 2.0**-36
#: A member that returns to an event within this share of its step does so in no time.
NO_TIME = 2.0**-100
#: After an event changed its state, a member is still at the event if |g| is at most this many times its value before, or the
#: share ``LEAST_LEFT`` of its values at the ends of the step. Else its state is elsewhere, as that of a neuron after a spike.
AT = 8.0
#: At one instant each event occurs so many times at most. If its members then are not done, their events set each other off.
MOST_AT_ONCE = 100
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


class After(NamedTuple):
    """Members after an instant at which events occurred.

    Attributes:
        v: velocities, shape (*block, n).
        y: coordinates.
        at: for each event the side from which members came that are at it since it changed their state; 0 for others.
        event: the number of the last event that changed the state; −1 without one.
        stops: which members a terminal event stopped.
        circles: which members are given up, since their events set each other off again and again.
    """

    v: Array
    y: Array
    at: Array
    event: Whole
    stops: Any
    circles: Any


class Ahead(NamedTuple):
    """The ends of some stretches: the share of each, infinite if nothing ends it, the time, and members after it.

    ``g_end`` is each quantity where a stretch ends without that.
    """

    share: Array
    t: Array
    after: After
    g_end: Array


class Arrived(NamedTuple):
    """Where members are at the end of a step with events, or where they stopped before.

    Attributes:
        v: velocities, shape (*block, n).
        y: coordinates.
        at: for each event the side from which members came that are still at it.
        rests: for members at rest the number of the event that holds them or changes their state again and again, else −1.
        t: the time at which members stopped or came to rest, NaN for others.
    """

    v: Array
    y: Array
    at: Array
    rests: Whole
    t: Array


class Resets:
    """Steps with events that change the state, of the members of a run or a world."""

    def __init__(self, run: Collected) -> None:
        parameters = run.members.numbers(slice(None))
        #: The direction of time.
        self._run, self._way = run, 1.0 if run.plan.dt > 0.0 else -1.0
        self.new_states = {
            e: NewState(event, run.plan.system, parameters, by_core=run.plan.backend == "rust")
            for e, event in enumerate(run.events)
            if event.then is not None
        }
        #: For each event the side from which members came that are at it since it changed their state in the last step.
        self.at = np.zeros((len(run.events), run.plan.members))
        #: Which members at an event it leads back to where they are; which of them have been there for a step or more, with g at
        #: zero; and whose events set each other off without end, with these.
        self.led_back, self.lain, self.circles = (np.zeros(self.at.shape, dtype=bool) for _ in range(3))

        #: Since when the states of members were changed as often as they may be; NaN for others.
        self.often_since = np.full(run.plan.members, np.nan)

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
        for e, new_state in self.new_states.items():
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
            self.lain[e] &= ~changed[e]

    def take(self, rested: list[tuple[int, int, bool, float, list[bool]]], rests: Whole) -> None:
        """Take which members the core left at rest, at which events, and why."""
        for member, event, led_back, often_since, circle in rested:
            rests[member], self.led_back[event, member], self.often_since[member] = event, led_back, often_since
            self.circles[:, member] = circle

    def changes(self, e: int) -> bool:
        """True if an event changes the state."""
        return e in self.new_states

    def within(self, e: int, steps: Changes) -> tuple[Changes, Whole]:
        """As ``Collected.within`` for whole steps, where members may lie at the event; also the steps in which it holds them."""
        lies = self.lain[e, steps.member] & (steps.g == 0.0)
        return self.from_side(e, steps, np.where(lies, self.at[e, steps.member], 0.0), lies)

    def from_side(self, e: int, steps: Changes, side: Array, lies: Any) -> tuple[Changes, Whole]:
        """The changes from the sides from which members at the event came, 0 for others, and which of these lie there."""
        if not side.any():
            return self._run.within(e, steps)[0], np.zeros(0, dtype=np.int64)
        changes, stuck = self._run.within(e, steps, side)
        who = np.flatnonzero(lies & (side != 0.0))
        state = steps.v[..., who], steps.y[..., who]
        holds = self._leads_back(e, steps.t[who], steps.h[who], state, state, steps.member[who], side[who])
        return changes, np.union1d(stuck, who[holds])

    def leave(self, member: Whole, t: Array, v: Array, y: Array) -> None:
        """Forget from which side members came that lay at an event and have left it."""
        for e in self.new_states:
            who = np.flatnonzero(self.lain[e, member])
            if len(who):
                g = self._run.quantity(e, t[who], v[..., who], y[..., who], self._run.members.numbers(member[who]))
                gone = member[who[g != 0.0]]
                self.at[e, gone], self.lain[e, gone] = 0.0, False

    def fresh(self, member: Any) -> Any:
        """Which of these members begin where an event changed their state, or holds them."""
        return ((self.at[:, member] != 0.0) & ~(self.lain[:, member] & ~self.led_back[:, member])).any(axis=0)

    def may_go_on(self, rests: Whole, member: Whole) -> Any:
        """Which of these are at rest and may go on later: the event lets them go, or another comes at a known time."""
        return (rests[member] >= 0) & (self.led_back[rests[member], member] | bool(self._run.timed))

    def holds(self, rests: Whole, member: Whole, t: Array, h: Array, v: Array, y: Array) -> Any:
        """Which members at rest at these events would be so at these times."""
        holds = rests >= 0
        for e in self.new_states:
            who = np.flatnonzero((rests == e) & self.led_back[e, member])
            if len(who):
                state = v[..., who], y[..., who]
                holds[who] = self._leads_back(e, t[who], h[who], state, state, member[who], self.at[e, member[who]])
        return holds

    def let_go(self, rests: Whole, member: Whole, t: Array, within: Array, h: Array, v: Array, y: Array) -> Array:
        """After which share of a time the events let members at rest go; infinite where they do not by its end."""
        share = np.full(len(member), np.inf)
        which = np.flatnonzero((rests >= 0) & ~self.holds(rests, member, t + within, h, v, y))

        def trial(some: Any, part: Array) -> tuple[Array, Array, Array]:
            of = which[some]
            there = rests[of], member[of], t[of] + part * within[of], h[of], v[..., of], y[..., of]
            return np.where(self.holds(*there), -1.0, 1.0), *there[-2:]

        ones = np.ones(len(which))
        share[which] = located(trial, 0.0 * ones, ones, -ones, ones, v[..., which], y[..., which])[0]
        return share

    def happen(self, at: Located, h: Array, side: Array, due: Any, size: Array, lies: Array) -> After:
        """Make events occur at an instant of some members: those due, in the order of the list, and those that they set off.

        A change of the state sets off each event whose quantity it takes across zero or to zero, in the event's direction. An
        event that changed the state and at which the new state still is begins without a side: it is not set off.

        Args:
            at: the members, and where they are.
            h: the lengths of their steps.
            side: for each event the sign of its quantity just before.
            due: which events occur.
            size: for each event the largest |g| at the ends of the step.
            lies: for each event the side from which members came that are at it since it changed their state, or 0.
        """
        run, n, member, numbers = self._run, len(at.member), at.member, self._run.members.numbers(at.member)
        events, v, y, side, due = range(len(run.events)), at.v.copy(), at.y.copy(), side.copy(), due.copy()
        stops, event, came, acted = np.zeros(n, dtype=bool), np.full(n, -1), np.zeros_like(side), np.zeros_like(due)
        g = np.array([run.quantity(e, at.t, v, y, numbers) for e in events])
        lies, held = np.where(due, 0.0, lies), np.where(self.led_back[:, member], g, 0.0)
        lies = np.where((g == 0.0) | (held != 0.0), lies, 0.0)
        side = np.where(lies != 0.0, lies, side)
        near = np.maximum(np.where(due, AT * np.abs(g), 0.0), LEAST_LEFT * size)
        near[[e for e, _ in run.timed]] = -1.0  # members are at no event that comes by the time
        for _ in range(MOST_AT_ONCE):
            acted[:, due.any(axis=0)] = False
            for e in events:
                who = np.flatnonzero(due[e])
                if not len(who):
                    continue
                due[e, who], acted[e, who] = False, True
                ends = run.ends(e, member[who])
                self._note(e, at.some(who)._replace(v=v[..., who], y=y[..., who]))
                if e not in self.new_states:
                    side[e, who] = np.sign(g[e, who])
                    stops[who] |= ends
                    continue
                who = who[~stops[who]]
                t, state, of_them = at.t[who], (v[..., who], y[..., who]), run.members.numbers(member[who])
                v[..., who], y[..., who] = self.new_states[e](run.sign * t, *state, of_them)
                event[who], came[e, who] = e, side[e, who]
                for other in events:
                    last, now = g[other, who], run.quantity(other, t, v[..., who], y[..., who], of_them)
                    new_side = np.where(now == 0.0, side[other, who], np.sign(now))
                    if other == e:
                        new_side = np.where(np.abs(now) <= near[e, who], 0.0, new_side)
                    else:
                        crosses = (side[other, who] * now < 0.0) | ((now == 0.0) & (last != 0.0) & (side[other, who] != 0.0))
                        crosses &= side[other, who] * run.events[other].direction <= 0.0
                        due[other, who] |= crosses
                        new_side = np.where(due[other, who], side[other, who], new_side)
                    g[other, who], side[other, who] = now, new_side
            if not due.any():
                break
        here = np.where(came == 0.0, np.where(g == held, lies, 0.0), np.where(np.abs(g) <= near, came, 0.0))
        self.lain[:, member] = (here != 0.0) & (came == 0.0) & (g == 0.0)
        for e in self.new_states:
            who = np.flatnonzero(came[e])
            if len(who):
                old, new = ((each_v[..., who], each_y[..., who]) for each_v, each_y in ((at.v, at.y), (v, y)))
                self.led_back[e, member[who]] = self._leads_back(e, at.t[who], h[who], old, new, member[who], here[e, who])
        circles = due.any(axis=0) & ~stops
        self.circles[:, member[circles]], self.led_back[:, member[circles]] = acted[:, circles], False
        return After(v, y, here, event, stops, circles)

    def _note(self, e: int, entries: Located) -> None:
        """Note these occurrences, but for members at rest, which do not cross the event."""
        self._run.note(e, entries.some(entries.share > AT_START))

    def _leads_back(self, e: int, t: Array, h: Array, old: State, new: State, member: Whole, side: Array) -> Any:
        """True if an event holds members where they are, such as the event of an empty tank that sets a level below zero to zero.

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
            t_further, *states = self._further(e, t, h, new, rates, member)
            g = run.quantity(e, t, *new, numbers)
            g_further, g_back = (run.quantity(e, t_further, *state, numbers) for state in states)
            across = side * (g - g_further)
            return holds & (across > 0.0) & (side * (g_back - g_further) >= 0.5 * across)

    def bounces(self, e: int, t: Array, h: Array, state: State, member: Whole, side: Array) -> Any:
        """True if an event turns members back, or holds them, that begin at it, at rest, and are pushed across it.

        A little later its change of the state must not lead to the other side, as a damping does, of v to 0.9 v.
        """
        if not len(member):
            return np.zeros(0, dtype=bool)
        with np.errstate(all="ignore"):
            t, _, back = self._further(e, t, h, state, self._run.trials.rates(member, t, h, *state), member)
            return side * self._run.slope(e, member, t, h, *back) >= 0.0

    def _further(self, e: int, t: Array, h: Array, state: State, rates: State, member: Whole) -> tuple[Array, State, State]:
        """A little later: the time, the state there by these rates, and that which an event makes of it."""
        t = t + FURTHER * h
        v, y = (block + FURTHER * change for block, change in zip(state, rates, strict=True))
        return t, (v, y), self.new_states[e](self._run.sign * t, v, y, self._run.members.numbers(member))

    def through(self, stretch: Stretch) -> Arrived:
        """Make one step of some members again, with its events."""
        n, end, step, way = len(stretch.member), stretch.t + stretch.h, np.abs(stretch.h), self._way
        v, y, at = stretch.v_end.copy(), stretch.y_end.copy(), np.zeros_like(stretch.at)
        times, rests, live = np.full(n, np.nan), np.full(n, -1), np.arange(n)
        flight, ratio = np.full(n, np.nan), np.full(n, np.nan)
        for resets in range(MOST_IN_A_STEP + 1):
            ahead, returns = self._ahead(stretch, step[live])
            after, ends = ahead.after, ahead.share < np.inf
            with np.errstate(all="ignore"):
                last, flight = (
                    flight,
                    np.where(((stretch.at != 0.0) & (after.at != 0.0)).any(axis=0), ahead.t - stretch.t, np.nan),
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
                which = settled & ends & ~after.stops & ~after.circles
                returns = np.where(which, after.event, returns)
                v_limit, y_limit = (
                    np.where(which, now + (now - earlier) * rest_of_series, earlier)
                    for now, earlier in ((after.v, stretch.v), (after.y, stretch.y))
                )
                stretch = stretch._replace(t=np.where(which, limit, stretch.t), v=v_limit, y=y_limit)
            if resets == MOST_IN_A_STEP:
                often = ends & ~after.stops & ~after.circles & (returns < 0)
                returns = np.where(often, after.event, returns)
                self.often_since[stretch.member[often]] = (end - way * step)[live[often]]
            free = self._free(stretch, returns, step[live], ahead, may=resets < MOST_IN_A_STEP)
            flight, ratio = np.where(free, np.nan, flight), np.where(free, np.nan, ratio)
            rest, stop = (returns >= 0) & ~free, (returns < 0) & (after.stops | after.circles)
            goes_on, arrives = ((returns < 0) & ends & ~stop) | free, (returns < 0) & ~ends
            soon = np.abs(stretch.h) < LEAST_LEFT * step[live]
            falls = soon & (stretch.at * ahead.g_end < 0.0).any(axis=0)
            start, ends_at = (stretch.v, stretch.y), (stretch.v_end, stretch.y_end)
            for which, t, state in (
                (rest, stretch.t, start),
                (stop, ahead.t, (after.v, after.y)),
                (arrives, np.full(len(live), np.nan), [np.where(falls, *each) for each in zip(start, ends_at, strict=True)]),
            ):
                who = live[which]
                times[who], v[..., who], y[..., who] = t[which], state[0][..., which], state[1][..., which]
            rests[live[rest]], rests[live[after.circles]] = returns[rest], after.event[after.circles]
            at[:, live[rest]] = stretch.at[:, rest]
            at[:, live[arrives & soon]] = stretch.at[:, arrives & soon]
            lies, far = (stretch.at != 0.0) & (ahead.g_end == 0.0), arrives & ~soon
            at[:, live[far]], self.lain[:, stretch.member[far]] = np.where(lies, stretch.at, 0.0)[:, far], lies[:, far]
            if not goes_on.any():
                break
            live, flight, ratio = live[goes_on], flight[goes_on], ratio[goes_on]
            stretch = self._anew(stretch.member[goes_on], stretch.step[goes_on], end[live], ahead, goes_on)
        return Arrived(v, y, at, rests, times)

    def _free(self, stretch: Stretch, returns: Whole, step: Array, ahead: Ahead, *, may: bool) -> Any:
        """Which members an event that holds them lets go within their stretches. They go on from there, in the same state."""
        free, who = np.zeros(len(returns), dtype=bool), np.flatnonzero((returns >= 0) & may)
        if not len(who):
            return free
        some, events, h = stretch.some(who), returns[who], self._way * step[who]
        self.at[:, some.member] = some.at
        lies = ~self.led_back[events, some.member] & self.lain[events, some.member]
        self.led_back[events, some.member] |= lies  # where the motion across begins within the stretch
        share = self.let_go(events, some.member, some.t, some.h, h, some.v, some.y)
        self.led_back[events[lies], some.member[lies]] = np.isinf(share[lies])
        share[lies] = np.inf
        gone = share < np.inf
        free[who], go = gone, who[gone]
        self.led_back[events[gone], some.member[gone]] = self.lain[events[gone], some.member[gone]] = False
        ahead.t[go], ahead.after.at[:, go] = some.t[gone] + share[gone] * some.h[gone], some.at[:, gone]
        ahead.after.v[..., go], ahead.after.y[..., go] = some.v[..., gone], some.y[..., gone]
        return free

    def _anew(self, member: Whole, step: Whole, end: Array, ahead: Ahead, which: Any) -> Stretch:
        """The rest of the steps, from the new states on."""
        t, v, y = ahead.t[which], ahead.after.v[..., which], ahead.after.y[..., which]
        h = np.where(is_no_time(t, end), 0.0, self._way * np.maximum(self._way * (end - t), 0.0))
        # Where nothing is left of a step, Verlet would divide by its length.
        v_end, y_end = (np.where(h == 0.0, *each) for each in zip((v, y), self._run.trials.step(member, t, h, v, y), strict=True))
        return Stretch(member, step, t, h, v, y, v_end, y_end, ahead.after.at[:, which])

    def _ahead(self, stretch: Stretch, step: Array) -> tuple[Ahead, Whole]:
        """Note what happens up to the first end of each stretch. Returns the ends, and the event that holds a member, else −1."""
        run, n = self._run, len(stretch.member)
        share, returns, rows = np.full(n, np.inf), np.full(n, -1), np.arange(n)
        numbers, found, sizes, g_ends = run.members.numbers(stretch.member), [], [], []
        ones, zeros = np.ones(n), np.zeros(n)
        t0 = np.broadcast_to(run.plan.t0, run.plan.batch).reshape(-1)[stretch.member]
        step_end = t0 + (stretch.step + 1) * run.plan.dt
        for e, quantity in enumerate(run.quantities):
            g = quantity(stretch.t, stretch.v, stretch.y, numbers)
            g_end = quantity(stretch.t + stretch.h, stretch.v_end, stretch.y_end, numbers)
            head = zeros.astype(np.int64), rows, stretch.member, stretch.step, stretch.t, stretch.h, step_end
            whole = Changes(*head, zeros, ones, g, g_end, stretch.v, stretch.y, stretch.v_end, stretch.y_end)
            looked = np.flatnonzero(~((stretch.at[e] != 0.0) & (np.abs(stretch.h) < LEAST_LEFT * step)))
            if e in self.new_states:
                lain = self.lain[e, stretch.member]
                stretch.at[e] = np.where(lain & (g != 0.0), 0.0, stretch.at[e])
                lies = np.flatnonzero(lain & (stretch.at[e] != 0.0))
                if len(lies):
                    some = stretch.some(lies)
                    state, h = (some.v, some.y), self._way * step[lies]
                    self.led_back[e, some.member] |= self._leads_back(e, some.t, h, state, state, some.member, some.at[e])
            changes, stuck = run.within(e, whole.some(looked), stretch.at[e, looked])
            if e in self.new_states:
                returns[looked[stuck]] = e
                returns[(stretch.at[e] != 0.0) & self.led_back[e, stretch.member]] = e
            occurs = run.located(e, changes)
            if e in self.new_states:  # in no time
                again = (stretch.at[e, changes.place] != 0.0) & (
                    self._way * (occurs.t - stretch.t[changes.place]) <= NO_TIME * step[changes.place]
                )
                again &= returns[changes.place] != e
                place = changes.place[again]
                some, h = stretch.some(place), self._way * step[place]
                bounces = self.bounces(e, some.t, h, (some.v, some.y), some.member, some.at[e])
                returns[place[bounces]], stretch.at[e, place[~bounces]] = e, 0.0
                stays = ~again
                stays[again] = bounces
                occurs, changes = occurs.some(stays), changes.some(stays)
            found.append((occurs, changes))
            sizes.append(np.maximum(np.abs(g), np.abs(g_end)))
            g_ends.append(g_end)
            ends = run.ends(e, occurs.member)
            np.minimum.at(share, changes.place[ends], occurs.share[ends])
        wakes = self._wakes(stretch, returns, step, share, found)
        returns[wakes], share[returns >= 0] = -1, -np.inf  # nothing happens before
        t, v, y = stretch.t.copy(), stretch.v.copy(), stretch.y.copy()
        for e, (occurs, changes) in enumerate(found):
            here = occurs.share == share[changes.place]
            place = changes.place[here]
            t[place], v[..., place], y[..., place] = occurs.t[here], occurs.v[..., here], occurs.y[..., here]
            run.note(e, occurs.some(occurs.share < share[changes.place]))
        v[..., wakes], y[..., wakes] = stretch.v[..., wakes], stretch.y[..., wakes]
        at = Located(stretch.member, stretch.step, share, t, v, y)
        after = self.happen(at, self._way * step, *run.sides_before(found, at), np.array(sizes), stretch.at)
        share[returns >= 0] = np.inf
        return Ahead(share, t, after, np.array(g_ends)), returns

    def _wakes(self, stretch: Stretch, returns: Whole, step: Array, share: Array, found: list[tuple[Located, Changes]]) -> Any:
        """Which members that are held meet an event at a known time: they stay until then. Nothing else happens to them."""
        first, when = np.full(len(returns), np.inf), np.full(len(returns), np.nan)
        for e, _ in self._run.timed:
            occurs, changes = found[e]
            here = np.flatnonzero(returns[changes.place] >= 0)[::-1]  # so that the first of each stays
            here = here[occurs.share[here] <= first[changes.place[here]]]
            first[changes.place[here]], when[changes.place[here]] = occurs.share[here], occurs.t[here]
        wakes = np.flatnonzero(first < np.inf)
        some, h = stretch.some(wakes), self._way * step[wakes]
        self.at[:, some.member] = some.at
        gone = self.let_go(returns[wakes], some.member, some.t, when[wakes] - some.t, h, some.v, some.y) < np.inf
        wakes = wakes[~gone]
        share[wakes] = first[wakes]
        timed = {e for e, _ in self._run.timed}
        for e, (occurs, changes) in enumerate(found):
            stays = ~np.isin(changes.place, wakes) | (e in timed)
            found[e] = occurs.some(stays), changes.some(stays)
        return wakes

    def of_rest(self, rests: Whole, times: Array) -> Finding:
        """A finding of members at rest: each one's event by its number, −1 for others, and since when."""
        batch, is_at_rest = self._run.plan.batch, (rests >= 0).reshape(self._run.plan.batch)
        first = int(np.argmin(np.where(rests >= 0, self._way * times, np.inf)))
        who = named(is_at_rest, tuple(map(int, np.unravel_index(first, batch))) if batch else ())
        if self.circles[:, first].any():
            names = ", ".join(each.name for each, acts in zip(self._run.events, self.circles[:, first], strict=True) if acts)
            why = f"events {names} set each other off at this instant, again and again"
        elif not np.isnan(self.often_since[first]):
            why = (
                f"its state was changed more than {MOST_IN_A_STEP} times since t = {self._run.sign * self.often_since[first]:.9g}"
            )
        elif self.led_back[rests[first], first]:
            why = "its change of the state leads back onto it, and the motion across it, so that it does not go on"
        else:
            why = "changes of its state follow each other within no time, so that it does not go on by them"
        text = f"{who.share} came to rest at event {self._run.events[rests[first]].name}{who.first or ','}"
        text += f" at t = {self._run.sign * times[first]:.9g}: {why}"
        return Finding(EventWarning, text, is_at_rest)
