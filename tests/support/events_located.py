"""What tests of events located share."""

from __future__ import annotations

from typing import Any

import numpy as np
import stepwell as sw
from stepwell.reference import events


def error_of_bounces(method: str, t: float = 0.0, **steps: Any) -> float:
    """Falling from 1 under gravity 1, bouncing with half of the speed: at √2·(1, 1 + 1, 1 + 1 + 1/2, …).

    Times asked for with ``at`` count from the bounce before.
    """

    @sw.system
    def ball(t: Any, v: Any, y: Any, *, gravity: float = 1.0) -> Any:
        return -gravity

    ground = sw.Event(lambda t, v, y: y, direction=-1, terminal=True, name="ground")
    v, y, times = 0.0, 1.0, []
    for _ in range(6):
        ask = steps | ({"at": [t + each for each in steps["at"]]} if "at" in steps else {})
        run = sw.integrate(ball(), method, v=v, y=y, t0=t, events=ground, **ask)
        assert run.stopped_at is not None
        v, y, t = -0.5 * float(run.v[-1]), float(run.y[-1]), float(run.stopped_at)
        assert -1e-13 < y <= 0.0  # at or past the ground
        times.append(t)
    expected = 2**0.5 * (1.0 + 2.0 * np.concatenate([[0.0], np.cumsum(0.5 ** np.arange(1, 6))]))
    return float(np.abs(np.array(times) - expected).max())


def straight(trial: Any, low: Any, high: Any, before: Any, after: Any, v: Any, y: Any) -> Any:
    """Mistake: by a straight line between both ends of the step."""
    share = before / (before - after)
    return (share, *trial(np.arange(len(before)), share)[1:])


def low_end(trial: Any, low: Any, high: Any, before: Any, after: Any, v: Any, y: Any) -> Any:
    """Mistake: the end of the bracket that is before the event."""
    share, *_ = events.located(trial, low, high, before, after, v, y)
    share = share * (1.0 - 2.0 * events.SPACING)
    return (share, *trial(np.arange(len(before)), share)[1:])
