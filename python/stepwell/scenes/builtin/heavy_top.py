"""A spinning top on its tip."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ...base.checks import number
from ...errors import ArgumentError
from ...model.systems import RigidBody
from ..base import Scene
from ..ranges import within


def heavy_top(spin: Any = 10.0, lean: Any = 30.0) -> Scene:
    """A top of moments (1, 1, 0.5) about its tip, with weight times distance 4, is let go while it spins; over one round or so.

    The axis falls a little, which makes it go round, and comes up again, at a cusp. A top that spins fast nods fast and little.
    The energy, the angular momentum about the vertical and the spin about the axis are constant. There is no exact solution
    here; charts and advice take a run to a tight tolerance.

    Args:
        spin: ω₃, in rad per unit of time, 1e-6 to 1e6.
        lean: of the axis from the vertical at the start, in degrees, above 0 and below 180.
    """
    spin = within("spin", spin, 1e-6, 1e6, "rad per unit of time")
    lean = number("lean", lean, unit="degrees")
    if not 0.0 < lean < 180.0:
        raise ArgumentError(f"lean: expected degrees above 0 and below 180, got {lean:g}")
    half = math.radians(0.5 * lean)
    return Scene(
        name="heavy_top",
        title="Heavy top",
        section="§12",
        description="A spinning top is let go on its tip: its axis falls, goes round and comes up again, at cusps.",
        error="as far from the true angular velocity, or from the true quaternion, as the largest true one is long",
        system=RigidBody([1.0, 1.0, 0.5], weight=4.0, centre=[0.0, 0.0, 1.0]),
        v=np.array([0.0, 0.0, spin]),
        y=np.array([math.cos(half), math.sin(half), 0.0, 0.0]),
        dt=0.1 / spin,
        horizon=2.0 * math.pi * (0.5 * spin) / 4.0,
    )
