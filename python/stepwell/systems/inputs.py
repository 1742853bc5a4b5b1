"""Inputs x(t) and accelerations a(t): a number, a sinusoid, or samples held in between."""

from __future__ import annotations

from typing import Any

import numpy as np

from .. import _checks
from .._brief import brief
from .._checks import Shape
from .._value import Fixed, Value
from ..errors import ArgumentError, ShapeError
from ..reference.signal import Constant, Held, Sine

#: Beyond this angle the spacing of floating-point numbers is too coarse to locate a time within a period.
LAST_ANGLE = 2.0**50
#: The same of float32, where such an angle is as far from its neighbours.
LAST_SINGLE_ANGLE = 2.0**21


class Sinusoid(Fixed, Value):
    """amplitude · sin(omega·t + phase).

    Args:
        amplitude: in the unit of the input; broadcasts over the batch.
        omega: in radians per unit of time; broadcasts.
        phase: in radians; broadcasts.

    Example:
        >>> drive = sw.Sinusoid(amplitude=0.1, omega=2.0)
        >>> run = sw.integrate(sw.Oscillator(damping=0.05, a=drive), "rk4", v=0.0, y=0.0, dt=0.05, steps=2000, every=1)
        >>> float(abs(run.y[-400:]).max().round(3))
        0.034
    """

    def __init__(self, amplitude: Any, omega: Any, phase: Any = 0.0) -> None:
        self.amplitude = _checks.numbers("amplitude", amplitude)
        self.omega = _checks.numbers("omega", omega, unit="rad per unit of time")
        self.phase = _checks.numbers("phase", phase, unit="rad")
        self.batch = _checks.batch_shape(
            {"amplitude": self.amplitude.shape, "omega": self.omega.shape, "phase": self.phase.shape}
        )

    def __repr__(self) -> str:
        return f"Sinusoid(amplitude={brief(self.amplitude)}, omega={brief(self.omega)}, phase={brief(self.phase)})"

    def check(self, last: float) -> None:
        """Raise if the angle leaves the range of the sine by a time."""
        angle = float(np.abs(self.omega).max() * abs(last) + np.abs(self.phase).max())
        if angle > LAST_ANGLE:
            raise ArgumentError(
                f"omega, phase: a sinusoid's angle may grow to {LAST_ANGLE:.3g} rad, but reaches {angle:.3g} rad by t = {last:g}"
            )

    def signal(self) -> Sine:
        """The reference signal."""
        return Sine(self.amplitude, self.omega, self.phase)


class Sampled(Fixed, Value):
    """Samples, each held until the next (zero-order hold); the first also holds before its time, the last one for ever.

    Args:
        values: the samples along the first axis, the batch along the others.
        interval: time from one sample to the next.
        start: time of the first sample.

    A time that falls short of a sample's time by less than a millionth of the interval, as t = t0 + k·dt may by rounding, already
    gets that sample.

    Example:
        >>> steps = sw.Sampled([0.0, 1.0, 0.5], interval=2.0)  # 0 until t = 2, 1 until 4, then 0.5
        >>> run = sw.integrate(sw.Oscillator(damping=1.0, x=steps), "rk4", v=0.0, y=0.0, dt=0.05, steps=600)
        >>> float(run.y[-1].round(4))
        0.5
    """

    def __init__(self, values: Any, interval: Any, start: Any = 0.0) -> None:
        self.values = _checks.numbers("values", values)
        if self.values.ndim == 0 or len(self.values) == 0:
            raise ShapeError(f"values: expected at least one sample along the first axis, got shape {self.values.shape}")
        self.interval = _checks.number("interval", interval, positive=True, unit="units of time")
        self.start = _checks.number("start", start, unit="units of time")
        self.batch: Shape = self.values.shape[1:]

    def __repr__(self) -> str:
        if len(self.values) == 1:
            return f"constant({brief(self.values[0])})"
        return f"Sampled({len(self.values)} values, interval={self.interval}, start={self.start})"

    @property
    def constant(self) -> bool:
        """Whether all samples are equal."""
        return bool((self.values == self.values[0]).all())

    def check(self, last: float) -> None:
        """Do nothing: samples are defined at any time."""

    def signal(self) -> Constant | Held:
        """The reference signal."""
        return Constant(np.asarray(self.values[0])) if len(self.values) == 1 else Held(self.values, self.interval, self.start)


Input = Sinusoid | Sampled


def as_input(argument: str, value: Any) -> Input | None:
    """An input from the argument of a user: a constant is one sample, held forever."""
    if value is None or isinstance(value, (Sinusoid, Sampled)):
        return value
    return Sampled(_checks.numbers(argument, value)[np.newaxis], interval=1.0)


def signal(given: Input | None) -> Constant | Held | Sine | None:
    """The reference signal of an input, or None."""
    return None if given is None else given.signal()
