"""Events at times that are known before a run: listed ones, and zeros of a quantity of the time alone."""

from __future__ import annotations

from math import prod
from types import SimpleNamespace
from typing import Any, cast

import numpy as np

from ... import _core
from ...base.arrays import Array, Whole
from ...errors import ShapeError, TooLargeError
from ...model.equations.series import MarkedReplay
from ...model.equations.switching import WIDER, Solving, Switch, Switches
from ...model.systems import System
from ...reference.marks import Marks, recording
from .event import Event
from .traced import Quantity

#: Zeros are solved for in so much more than the time that is asked for, as a share of it, so that signs are known at its ends.
MARGIN = 2.0**-10


class Timed:
    """The times of an event for each member, in the order in which the motion meets them.

    In place of the quantity of other events it has one that never changes its sign.

    Args:
        event: the event.
        system: the system that moves.
        batch: the shape of the batch.
        way: 1 for motions forward in time, −1 for others.
        zeros: for an event that has no listed times.
    """

    #: As a quantity's: its operations are those of any other.
    key = "of a known time"

    def __init__(self, event: Event, system: System, batch: tuple[int, ...], way: float, zeros: Zeros | None = None) -> None:
        self.event, self._way, self._axes, self._zeros = event, way, len(system.y_shape), zeros
        self._listed, self._period = self._of_batch("times", event.times, batch), self._of_batch("period", event.period, batch)
        self._until = np.inf, -np.inf

    def _of_batch(self, name: str, numbers: Any, batch: tuple[int, ...]) -> Any:
        """Numbers with one batch axis behind their own."""
        if numbers is None:
            return None
        own = numbers.ndim and name == "times"
        shape = numbers.shape[own:]
        try:
            if len(shape) > len(batch) or np.broadcast_shapes(shape, batch) != batch:
                raise ValueError
        except ValueError:
            raise ShapeError(
                f"events: {self.event.name}: {name}: expected {'axes behind the first' if own else 'a shape'} that broadcast to "
                f"the batch {batch}, got shape {numbers.shape}"
            ) from None
        row = numbers.reshape((*numbers.shape[:own], *(1,) * (len(batch) - len(shape)), *shape))
        return (
            np.broadcast_to(row, (*numbers.shape[:own], *batch)).reshape(*numbers.shape[:own], -1)
            if shape
            else row.reshape(-1, 1)
        )

    def cover(self, begin: float, end: float) -> None:
        """Find all times between these, of which either may be first."""
        low, high = self._until = min(begin, end), max(begin, end)
        if self._zeros is not None:
            keys, signs = self._zeros.between(low, high, self._way)
        else:
            times = self._listed
            if self._period is not None:
                with np.errstate(all="ignore"):
                    first, last = np.nanmin((low - times) / self._period), np.nanmax((high - times) / self._period)
                every = np.arange(max(np.floor(first), 0.0), np.ceil(last) + 1.0).reshape(-1, 1, 1)
                times = times + every * self._period
                times = times.reshape(-1, times.shape[-1])
            keys, signs = self._way * times, np.full(times.shape, -1.0)
        keys = np.where(np.isnan(keys), np.inf, keys)
        order = np.argsort(keys, axis=0, kind="stable")
        last = np.full((1, keys.shape[1]), np.inf)  # behind all others
        self._keys, self._signs = (np.concatenate([np.take_along_axis(each, order, 0), last]) for each in (keys, signs))

    @property
    def rows(self) -> tuple[Array, Array]:
        """The times that are known, negated if the motion goes back, ascending, the last infinite; the signs before them."""
        return self._keys, self._signs

    def covers(self, begin: float, end: float) -> bool:
        """True if all times between these are known."""
        return self._until[0] <= min(begin, end) and max(begin, end) <= self._until[1]

    def _place(self, member: Whole, key: Array) -> tuple[Whole, Whole]:
        """How many times of members are not after others, and in which column they stand."""
        key, column = np.broadcast_arrays(key, member if self._keys.shape[1] > 1 else np.zeros_like(member))
        place, count = np.zeros(key.shape, dtype=np.int64), len(self._keys)
        for step in 2 ** np.arange(count.bit_length())[::-1]:
            further = np.minimum(place + step, count)
            place = np.where(self._keys[further - 1, column] <= key, further, place)
        return place, column

    def after(self, member: Whole, key: Array) -> tuple[Array, Array]:
        """The first times of members after others, in the order of the motion, infinite without one; the signs before them."""
        place, column = self._place(member, key)
        return self._keys[place, column], self._signs[place, column]

    def nearest(self, member: Whole, key: Array) -> Array:
        """The times of members that are nearest to others."""
        place, column = self._place(member, key)
        later, earlier = self._keys[place, column], self._keys[np.maximum(place - 1, 0), column]
        return np.where(later - key < np.abs(key - earlier), later, earlier)

    def __call__(self, t: Array, v: Array, y: Array, values: dict[str, Any]) -> Array:
        """A number that keeps its sign."""
        return np.ones(y.shape[self._axes :])

    def slope(self, t: Array, v: Array, y: Array, values: dict[str, Any], h: Array, dv: Array, dy: Array) -> Array:
        """Its slope."""
        return np.zeros(y.shape[self._axes :])

    def with_parameters(self, tape: _core.Tape, places: dict[str, int]) -> _core.Symbol:
        """As a quantity's."""
        return tape.number(1.0)


