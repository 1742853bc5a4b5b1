"""A block on a spring and a rough plane, which comes to rest beside the spring's own place of rest (§8)."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ...base.arrays import Array
from ...model.systems import Oscillator
from ..base import Scene
from ..ranges import moderate


def sticking_block(friction: Any = 0.13) -> Scene:
    """A block on a spring, k = m = 1, from rest at y = 1; friction stops it where the spring is too weak to pull it on.

    Each half swing is half a cosine about ±μN/k. So the amplitude falls by 2μN/k in each, and the block comes to rest after a
    whole number of them: at y = −0.04 after four, for μN = 0.13.

    Args:
        friction: μN/m in units of length per unit of time squared, above zero.
    """
    friction = moderate("friction", friction, "units of length per unit of time squared")
    # At the end of that half swing the spring pulls no harder than friction holds.
    last = max(0, math.ceil((1.0 - friction) / (2.0 * friction)))

    def exact(t: Array) -> tuple[Array, Array]:
        swing = np.clip(np.floor(t / math.pi), 0, last)
        side = 1.0 - 2.0 * np.remainder(swing, 2.0)
        amplitude = np.where(swing < last, 1.0 - (2.0 * swing + 1.0) * friction, 0.0)
        rest = np.where(swing < last, friction, 1.0 - 2.0 * last * friction)
        angle = t - math.pi * swing
        return -side * amplitude * np.sin(angle), side * (rest + amplitude * np.cos(angle))

    return Scene(
        name="sticking_block",
        title="Sticking block",
        section="§8",
        description="A block on a spring and a rough plane: each half swing is shorter by the same length, until it sticks.",
        error="as far from the true place as the start, or as wrong a velocity as the largest true one",
        system=Oscillator(1.0, friction=friction, form="physical"),
        v=np.asarray(0.0),
        y=np.asarray(1.0),
        dt=0.05,
        horizon=math.pi * (min(last, 19) + 0.7),
        exact=exact,
    )
