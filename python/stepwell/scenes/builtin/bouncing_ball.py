"""A ball that bounces until it rests (§1, elastic reflection)."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ...base.arrays import Array
from ...base.checks import number
from ...errors import ArgumentError
from ...model.surfaces import Floor
from ...model.systems import Particles
from ..base import Scene
from ..ranges import moderate

#: Impacts are computed down to this share of the first speed, and up to this number.
LEAST_SPEED, MOST_IMPACTS = 1e-17, 100_000

#: The velocity along the floor, as a share of that of the first impact.
ALONG = 0.1


def bouncing_ball(restitution: Any = 0.8, height: Any = 1.0, gravity: Any = 9.81) -> Scene:
    """A ball is thrown sideways, falls, and bounces lower and lower, until it slides along the floor.

    An impact at speed u leaves the speed e·u, so the times between impacts are a geometric series. With the speed u at the first
    impact the ball comes to rest after the time (1 + e)/(1 − e)·u/g.

    Args:
        restitution: e, 0 to 1, without a unit.
        height: the height from which it falls, in units of length, above zero.
        gravity: acceleration of free fall, above zero.
    """
    restitution = number("restitution", restitution)
    if not 0.0 <= restitution <= 1.0:
        raise ArgumentError(f"restitution: expected a number from 0 to 1, got {restitution:g}")
    height = moderate("height", height, "units of length")
    gravity = moderate("gravity", gravity, "units of length per unit of time squared")
    speed = math.sqrt(2.0 * gravity * height)
    fall, along = speed / gravity, ALONG * speed
    horizon = 10.5 * fall
    leaving, impacts = _impacts(speed, fall, restitution, gravity, horizon)

    def exact(t: Array) -> tuple[Array, Array]:
        flight = np.searchsorted(impacts, t, side="right")
        since = t - np.concatenate([[0.0], impacts])[flight]
        up = np.concatenate([[0.0], leaving])[flight]
        start = np.where(flight == 0, height, 0.0)
        y = start + (up - 0.5 * gravity * since) * since
        v = up - gravity * since
        rests = up == 0.0
        rests &= flight > 0
        v, y = np.where(rests, 0.0, v), np.where(rests, 0.0, y)
        blocks = np.stack([np.full_like(t, along), v], axis=-1), np.stack([along * t, y], axis=-1)
        return blocks[0][:, np.newaxis], blocks[1][:, np.newaxis]

    return Scene(
        name="bouncing_ball",
        title=f"Bouncing ball, e = {restitution:g}",
        section="§1",
        description="A ball bounces lower and lower and comes to rest; no impact adds energy, wherever in a step it is.",
        error="as far from the true place as the ball rolls, or from the true velocity as that of the first impact",
        system=Particles(gravity=gravity, floor=Floor(restitution=restitution), dim=2),
        v=np.array([[along, 0.0]]),
        y=np.array([[0.0, height]]),
        dt=fall / 26.5,
        horizon=horizon,
        exact=exact,
    )


def _impacts(speed: float, fall: float, restitution: float, gravity: float, horizon: float) -> tuple[Array, Array]:
    """The speeds after the impacts and the times of the impacts. The last speed is 0 if the ball comes to rest."""
    leaving: list[float] = []
    times: list[float] = []
    t = fall
    while t <= horizon and len(times) < MOST_IMPACTS:
        speed_left = leaving[-1] if leaving else speed
        up = restitution * speed_left
        if up <= LEAST_SPEED * speed:
            up = 0.0
        leaving.append(up)
        times.append(t)
        if up == 0.0:
            break
        t += 2.0 * up / gravity
    return np.array(leaving), np.array(times)
