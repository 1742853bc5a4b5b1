"""A pendulum in space that circles (§12)."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ...base.arrays import Array
from ...base.checks import number
from ...errors import ArgumentError
from ...model.systems import Pendulum3D
from ..base import Scene


def conical_pendulum(angle: Any = 60.0) -> Scene:
    """A rod of length 1 that circles about the vertical at one angle, under gravity 1, for three turns.

    A turn takes 2π·√(cos θ), 4.442883 at 60°. The rod's length is not a coordinate of the motion: it is a constraint that a step
    misses, and that ``LengthControl`` or ``Projection("length")`` keeps.

    Args:
        angle: from straight down in degrees, above 0 and below 90.
    """
    angle = number("angle", angle, unit="degrees")
    if not 0.0 < angle < 90.0:
        raise ArgumentError(f"angle: expected degrees above 0 and below 90, got {angle:g}")
    out, height = math.sin(math.radians(angle)), -math.sin(math.radians(90.0 - angle))
    omega = 1.0 / math.sqrt(-height)
    period = 2.0 * math.pi / omega

    def exact(t: Array) -> tuple[Array, Array]:
        turned = omega * np.remainder(t, period)
        co, si, level = np.cos(turned), np.sin(turned), np.full_like(turned, height)
        v = np.stack([-omega * out * si, omega * out * co, np.zeros_like(turned)], axis=-1)
        return v, np.stack([out * co, out * si, level], axis=-1)

    v, y = exact(np.zeros(1))
    return Scene(
        name="conical_pendulum",
        title=f"Conical pendulum, {angle:g}°",
        section="§12",
        description="A rod circles about the vertical in x, y and z; its length is a constraint that a method has to keep.",
        error="as far from the true place or velocity as the largest true one",
        system=Pendulum3D(),
        v=v[0],
        y=y[0],
        dt=0.04 * period,
        horizon=3.0 * period,
        exact=exact,
        period=period,
    )
