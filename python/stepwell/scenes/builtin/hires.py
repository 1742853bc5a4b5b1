"""A plant's answer to light, eight reactants, of the Test Set for IVP Solvers."""

from __future__ import annotations

import numpy as np

from .. import stiff_equations
from ..base import Scene


def hires() -> Scene:
    """High Irradiance Response: eight reactants of a plant that is exposed to light, over 321.8122 units of time.

    It is stiff in a moderate way: an explicit method takes some ten thousand steps where an implicit one takes a hundred.
    """
    horizon = 321.8122
    return Scene(
        name="hires",
        title="High irradiance response",
        section="not in Hoffmann (2002)",
        description="Eight reactants of a plant in the light, moderately stiff: the largest of the stiff scenes.",
        error="as far from the true amount of a reactant as the largest true one of it",
        system=stiff_equations.hires(),
        y=np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0057]),
        dt=horizon / 200.0,
        horizon=horizon,
    )
