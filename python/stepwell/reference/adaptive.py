"""Adaptive steps: each member has steps of its own, as long as the estimate of their error stays within a tolerance.

The increments of a step h are h times those of a step of 1, so a system is scaled once and stretched to every step.
"""

import operator
from collections.abc import Callable, Sequence
from functools import reduce
from math import prod
from typing import Any, NamedTuple, Protocol, Self

import numpy as np

from ..base.arrays import Array, Scaled, Whole
from . import tableau
from .acceptance import Acceptance
from .around import Bound, wrapped
from .bits import and_bits, at_most, less, where
from .tableau import Increments, Weights

#: A new step is the old one times SAFETY·r^(−5/32)·p^(1/16), r being the error over the tolerance and p that of the step before
#: (PI control, Gustafsson 1988), held between MIN_FACTOR and MAX_FACTOR; after a rejected step there is no p and no growth. Where
#: the error is estimated in a higher order than LOW, it is SAFETY·r^(−3/32)·p^(1/32). The powers are dyadic so that square roots
#: make them, which are the same to the last bit everywhere.
SAFETY, MIN_FACTOR, MAX_FACTOR = 0.9, 0.2, 5.0
LOW = 5
#: r below TINY counts as TINY; p's root, the sixteenth or the thirty-second, is that of 1e-4 or more.
TINY, CALM_ROOTS = 1e-10, (0.5623413251903491, 0.7498942093324558)
#: A change of y in a step that is smaller than this, relative to the largest size of y so far, is lost in rounding, with some
#: margin. So an error of v that moves y by less is tolerated, however small v is: near rest, where forces cancel, v is only
#: rounding.
ROUNDING = 1.0 / (1 << 40)
#: The same of states of float32, whose roundings are 2²⁹ times as large.
SINGLE_ROUNDING = 1.0 / (1 << 11)
#: A component that has been zero so far counts as this part of the largest in its block. A cascade or a wave reaches one
#: component after the other, each at first with a power of the time that is beyond the order of the method: relative to itself
#: its first step would always be all wrong, however short.
ONSET = 1.0 / (1 << 40)
#: A jump of a force is met by ever shorter steps until one errs by no more than the tolerance of the length that the push would
#: have made in this part of the time since the start: it must be long beside the roundings of time, and short beside the motion
#: that follows.
PUSHED = 1.0 / 64.0
#: A step in which nothing moves and no stage saw a rate has an estimate of zero that says nothing. The next is then no longer
#: than QUIET times the time since the start, or than this one; so what begins later is not stepped over, unless it lasts for less
#: than that.
QUIET = 1.0 / 32.0
#: The most by which a coarse estimate e₃ may exceed a finer one, times √e₃, e₃ relative to the size. Where rates are smooth, that
#: is a constant of the motion and not of the step: 5 to 20 in nine of ten steps of eight motions at tolerances of 1e-3 to 1e-12.
SMOOTH = 32.0
#: Rates that differ within a step by more than WILD of the size, by the coarse estimate, while the finer one is more than CHANCE
#: times less: a pole within the step, of which the method happens to be exact. By Fehlberg's it is 0.96 and 10¹¹ at least; of
#: 55 000 steps of tame and of stiff motions none had more than 330 times where rates differed by a tenth.
WILD, CHANCE = 0.5, 1024.0
#: The error over the tolerance that a step counts as which makes a component negative that has to stay positive.
OUTSIDE = 16.0

#: The first step is the fraction FIRST of the time in which the state changes, at the start and at two times ahead: rather too
#: short than too long, since it then grows by MAX_FACTOR a step. It is at least MOVES times the time of the start, 2¹² roundings.
#: After a jump it is MIN_FACTOR times the step before.
FIRST, MOVES = 0.01, 1.0 / (1 << 40)
#: The same of float32, 2⁸ of its roundings: a state at an event is known to them only, and the next step must lead away from it.
SINGLE_MOVES = 1.0 / (1 << 16)

OK, BUDGET, UNDERFLOW, NOT_FINITE = 0, 2, 3, 4


class Pair(Protocol):
    """A method that estimates its error: its file in ``steppers/``, which may have weights ``COARSE`` of a second estimate."""

    WEIGHTS: Weights
    ERROR: Weights

    def stages(self, s: Any, t: Any, h: Any, v: Array, y: Array, /) -> Increments:
        """The increments of all stages; time and step are each member's own."""


