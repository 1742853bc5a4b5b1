"""The damped oscillator, driven by a sinusoidal acceleration (§3)."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...base.arrays import Array
from ...base.checks import number
from ...errors import ArgumentError
from ...model.systems import Oscillator, Sinusoid
from ..base import Scene
from ..ranges import LARGEST, frequency, within


def forced_oscillator(omega: Any = 1.0, damping: Any = 0.1, *, amplitude: Any = 1.0, drive: Any = 0.7, phase: Any = 0.5) -> Scene:
    """A damped oscillator from v = 0, y = 1, driven by amplitude·sin(drive·t + phase), over ten of its own periods.

    In physical form (§3): v is the velocity. The exact solution is the sum of the steady oscillation and of a decaying
    one. The rates of this scene depend on the time and on v.

    Args:
        omega: ω₀ in radians per unit of time, above zero.
        damping: damping ratio D, above 0 and below 1.
        amplitude: amplitude of the acceleration, in units of length per unit of time squared.
        drive: angular frequency of the acceleration, in radians per unit of time, above zero.
        phase: phase of the acceleration, in radians.
    """
    omega = frequency("omega", omega)
    damping = number("damping", damping, positive=True)
    if damping >= 1:
        raise ArgumentError(f"damping: expected a ratio below 1, where the oscillator still swings, got {damping:g}")
    amplitude = within("amplitude", amplitude, -LARGEST, LARGEST)
    drive = frequency("drive", drive)
    phase = number("phase", phase, unit="rad")
    y0, v0 = 1.0, 0.0

    # y = Re(steady·exp(i·drive·t) + free·exp(decay·t)); sin is the real part of −i·exp.
    steady = amplitude * np.exp(1j * (phase - 0.5 * np.pi)) / (omega**2 - drive**2 + 2j * damping * omega * drive)
    decay = omega * (-damping + 1j * np.sqrt(1.0 - damping**2))
    rest_y, rest_v = y0 - steady.real, v0 - (1j * drive * steady).real
    free = rest_y + 1j * (decay.real * rest_y - rest_v) / decay.imag

    def exact(t: Array) -> tuple[Array, Array]:
        forced, dying = steady * np.exp(1j * drive * t), free * np.exp(decay * t)
        return (1j * drive * forced + decay * dying).real, (forced + dying).real

    return Scene(
        name="forced_oscillator",
        title="Forced, damped oscillator",
        section="§3",
        description="A damped mass on a spring under a sinusoidal force: rates that depend on the time and on v.",
        error="as far from the true position or velocity as the largest true one",
        system=Oscillator(omega, damping, a=Sinusoid(amplitude, drive, phase), form="physical"),
        v=np.asarray(v0),
        y=np.asarray(y0),
        dt=0.3 / omega,
        horizon=20.0 * np.pi / omega,
        exact=exact,
    )
