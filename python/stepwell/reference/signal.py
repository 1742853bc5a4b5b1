"""Inputs: what drives a system from outside, as a function of time."""

from __future__ import annotations

from collections.abc import Callable
from contextvars import ContextVar
from copy import copy
from typing import Any

import numpy as np

from ..base.arrays import Array
from ..base.context import within
from . import bits, trig

#: By this factor the number of intervals since the first sample is taken longer: rounding may put it just before a whole number.
HOLD_SLACK = 1.0 + 2.0**-44

#: The two ends of a stretch of time, and its length.
Window = tuple[Any, Any, Any]

#: The times over which samples that are held are averaged; None where a time selects one of them.
_WINDOW: ContextVar[Window | None] = ContextVar("window", default=None)


def over(window: Window, compute: Callable[..., Any], /, *arguments: Any) -> Any:
    """``compute(*arguments)``, which sees the mean of held samples over a stretch of time."""
    return within({_WINDOW: window}, compute, *arguments)


def _ways(h: Any) -> tuple[Any, Any]:
    """The part of a length that leads back in time, and the part that leads on; one of them is zero."""
    back = bits.where(bits.less(h, 0.0), h, 0.0)
    return back, h - back


def of_step(t: Any, h: Any, carries: bool) -> Window:
    """The window of a step from t; its middle is the time of the rates if a method carries something in place of v."""
    back, on = _ways(h)
    length = on - back
    return (t - 0.5 * length, t + 0.5 * length, length) if carries else (t + back, t + on, length)


def of_slot(t: Any, h: Any) -> Window:
    """The window of half a kick at t, from what a method carries to velocities and back."""
    back, on = _ways(0.5 * h)
    return t - on, t - back, on - back


class Constant:
    """An input with the same value at all times."""

    def __init__(self, value: Array) -> None:
        self.value = value

    def parts(self) -> dict[str, Array]:
        """Its numbers, by what is put behind its name."""
        return {"": self.value}

    def at(self, t: float) -> Array:
        """The value."""
        return self.value

    def scaled(self, factor: Array) -> Constant:
        """Return this input times a factor."""
        return Constant(factor * self.value)


class Sine:
    """amplitude · sin(omega·t + phase)."""

    def __init__(self, amplitude: Array, omega: Array, phase: Array) -> None:
        self.amplitude, self.omega, self.phase = amplitude, omega, phase

    def parts(self) -> dict[str, Array]:
        """Its numbers, by what is put behind its name."""
        return {".amplitude": self.amplitude, ".omega": self.omega, ".phase": self.phase}

    def at(self, t: float) -> Array:
        """The value at time t."""
        return self.amplitude * trig.sin(self.omega * t + self.phase)

    def scaled(self, factor: Array) -> Sine:
        """Return this input times a factor."""
        return Sine(factor * self.amplitude, self.omega, self.phase)


class Held:
    """``values[i]`` from start + i·interval until the next sample; the first before, the last after."""

    factor: Array | None = None
    #: True if its values are the times at which the samples of another begin.
    is_times = False

    def __init__(self, values: Array, interval: float, start: float) -> None:
        self.values, self.interval, self.start = values, interval, start

    def at(self, t: float) -> Array:
        """The value at time t."""
        from .series import at_start  # which importing the package does not need

        sample = self.sample(at_start(t))
        return sample if self.factor is None else np.asarray(self.factor * sample)

    def sample(self, t: float) -> Array:
        """The sample that holds at time t."""
        i = np.floor((t - self.start) / self.interval * HOLD_SLACK)
        i = np.clip(i, 0, len(self.values) - 1).astype(np.int64)
        if i.ndim == 0:  # one time for all members
            return np.asarray(self.values[i])
        own = self.values.shape[1:]
        batch = np.broadcast_shapes(i.shape, own)
        rows = self.values.reshape((len(self.values), *(len(batch) - len(own)) * (1,), *own))
        i = np.broadcast_to(i, batch)[np.newaxis]
        return np.asarray(np.take_along_axis(np.broadcast_to(rows, (len(rows), *batch)), i, axis=0)[0])

    def scaled(self, factor: Array) -> Held:
        """Return this input times a factor."""
        other = copy(self)
        other.factor = factor
        return other


class Stepped:
    """Samples, of which a step of fixed length sees the mean over it, and all else the one that holds.

    Args:
        samples: the samples.
        times: when each of them begins, likewise.
        origin: for each member the time from which both count, always the same; None for times as they are.
    """

    factor: Array | None = None

    def __init__(self, samples: Held, times: Held, origin: Held | None = None) -> None:
        self.samples, self.times, self.origin = samples, times, origin
        times.is_times = True

    def parts(self) -> dict[str, Held]:
        """Its tables, by what is put behind its name."""
        tables = {"": self.samples, ".times": self.times}
        return tables if self.origin is None else tables | {".origin": self.origin}

    def at(self, t: Any) -> Array:
        """The value at time t, or that of a step."""
        window = _WINDOW.get()
        value = self._held(t) if window is None else self._mean(*window)
        return value if self.factor is None else np.asarray(self.factor * value)

    def _held(self, t: Any) -> Any:
        return self.samples.at(t if self.origin is None else t - self.origin.at(t))

    def _mean(self, start: Any, end: Any, length: Any) -> Any:
        if self.origin is None:
            before, after, began = self.samples.sample(start), self.samples.sample(end), self.times.sample(end)
        else:
            origin = self.origin.sample(end)
            before, after = self.samples.sample(start - origin), self.samples.sample(end - origin)
            began = origin + self.times.sample(end - origin)
        share = (end - began) / length
        share = bits.where(bits.less(0.0, share), share, 0.0)
        share = bits.where(bits.less(share, 1.0), share, 1.0)
        return np.asarray(before + share * (after - before))

    def scaled(self, factor: Array) -> Stepped:
        """Return this input times a factor."""
        other = copy(self)
        other.factor = factor
        return other


class Curve:
    """A polynomial between each two samples, of the time since the first of them.

    Args:
        coefficients: those of each power, the constant terms first.
        times: when each piece begins.
    """

    factor: Array | None = None

    def __init__(self, *tables: Held) -> None:
        *self.coefficients, self.times = tables
        self.times.is_times = True

    def parts(self) -> dict[str, Held]:
        """Its tables, by what is put behind its name."""
        return {f".{k}": each for k, each in enumerate(self.coefficients)} | {".times": self.times}

    def at(self, t: Any) -> Any:
        """The value at time t."""
        since = t - self.times.at(t)
        *others, value = self.coefficients
        result: Any = value.at(t)
        for each in reversed(others):
            result = result * since + each.at(t)
        return result if self.factor is None else np.asarray(self.factor * result)

    def scaled(self, factor: Array) -> Curve:
        """Return this input times a factor."""
        other = copy(self)
        other.factor = factor
        return other


#: Signals that consist of numbers, or of tables of samples, as ``parts`` names them.
COMPOSED = (Constant, Sine, Stepped, Curve)


def converted(value: Any, numbers: Callable[[Array], Any], table: Callable[[Held], Any]) -> Any:
    """A parameter whose numbers and tables of samples are converted; words and the like stay as they are."""
    match value:
        case np.ndarray():
            return numbers(value)
        case list():
            return [converted(each, numbers, table) for each in value]
        case Held():
            return table(value)
        case _ if isinstance(value, COMPOSED):
            signal: Any = type(value)
            return signal(*(converted(part, numbers, table) for part in value.parts().values()))
        case _:
            return value