class Outlook(NamedTuple):
    """The length of the next step, whether it is an extra one, whether it ends at the wall, and whether there is one to try."""

    step: Any
    is_extra: Any
    ends: Any
    runs: Any


class Pace(NamedTuple):
    """The time of each member and the state of its step-size controller. All are floats, even the counts.

    Steps do not depend on the saved times: a step that passes the next of them is held, not taken, until the states within it are
    saved. Each is computed by an extra step, from the start of the held one. An extra step whose error is not tolerated shows
    that the held one missed something: that one is then rejected.

    Attributes:
        t: its time.
        h: the step that it will try next.
        target: the next output time.
        extra: above zero, the length of the extra step that comes next, to a saved time.
        held: 1 if the next step is held: it was accepted, but passes the target.
        relative: tolerated error of a step, relative to the size of a group of components.
        absolute: tolerated error in addition to the relative one.
        lasts: 1 if errors are relative to the largest size of a group so far, 0 if they are relative to its present size.
        begin: the time of the start.
        interval: the longest step while inputs change from sample to sample, so that no sample is skipped.
        until: the time until which they do.
        most_step: the longest step.
        wall: the time that no step crosses, just before the next jump.
        before: the sixteenth root of the last accepted error over the tolerance, or its thirty-second.
        most: how much the next step may grow.
        accepted: accepted attempts.
        rejected: rejected attempts.
        extra_steps: steps for saved states: the extra ones, and those that were held and are made once more.
        error: the last error over the tolerance.
        work: the energy that a control or projection added in accepted steps; for a control the sum over their evaluations.
        longest: the largest size so far of each group, along the first axis.
        own: tolerances of their own: the relative one of each group, then the absolute one of each; empty if there are none.
    """

    t: Any
    h: Any
    target: Any
    extra: Any
    held: Any
    relative: Any
    absolute: Any
    lasts: Any
    begin: Any
    interval: Any
    until: Any
    most_step: Any
    wall: Any
    before: Any
    most: Any
    accepted: Any
    rejected: Any
    extra_steps: Any
    error: Any
    work: Any
    longest: Any = ()
    own: Any = ()

    @classmethod
    def of(cls, numbers: Sequence[Any], groups: int) -> Self:
        """From its numbers, one after the other."""
        single = len(cls._fields) - 2
        longest, own = stacked(numbers[single : single + groups]), stacked(numbers[single + groups :])
        return cls(*numbers[:single])._replace(longest=longest, own=own)

    @property
    def numbers(self) -> list[Any]:
        """Its numbers, one after the other."""
        return [*self[:-2], *self.longest, *self.own]

    def tolerances(self) -> tuple[Any, Any]:
        """The relative and the absolute tolerance, of all groups or of each."""
        groups = len(self.own) // 2
        return (self.own[:groups], self.own[groups:]) if groups else (self.relative, self.absolute)

    def reach(self) -> tuple[Any, Any]:
        """Where the next step ends, and whether that is at the wall."""
        ends = less(self.wall, self.t + self.h)
        return where(ends, self.wall, self.t + self.h), ends

    def outlook(self, budget: Any) -> Outlook:
        """What comes next."""
        is_extra = less(0.0, self.extra)
        _, ends = self.reach()
        moves = less(self.t, self.t + self.h)
        left = less(self.accepted + self.rejected, budget)
        runs = less(self.t, self.target) & less(self.t, self.wall) & moves & left & at_most(self.held, 0.0) & ~is_extra
        return Outlook(where(is_extra, self.extra, where(ends, self.wall - self.t, self.h)), is_extra, ends, runs)

    def shortened(self, h: Any, t: Any) -> Any:
        """A step from t, no longer than is allowed there."""
        most = where(less(t, self.until) & less(self.interval, self.most_step), self.interval, self.most_step)
        return where(less(most, h), most, h)


def stacked(numbers: Sequence[Any]) -> Any:
    """Rows as one array; a row may be the same number for all members."""
    if any(isinstance(each, np.ndarray) and each.dtype != object for each in numbers):
        return np.stack(np.broadcast_arrays(*numbers))
    out = np.empty(len(numbers), dtype=object if any(not isinstance(each, float) for each in numbers) else float)
    out[:] = numbers
    return out


