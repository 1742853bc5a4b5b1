"""A rope bridge: two ropes side by side with planks across, from four fixed points."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...base.checks import count, fits
from ...model.systems import Springs
from ..base import Scene
from ..ranges import moderate


def rope_bridge(planks: Any = 15, load: Any = 5.0) -> Scene:
    """A bridge of two ropes, ten units of length long, falls from a level position with a load on one side of its middle plank.

    Each plank is a spring across, between particles of mass 1; crossed springs keep the meshes square. Gravity is 9.81. The
    bridge bounces and sways without damping, and its two ropes do so by different amounts.

    Args:
        planks: number of planks, one or more.
        load: mass on one end of the middle plank, above zero.
    """
    planks, load = count("planks", planks, 1), moderate("load", load)
    fits("planks: the springs", 300.0 * planks, (), "take fewer planks")
    ends = planks + 2
    left, right = np.arange(ends), ends + np.arange(ends)
    across = np.stack([left[1:-1], right[1:-1]], axis=1)
    ropes = [np.stack([row[:-1], row[1:]], axis=1) for row in (left, right)]
    crossed = [np.stack([left[:-1], right[1:]], axis=1), np.stack([right[:-1], left[1:]], axis=1)]
    pairs = np.concatenate([*ropes, across, *crossed])
    y = np.zeros((2 * ends, 3))
    y[:, 0] = np.tile(np.linspace(0.0, 10.0, ends), 2)
    y[right, 1] = 1.0
    masses = np.ones(2 * ends)
    masses[ends // 2] += load
    fixed = [0, ends - 1, ends, 2 * ends - 1]
    # A particle has two springs of its rope, a plank and two crossed springs: with a neighbour like it ω² is at most 10·k/m.
    system = Springs(pairs, stiffness=FASTEST**2 / 10.0, layout=y, masses=masses, fixed=fixed, gravity=(0.0, 0.0, -9.81))
    return Scene(
        name="rope_bridge",
        title=f"Rope bridge of {planks} planks",
        section="not in Hoffmann (2002)",
        description="A rope bridge falls and bounces under a load on one side: stiff springs, and a slow motion that one sees.",
        error="as far from the true places or velocities as the largest true ones",
        system=system,
        v=np.zeros_like(y),
        y=y,
        dt=DT,
        horizon=HORIZON,
    )


#: A bound of the largest ω, in 1 per unit of time.
FASTEST = 240.0
#: Half of the longest safe step of False Euler, and the time in which the bridge falls and bounces.
DT, HORIZON = 1.0 / 240.0, 3.0
