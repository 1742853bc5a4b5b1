"""The undamped oscillator (§3), Hoffmann's test of every method."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...base.arrays import Array
from ...model.systems import Oscillator
from ..base import Scene
from ..ranges import frequency


def oscillator(omega: Any = 1.0) -> Scene:
    """The undamped oscillator from v = 0, y = 1, over ten periods.

    In canonical form (§3): v is the velocity divided by ω₀, and the exact orbit is the unit circle. Hoffmann gives
    no step for it; Φ = ω₀·dt = 0.3 is the angle per step of his Appendix C.

    Args:
        omega: ω₀ in radians per unit of time, above zero.
    """
    omega = frequency("omega", omega)

    def exact(t: Array) -> tuple[Array, Array]:
        return -np.sin(omega * t), np.cos(omega * t)

    return Scene(
        name="oscillator",
        title="Undamped oscillator",
        section="§3",
        description="A mass on a spring, left to itself for ten periods. Each method's stability limit is known here.",
        error="as far from the true state as the true state is from rest",
        system=Oscillator(omega=omega),
        v=np.asarray(0.0),
        y=np.asarray(1.0),
        dt=0.3 / omega,
        horizon=20.0 * np.pi / omega,
        exact=exact,
        period=2.0 * np.pi / omega,
    )