class Jumps(NamedTuple):
    """The times that no step crosses: each is between two, just before and just after it.

    Attributes:
        before: those times, ascending along the first axis, the same for all members or of each.
        after: the times from which members go on.
    """

    before: Array
    after: Array

    @classmethod
    def around(cls, times: Array, t0: Any, in_single: Any = None) -> Self:
        """Some roundings before and after each; t0 is the start, before which no jump counts. An infinite one is none.

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
        """The time of the start: behind a jump that is there."""
        there = (self.before <= t0) & (t0 <= self.after)
        return np.where(there, self.after, t0).max(axis=0)

    def passed(self, t: Any) -> Any:
        """How many jumps are at or before t."""
        if self.before.ndim == 1:
            return np.searchsorted(self.before, t, side="right")
        return np.count_nonzero(self.before <= t, axis=0)

    def wall(self, t: Any) -> Any:
        """The next time at which a step from t must end, infinite if there is none."""
        return self._of_each(t, self.before, self.passed(t))

    def crossed(self, pace: Pace, *, series: bool) -> Pace:
        """Where members stand that have come to a wall: behind it, with a step that is chosen anew."""
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
        """The time at a place of each member; infinite behind the last."""
        shape = np.shape(t)
        rows = np.broadcast_to(times.reshape(len(times), *(times.shape[1:] or len(shape) * (1,))), (len(times), *shape))
        ended = np.concatenate([rows, np.full((1, *shape), np.inf)])
        return np.take_along_axis(ended, np.asarray(place, dtype=np.intp)[np.newaxis], 0)[0]


class Stretched:
    """A system scaled to a step of 1, stretched to each member's step."""

    def __init__(self, s: Scaled, h: Array) -> None:
        self.s, self.h = s, h
        self.fixed = getattr(s, "fixed", ())

    def dv(self, t: Array, v: Array, y: Array) -> Array:
        """h·v̇."""
        return self.h * self.s.dv(t, v, y)  # type: ignore[arg-type, operator]  # a time for each member

    def dy(self, t: Array, v: Array, y: Array) -> Array:
        """h·ẏ."""
        return self.h * self.s.dy(t, v, y)  # type: ignore[arg-type, operator]

    def energies(self, v: Array, y: Array) -> tuple[Array, Array, Array]:
        """h·v̇, h times the kinetic energy, and h times the whole energy."""
        dv, kinetic, whole = self.s.energies(v, y)  # type: ignore[attr-defined]
        return self.h * dv, self.h * kinetic, self.h * whole


class Attempted:
    """How an attempt uses a system: its rates for a step, with what acts on them, and the projection of the state after it.

    ``s`` is the system scaled to a step of 1. What is around it and acts on rates needs the step; a projection does not.

    Attributes:
        unit: the rates for a step of 1, with all that acts on them but a control.
    """

    def __init__(self, s: Any, parts: Sequence[Bound] = ()) -> None:
        scaled = [part for part in parts if part[0].is_scaled]
        s = Backward(wrapped(s.s, -1.0, scaled)) if isinstance(s, Backward) and scaled else wrapped(s, 1.0, scaled)
        self.s = s
        parts = [part for part in parts if not part[0].is_scaled]
        self.acting = [part for part in parts if part[0].acts_on_rates]
        self.projected = wrapped(s, 1.0, [part for part in parts if not part[0].acts_on_rates])
        self.unit = self._acting(s, 1.0, without="control")

    def rates(self, step: Any) -> Any:
        """The rates for a step, which may be another for each member."""
        stretched = self.s.stretched(step) if hasattr(self.s, "stretched") else Stretched(self.s, step)
        return self._acting(stretched, step)

    def _acting(self, rates: Any, step: Any, without: str = "") -> Any:
        """Rates with what acts on them; where time runs backward, that sees the step and the time of the system."""
        parts = [part for part in self.acting if part[0].kind != without]
        if not parts or not isinstance(self.s, Backward):
            return wrapped(rates, step, parts)
        return Backward(wrapped(Backward(rates), -step, parts))

    def project(self, v: Array, y: Array) -> tuple[Array, Array, Any]:
        """The state after the step, and the energy that this added; None without a projection."""
        if not hasattr(self.projected, "project"):
            return v, y, None
        if not hasattr(self.projected, "work"):
            return *self.projected.project(v, y), None
        self.projected.work = 0.0
        v, y = self.projected.project(v, y)
        return v, y, self.projected.work


