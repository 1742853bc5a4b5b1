"""Robertson's reaction, the first of the stiff problems of the Test Set for IVP Solvers."""

from __future__ import annotations

from typing import Any

import numpy as np

from .. import stiff_equations
from ..base import Scene
from ..ranges import moderate


def rober(horizon: Any = 40.0) -> Scene:
    """Three reactants, of which the second is made slowly and used up a billion times as fast.

    It reaches some 4·10⁻⁵ within a thousandth of a unit of time; then all change for ever more slowly, up to 10¹¹ units of time.

    Args:
        horizon: in units of time, above zero.
    """
    horizon = moderate("horizon", horizon, "units of time")
    return Scene(
        name="rober",
        title="Robertson's reaction",
        section="not in Hoffmann (2002)",
        description="Three reactants, one of which is used up a billion times as fast as it is made: stiff from the start on.",
        error="as far from the true amount of a reactant as the largest true one of it",
        system=stiff_equations.rober(),
        y=np.array([1.0, 0.0, 0.0]),
        dt=horizon / 200.0,
        horizon=horizon,
    )
