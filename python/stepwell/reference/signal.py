"""Inputs: what drives a system from outside, as a function of time."""

from copy import copy

import numpy as np

from . import trig
from .types import Array

#: A sample's instant may be missed by the rounding of t = t₀ + k·h; a time this fraction of an interval before it counts as it.
HOLD_SLACK = 1e-6


class Constant:
    """The same value at all times."""

    def __init__(self, value: Array) -> None:
        self.value = value

    def at(self, t: float) -> Array:
        """The value."""
        return self.value

    def scaled(self, factor: Array) -> "Constant":
        """The same input, times a factor."""
        return Constant(factor * self.value)


class Sine:
    """amplitude · sin(omega·t + phase)."""

    def __init__(self, amplitude: Array, omega: Array, phase: Array) -> None:
        self.amplitude, self.omega, self.phase = amplitude, omega, phase

    def at(self, t: float) -> Array:
        """The value at time t."""
        return self.amplitude * trig.sin(self.omega * t + self.phase)

    def scaled(self, factor: Array) -> "Sine":
        """The same input, times a factor."""
        return Sine(factor * self.amplitude, self.omega, self.phase)


class Held:
    """``values[i]`` from start + i·interval until the next sample; the first before, the last after."""

    factor: Array | None = None

    def __init__(self, values: Array, interval: float, start: float) -> None:
        self.values, self.interval, self.start = values, interval, start

    def at(self, t: float) -> Array:
        """The value at time t."""
        from .series import at_start  # which importing the package does not need

        sample = self.sample(at_start(t))
        return sample if self.factor is None else np.asarray(self.factor * sample)

    def sample(self, t: float) -> Array:
        """The sample that holds at time t."""
        i = np.floor((t - self.start) / self.interval + HOLD_SLACK)
        i = np.clip(i, 0, len(self.values) - 1).astype(np.int64)
        if i.ndim == 0:  # one time for all members
            return np.asarray(self.values[i])
        own = np.broadcast_to(
            self.values.reshape((len(self.values), *_aligned(self.values, i.ndim))), (len(self.values), *i.shape)
        )
        return np.asarray(np.take_along_axis(own, i[np.newaxis], axis=0)[0])

    def scaled(self, factor: Array) -> "Held":
        """The same input, times a factor."""
        held = copy(self)
        held.factor = factor
        return held


def _aligned(values: Array, axes: int) -> tuple[int, ...]:
    """The batch axes of samples, with ones before them until there are as many."""
    own = values.shape[1:]
    return (*(1,) * (axes - len(own)), *own)
