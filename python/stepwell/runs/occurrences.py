"""Where the quantity of an event changed its sign."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..base import checks
from ..base.arrays import Array, Whole
from ..base.immutable import ValueEquality
from ..base.reprs import counted
from ..errors import ArgumentError


@dataclass(frozen=True, eq=False)
class Occurrences(ValueEquality):
    """Where a quantity changed its sign: one entry for each occurrence that was kept, by member and then by time.

    Attributes:
        name: of the event.
        count: how many there were, per member, shape (*batch).
        member: to which member each entry belongs: its index in the flattened batch, shape (kept,).
        step: the number of the step in which it was, shape (kept,): between t0 + step·dt and one dt later; with adaptive steps
            how many the member had taken before.
        t: its time, shape (kept,).
        v: velocities there, shape (kept, *block).
        y: coordinates there, likewise.

    Example:
        >>> zero = sw.Event(lambda t, v, y: y, name="zero")
        >>> run = sw.integrate(sw.Oscillator([1.0, 2.0]), "rk4", v=0.0, y=1.0, dt=0.01, steps=400, events=zero)
        >>> run.events["zero"].count, run.events["zero"].member
        (array([1, 3]), array([0, 1, 1, 1]))
        >>> run.events["zero"].of(1).t.round(4)  # π/4, 3π/4, 5π/4
        array([0.7854, 2.3562, 3.927 ])
    """

    name: str
    count: Whole
    member: Whole
    step: Whole
    t: Array
    v: Array
    y: Array

    def of(self, index: int | tuple[int, ...] = ()) -> Occurrences:
        """The occurrences of one member.

        Args:
            index: of the member in the batch, a whole number or, for several batch axes, a tuple of them.

        Raises:
            ArgumentError: if there is no such member.
        """
        shape = self.count.shape
        index = index if isinstance(index, tuple) else (index,)
        if len(index) != len(shape):
            raise ArgumentError(
                f"index: expected {counted(len(shape), 'whole number')}, for a batch of shape {shape}, got {len(index)}"
            )
        place = tuple(checks.count("index", i, -n, n - 1) % n for i, n in zip(index, shape, strict=True))
        mine = self.member == (np.ravel_multi_index(place, shape) if shape else 0)
        return Occurrences(
            self.name, self.count[place], self.member[mine], self.step[mine], self.t[mine], self.v[mine], self.y[mine]
        )

    def __repr__(self) -> str:
        return f"<{int(self.count.sum())} of event {self.name}, {len(self.t)} kept, {counted(self.count.size, 'member')}>"