class Backward:
    """A system whose time runs backward: ``s`` is scaled to a step of −1, and the time is that of the run, negated."""

    def __init__(self, s: Any) -> None:
        self.s = s
        if hasattr(s, "stretched"):
            self.stretched = lambda h: Backward(s.stretched(-h))
        if hasattr(s, "project"):
            self.project = s.project
        self.fixed = getattr(s, "fixed", ())

    def dv(self, t: Any, v: Array, y: Array) -> Any:
        """−h·v̇."""
        return self.s.dv(-t, v, y)

    def dy(self, t: Any, v: Array, y: Array) -> Any:
        """−h·ẏ."""
        return self.s.dy(-t, v, y)


class Outcome(NamedTuple):
    """Saved states, and the state, pace and status of each member at the end.

    Of the attempts after which a step was kept, ``steps`` has which members made it, the times, v and y.
    """

    v: Array
    y: Array
    last_v: Array
    last_y: Array
    pace: Pace
    status: Whole
    steps: list[tuple[Any, Any, Array, Array]]


def waiting(
    t0: Any, first: Any, tolerance: tuple[Any, Any, float], samples: tuple[float, float], most_step: Any = np.inf, groups: int = 2
) -> Pace:
    """The pace of a member that has not begun: ``begin`` finds what depends on its state.

    ``first`` is the step to try first; below zero it is to be chosen, and is minus this number where the state tells nothing.
    ``tolerance`` is ``relative``, ``absolute`` and ``lasts`` of a ``Pace``, ``samples`` its ``interval`` and ``until``.
    """
    counts = *tolerance, t0, *samples, most_step, np.inf, 1.0, MAX_FACTOR
    return Pace(t0, first, t0, 0.0, 0.0, *counts, 0.0, 0.0, 0.0, 0.0, 0.0, np.zeros(groups))


def begin(
    s: Any,
    pace: Pace,
    v: Array,
    y: Array,
    block_axes: tuple[int, int],
    groups: tuple[int, ...] = (),
    *,
    series: bool = False,
    moves: float = MOVES,
) -> Pace:
    """Where members stand at the start, from their time and tolerance; a step to try first that is below zero is chosen here.

    It is a share of the shortest time in which a group changes by its size: |v|/|v̇|, |y|/|ẏ| and, from rest, √(|y|/|v̇|), times
    that do not depend on the units of v and y. As the rates at one time may be small by chance, they are looked at twice more,
    in the middle and at the end of the step. ``s`` is scaled to a step of 1; ``series`` says whether the method is one; ``moves``
    is ``MOVES`` or that of float32.
    """
    with np.errstate(all="ignore"):
        rates = s.dv(pace.t, v, y), s.dy(pace.t, v, y)
        longest = sizes(v, y, block_axes, groups)
        least = moves * longer(pace.t, -pace.t)
        counts = Acceptance(groups).counts(*numbers_in(v, y, block_axes))
        changes = sizes(*rates, block_axes, groups)
        time = shortest(longest, changes, counts)
        # Where no component changes by its size, the times of whole blocks count, whatever the units of their components.
        time = where(less(time, np.inf), time, of_blocks(longest, changes, counts))
        chosen = longer(where(less(time, np.inf), FIRST * time, -pace.h), least)
        h = chosen
        for part in (0.5, 1.0):
            ahead = part * chosen
            t1, v1, y1 = pace.t + ahead, v + ahead * rates[0], y + ahead * rates[1]
            time = shortest(longest, sizes(s.dv(t1, v1, y1), s.dy(t1, v1, y1), block_axes, groups), counts)
            h = where(less(FIRST * time, h), FIRST * time, h)
        h = where(less(0.0, pace.h), pace.h, longer(h, least))
        h = pace.shortened(h, pace.t)
    return pace._replace(h=h, longest=longest, before=h if series else pace.before)


def numbers_in(v: Array, y: Array, block_axes: tuple[int, int]) -> list[int]:
    """How many numbers v and y of a member have."""
    return [prod(np.shape(block)[:axes]) for block, axes in zip((v, y), block_axes, strict=True)]


def shortest(lengths: Any, rates: Any, counts: tuple[int, int]) -> Any:
    """The shortest time in which a group of v or of y changes by its size; infinite if there is none."""
    of_v, of_y = counts
    times = [length / rate for length, rate in zip(lengths, rates, strict=True)]
    if of_v and of_y:
        times += [np.sqrt(length / rate) for length, rate in zip(paired(lengths[of_v:], of_v), rates[:of_v], strict=True)]
    least: Any = np.inf
    for time in times:
        least = where(less(0.0, time) & less(time, least), time, least)
    return least


