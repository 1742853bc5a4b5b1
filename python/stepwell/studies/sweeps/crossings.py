"""Passages of a level: the first time at which a quantity passes it, and the mean time from one passage to the next."""

from __future__ import annotations

from abc import abstractmethod
from math import prod
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ...base import checks
from ...base.arrays import Array, Whole
from ...errors import ShapeError
from ...model.systems import System
from ...runs.result import Run
from .observed import Observed, Of, Piece, Rows, checked, has_rates, name_of, possible, rates
from .outcomes import ReducedOutcome, Reduction, Results, Variable, called

if TYPE_CHECKING:
    from ...base.literals import Direction

#: The directions in words.
WORDS = {number: word for word, number in checks.DIRECTIONS.items()}
#: Halvings of an interval, after which the rest is below the spacing of its numbers.
HALVINGS = 53

Mask = np.ndarray[Any, np.dtype[np.bool_]]


class _Passages(ReducedOutcome):
    def __init__(self, of: Any = "y", level: float = 0.0, direction: int | Direction = 1, *, name: str | None = None) -> None:
        self.of: Of = checked(of)
        self.name = called(name, self.of) or name_of(self.of)
        self.level = checks.number("level", level)
        self.direction = checks.direction("direction", direction)

    def check(self, system: System) -> None:
        possible(self.of, system)
        if self.of in ("v", "y"):
            shape = system.v_shape if self.of == "v" else system.y_shape
            if shape:
                raise ShapeError(
                    f"of: expected one number for each member, such as ({self.of!r}, {', '.join('0' for _ in shape)}), "
                    f"but {self.of} has the shape {shape}"
                )

    def passages(self, rows: Rows, *, has_last: bool) -> Any:
        """The passages on a device, of ``device.reductions``, or None if it does not have the quantity."""
        from ...device import reductions

        of = rows.of(self.of)
        if of is None or len(of) != 1:  # a quantity of several numbers is refused where the states are seen
            return None
        states = rows.states if has_rates(self.of) else 0
        return reductions.Passages(of[0], self.level, self.direction, has_last, states)


class _State(NamedTuple):
    """A state, of all members: its time, the value there, and blocks."""

    t: Any
    value: Array
    v: Array
    y: Array


class _Seeing(Reduction):
    """Finds passages in pieces."""

    def __init__(self, outcome: _Passages) -> None:
        super().__init__(outcome)
        self.before: _State | None = None

    def see(self, piece: Piece) -> None:
        value = np.asarray(piece.of(self.outcome.of), np.float64)
        if value.ndim != 2:
            raise ShapeError(
                f"of: expected one number for each member of {name_of(self.outcome.of)}, got the shape {value.shape[1:-1]}"
            )
        t, (v, y) = piece.t, (np.asarray(block[piece.since :], np.float64) for block in (piece.run.v, piece.run.y))
        if self.before is not None:
            old = self.before
            t, value = np.concatenate([[old.t], t]), np.concatenate([old.value[np.newaxis], value])
            v, y = np.concatenate([old.v[np.newaxis], v]), np.concatenate([old.y[np.newaxis], y])
        if len(t) == 0:
            return
        self.passed(_States(piece.run, self.outcome, t, value, v, y))
        self.before = _State(float(t[-1]), value[-1].copy(), v[-1].copy(), y[-1].copy())

    @abstractmethod
    def passed(self, states: _States) -> None:
        """Take the passages between states into account."""


class _States:
    """States that follow each other, and the passages between them."""

    def __init__(self, run: Run, outcome: _Passages, t: Array, value: Array, v: Array, y: Array) -> None:
        self.run, self.of, self.t, self.v, self.y = run, outcome.of, t, v, y
        self.value = value - outcome.level
        a, b = self.value[:-1], self.value[1:]
        rising, falling = (a < 0.0) & (b >= 0.0), (a > 0.0) & (b <= 0.0)
        #: True where the level is passed after each state but the last, shape (states − 1, members).
        self.mask: Mask = {1: rising, -1: falling, 0: rising | falling}[outcome.direction]

    def times(self, k: Whole, members: Mask) -> Array:
        """The times at which these members pass the level after state k, shape (members,); NaN for the others."""
        each = np.arange(len(k))
        before, after = (
            _State(self.t[i], self.value[i, each], *(np.moveaxis(block[i, ..., each], 0, -1) for block in (self.v, self.y)))
            for i in (k, k + 1)
        )
        return _times(self.run, self.of, before, after, members)


