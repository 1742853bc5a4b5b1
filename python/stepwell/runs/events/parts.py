"""Values that the parts of an event search exchange: states of members, changes of sign, occurrences."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ...base.arrays import Array, Whole

#: So many units in the last place of a time are none. Verlet divides by the length of a step, so after one of 4e-16 its velocity
#: would be nothing but roundings.
ROUNDINGS = 2.0


def is_no_time(t: Array, other: Array) -> Any:
    """True if only roundings of times lie between these."""
    return np.abs(other - t) <= ROUNDINGS * np.spacing(np.maximum(np.abs(t), np.abs(other)))


class At(NamedTuple):
    """Where members are: the v slot, y, first bad steps, and whether the slot contains what the method carries."""

    slot: Array
    y: Array
    bad: Whole
    carried: bool

    def some(self, which: Any) -> At:
        """Some of them."""
        return At(self.slot[..., which], self.y[..., which], self.bad[which], self.carried)


class Changes(NamedTuple):
    """Parts of steps in which one event changes its sign, or may do so.

    A step begins at ``t`` and has the length ``h``; the part is from the share ``low`` of it to ``high``.

    Attributes:
        row: the number of the step among those that are searched together.
        place: the number of the member among those that are searched together.
        member: the number of the member in the batch.
        step: the number of the step.
        t: the time at its start.
        h: its length.
        t_end: the time at its end, where the next one begins.
        low: the share of the step where the part begins.
        high: where it ends.
        g: the quantity where the part begins.
        g_end: where it ends.
        v: velocities at the start of the step.
        y: coordinates there.
        v_end: velocities where the part ends.
        y_end: coordinates there.
    """

    row: Whole
    place: Whole
    member: Whole
    step: Whole
    t: Array
    h: Array
    t_end: Array
    low: Array
    high: Array
    g: Array
    g_end: Array
    v: Array
    y: Array
    v_end: Array
    y_end: Array

    def some(self, which: Any) -> Changes:
        """Some of them."""
        parts: Any = (each[..., which] for each in self)
        return Changes(*parts)


class Located(NamedTuple):
    """Located changes of sign of one event: members, numbers of steps, shares of them, times, and states there."""

    member: Whole
    step: Whole
    share: Array
    t: Array
    v: Array
    y: Array

    def some(self, which: Any) -> Located:
        """Some of them."""
        parts: Any = (each[..., which] for each in self)
        return Located(*parts)


def ordinals(member: Whole) -> Whole:
    """The number of each entry among those of its member, from 1 on; entries are in the order of time."""
    order = np.argsort(member, kind="stable")
    ascending = member[order]
    first = np.searchsorted(ascending, ascending, "left")
    ordinals = np.empty(len(member), dtype=np.int64)
    ordinals[order] = np.arange(len(member)) - first + 1
    return ordinals


def nothing(blocks: Any) -> Located:
    """No occurrences."""
    whole, real = np.empty(0, dtype=np.int64), np.empty(0)
    return Located(whole, whole, real, real, *(np.empty((*shape, 0)) for shape in blocks))
