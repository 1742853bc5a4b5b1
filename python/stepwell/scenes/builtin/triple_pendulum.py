"""Three rods, each hanging from the one before."""

from __future__ import annotations

from typing import Any

from ..base import Scene
from .double_pendulum import hanging_rods


def triple_pendulum(angles: Any = (90.0, 120.0, 150.0)) -> Scene:
    """Three rods of length 1 with unit masses at their ends, under gravity 1, from rest; see ``double_pendulum``.

    Args:
        angles: of the rods from straight down in degrees, shape (3,).
    """
    return hanging_rods(
        "triple_pendulum",
        "Triple pendulum",
        "Three rods swing from rest high up; the outermost whips about, and no motion is known for long.",
        angles,
        3,
        horizon=30.0,
    )
