"""The Pythagorean three-body problem (Burrau 1913; Szebehely and Peters 1967)."""

from __future__ import annotations

import numpy as np

from ...model.systems import NBody
from ..base import Scene
from ..taylor import Orbit

#: At about t = 60 the first body escapes, and the other two stay a pair: the motion is simple from then on.
UNTIL = 70.0


def pythagorean() -> Scene:
    """Masses 3, 4 and 5 from rest at the corners of the right triangle with these sides, up to t = 10.

    Under Newton's law they fall into near collisions: masses 4 and 5 pass each other at a distance of 0.0097 at t = 1.879, of
    0.061 at t = 3.80 and of 0.0085 at t = 8.760. There the velocities turn round within a time of 0.0004, so a fixed step short
    enough for that is ten thousand times too short for the rest. ``exact`` is computed in multi-precision, up to t = 70.
    """
    masses = [3.0, 4.0, 5.0]
    v = np.zeros((3, 2))
    y = np.array([[1.0, 3.0], [-2.0, -1.0], [1.0, -1.0]])
    return Scene(
        name="pythagorean",
        title="Pythagorean problem",
        section="not in Hoffmann (2002)",
        description="Masses 3, 4 and 5 fall from rest into near collisions, which no step of fixed length is small enough for.",
        error="bodies as far from their true places as the largest true distance from the centre, or likewise velocities",
        system=NBody(masses, force="newton"),
        v=v,
        y=y,
        dt=0.001,
        horizon=10.0,
        exact=Orbit(masses, v, y),
        until=UNTIL,
    )
