"""Two bodies on Kepler's ellipse."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ...base.arrays import Array
from ...base.checks import number
from ...errors import ArgumentError
from ...model.systems import NBody
from ..base import Scene

#: The most steps of Newton's method from the far end, for any eccentricity that is not 1 as a float.
MAX_ITERATIONS = 100


def kepler(e: Any = 0.9, share: Any = 0.5) -> Scene:
    """Two bodies on an ellipse, from where they are nearest, over three periods.

    Newton's law with G = 1 and masses of 1 in all, so that μ = 1; the semi-major axis is 1 and the period 2π. For e = 0.9 the
    distance goes from 0.1 to 1.9, the speed from 4.36 to 0.23: what a fixed step is not made for.

    Args:
        e: eccentricity, 0 or more and below 1.
        share: of the second body in the mass, above 0 and below 1.
    """
    e, share = number("e", e), number("share", share)
    if not 0.0 <= e < 1.0:
        raise ArgumentError(f"e: expected an eccentricity of 0 or more and below 1, got {e:g}")
    if not 0.0 < share < 1.0:
        raise ArgumentError(f"share: expected a share of the mass above 0 and below 1, got {share:g}")
    masses = np.array([1.0 - share, share])
    # Both bodies on the line through their centre of mass, which rests at the origin.
    lever = np.array([-share, 1.0 - share])[:, np.newaxis]
    minor = math.sqrt((1.0 - e) * (1.0 + e))

    def exact(t: Array) -> tuple[Array, Array]:
        angle = eccentric_anomaly(t, e)
        c, s = np.cos(angle), np.sin(angle)
        rate = 1.0 / (1.0 - e * c)
        v = np.stack([-s * rate, minor * c * rate], axis=-1)
        y = np.stack([c - e, minor * s], axis=-1)
        return v[:, np.newaxis] * lever, y[:, np.newaxis] * lever

    v, y = exact(np.zeros(1))
    return Scene(
        name="kepler",
        title=f"Kepler's ellipse, e = {e:g}",
        section="not in Hoffmann (2002)",
        description="Two bodies on a long ellipse under Newton's law: slow far apart, twenty times as fast where they meet.",
        error="as far from the true places or velocities as the largest true ones",
        system=NBody(masses, force="newton"),
        v=v[0],
        y=y[0],
        dt=0.01,
        horizon=6.0 * math.pi,
        exact=exact,
        period=2.0 * math.pi,
    )


def eccentric_anomaly(t: Array, e: float) -> Array:
    """E of Kepler's equation E − e·sin E = t, for times of shape (n,) and a period of 2π, shape (n,), within [−π, π].

    Newton's method from the far end, E = π, where the left side is convex, so that it cannot overshoot.
    """
    mean = np.remainder(t + math.pi, 2.0 * math.pi) - math.pi
    wanted = np.abs(mean)
    angle = np.full_like(wanted, math.pi)
    for _ in range(MAX_ITERATIONS):
        # (1 − e)·E + e·(E − sin E) keeps its digits where e and 1 are close.
        excess = (1.0 - e) * angle + e * (angle - np.sin(angle)) - wanted
        nearer = np.maximum(angle - excess / (1.0 - e * np.cos(angle)), 0.0)
        if (np.abs(nearer - angle) <= 1e-16 * angle).all():
            break
        angle = nearer
    return np.copysign(angle, mean)
