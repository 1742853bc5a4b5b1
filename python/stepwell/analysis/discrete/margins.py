"""Frequency responses of linear systems, of continuous time and sampled, and the margins of a loop."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import inf, pi
from typing import Any

import numpy as np

from ...base import checks
from ...base.arrays import Array
from ...base.immutable import ValueEquality
from ...errors import ArgumentError, ShapeError
from ...model.systems import LinearSystem
from ...model.systems.linear import part_of
from ..stability import eigen
from .response import Complex, response
from .systems import DiscreteSystem

#: Frequencies in each decade of the search for crossings, and how far it goes beyond the corners of a system, as a factor.
IN_DECADE, BEYOND = 200, 1e4

#: The phase of a dead time up to which each turn of it is seen, in radians; beyond that only those between frequencies above.
MOST_TURNS = 1e4

#: Halvings of an interval with a crossing: to the last digit.
HALVINGS = 60


def frequency_response(system: Any, omega: Any) -> Complex:
    """Z/X at s = jω of a linear system, or at z = e^(jω·dt) of a sampled one.

    Args:
        system: a linear system with inputs and outputs, of stepwell, SciPy or python-control, or a ``DiscreteSystem``.
        omega: frequencies ω in radians per unit of time, shape (frequencies,) or a number.

    Returns:
        Complex numbers, shape (*frequencies, *batch); of several inputs or outputs (*frequencies, r, m, *batch).

    Raises:
        ArgumentError: if an argument is wrong.

    Example:
        >>> lag = sw.TransferFunction(1.0, [1.0, 1.0])
        >>> sw.frequency_response(lag, 1.0).round(6)
        np.complex128(0.5-0.5j)
    """
    if isinstance(system, DiscreteSystem):
        return system.frequency_response(omega)
    omega = checks.numbers("omega", omega, unit="rad per unit of time")
    part = part_of("system", system, of_states=True)
    return response(part.A, part.B, part.C, part.D, 1j * omega)


@dataclass(frozen=True, eq=False)
class Margins(ValueEquality):
    """How far an open loop is from instability when it is closed by negative feedback.

    Attributes:
        gain: the factor by which the gain may change, up or down, until the closed loop oscillates: of the two the nearer to 1 in
            decibels; infinite if no gain does that.
        phase: the phase, in degrees, by which the loop may lag more (above zero) until the closed loop oscillates, or by which it
            must lead more (below zero); infinite where the gain is never 1.
        gain_frequency: where the phase is −180°, in radians per unit of time; NaN without such a frequency.
        phase_frequency: where the gain is 1; NaN without such a frequency.
        delay: the dead time that the loop can bear, in units of time: the phase margin as a time.
    """

    gain: float
    phase: float
    gain_frequency: float
    phase_frequency: float

    @property
    def delay(self) -> float:
        """The dead time that the loop can bear."""
        if not self.phase < inf:
            return inf
        return max(0.0, self.phase) * pi / 180.0 / self.phase_frequency


def margins(loop: Any, *, delay: float = 0.0) -> Margins:
    """The gain and phase margins of an open loop with one input and one output.

    They say something if the loop itself is stable, as most are; else count the poles of the closed loop, ``feedback(loop)``.

    Args:
        loop: a linear system, from the sum to where the feedback is taken; or a ``DiscreteSystem``, seen up to π/dt.
        delay: dead time in the loop, in units of time; that of a ``DiscreteSystem`` is an argument of ``discretise``.

    Raises:
        ArgumentError: if it is no such system, or has several inputs, outputs or members.

    Example:
        >>> found = sw.margins(sw.TransferFunction(4.0, [1.0, 3.0, 3.0, 1.0]))  # 4/(1 + s)³
        >>> round(found.gain, 6), round(found.phase, 3), round(found.gain_frequency, 6)  # 8/4, at √3
        (2.0, 27.142, 1.732051)
    """
    delay = checks.number("delay", delay, unit="units of time")
    if delay < 0.0:
        raise ArgumentError(f"delay: expected a time of zero or more, got {delay:g}")
    if isinstance(loop, DiscreteSystem):
        if delay:
            raise ArgumentError("delay: a DiscreteSystem has its dead time within; give it to discretise(system, dt, delay=…)")
        P, last = loop.standard()[0], pi / loop.dt
        with np.errstate(all="ignore"):
            corners = np.abs(np.log(eigen.eigenvalues(P).reshape(-1))) / loop.dt
        shape, batch = loop.D.shape[:2], loop.batch
    else:
        part, last = part_of("loop", loop, of_states=True), inf
        loop = LinearSystem.of(loop)
        corners, shape, batch = np.abs(eigen.eigenvalues(part.A)).reshape(-1), part.D.shape[:2], loop.batch
    if shape != (1, 1) or batch:
        what = f"a batch {batch}" if batch else f"{shape[1]} inputs and {shape[0]} outputs"
        raise ShapeError(f"loop: expected one input, one output and one member, got {what}")

    def of(omega: Any) -> Any:
        return frequency_response(loop, omega) * np.exp(-1j * delay * omega) if delay else frequency_response(loop, omega)

    corners = np.append(corners[np.isfinite(corners) & (corners > 0.0)], [1.0 / delay] if delay else [])
    low, high = (corners.min() / BEYOND, corners.max() * BEYOND) if corners.size else (1.0 / BEYOND, BEYOND)
    high = min(high, last)
    low = min(low, high / BEYOND)
    omega = np.geomspace(low, high, max(2, round(IN_DECADE * np.log10(high / low))))
    if delay:  # whose phase turns evenly, at last faster than the grid
        omega = np.union1d(omega, np.arange(low, min(high, MOST_TURNS / delay), 0.5 / delay))
    return of_response(of, omega, last, delay)


def of_response(of: Callable[[Any], Any], omega: Array, last: float, delay: float = 0.0) -> Margins:
    """The margins of a loop by its response, which is searched at these frequencies; samples end at the last one.

    ``delay`` is a dead time in the response, whose lag may be more than a turn.
    """
    at = of(omega)
    ones = _crossings(of, omega, at, lambda z: np.abs(z) - 1.0)
    turns = [w for w in _crossings(of, omega, at, lambda z: z.imag) if of(w).real < 0.0]
    if last < inf and (end := of(last)).real < 0.0 and abs(end.imag) < 1e-9 * abs(end.real):
        turns.append(last)
    gains = {w: 1.0 / abs(of(w)) for w in turns}
    phases = {w: float(np.degrees(np.angle(-of(w) * np.exp(1j * delay * w)) - delay * w)) for w in ones}
    at_gain = min(gains, key=lambda w: abs(np.log(gains[w])), default=None)
    at_phase = min(phases, key=lambda w: phases[w] if delay else abs(phases[w]), default=None)
    return Margins(
        inf if at_gain is None else float(gains[at_gain]),
        inf if at_phase is None else phases[at_phase],
        np.nan if at_gain is None else float(at_gain),
        np.nan if at_phase is None else float(at_phase),
    )


def _crossings(of: Any, omega: Array, at: Any, level: Any) -> list[float]:
    """The frequencies at which a function of the response changes its sign, by halving."""
    value = level(at)
    i = np.flatnonzero((np.sign(value[:-1]) != np.sign(value[1:])) & np.isfinite(value[:-1]) & np.isfinite(value[1:]))
    low, high, side = omega[i], omega[i + 1], np.sign(value[i])
    for _ in range(HALVINGS if len(i) else 0):
        middle = 0.5 * (low + high)
        is_before = np.sign(level(of(middle))) == side
        low, high = np.where(is_before, middle, low), np.where(is_before, high, middle)
    return [float(each) for each in high]
