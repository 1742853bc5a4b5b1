"""Coulomb's friction that sticks (§8): v + f is reduced by the limit towards zero, where it stays if it gets there.

f is h·v̇ without friction, and the limit is h times the deceleration by friction.
"""

from typing import Any

import numpy as np

from ..base.arrays import Array, Scaled
from . import bits
from .around import Around


class Separate:
    """Friction on each number of v; ``limit`` broadcasts to v."""

    def __init__(self, limit: Array) -> None:
        self.limit = limit

    def reduced(self, v: Array, f: Array) -> Array:
        """The change of v, which is −v where friction stops it."""
        moved, limit = v + f, self.limit
        forward = bits.where(bits.less(limit, moved), f - limit, -v)
        return np.asarray(bits.where(bits.less(moved, -limit), f + limit, forward))

    def stops(self, v: Array, f: Array) -> Any:
        """True where friction stops it, and can hold it there."""
        return self._within(v + f) & self._within(f)

    def stopped(self, v: Array, stops: Any) -> Array:
        """The v, with zero where it stops."""
        return np.asarray(bits.where(stops, 0.0, v))

    def _within(self, x: Array) -> Any:
        return bits.at_most(-self.limit, x) & bits.at_most(x, self.limit)


class OnVectors(Separate):
    """Friction on vectors along the axis before those of the batch: they become shorter. ``limit`` has one number for each."""

    def __init__(self, limit: Array, axis: int) -> None:
        super().__init__(limit)
        self.axis = axis

    def reduced(self, v: Array, f: Array) -> Array:
        """The change of v, which is −v where friction stops it."""
        moved = v + f
        length = self._lengths(moved)
        with np.errstate(all="ignore"):  # a length of zero is at most the limit
            share = self.limit / length
        forward = f - moved * np.expand_dims(share, self.axis)
        return np.asarray(bits.where(np.expand_dims(bits.at_most(length, self.limit), self.axis), -v, forward))

    def stopped(self, v: Array, stops: Any) -> Array:
        """The v, with zero where it stops."""
        return super().stopped(v, np.expand_dims(stops, self.axis))

    def _within(self, x: Array) -> Any:
        return bits.at_most(self._lengths(x), self.limit)

    def _lengths(self, x: Array) -> Array:
        first, *others = np.moveaxis(x, self.axis, 0)
        square = first * first
        for each in others:
            square = square + each * each
        return np.asarray(np.sqrt(square))


class OnOne(Separate):
    """Friction on one number of v, at that place; ``along`` is by how much others change where it changes by 1, or None."""

    def __init__(self, limit: Array, at: tuple[int, ...], along: Array | None) -> None:
        super().__init__(limit)
        self.at, self.along = at, along

    def reduced(self, v: Array, f: Array) -> Array:
        """The change of v, which is −v at that place if friction stops it."""
        moved, limit = v[self.at] + f[self.at], self.limit
        forward = bits.where(bits.less(limit, moved), -limit, -moved)
        push = bits.where(bits.less(moved, -limit), limit, forward)
        return self._with(super().reduced(v[self.at], f[self.at]), f if self.along is None else f + self.along * push)

    def stops(self, v: Array, f: Array) -> Any:
        """True where friction stops it, and can hold it there."""
        return super().stops(v[self.at], f[self.at])

    def stopped(self, v: Array, stops: Any) -> Array:
        """The v, with zero at that place where it stops."""
        others = v if self.along is None else bits.where(stops, v - self.along * v[self.at], v)
        return self._with(super().stopped(v[self.at], stops), others)

    def _with(self, one: Array, others: Any) -> Array:
        block = np.array(others)
        block[self.at] = np.asarray(one)[()]  # a symbol, not an array of it
        return block


class Rubbing(Around):
    """A system with friction around all other forces: that of ``s.friction``, or one deceleration of each velocity."""

    def __init__(self, s: Scaled, h: float, deceleration: Array | None = None) -> None:
        super().__init__(s)
        self.common = None if deceleration is None else Separate(h * deceleration)

    def dv(self, t: float, v: Array, y: Array) -> Array:
        """The change of v, which is −v where friction stops it."""
        return self._at(t, v, y).reduced(v, self.s.dv(t, v, y))

    def bring_to_rest(self, t: float, v: Array, y: Array, new_v: Array) -> Array:
        """The velocity after a step from v and y: zero if the first stage stops it, and friction can hold it there.

        A method of several stages mixes their increments, so by itself it would only divide v by some number in each step.
        """
        friction = self._at(t, v, y)
        return friction.stopped(new_v, friction.stops(v, self.s.dv(t, v, y)))

    def _at(self, t: float, v: Array, y: Array) -> Separate:
        friction: Separate = self.s.friction(t, v, y) if self.common is None else self.common
        return friction
