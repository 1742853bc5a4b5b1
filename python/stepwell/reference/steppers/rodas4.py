"""Rodas4 (Hairer and Wanner, *Solving Ordinary Differential Equations II*, IV.7): fourth order, L-stable, with an estimate."""

from ...base.arrays import Array, Blocks, Scaled
from .. import rosenbrock, tableau
from ..rosenbrock import Rosenbrock
from ..tableau import Increments

FIFTH = (1.221224509226641, 6.019134481288629, 12.53708332932087, -0.687886036105895)
METHOD = Rosenbrock(
    gamma=0.25,
    nodes=(0.0, 0.386, 0.21, 0.63, 1.0, 1.0),
    by_time=(0.25, -0.1043, 0.1035, -0.03620000000000023, 0.0, 0.0),
    rows=(
        (),
        (1.544,),
        (0.9466785280815826, 0.2557011698983284),
        (3.314825187068521, 2.896124015972201, 0.9986419139977817),
        FIFTH,
        (*FIFTH, 1.0),
    ),
    of_solutions=(
        (),
        (-5.6688,),
        (-2.430093356833875, -0.2063599157091915),
        (-0.1073529058151375, -9.594562251023355, -20.47028614809616),
        (7.496443313967647, -10.24680431464352, -33.99990352819905, 11.7089089320616),
        (8.083246795921522, -7.981132988064893, -31.52159432874371, 16.31930543123136, -6.058818238834054),
    ),
)
WEIGHTS = (*FIFTH, 1.0, 1.0)
ERROR = (0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
#: The weights of the powers of θ in the state at the share θ of a step: of third order (Hairer and Wanner, IV.7).
EXTENSION = (
    (11.3474595926725, -1.468861396321538, -22.2638352862366, -8.680657743674718, 2.025137723295662, 1.0),
    (-10.802515422725985, 13.575710529290182, 51.23176182448225, 32.75999682175269, -7.619526849012534, 0.0),
    (0.6762803392801253, -6.087714651680015, -16.43084320892478, -24.76722511418386, 6.594389125716872, 0.0),
)


def stages(s: Scaled, t: float, h: float, v: Array, y: Array) -> Increments:
    """Six solutions of linear equations."""
    return rosenbrock.stages(METHOD, s, t, h, v, y)


def step(s: Scaled, t: float, h: float, v: Array, y: Array) -> Blocks:
    """The fourth-order result, which is stiffly accurate."""
    return tableau.plus(v, y, WEIGHTS, stages(s, t, h, v, y))


def extension(s: Scaled, t: float, h: float, v: Array, y: Array) -> Increments:
    """The coefficients of the powers of θ."""
    return tableau.powers(EXTENSION, stages(s, t, h, v, y))
