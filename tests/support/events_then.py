"""What tests of events then share."""

from __future__ import annotations

from typing import Any

import numpy as np
import stepwell as sw

U = 2.0**-53


GRAVITY = 9.81


@sw.system
def ball(t: Any, v: Any, y: Any) -> Any:
    return -GRAVITY


@sw.system
def bumper(t: Any, v: Any, y: Any, *, restitution: Any = 1.0) -> Any:
    return -GRAVITY


@sw.system
def free(t: Any, v: Any, y: Any) -> Any:
    return 0.0 * y


WALLS = [
    sw.Event(lambda t, v, y: y, direction=-1, then=lambda t, v, y: (-v, 0.0 * y), name="left"),
    sw.Event(lambda t, v, y: y - 1.0, direction=1, then=lambda t, v, y: (-v, 0.0 * y + 1.0), name="right"),
]


def ground(restitution: float) -> sw.Event:
    return sw.Event(lambda t, v, y: y, direction=-1, then=lambda t, v, y: (-restitution * v, y), name="ground")


def times_of_bounces(height: Any, restitution: float, n: int) -> Any:
    """The fall, and then twice its time by the restitution's power for each flight."""
    fall = np.sqrt(2.0 * height / GRAVITY)
    return np.stack([fall * (1.0 + 2.0 * sum(restitution**j for j in range(1, k + 1))) for k in range(n)], -1)
