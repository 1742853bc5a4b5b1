"""Three bodies on one figure of eight (Chenciner and Montgomery 2000)."""

from __future__ import annotations

import numpy as np

from ...model.systems import NBody
from ..base import Scene
from ..taylor import Orbit

#: The velocity of the first two bodies at t = 0, which that of the third is −2 times; and the period.
VELOCITY = (0.347116888118926938, 0.532724945388030229)
PERIOD = 6.32591398292621167759


def figure_eight() -> Scene:
    """Three bodies follow each other on one figure of eight, over ten periods.

    Three unit masses under Newton's law, a stable orbit that closes after 6.3259. There is no formula for it; ``exact`` is
    computed to more digits than a float holds. The usual step makes about 200 rate evaluations a period by False Euler.
    """
    one = np.array(VELOCITY)
    masses = [1.0, 1.0, 1.0]
    v = np.array([one, one, -2.0 * one])
    y = np.array([[-1.0, 0.0], [1.0, 0.0], [0.0, 0.0]])
    return Scene(
        name="figure_eight",
        title="Figure of eight",
        section="not in Hoffmann (2002)",
        description="Three bodies follow each other on one curve under Newton's law, a stable orbit without a formula.",
        error="bodies as far from their true places as those are from the centre",
        system=NBody(masses, force="newton"),
        v=v,
        y=y,
        dt=PERIOD / 200,
        horizon=10 * PERIOD,
        exact=Orbit(masses, v, y, period=PERIOD),
        period=PERIOD,
    )
