"""Events of ``solve_ivp``: zeros of functions of time and state between the ends of steps."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ..base import checks
from ..base.arrays import Array
from ..errors import DTypeError
from ..reference.events import REACH, Parts, parted
from .ivp_function import takes

#: A zero is located to four roundings of its time, or of the time since the start of its step, whichever are more.
ROOT_TOLERANCE = 4.0 * np.finfo(float).eps

#: Shorter brackets have no roundings of their own.
LEAST = float(np.finfo(float).tiny)

#: The fraction of a step over which the slope of an event function is taken: rounding then takes half of its digits.
SHORT = 2.0**-26

#: The most values of an event function for one zero; bisection alone needs fewer than this many for any interval of floats.
MAX_VALUES = 2200


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
        """Whether the function has a zero between these values at both ends of a step, in its ``direction``."""
        grows, falls = before <= 0.0 <= after, before >= 0.0 >= after
        return (grows and self.direction >= 0.0) or (falls and self.direction <= 0.0)


def root(g: Callable[[float], float], a: float, b: float, g_a: float, g_b: float) -> float:
    """A zero of g between a and b, at which it has values of different signs or zero (Brent 1973).

    The zero is bracketed to ``ROOT_TOLERANCE``; the step begins at a. If g is continuous, the end of the bracket with the smaller
    value is returned.
    """
    begin = a
    if g_a == 0.0:
        return a
    if g_b == 0.0:
        return b
    # b is the best estimate, c the other end of the bracket, a the estimate before.
    c, g_c, step, before = a, g_a, b - a, b - a
    for _ in range(MAX_VALUES):
        if abs(g_c) < abs(g_b):
            a, b, c, g_a, g_b, g_c = b, c, b, g_b, g_c, g_b
        least = max(0.5 * ROOT_TOLERANCE * max(abs(b), abs(b - begin)), LEAST)
        half = 0.5 * (c - b)
        if abs(half) <= least or g_b == 0.0:
            break
        if abs(before) < least or abs(g_a) <= abs(g_b):
            step = before = half
        else:
            s = g_b / g_a
            if a == c:  # a secant
                p, q = 2.0 * half * s, 1.0 - s
            else:  # an inverse parabola
                r, q = g_b / g_c, g_a / g_c
                p = s * (2.0 * half * q * (q - r) - (b - a) * (r - 1.0))
                q = (q - 1.0) * (r - 1.0) * (s - 1.0)
            p, q = (p, -q) if p > 0.0 else (-p, q)
            if 2.0 * p < min(3.0 * half * q - abs(least * q), abs(before * q)):
                step, before = p / q, step
            else:
                step = before = half
        a, g_a = b, g_b
        b += step if abs(step) > least else (least if half > 0.0 else -least)
        g_b = g(b)
        if (g_b > 0.0) == (g_c > 0.0):
            c, g_c, step, before = a, g_a, b - a, b - a
    return b


def _parts(
    g: Callable[[float], float], span: tuple[float, float], before: float, g_a: float, g_b: float
) -> list[tuple[float, float, float, float]]:
    """The parts of a step in which an event function has at most one zero: the times and the values at both ends of each.

    The whole step is the only part, unless the function bends so much, compared with the step before, that it may have more
    zeros.
    """
    begin, end = span
    h = end - begin
    whole = [(begin, end, g_a, g_b)]
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
    times = (begin + parts.low * h).tolist(), (begin + parts.high * h).tolist()
    return list(zip(*times, parts.g_low.tolist(), parts.g_high.tolist(), strict=True))


def note_zeros(
    events: list[Event], values: list[list[float]], state: Callable[[float], Array], span: tuple[float, float]
) -> float | None:
    """Record the zeros of events in a step over ``span``; returns the time at which one of them ends the run, or None.

    ``values`` are those of the event functions at the start of the step before (NaN in the first step), at the start and at the
    end of this one; ``state`` returns the state at a time within it.
    """
    begin, end = span
    zeros = []
    for event, before, g_a, g_b in zip(events, *values, strict=True):

        def g(at: float, event: Event = event) -> float:
            return event.value(at, state(at))

        for low, high, g_low, g_high in _parts(g, span, before, g_a, g_b):
            if event.occurs(g_low, g_high):
                zeros.append((root(g, low, high, g_low, g_high), event))
    zeros.sort(key=lambda each: each[0] if end > begin else -each[0])
    for t, event in zeros:
        event.count += 1
        event.times.append(t)
        event.states.append(state(t))
        if event.count >= event.terminal:
            return t
    return None
