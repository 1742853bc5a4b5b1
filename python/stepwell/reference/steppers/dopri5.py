"""Dormand-Prince 5(4): fifth order, with an estimate of its error (Hairer, Nørsett, Wanner, §II.5)."""

from ...base.arrays import Array, Blocks, Scaled
from .. import tableau
from ..tableau import Increments

NODES = (0.0, 0.2, 0.3, 0.8, 8 / 9, 1.0, 1.0)
ROWS = (
    (),
    (0.2,),
    (3 / 40, 9 / 40),
    (44 / 45, -56 / 15, 32 / 9),
    (19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729),
    (9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656),
    (35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84),
)
WEIGHTS = (35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84, 0.0)
#: The fifth-order result less the fourth-order one.
ERROR = (71 / 57600, 0.0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40)
#: The weights of the powers of θ in the state at the share θ of a step: of fourth order (Shampine 1986).
EXTENSION = (
    (1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    (
        -8048581381 / 2820520608,
        0.0,
        131558114200 / 32700410799,
        -1754552775 / 470086768,
        127303824393 / 49829197408,
        -282668133 / 205662961,
        40617522 / 29380423,
    ),
    (
        8663915743 / 2820520608,
        0.0,
        -68118460800 / 10900136933,
        14199869525 / 1410260304,
        -318862633887 / 49829197408,
        2019193451 / 616988883,
        -110615467 / 29380423,
    ),
    (
        -12715105075 / 11282082432,
        0.0,
        87487479700 / 32700410799,
        -10690763975 / 1880347072,
        701980252875 / 199316789632,
        -1453857185 / 822651844,
        69997945 / 29380423,
    ),
)


def stages(s: Scaled, t: float, h: float, v: Array, y: Array) -> Increments:
    """Seven evaluations."""
    return tableau.stages(NODES, ROWS, s, t, h, v, y)


def step(s: Scaled, t: float, h: float, v: Array, y: Array) -> Blocks:
    """The fifth-order result, without the last stage, which counts only in the estimate."""
    return tableau.plus(v, y, WEIGHTS[:-1], tableau.stages(NODES[:-1], ROWS[:-1], s, t, h, v, y))


def extension(s: Scaled, t: float, h: float, v: Array, y: Array) -> Increments:
    """The coefficients of the powers of θ."""
    return tableau.powers(EXTENSION, stages(s, t, h, v, y))
