"""A cloth that hangs from two corners, as games have it: particles in rows and columns, joined by springs."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...base.checks import count, fits
from ...errors import ArgumentError
from ...model.systems import Springs
from ..base import Scene
from ..ranges import LARGEST, within


def cloth(n: Any = 32, shear: Any = 0.5, damping: Any = 0.0) -> Scene:
    """A square cloth of n × n particles, one unit of length wide, from rest in a level position, hung by two corners of one side.

    Springs join neighbours in rows and columns, and across every mesh. The masses are 1 in all, gravity is 9.81, and the springs
    are so stiff that False Euler is stable from 480 steps per unit of time on, whatever n is: half of what the scene takes.

    Args:
        n: particles in a row, two or more.
        shear: stiffness of the springs across the meshes, as a share of that of the others, zero or more; none with 0.
        damping: c of all springs, relative to the critical damping of the fastest mode of one alone, zero or more.
    """
    n = count("n", n, 2)
    fits("n: the springs", 200.0 * n * n, (), "take fewer particles")
    shear, damping = within("shear", shear, 0.0, LARGEST), within("damping", damping, 0.0, LARGEST)
    for name, share in (("shear", shear), ("damping", damping)):
        if share < 0.0:
            raise ArgumentError(f"{name}: expected a share of zero or more, got {share:g}")
    at = np.arange(n * n).reshape(n, n)
    straight = [(at[:, :-1], at[:, 1:]), (at[:-1], at[1:])]
    across = [(at[:-1, :-1], at[1:, 1:]), (at[:-1, 1:], at[1:, :-1])] if shear else []
    pairs = np.concatenate([np.stack([i.ravel(), j.ravel()], axis=1) for i, j in (*straight, *across)])
    y = np.zeros((n * n, 3))
    y[:, 0], y[:, 1] = np.tile(np.linspace(0.0, 1.0, n), n), np.repeat(np.linspace(0.0, -1.0, n), n)
    mass = 1.0 / (n * n)
    # The bound of ω² is that of two particles with all their neighbours: 8·(1 + shear)·k/m.
    stiffness = mass * FASTEST**2 / (8.0 * (1.0 + shear))
    stiffnesses = np.full(len(pairs), stiffness)
    stiffnesses[2 * n * (n - 1) :] *= shear
    system = Springs(
        pairs,
        stiffness=stiffnesses,
        layout=y,
        masses=mass,
        fixed=[0, n - 1],
        gravity=(0.0, 0.0, -9.81),
        damping=damping * 2.0 * np.sqrt(0.5 * stiffnesses * mass) if damping else None,
    )
    return Scene(
        name="cloth",
        title=f"Cloth of {n} × {n} particles",
        section="not in Hoffmann (2002)",
        description="A cloth falls from a level position and swings from two corners: a large net, whose safe step is known.",
        error="as far from the true places or velocities as the largest true ones",
        system=system,
        v=np.zeros_like(y),
        y=y,
        dt=DT,
        horizon=HORIZON,
    )


#: A bound of the largest ω, in 1 per unit of time: 2 for each of 480 steps.
FASTEST = 960.0
#: Sixteen steps for each of 60 pictures, and the time in which the cloth falls.
DT, HORIZON = 1.0 / 960.0, 0.5
