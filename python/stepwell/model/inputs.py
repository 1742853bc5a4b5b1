"""Inputs x(t) and accelerations a(t): a number, a sinusoid, or samples."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..base import checks
from ..base.arrays import Array, Shape
from ..base.immutable import Immutable, ValueEquality, changed
from ..base.reprs import brief
from ..errors import ArgumentError, ShapeError
from ..reference.signal import HOLD_SLACK, Constant, Curve, Held, Sine, Stepped

if TYPE_CHECKING:
    from ..base.literals import Interpolation

#: Beyond this angle the spacing of floating-point numbers is too coarse to locate a time within a period.
LAST_ANGLE = 2.0**50
#: The angle at which the spacing of float32 is as coarse.
LAST_SINGLE_ANGLE = 2.0**21


class Sinusoid(Immutable, ValueEquality):
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
        self.amplitude = checks.numbers("amplitude", amplitude)
        self.omega = checks.numbers("omega", omega, unit="rad per unit of time")
        self.phase = checks.numbers("phase", phase, unit="rad")
        self.batch = checks.batch_shape({"amplitude": self.amplitude.shape, "omega": self.omega.shape, "phase": self.phase.shape})

    def __repr__(self) -> str:
        return f"Sinusoid(amplitude={brief(self.amplitude)}, omega={brief(self.omega)}, phase={brief(self.phase)})"

    def check(self, last: float) -> None:
        """Raise if the angle leaves the range of the sine up to a time."""
        angle = float(np.abs(self.omega).max() * abs(last) + np.abs(self.phase).max())
        if angle > LAST_ANGLE:
            raise ArgumentError(
                f"omega, phase: a sinusoid's angle may grow to {LAST_ANGLE:.3g} rad, but reaches {angle:.3g} rad by t = {last:g}"
            )

    def jumps(self, begin: float, end: float) -> Array:
        """The times at which it or a derivative jumps: none."""
        return np.empty(0)

    def signal(self) -> Sine:
        """The reference signal."""
        return Sine(self.amplitude, self.omega, self.phase)


#: The kinds of interpolation between samples.
INTERPOLATIONS: tuple[Interpolation, ...] = ("hold", "linear", "cubic")


class Sampled(Immutable, ValueEquality):
    """Samples at equal intervals, with a kind of interpolation between them.

    | ``interpolation`` | between two samples | use |
    |---|---|---|
    | ``"hold"`` | the first of them (zero-order hold) | the output of a computer or a converter |
    | ``"linear"`` | a straight line, as ``np.interp`` | measurements |
    | ``"cubic"`` | a cubic (Hermite), with derivatives from up to five neighbouring samples | samples of a smooth function |

    Before the first sample the value is the first, after the last sample the last.

    A step of fixed length sees the mean of held samples over the step. If samples begin with steps, so that the interval is a
    multiple of dt, that is the sample itself, and each method has its order. If a sample begins within a step, the error is of
    second order in dt. Curves are functions of the time, which a method evaluates anywhere in a step. The error of straight lines
    is of second order in the interval, and they have kinks; that of cubics is of fourth order, and their first derivative is
    continuous.

    Args:
        values: the samples along the first axis, the batch along the others.
        interval: time from one sample to the next.
        start: time of the first sample.
        interpolation: one of the table.

    A time that is before a sample's time by rounding alone already has that sample.

    Example:
        >>> steps = sw.Sampled([0.0, 1.0, 0.5], interval=2.0)  # 0 until t = 2, 1 until 4, then 0.5
        >>> run = sw.integrate(sw.Oscillator(damping=1.0, x=steps), "rk4", v=0.0, y=0.0, dt=0.05, steps=600)
        >>> float(run.y[-1].round(4))
        0.5
    """

    interpolation: Interpolation = "hold"
    _origin: Array | None = None  # for each member the time of its first sample, from which ``start`` counts

    def __init__(self, values: Any, interval: Any, start: Any = 0.0, interpolation: Interpolation = "hold") -> None:
        self.values = checks.numbers("values", values)
        if self.values.ndim == 0 or len(self.values) == 0:
            raise ShapeError(f"values: expected at least one sample along the first axis, got shape {self.values.shape}")
        self.interval = checks.number("interval", interval, positive=True, unit="units of time")
        self.start = checks.number("start", start, unit="units of time")
        self.interpolation = checks.known("interpolation", interpolation, INTERPOLATIONS)

    def __repr__(self) -> str:
        if len(self.values) == 1:
            return f"constant({brief(self.values[0])})"
        between = "" if self.interpolation == "hold" else f", interpolation={self.interpolation!r}"
        return f"Sampled({len(self.values)} values, interval={self.interval}, start={self.start}{between})"

    @property
    def batch(self) -> Shape:
        """The axes of the samples' own batch."""
        return self.values.shape[1:]

    @property
    def constant(self) -> bool:
        """True if all samples are equal."""
        return bool((self.values == self.values[0]).all())

    @property
    def times(self) -> Array:
        """The times of the samples, shape (samples,)."""
        return np.asarray(self.start + self.interval * np.arange(len(self.values)), np.float64)

    def jumps(self, begin: float, end: float) -> Array:
        """The times from ``begin`` to ``end`` at which the input or its first derivatives jump, ascending.

        Held samples jump where a sample differs from the one before it, some roundings early. Curves have a kink (linear) or a
        jump of the second derivative (cubic) at each sample.
        """
        times: Array = self.times
        if self.constant:
            return np.empty(0)
        if self.interpolation == "hold":
            changes = (self.values[1:] != self.values[:-1]).reshape(len(times) - 1, -1).any(axis=1)
            times = self.start + (self.interval * np.arange(1, len(times))[changes]) / HOLD_SLACK
        return times[(begin <= times) & (times <= end)]

    def over_steps(self, first: Any, dt: float) -> Sampled:
        """The means over steps from ``first`` on, if a step has several held samples; else the input itself.

        ``first`` is one time or one for each member.
        """
        if self.interpolation != "hold" or len(self.values) == 1 or self.interval >= dt * (1.0 - 1e-9):
            return self
        times, own, batch = self.times, np.shape(first), np.broadcast_shapes(np.shape(first), self.batch)
        numbers = np.arange(np.ceil((times[-1] - times[0]) / dt) + 2.0)
        checks.fits("the means of samples over steps", 8.0 * len(numbers), batch, "take steps no longer than their interval")
        before = np.floor((times[0] - first) / dt)
        ends = first + dt * (before + numbers.reshape(-1, *(1,) * len(own)))
        off = self.values - self.values[0]  # so that less cancels
        until = np.concatenate([np.zeros((1, *off.shape[1:])), np.cumsum(off, axis=0)]) * self.interval
        at = np.clip(np.searchsorted(times, ends, side="right") - 1, 0, None)
        since = np.maximum(ends - times[at], 0.0).reshape(len(numbers), *(1,) * (len(batch) - len(own)), *own)
        means = np.diff(_at(until, at, batch) + _at(off, at, batch) * since, axis=0) / dt + self.values[0]
        values = np.concatenate([means, np.broadcast_to(self.values[-1:], (1, *batch))])
        if own:
            return changed(self, values=values, interval=dt, start=0.0, _origin=ends[0])
        return Sampled(values, dt, float(ends[0]))

    def check(self, last: float) -> None:
        """Do nothing, because samples are defined at any time."""

    def signal(self) -> Constant | Stepped | Curve:
        """The reference signal."""
        if len(self.values) == 1:
            return Constant(np.asarray(self.values[0]))
        if self.interpolation == "hold":
            origin = None if self._origin is None else Held(self._origin[np.newaxis], 1.0, 0.0)
            table, since = (Held(each, self.interval, self.start) for each in (self.values, self.times))
            return Stepped(table, since, origin)
        slopes = np.diff(self.values, axis=0) / self.interval
        pieces = [self.values[:-1], slopes]
        if self.interpolation == "cubic":
            at = _derivatives(self.values, self.interval)
            pieces[1:] = [
                at[:-1],
                (3.0 * slopes - 2.0 * at[:-1] - at[1:]) / self.interval,
                (at[:-1] + at[1:] - 2.0 * slopes) / self.interval**2,
            ]
        # The pieces before the first sample and after the last are constant.
        ends = [self.values[[0]], self.values[[-1]]]
        nothing = np.zeros_like(ends[0])
        tables = [np.concatenate([ends[0], pieces[0], ends[1]])]
        tables += [np.concatenate([nothing, each, nothing]) for each in pieces[1:]]
        first = self.start - self.interval
        times = first + self.interval * np.arange(len(tables[0]))
        return Curve(*(Held(each, self.interval, first) for each in (*tables, times)))


