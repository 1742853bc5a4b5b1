"""Events of ``solve_ivp``: zeros of functions of time and state between the ends of steps."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from ..base import checks
from ..base.arrays import Array
from ..errors import DTypeError
from ..reference.events import REACH, Parts, located_alone, parted
from .ivp_function import takes

#: A zero is located to four roundings of its time, or of the time since the start of its step, whichever are more.
EPS = float(np.finfo(float).eps)
ROOT_TOLERANCE = 4.0 * EPS

#: The fraction of a step over which the slope of an event function is taken: rounding then takes half of its digits.
SHORT = 2.0**-26


class Event:
    """An event function with the attributes that SciPy reads.

    Attributes:
        terminal: the number of zeros after which the run ends; infinite if they do not end it.
        direction: above zero for zeros where the function grows, below zero where it falls, zero for both.
        count: the number of zeros so far.
        times: their times.
        states: the states at these times.
    """

    def __init__(self, function: Any, args: tuple[Any, ...]) -> None:
        if not callable(function) or isinstance(function, type):
            raise DTypeError(f"events: expected functions event(t, y), got {checks.short(function)} ({type(function).__name__})")
        takes("events", function, args)
        terminal = getattr(function, "terminal", None)
        if terminal is None or terminal is False:
            self.terminal = np.inf
        else:
            self.terminal = 1 if terminal is True else checks.count("terminal", terminal, 0) or np.inf
        self.direction = checks.number("direction", getattr(function, "direction", 0.0))
        self._function, self._args = function, args
        self.count = 0
        self.times: list[float] = []
        self.states: list[Array] = []

    def value(self, t: float, y: Array) -> float:
        """The value of the function."""
        value = checks.as_array("events", self._function(t, y, *self._args))
        if value.size != 1 or value.dtype.kind not in "biuf":
            raise DTypeError(f"events: expected a function that returns one real number, got {checks.short(value)}")
        return float(value.reshape(-1)[0])

    def occurs(self, before: float, after: float) -> bool:
        """True if the function has a zero between these values at both ends of a step, in its ``direction``."""
        grows, falls = before <= 0.0 <= after, before >= 0.0 >= after
        return (grows and self.direction >= 0.0) or (falls and self.direction <= 0.0)


class Part(NamedTuple):
    """A part of a step in which an event function has at most one zero: its ends as shares of the step, the values there."""

    low: float
    high: float
    g_low: float
    g_high: float


def time_of(span: tuple[float, float], share: float) -> float:
    """The time at a share of a step."""
    begin, end = span
    time = end if share == 1.0 else begin + share * (end - begin)
    return min(max(time, min(span)), max(span))


def zero(g: Callable[[float], float], span: tuple[float, float], part: Part) -> float:
    """The time of a zero of g in a part of a step, at whose ends it has values of different signs or zero.

    The zero is bracketed to a quarter of ``ROOT_TOLERANCE``, one rounding. If g is continuous, the end of the bracket with the
    smaller value is returned.
    """
    if part.g_low == 0.0 or part.g_high == 0.0:
        return time_of(span, part.low if part.g_low == 0.0 else part.high)
    begin, h = span[0], span[1] - span[0]
    values = {part.low: part.g_low, part.high: part.g_high}

    def trial(share: float) -> float:
        values[share] = g(time_of(span, share))
        return values[share]

    low, high = located_alone(trial, *part, lambda share: EPS * max(share, abs(begin / h + share)))
    return time_of(span, min((high, low), key=lambda share: abs(values[share])))


def _parts(g: Callable[[float], float], span: tuple[float, float], before: float, g_a: float, g_b: float) -> list[Part]:
    """The parts of a step in which an event function has at most one zero.

    The whole step is the only part, unless the function bends so much, compared with the step before, that it may have more
    zeros.
    """
    begin, end = span
    h = end - begin
    whole = [Part(0.0, 1.0, g_a, g_b)]
    if g_a == 0.0 or g_b == 0.0 or min(abs(g_a), abs(g_b)) > REACH * abs((g_b - g_a) - (g_a - before)):
        return whole

    def slope(share: float, value: float) -> float:
        way = SHORT if share < 0.5 else -SHORT
        return (g(begin + (share + way) * h) - value) / way

    def look(_: Any, shares: Array) -> tuple[Array, Array, Array, Array]:
        values = [g(begin + share * h) for share in shares.tolist()]
        slopes = [slope(share, value) for share, value in zip(shares.tolist(), values, strict=True)]
        return np.array(values), np.array(slopes), shares, shares

    ends = [np.array([each]) for each in (0.0, 1.0, g_a, g_b, slope(0.0, g_a), slope(1.0, g_b), 0.0, 0.0)]
    parts, _ = parted(look, Parts(np.zeros(1, dtype=np.int64), *ends))
    if len(parts.of) < 2:
        return whole
    return [Part(*each) for each in np.stack([parts.low, parts.high, parts.g_low, parts.g_high], axis=1).tolist()]


def note_zeros(
    events: list[Event], values: list[list[float]], state: Callable[[float], Array], span: tuple[float, float]
) -> float | None:
    """Record the zeros of events in a step over ``span``; returns the time at which one of them ends the run, or None.

    ``values`` are those of the event functions at the start of the step before (NaN in the first step), at the start and at the
    end of this one; ``state`` returns the state at a time within it.
    """
    begin, end = span
    zeros = []
    states: dict[float, Array] = {}  # each takes a step of the method

    def known(at: float) -> Array:
        if at not in states:
            states[at] = state(at)
        return states[at].copy()  # which the function may write to

    for event, before, g_a, g_b in zip(events, *values, strict=True):

        def g(at: float, event: Event = event) -> float:
            return event.value(at, known(at))

        for part in _parts(g, span, before, g_a, g_b):
            if event.occurs(part.g_low, part.g_high):
                zeros.append((zero(g, span, part), event))
    zeros.sort(key=lambda each: each[0] if end > begin else -each[0])
    for t, event in zeros:
        event.count += 1
        event.times.append(t)
        event.states.append(known(t))
        if event.count >= event.terminal:
            return t
    return None
