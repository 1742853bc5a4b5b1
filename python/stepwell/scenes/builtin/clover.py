"""The clover leaf (Appendix C)."""

from __future__ import annotations

import math

import numpy as np

from ...base.arrays import Array
from ...model.systems import NBody
from ..base import Scene

#: The angles of the three bodies on the unit circle at t = 0, in radians.
ANGLES = np.radians([210.0, -30.0, 90.0])


def clover() -> Scene:
    """Three bodies chase each other round the unit circle; Hoffmann's first 100 steps of 0.3.

    Three unit masses under the 1/r law (Appendix C). The exact orbit is the unit circle, clockwise with angular speed
    1; Hoffmann's False Euler draws a clover leaf around it.
    """

    def exact(t: Array) -> tuple[Array, Array]:
        angle = ANGLES - t[:, np.newaxis]
        c, s = np.cos(angle), np.sin(angle)
        return np.stack([s, -c], axis=-1), np.stack([c, s], axis=-1)

    v, y = exact(np.zeros(1))
    return Scene(
        name="clover",
        title="Clover leaf",
        section="Appendix C",
        description="Three bodies on one circle under the 1/r law; large steps make the circle a clover leaf.",
        error="bodies as far from their true places as those are from the centre",
        system=NBody(masses=[1.0, 1.0, 1.0], force="logarithmic"),
        v=v[0],
        y=y[0],
        dt=0.3,
        horizon=30.0,
        exact=exact,
        period=2.0 * math.pi,
    )