def _times(run: Run, of: Of, before: _State, after: _State, members: Mask) -> Array:
    """The times at which these members pass the level between two states of each, shape (members,); NaN for the others.

    Values are differences from the level, and times have one number for each member.
    """
    start, length = before.t, after.t - before.t
    slopes = [rates(run, of, state.t, state.v, state.y) for state in (before, after)]
    if slopes[0] is None or slopes[1] is None:
        with np.errstate(all="ignore"):
            share = before.value / (before.value - after.value)
    else:
        share = _root(before.value, after.value, slopes[0] * length, slopes[1] * length)
    return np.where(members, start + share * length, np.nan)


def _times_of(observed: Observed, outcome: _Passages, passed: Mask, *, last: bool) -> Array:
    """The times of the first passages, or of the last ones, that a device has seen."""
    run, has_states = observed.run, has_rates(outcome.of)
    n_v, n = prod(run.system.v_shape), prod(run.system.v_shape) + prod(run.system.y_shape)
    numbers = observed.numbers[1:]
    numbers = numbers[len(numbers) // 2 :] if last else numbers
    numbers = np.where(passed, numbers, 0.0)  # there is nothing of the others
    ends = []
    for i in range(2):
        state = numbers[4 + i * n :][: n if has_states else 0]
        v, y = (
            block.reshape(*shape, len(passed)) if has_states else block
            for block, shape in ((state[:n_v], run.system.v_shape), (state[n_v:], run.system.y_shape))
        )
        ends.append(_State(numbers[i], numbers[2 + i], v, y))
    return _times(run, outcome.of, ends[0], ends[1], passed)


def _root(a: Array, b: Array, da: Array, db: Array) -> Array:
    """The zero in 0 … 1 of the cubic with these values and slopes at both ends, whose values have different signs.

    It is found by a fixed number of halvings: the operations are the same for every member, wherever it is computed.
    """
    third, second = 2.0 * (a - b) + da + db, 3.0 * (b - a) - 2.0 * da - db
    low, high = np.zeros(a.shape), np.ones(a.shape)
    with np.errstate(all="ignore"):
        for _ in range(HALVINGS):
            s = 0.5 * (low + high)
            value = ((third * s + second) * s + da) * s + a
            before = np.where(a < 0.0, value < 0.0, value > 0.0)
            low, high = np.where(before, s, low), np.where(before, high, s)
    return 0.5 * (low + high)


class _Crossing(_Seeing):
    def __init__(self, outcome: Crossing) -> None:
        super().__init__(outcome)
        self.time: Array | None = None

    def passed(self, states: _States) -> None:
        if self.time is None:
            self.time = np.full(states.value.shape[1:], np.nan)
            self.is_past = np.zeros(states.value.shape[1:], np.bool_)
        if len(states.mask) == 0:
            return
        passing: Mask = np.asarray(states.mask.any(axis=0))
        new = passing & ~self.is_past  # its time may be NaN where the rates are not finite
        if new.any():
            self.time = np.where(new, states.times(states.mask.argmax(axis=0), new), self.time)
        self.is_past |= passing

    def take(self, observed: Observed) -> None:
        self.time = _times_of(observed, self.outcome, observed.numbers[0] > 0.0, last=False)

    def results(self) -> Results:
        name = self.outcome.name
        about = f"first time at which {name} passes {self.outcome.level:g}, {WORDS[self.outcome.direction]}"
        assert self.time is not None
        return {f"{name}_crossing": Variable((), self.time, about, "t")}


class Crossing(_Passages):
    """The first time at which a quantity passes a level, ``y_crossing``; NaN if it did not.

    It passes between two observed states if it is below the level at the first and not below at the second (rising; likewise
    falling). For v, y and their components the time is that of the cubic through both values with the rates of the system at both
    (Hermite): its error is of the order of (interval)⁴. For other quantities it is linear, with an error of the order of
    (interval)². A passage and return between two observed states is not seen.

    Args:
        of: "v" or "y", a component such as ("y", 0), a quantity such as "energy", or a function f(t, v, y) of states, whose v
            and y have the shape (*block, states, members).
        level: the level, in the units of the quantity.
        direction: 1 or "rising", −1 or "falling", 0 or "both", as for ``Event``.
        name: the name of the results, in place of that of the quantity.

    Example:
        >>> quarter = sw.sweeps.Crossing("y", direction=-1)
        >>> axes = {"omega": ("omega", [1.0, 2.0])}
        >>> found = sw.sweep(sw.Oscillator, axes, "rk4", v=0.0, y=1.0, dt=0.01, steps=200, outcomes=quarter)
        >>> found.y_crossing.values.round(6)
        array([1.570796, 0.785398])
    """

    reduction = _Crossing

    def on_device(self, rows: Rows) -> Any:
        """The first passage on a device."""
        return self.passages(rows, has_last=False)


class _Period(_Seeing):
    def __init__(self, outcome: Period) -> None:
        super().__init__(outcome)
        self.first: Array | None = None

    def passed(self, states: _States) -> None:
        if self.first is None:
            self.first, self.last = (np.full(states.value.shape[1:], np.nan) for _ in range(2))
            self.count = np.zeros(states.value.shape[1:], dtype=np.int64)
        if len(states.mask) == 0 or not states.mask.any():
            return
        passing: Mask = np.asarray(states.mask.any(axis=0))
        new = passing & (self.count == 0)
        self.first = np.where(new, states.times(states.mask.argmax(axis=0), new), self.first) if new.any() else self.first
        self.last = np.where(passing, states.times(len(states.mask) - 1 - states.mask[::-1].argmax(axis=0), passing), self.last)
        self.count = self.count + states.mask.sum(axis=0)

    def take(self, observed: Observed) -> None:
        self.count = observed.numbers[0].astype(np.int64)
        self.first, self.last = (_times_of(observed, self.outcome, self.count > 0, last=last) for last in (False, True))

    def results(self) -> Results:
        name = self.outcome.name
        assert self.first is not None
        with np.errstate(all="ignore"):
            period = np.where(self.count > 1, (self.last - self.first) / (self.count - 1), np.nan)
        about = f"mean time between passages of {name} through {self.outcome.level:g}, {WORDS[self.outcome.direction]}"
        return {
            f"{name}_period": Variable((), period, about, "t"),
            f"{name}_passages": Variable((), np.asarray(self.count), f"how many passages of {name} were seen"),
        }


class Period(_Passages):
    """The mean time between passages of a level in one direction, ``y_period``, and their number, ``y_passages``.

    It is the time from the first to the last, divided by the number of intervals between them; NaN if there are fewer than two.
    Times are those of ``Crossing``. A direction 0 gives the half of a symmetric oscillation's period.

    Args:
        of: as for ``Crossing``.
        level: the level, in the units of the quantity.
        direction: 1 or "rising", −1 or "falling", 0 or "both", as for ``Event``.
        name: the name of the results, in place of that of the quantity.

    Example:
        >>> axes = {"y": ("y0", [0.1, 2.0])}
        >>> found = sw.sweep(sw.Pendulum(), axes, "rk4", v=0.0, dt=0.01, steps=5000, outcomes="period")
        >>> found.y_period.values.round(5)  # four complete elliptic integrals
        array([6.28711, 8.34975])
    """

    reduction = _Period

    def on_device(self, rows: Rows) -> Any:
        """The first and the last passage on a device, and their number."""
        return self.passages(rows, has_last=True)
