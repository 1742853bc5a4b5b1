"""The Oregonator, a reaction that swings, of the Test Set for IVP Solvers."""

from __future__ import annotations

from typing import Any

import numpy as np

from .. import stiff_equations
from ..base import Scene
from ..ranges import moderate


def oregonator(horizon: Any = 360.0) -> Scene:
    """Belousov and Zhabotinsky's reaction as three equations: a swing takes some 300 units of time and jumps by a factor of 10⁵.

    Args:
        horizon: in units of time, above zero.
    """
    horizon = moderate("horizon", horizon, "units of time")
    return Scene(
        name="oregonator",
        title="Oregonator",
        section="not in Hoffmann (2002)",
        description="A reaction that swings: amounts jump by five powers of ten within a unit of time, and rest for a hundred.",
        error="as far from the true amount of a reactant as the largest true one of it",
        system=stiff_equations.oregonator(),
        y=np.array([1.0, 2.0, 3.0]),
        dt=horizon / 200.0,
        horizon=horizon,
    )
