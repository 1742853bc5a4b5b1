"""Rosenbrock 2(3) (Shampine and Reichelt, The MATLAB ODE suite): second order, L-stable, with an estimate of third order."""

from ...base.arrays import Array, Blocks, Scaled
from .. import rosenbrock, tableau
from ..rosenbrock import Rosenbrock
from ..tableau import Increments

#: 1/(2 + √2), and its reciprocal.
GAMMA, OVER = 0.2928932188134524, 3.414213562373095
METHOD = Rosenbrock(
    gamma=GAMMA,
    nodes=(0.0, 0.5, 1.0),
    by_time=(GAMMA, 0.0, -GAMMA),
    rows=((), (0.5 * OVER,), (OVER, OVER)),
    of_solutions=((), (-OVER,), (-2.0 * OVER, -25.31370849898476)),
)
WEIGHTS = (OVER, OVER, 0.0)
#: The weights of the powers of θ in the state at the share θ of a step: of second order (Shampine and Reichelt).
EXTENSION = ((OVER, -2.0 * GAMMA / (1.0 - 2.0 * GAMMA) * OVER), (0.0, OVER / (1.0 - 2.0 * GAMMA)))
ERROR = (OVER / 6, 3.080880229039762, OVER / 6)


def stages(s: Scaled, t: float, h: float, v: Array, y: Array) -> Increments:
    """Three solutions of linear equations."""
    return rosenbrock.stages(METHOD, s, t, h, v, y)


def step(s: Scaled, t: float, h: float, v: Array, y: Array) -> Blocks:
    """The second-order result, by the two stages that it has a weight for."""
    return tableau.plus(v, y, WEIGHTS[:2], rosenbrock.stages(METHOD, s, t, h, v, y, count=2))


def extension(s: Scaled, t: float, h: float, v: Array, y: Array) -> Increments:
    """The coefficients of the powers of θ."""
    return tableau.powers(EXTENSION, rosenbrock.stages(METHOD, s, t, h, v, y, count=2))
