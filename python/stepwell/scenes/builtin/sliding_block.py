"""A block that slides to a stop (§8)."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...base.arrays import Array
from ...model.systems import Oscillator
from ..base import Scene
from ..ranges import moderate


def sliding_block(friction: Any = 0.5 * 9.81, speed: Any = 3.0) -> Scene:
    """A block on a plane, which friction stops after v₀²/(2μg), and which then rests.

    Args:
        friction: the deceleration μg in units of length per unit of time squared, above zero.
        speed: v₀ in units of length per unit of time, above zero.
    """
    friction = moderate("friction", friction)
    speed = moderate("speed", speed)
    stop = speed / friction

    def exact(t: Array) -> tuple[Array, Array]:
        moving = np.minimum(t, stop)
        return np.maximum(speed - friction * t, 0.0), (speed - 0.5 * friction * moving) * moving

    return Scene(
        name="sliding_block",
        title="Sliding block",
        section="§8",
        description="A block slides on a plane until friction stops it, and stays there: where it stops tells methods apart.",
        error="as far from the true place as the block slides, or as wrong a velocity as that of the start",
        system=Oscillator(0.0, friction=friction, form="physical"),
        v=np.asarray(speed),
        y=np.asarray(0.0),
        dt=stop * 0.6 / 22.0,
        horizon=1.5 * stop,
        exact=exact,
    )