def of_blocks(lengths: Any, rates: Any, counts: tuple[int, int]) -> Any:
    """The shortest time in which a block that is not zero changes by the sum of its sizes; infinite if there is none."""
    least: Any = np.inf
    for block in (slice(0, counts[0]), slice(counts[0], sum(counts))):
        if len(lengths[block]):
            time = total(lengths[block]) / total(rates[block])
            least = where(less(0.0, time) & less(time, least), time, least)
    return least


def paired(of_y: Any, number: int) -> list[Any]:
    """For each group of v the size of its y; where they are not so many, the largest."""
    return list(of_y) if len(of_y) == number else number * [largest(of_y)]


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
) -> Outcome:
    """Continue all members and save their states at each time of ``at``, ascending. Members that stop before have NaN.

    ``attempt(pace, budget, v, y)`` is one attempt of all members. Every ``every``-th accepted step is kept; 0 for none.
    """
    one = np.ones(pace.t.shape)
    saved_v, saved_y, steps = [], [], []
    if jumps is not None:
        pace = pace._replace(wall=jumps.wall(pace.t))
    with np.errstate(all="ignore"):
        for target in at:
            within = (pace.held > 0.0) & (target < pace.reach()[0])
            pace = pace._replace(target=target * one, held=where(within, 1.0, 0.0))
            there, at_target = np.zeros(pace.t.shape, dtype=bool), (np.full(v.shape, np.nan), np.full(y.shape, np.nan))
            while True:
                while pace.outlook(budget).runs.any():
                    before = pace.accepted
                    pace, v, y = attempt(pace, budget, v, y)
                    if every and (due := (pace.accepted > before) & (pace.accepted % every == 0.0)).any():
                        steps.append((due, pace.t, v, y))
                    if jumps is not None:
                        pace = jumps.crossed(pace, series=series)
                waits = (pace.held > 0.0) & ~there
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


def attempt(
    pair: Pair,
    system: Attempted,
    order: int,
    block_axes: tuple[int, int],
    acceptance: Acceptance,
    pace: Pace,
    budget: Any,
    v: Array,
    y: Array,
) -> tuple[Pace, Array, Array]:
    """One attempt at a step: the state advances, projected, if the error is tolerated, and if there is a step to try.

    An extra step that is accepted leaves the pace as it is. ``order`` is the one in which the error is estimated.
    """
    outlook = pace.outlook(budget)
    trial = tried(pair, system, pace.t, outlook.step, v, y)
    return judged(pace, outlook, order, block_axes, acceptance, v, y, trial)


class Tried(NamedTuple):
    """What an attempt makes before it is decided whether it counts.

    Attributes:
        v: velocities after the step.
        y: coordinates after the step.
        errors: one or two estimates of their error.
        projected: the state after the step as a projection leaves it.
        work: the energy that a control or projection added, or None.
    """

    v: Array
    y: Array
    errors: list[tuple[Array, Array]]
    projected: tuple[Array, Array]
    work: Any


def tried(pair: Pair, system: Attempted, t: Any, step: Any, v: Array, y: Array) -> Tried:
    """The stages of an attempt, and what follows from them by their weights."""
    s = system.rates(step)
    increments = pair.stages(s, t, step, v, y)
    v1, y1 = tableau.plus(v, y, pair.WEIGHTS, increments)
    weights = [pair.ERROR, *([coarse] if (coarse := getattr(pair, "COARSE", None)) else [])]
    errors = [tableau.combined(each, increments) for each in weights]
    v2, y2, work = system.project(v1, y1)
    return Tried(v1, y1, errors, (v2, y2), s.work / step if hasattr(s, "work") else work)


