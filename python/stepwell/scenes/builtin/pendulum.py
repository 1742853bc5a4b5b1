"""A pendulum that swings far."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ..._checks import Array, number
from ...errors import ArgumentError
from ...systems import Pendulum
from ..base import Scene
from ..ranges import frequency

#: The arithmetic-geometric mean doubles its digits with every step; this many are enough for any amplitude that a float can tell
#: from 180°.
MAX_ITERATIONS = 40


def pendulum(amplitude: Any = 90.0, omega: Any = 1.0) -> Scene:
    """The undamped pendulum from rest at its amplitude, over three periods.

    The larger the amplitude, the longer the period: 2π/ω₀ for small swings, 18 % more at 90°, and 144 % more at 170°.

    Args:
        amplitude: in degrees, above 0 and below 180.
        omega: ω₀ of small swings in radians per unit of time, above zero.

    Raises:
        ArgumentError: what is wrong with which argument.
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
        section="beyond the document",
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


def quarter(complement: float) -> float:
    """The quarter period K of Jacobi's functions, of the complementary modulus k'."""
    return 0.5 * math.pi / _means(complement)[0][-1]


def elliptic(u: Array, modulus: float, complement: float) -> tuple[Array, Array, Array]:
    """Jacobi's sn, cn and dn of u, within some periods of 0, by the arithmetic-geometric mean (Abramowitz and Stegun 16.4)."""
    a, c = _means(complement)
    angle = 2.0 ** (len(a) - 1) * a[-1] * u
    for n in range(len(a) - 1, 0, -1):
        angle = 0.5 * (angle + np.arcsin(np.clip(c[n] / a[n] * np.sin(angle), -1.0, 1.0)))
    sn, cn = np.sin(angle), np.cos(angle)
    # 1 − k²·sn², as a sum of what is not negative.
    return sn, cn, np.sqrt(complement * complement + modulus * modulus * cn * cn)


def _means(complement: float) -> tuple[list[float], list[float]]:
    """The arithmetic means of 1 and k', and half the differences of what they are the means of."""
    a, b, means, halves = 1.0, complement, [1.0], [0.0]
    for _ in range(MAX_ITERATIONS):
        a, b, half = 0.5 * (a + b), math.sqrt(a * b), 0.5 * (a - b)
        means.append(a)
        halves.append(half)
        if half <= 1e-17 * a or half == 0.0 or abs(a - b) <= 2e-16 * a:
            break
    return means, halves
