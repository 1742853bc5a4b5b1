"""A cube of jelly: particles in a cubic lattice, joined to all of their neighbours by springs."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np

from ...base.checks import count, fits
from ...model.systems import Springs
from ..base import Scene
from ..ranges import LARGEST, within


def jelly_cube(n: Any = 4, twist: Any = 4.0) -> Scene:
    """A free cube of n × n × n particles, one unit of length wide, whose top and bottom turn against each other at first.

    Springs join each particle to its neighbours along the edges, the faces and through the middle of the lattice's cubes, up to
    26. The masses are 1 in all. No force acts from outside: momentum stays 0, and so does the turn as a whole.

    Args:
        n: particles along an edge, two or more.
        twist: how fast the top turns at first, and the bottom the other way, in radians per unit of time.
    """
    n, twist = count("n", n, 2), within("twist", twist, -LARGEST, LARGEST, "radians per unit of time")
    fits("n: the springs", 600.0 * n**3, (), "take fewer particles")
    at = np.arange(n**3).reshape(n, n, n)
    pairs = []
    for step in itertools.product((-1, 0, 1), repeat=3):
        if step > (0, 0, 0):  # one of both directions
            near = [slice(max(0, -d), n - max(0, d)) for d in step]
            far = [slice(max(0, d), n - max(0, -d)) for d in step]
            pairs.append(np.stack([at[tuple(near)].ravel(), at[tuple(far)].ravel()], axis=1))
    edge = np.linspace(-0.5, 0.5, n)
    y = np.stack(np.meshgrid(edge, edge, edge, indexing="ij"), axis=-1).reshape(-1, 3)
    # v = ω × r with ω along the third axis, ahead above the middle and back below it.
    turn = 2.0 * twist * y[:, 2]
    v = np.stack([-turn * y[:, 1], turn * y[:, 0], np.zeros(len(y))], axis=1)
    mass = 1.0 / n**3
    system = Springs(np.concatenate(pairs), stiffness=mass * FASTEST**2 / 52.0, layout=y, masses=mass)
    return Scene(
        name="jelly_cube",
        title=f"Jelly cube of {n} × {n} × {n} particles",
        section="not in Hoffmann (2002)",
        description="A free cube of jelly twists to and fro: a net in space, whose momentum stays what it is.",
        error="as far from the true places or velocities as the largest true ones",
        system=system,
        v=v,
        y=y,
        dt=DT,
        horizon=HORIZON,
    )


#: A bound of the largest ω, in 1 per unit of time: twice the stiffness of 26 springs over the mass.
FASTEST = 120.0
#: Half of the longest safe step of False Euler, and some swings.
DT, HORIZON = 1.0 / 120.0, 1.5
