"""The time of each member and the state of its step-size controller."""

from collections.abc import Sequence
from itertools import pairwise
from typing import Any, NamedTuple, Self

from ..bits import at_most, less, where
from .sizes import stacked

#: A step is at least so many times the one before it, and at most so many times.
MIN_FACTOR, MAX_FACTOR = 0.2, 5.0
#: The first step is at least so many times the time of the start: 2¹² roundings.
MOVES = 1.0 / (1 << 40)
#: As ``MOVES``, for float32, 2⁸ of its roundings: no state at an event is known better, and the next step must lead away from it.
SINGLE_MOVES = 1.0 / (1 << 16)


class Outlook(NamedTuple):
    """The length of the next step, whether it is an extra one, whether it ends at the wall, and whether there is one to try."""

    step: Any
    is_extra: Any
    ends: Any
    runs: Any


class Pace(NamedTuple):
    """The time of each member and the state of its step-size controller. All are floats, even the counts.

    Steps do not depend on the saved times: a step that passes the next of them is held, not taken, until the states within it are
    saved, by the continuous extension of the method. The last of them, and all where there is no extension, are made by extra
    steps from the start of the held one. An extra step whose error is not tolerated shows that the held one missed something:
    that one is then rejected.

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
        extra_steps: steps for saved states: the extra ones, and those that were held and are made once more or extended.
        error: the last error over the tolerance.
        work: the energy that a control or projection added in accepted steps; for a control the sum over their evaluations.
        longest: the largest size so far of each group, along the first axis.
        noise: what the rounding of the rates of each group makes in a unit of time, as far as it is known.
        failed: of each group the error of steps that failed by it over the power 3/2 of their length, the largest; or zero.
        own: tolerances of their own: the relative one of each group, then the absolute one of each; empty if there are none.
        low: what each number of v, then of y, is more than the state has, where the method keeps it; else empty.
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
    noise: Any = ()
    failed: Any = ()
    own: Any = ()
    low: Any = ()

    @classmethod
    def of(cls, numbers: Sequence[Any], groups: int, low: int = 0) -> Self:
        """From its numbers, one after the other, with so many of ``low``."""
        single = len(cls._fields) - 5
        ends = *range(single, single + 4 * groups, groups), len(numbers) - low, len(numbers)
        return cls(*numbers[:single], *(stacked(numbers[first:last]) for first, last in pairwise(ends)))

    @property
    def numbers(self) -> list[Any]:
        """Its numbers, one after the other."""
        return [*self[:-5], *self.longest, *self.noise, *self.failed, *self.own, *self.low]

    def tolerances(self) -> tuple[Any, Any]:
        """The relative and the absolute tolerance, of all groups or of each."""
        groups = len(self.own) // 2
        return (self.own[:groups], self.own[groups:]) if groups else (self.relative, self.absolute)

    def reach(self) -> tuple[Any, Any]:
        """Where the next step ends, and whether that is at the wall."""
        ends = less(self.wall, self.t + self.h)
        return where(ends, self.wall, self.t + self.h), ends

    def outlook(self, budget: Any) -> Outlook:
        """The outlook on the next step."""
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
