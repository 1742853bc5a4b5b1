"""A pendulum that swings far."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ...base.arrays import Array
from ...base.checks import number
from ...errors import ArgumentError
from ...model.systems import Pendulum
from ..base import Scene
from ..elliptic import elliptic, quarter
from ..ranges import frequency


def pendulum(amplitude: Any = 90.0, omega: Any = 1.0) -> Scene:
    """The undamped pendulum from rest at its amplitude, over three periods.

    The larger the amplitude, the longer the period: 2π/ω₀ for small swings, 18 % more at 90°, and 144 % more at 170°.

    Args:
        amplitude: in degrees, above 0 and below 180.
        omega: ω₀ of small swings in radians per unit of time, above zero.
    """
    amplitude = number("amplitude", amplitude, unit="degrees")
    if not 0.0 < amplitude < 180.0:
        raise ArgumentError(f"amplitude: expected degrees above 0 and below 180, got {amplitude:g}")
    omega = frequency("omega", omega)
    # Jacobi's modulus and its complement; the latter from the angle to the top keeps its digits for an amplitude near 180°.
    modulus = math.sin(math.radians(0.5 * amplitude))
    complement = math.sin(math.radians(0.5 * (180.0 - amplitude)))
    period = 4.0 * quarter(complement) / omega

    def exact(t: Array) -> tuple[Array, Array]:
        # sin ½y = k·cn/dn and cos ½y = k'/dn.
        sn, cn, dn = elliptic(omega * np.remainder(t + 0.5 * period, period) - 0.5 * omega * period, modulus, complement)
        return -2.0 * omega * modulus * complement * sn / dn, 2.0 * np.arctan2(modulus * cn, complement)

    return Scene(
        name="pendulum",
        title=f"Pendulum, {amplitude:g}°",
        section="not in Hoffmann (2002)",
        description="A pendulum swings so far that its period is no longer that of small swings; its motion is known still.",
        error="as far from the true angle or velocity as the largest true one",
        system=Pendulum(omega),
        v=np.asarray(0.0),
        y=np.asarray(math.radians(amplitude)),
        dt=0.3 / omega,
        horizon=3.0 * period,
        exact=exact,
        period=period,
    )
