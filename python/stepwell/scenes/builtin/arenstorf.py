"""Arenstorf's orbit around the earth and the moon (1963)."""

from __future__ import annotations

import numpy as np

from ...model.systems import RestrictedThreeBody
from ..base import Scene
from ..taylor import TurningOrbit

#: The moon's share of the mass, the start, and the period.
MU = 0.012277471
PLACE, VELOCITY = (0.994, 0.0), (0.0, -2.00158510637908252240537862224)
PERIOD = 17.0652165601579625588917206249


def arenstorf() -> Scene:
    """A spacecraft goes round the earth three times and comes back to the moon, where it began, over one period.

    In the frame that turns with earth and moon, it begins 0.0063 from the moon's centre, which takes small steps, and goes on
    through wide loops, which do not: the classical test of step-size control. The orbit is unstable; from a start that is rounded
    to floats, it does not close to the last digits. ``exact`` is computed to more digits than a float has. The usual step is a
    20 000th of the period.
    """
    v, y = np.array(VELOCITY), np.array(PLACE)
    return Scene(
        name="arenstorf",
        title="Arenstorf's orbit",
        section="not in Hoffmann (2002)",
        description="A spacecraft goes round earth and moon and comes back: fast and near at the moon, slow elsewhere.",
        error="as far from the true place or velocity as the largest true one",
        system=RestrictedThreeBody(MU),
        v=v,
        y=y,
        dt=PERIOD / 20_000,
        horizon=PERIOD,
        exact=TurningOrbit(MU, v, y),
        period=PERIOD,
    )