def judged(
    pace: Pace,
    outlook: Outlook,
    order: int,
    block_axes: tuple[int, int],
    acceptance: Acceptance,
    v: Array,
    y: Array,
    trial: Tried,
    *,
    rounding: float = ROUNDING,
) -> tuple[Pace, Array, Array]:
    """The pace after an attempt, and the state: the new one if the error is tolerated, and if there was a step to try."""
    step, groups, v1, y1 = outlook.step, acceptance.groups, trial.v, trial.y
    old, new = sizes(v, y, block_axes, groups), sizes(v1, y1, block_axes, groups)
    least, bound = tolerated(pace, step, acceptance.counts(*numbers_in(v, y, block_axes)), old, new, rounding)
    error = sizes(*trial.errors[0], block_axes, groups)
    r = over(error, bound)
    # Of a coarse estimate e₃ of third order and one of fifth, the corrected one is e₅²/√(e₅² + 0.01·e₃²). Where rates jump, e₅
    # may be next to nothing by chance, so it is corrected only where the two are as of smooth rates: e₅ falls as e₃^(3/2).
    for coarse in trial.errors[1:]:
        second = sizes(*coarse, block_axes, groups)
        of_second, share = over(second, bound), over(second, longer(pace.longest, new))
        other = of_second / r
        by_chance = less(CHANCE, other) & less(WILD, share)
        if order > LOW:
            smooth = less(other * other * share, SMOOTH * SMOOTH)
            r = where(less(0.0, r) & smooth, r / np.sqrt(1.0 + 0.01 * (other * other)), r)
        r = where(by_chance, of_second, r)
    # Sizes that overflow would tolerate any error, so they count as not finite; and so does a stage that only the estimate sees.
    r = where(less(total(new) + total(error), np.inf), r, np.inf)
    for row in acceptance.positive:
        r = where(less(component(v1, y1, block_axes, row), 0.0), longer(r, OUTSIDE), r)
    rests = at_most(total(error) + total(absolute(new - old)), 0.0)
    following, goes_on = decided(pace, order > LOW, r, rests, least, outlook)
    if trial.work is not None:
        following = following._replace(work=where(goes_on & ~outlook.is_extra, pace.work + trial.work, pace.work))
    return following, *(where(goes_on, new, now) for new, now in zip(trial.projected, (v, y), strict=True))


def decided(pace: Pace, high: bool, r: Any, rests: Any, new: Any, outlook: Outlook) -> tuple[Pace, Any]:
    """The pace after an attempt with this error, and whether the state advances; ``new`` are the sizes that it would have.

    ``rests`` is whether nothing moved.
    """
    step, is_extra, ends, runs = outlook
    good = at_most(r, 1.0)  # NaN is not
    floored = where(less(TINY, r), r, TINY)
    r8 = np.sqrt(np.sqrt(np.sqrt(floored)))  # the eighth root of r
    r16 = np.sqrt(r8)
    r32 = np.sqrt(r16)
    factor = SAFETY / ((r16 if high else r8) * r32)
    factor = where(good, factor * pace.before, factor)
    factor = where(less(MIN_FACTOR, factor), factor, MIN_FACTOR)
    ceiling = where(good, pace.most, 1.0)
    factor = where(less(factor, ceiling), factor, ceiling)
    factor = where(less(r, np.inf), factor, MIN_FACTOR)
    reached = where(ends, pace.wall, pace.t + step)
    passes = less(pace.target, reached)
    takes, holds, fails = runs & good & ~passes, runs & good & passes, (runs | is_extra) & ~good
    decides = takes | fails
    root, calm = (r32, CALM_ROOTS[1]) if high else (r16, CALM_ROOTS[0])
    root = where(less(calm, root), root, calm)
    t = where(takes, reached, pace.t)
    grown = where(takes & ends, pace.h, step * factor)
    quiet = longer(step, QUIET * (reached - pace.begin))
    grown = pace.shortened(where(takes & rests & less(quiet, grown), quiet, grown), t)
    following = pace._replace(
        t=t,
        h=where(decides, grown, pace.h),
        extra=where(is_extra, 0.0, pace.extra),
        held=where(holds, 1.0, where(fails, 0.0, pace.held)),
        longest=where(takes & less(pace.longest, new), new, pace.longest),
        before=where(takes, root, pace.before),
        most=where(decides, where(good, MAX_FACTOR, 1.0), pace.most),
        accepted=pace.accepted + where(takes, 1.0, 0.0),
        rejected=pace.rejected + where(fails, 1.0, 0.0),
        extra_steps=pace.extra_steps + where(holds | (is_extra & good), 1.0, 0.0),
        error=where(decides, r, pace.error),
    )
    return following, takes | (is_extra & good)


