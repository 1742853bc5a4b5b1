"""Van der Pol's oscillator, which is stiff where its damping is strong."""

from __future__ import annotations

from typing import Any

import numpy as np

from .. import stiff_equations
from ..base import Scene
from ..ranges import moderate


def van_der_pol(mu: Any = 100.0) -> Scene:
    """ÿ = μ(1 − y²)ẏ − y from y = 2 at rest, over 2μ units of time, or 10 where that is more.

    For small μ it swings like an oscillator, and explicit methods are the cheapest. For large μ it creeps for about 0.8·μ and
    jumps within some 1/μ, over and over; while it creeps, the rate of what is fast is up to −3μ.

    Args:
        mu: μ, above zero.
    """
    mu = moderate("mu", mu)
    horizon = max(10.0, 2.0 * mu)
    return Scene(
        name="van_der_pol",
        title=f"Van der Pol's oscillator, μ = {mu:g}",
        section="not in Hoffmann (2002)",
        description="It creeps and jumps: the larger μ, the stiffer; with a small one it is an oscillator like others.",
        error="as far from the true coordinate or velocity as the largest true one",
        system=stiff_equations.van_der_pol(mu=mu),
        v=np.asarray(0.0),
        y=np.asarray(2.0),
        dt=horizon / 200.0,
        horizon=horizon,
    )
