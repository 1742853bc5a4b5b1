"""Two rods, one hanging from the other."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...base.checks import numbers
from ...errors import ShapeError
from ...model.systems import Rods
from ..base import Scene


def double_pendulum(angles: Any = (120.0, 150.0)) -> Scene:
    """Two rods of length 1 with unit masses at their ends, under gravity 1, from rest.

    High enough the motion is chaotic: charts and advice take a run to a tight tolerance as the true one, as long as a less tight
    one agrees with it. Its equations in angles would be another system; here each rod is a constraint on x and height.

    Args:
        angles: of the rods from straight down in degrees, shape (2,).
    """
    return hanging_rods(
        "double_pendulum",
        "Double pendulum",
        "Two rods swing from rest high up, and soon without any order; each rod is a constraint that a method has to keep.",
        angles,
        2,
        horizon=30.0,
    )


def hanging_rods(name: str, title: str, description: str, angles: Any, count: int, horizon: float) -> Scene:
    """A chain of rods of length 1 with unit masses, from rest at these angles from straight down."""
    angles = numbers("angles", angles, unit="degrees")
    if angles.shape != (count,):
        raise ShapeError(f"angles: expected one for each of {count} rods, in degrees, got shape {angles.shape}")
    turned = np.radians(angles)
    y = np.cumsum(np.stack([np.sin(turned), -np.cos(turned)], axis=-1), axis=0)
    return Scene(
        name=name,
        title=title,
        section="not in Hoffmann (2002)",
        description=description,
        error="as far from the true places or velocities as the largest true ones",
        system=Rods(np.ones(count), [((0.0, 0.0), 0), *((i, i + 1) for i in range(count - 1))], 1.0),
        v=np.zeros((count, 2)),
        y=y,
        dt=0.01,
        horizon=horizon,
    )