def _at(values: Array, numbers: Any, batch: Shape) -> Array:
    """The values at these indices, which may differ from member to member, over the batch."""
    if numbers.ndim == 1:
        return np.asarray(values[numbers])
    wide, each = (
        np.broadcast_to(rows.reshape(len(rows), *(1,) * (len(batch) + 1 - rows.ndim), *rows.shape[1:]), (len(rows), *batch))
        for rows in (values, numbers)
    )
    return np.take_along_axis(wide, each, axis=0)


#: The most samples for a derivative, which is exact for polynomials of a lower degree.
NEIGHBOURS = 5


def _derivatives(values: Array, interval: float) -> Array:
    """The derivative at each sample of the polynomial through it and its nearest neighbours, ``NEIGHBOURS`` in all."""
    n = min(NEIGHBOURS, len(values))
    derivatives = np.empty(values.shape)
    for i in range(n):
        # The first rows have too few neighbours before them, the last too few after them; the rows between have equal weights.
        weights = _weights(n, i) / interval
        middle = i == n // 2
        first, count = (0, len(values) - n + 1) if middle else (0 if i < n // 2 else len(values) - n, 1)
        derivatives[first + i : first + i + count] = sum(w * values[first + k : first + k + count] for k, w in enumerate(weights))
    return derivatives


def _weights(n: int, at: int) -> Array:
    """The weights of n samples at 0, 1, … in the derivative of their polynomial at one of them."""
    powers = np.vander(np.arange(n) - at, increasing=True).T.astype(np.float64)
    return np.linalg.solve(powers, np.eye(n)[1]) if n > 1 else np.zeros(1)


class Pulse(Sampled):
    """Held samples that a method evaluates anywhere in a step; the analysis finds the effect of an input by them."""

    def signal(self) -> Constant | Held:  # type: ignore[override]
        """The reference signal."""
        return Held(self.values, self.interval, self.start)


Input = Sinusoid | Sampled


def as_input(argument: str, value: Any) -> Input | None:
    """A user's argument as an input; a constant becomes one sample, held forever."""
    if value is None or isinstance(value, (Sinusoid, Sampled)):
        return value
    return Sampled(checks.numbers(argument, value)[np.newaxis], interval=1.0)


def signal(value: Input | None) -> Constant | Held | Sine | Stepped | Curve | None:
    """The reference signal of an input, or None."""
    return None if value is None else value.signal()