def tolerated(pace: Pace, step: Any, counts: tuple[int, int], old: Any, new: Any, rounding: float) -> tuple[Any, Any]:
    """Of each group the size that it has at least after the step, and the error that is tolerated.

    ``counts`` are how many groups v and y have; ``old`` and ``new`` are their sizes before and after the step. ``rounding`` is
    ``ROUNDING``, or that of float32.
    """
    # A state at zero so far on which a force sets in counts as long as that force would have made it in a part of the time since.
    since = longer(1.0, PUSHED * ((pace.t + step - pace.begin) / step))
    rested = at_most(total(pace.longest), 0.0)
    lasting, least = [], []
    of_v = counts[0]
    for block in (slice(0, of_v), slice(of_v, sum(counts))):
        longest, after = pace.longest[block], new[block]
        if len(after) == 1:
            lasting.append(where(rested, after[0] * since, longest[0]))
            least.append(after[0])
        elif len(after):
            onset = ONSET * longer(largest(longest), largest(after))
            for size, now in zip(longest, after, strict=True):
                been = less(0.0, size)
                lasting.append(where(been, size, where(rested, now * since, onset)))
                least.append(where(been | rested, now, longer(now, onset)))
    if all(counts):
        lost = rounding / step
        lasting[:of_v] = [
            longer(size, of_y * lost) for size, of_y in zip(lasting[:of_v], paired(pace.longest[of_v:], of_v), strict=True)
        ]
    size = longer(where(less(0.0, pace.lasts), stacked(lasting), old), new)
    relative, absolute = pace.tolerances()
    return stacked(least), absolute + relative * size


def absolute(x: Any) -> Any:
    """|x|; among symbols there may be numbers."""
    if isinstance(x, np.ndarray) and x.dtype == object:
        return np.frompyfunc(lambda each: absolute(each) if hasattr(each, "and_bits") else abs(each), 1, 1)(x)
    return and_bits(x, (1 << 63) - 1)


def longer(a: Any, b: Any) -> Any:
    """The larger of two sizes."""
    return where(less(a, b), b, a)


def largest(sizes: Any) -> Any:
    """The largest of some sizes."""
    return reduce(longer, sizes)


def total(sizes: Any) -> Any:
    """The sum of some sizes."""
    return reduce(operator.add, sizes)


def over(error: Any, bound: Any) -> Any:
    """The largest error of a group over what is tolerated."""
    # A group that is zero, as it has always been, tolerates no error and has none.
    return largest(where(at_most(error, 0.0), 0.0, error / bound))


def sizes(v: Array, y: Array, block_axes: tuple[int, int], groups: tuple[int, ...]) -> Any:
    """The size of each group of components along the first axis: of one number its absolute value, of several their length."""
    if not groups:
        return stacked([size_of(block, axes) for block, axes in zip((v, y), block_axes, strict=True) if np.size(block)])
    rows = [row for block, axes in zip((v, y), block_axes, strict=True) for row in rows_of(block, axes)]
    members: dict[int, list[Any]] = {}
    for group, row in zip(groups, rows, strict=True):
        members.setdefault(group, []).append(row)
    return stacked([length_of(members[group]) for group in sorted(members)])


def component(v: Array, y: Array, block_axes: tuple[int, int], place: int) -> Any:
    """The number of v, then of y, at a place."""
    return [row for block, axes in zip((v, y), block_axes, strict=True) for row in rows_of(block, axes)][place]


def rows_of(block: Array, axes: int) -> list[Any]:
    """The numbers of a block, each of all members."""
    block = np.asarray(block)
    if block.dtype == object and not any(hasattr(each, "and_bits") for each in block.flat):  # as a series has them
        block = block.astype(np.float64)
    return list(block.reshape((-1, *block.shape[axes:])))


def size_of(block: Array, axes: int) -> Any:
    """The size of a block."""
    block = np.asarray(block)
    if block.ndim == axes and block.dtype == np.float64:  # of one member: the same sum in floats, ten times as fast
        numbers = block.ravel().tolist()
        if len(numbers) == 1:
            return np.float64(abs(numbers[0]))
        squares = 0.0
        for number in numbers:
            squares += number * number
        return np.sqrt(np.float64(squares))
    return length_of(rows_of(block, axes))


def length_of(numbers: Sequence[Any]) -> Any:
    """The length of some numbers, each of all members; of one number its absolute value."""
    if len(numbers) == 1:
        return absolute(numbers[0])
    return np.sqrt(reduce(operator.add, (number * number for number in numbers), 0.0))