class _Solving(Solving):
    """A time does not depend on the others that are solved for with it, since those are not the same in each piece of a run."""

    def _exact(self, times: Array, switch: Switch) -> Array:
        exact, found = times.copy(), np.isnan(times)
        for roundings in WIDER:
            rounding = roundings * np.spacing(np.maximum(np.abs(times), np.finfo(np.float64).eps))
            before, after = times - rounding, times + rounding
            first = self._piece(switch, before)
            here = ~found & (first != self._piece(switch, after))
            for _ in range(int(np.log2(roundings)) + 1 if roundings > 1.0 and here.any() else 0):
                middle = before + 0.5 * (after - before)
                same = self._piece(switch, middle) == first
                before, after = np.where(same, middle, before), np.where(same, after, middle)
            exact, found = np.where(here & (roundings > 1.0), after, exact), found | here
        return exact


class Zeros:
    """The zeros of a quantity of the time alone, solved for as comparisons of the time in rates are.

    Args:
        quantity: the quantity.
        values: the parameters of the system that are numbers, by name, with one batch axis.
    """

    def __init__(self, quantity: Quantity, values: dict[str, Any]) -> None:
        tape, marks, self._name = _core.Tape(), Marks(), f"events: {quantity.event.name}"
        with recording(marks):
            g = quantity.of_time(tape)
            above = (tape.number(0.0) < g).choose(tape.number(1.0), tape.number(0.0))
        self._replay, self._numbers = MarkedReplay(tape, [above, g], marks), quantity.numbers(values)
        self._switches = Switches(cast("Any", SimpleNamespace(operations=self._replay)), self._numbers)

    def solved(self, begin: float, end: float) -> Array | None:
        """The times at which the sign may change, from begin to end and some around; None if they are not all solved for.

        They are not where a quotient or a tangent may have a pole.
        """
        changes, poles = self._switches.changes, {"tan"} & {mark.name for mark in self._replay.functions.values()}
        lines = [self._replay.lines[line] for line in self._replay.needed]
        if self._switches.unsolvable or poles or any(name == "divide" and changes[of[1]] for name, of, _ in lines):
            return None
        times = [self._switches.constants.reshape(-1, 1)]
        with np.errstate(all="ignore"):
            solving = _Solving(self._switches, self._numbers, begin, end)
            for each in (each for switch in self._switches.switches for each in solving.of(switch)):
                times.append(each.reshape(len(each), prod(each.shape[1:])))
        if solving.too_many or solving.unsolved:
            return None
        return np.concatenate([np.broadcast_to(each, (len(each), max(each.shape[1] for each in times))) for each in times])

    def between(self, begin: float, end: float, way: float) -> tuple[Array, Array]:
        """The times at which the sign changes, negated if ``way`` is −1, and the signs before, in the order of the motion."""
        margin = MARGIN * (end - begin) + MARGIN**4 * max(abs(begin), abs(end))
        begin, end = begin - margin, end + margin
        times = self.solved(begin, end)
        if times is None:
            raise TooLargeError(f"{self._name}: changes its sign too often from t = {begin:.9g} to {end:.9g} to be solved for")
        edges = np.broadcast_to(way * np.array([[begin], [end]]), (2, times.shape[1]))
        keys = np.sort(np.concatenate([np.where((times > begin) & (times < end), way * times, np.nan), edges]), axis=0)
        with np.errstate(all="ignore"):
            g = self._replay([], self._numbers, way * (keys[:-1] + 0.5 * (keys[1:] - keys[:-1])))[1]
        sign = np.nan_to_num(np.sign(np.broadcast_to(g, (len(keys) - 1, keys.shape[1]))))
        # Between two times that are equal but for roundings the sign is as before.
        known = np.maximum.accumulate(np.where(sign != 0.0, np.arange(len(sign))[:, np.newaxis], 0), axis=0)
        sign = np.take_along_axis(sign, known, 0)
        changes = sign[:-1] * sign[1:] < 0.0
        return np.where(changes, keys[1:-1], np.nan), sign[:-1]
