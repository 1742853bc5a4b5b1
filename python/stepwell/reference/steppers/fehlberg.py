"""Runge-Kutta-Fehlberg 4(5) (§12): goes on with the fourth-order result.

It estimates its error by the fifth-order one, for which alone it needs the last stage.
"""

from ...base.arrays import Array, Blocks, Scaled
from .. import tableau
from ..tableau import Increments

NODES = (0.0, 0.25, 0.375, 12 / 13, 1.0, 0.5)
ROWS = (
    (),
    (1 / 4,),
    (3 / 32, 9 / 32),
    (1932 / 2197, -7200 / 2197, 7296 / 2197),
    (439 / 216, -8.0, 3680 / 513, -845 / 4104),
    (-8 / 27, 2.0, -3544 / 2565, 1859 / 4104, -11 / 40),
)
WEIGHTS = (25 / 216, 0.0, 1408 / 2565, 2197 / 4104, -1 / 5, 0.0)
ERROR = (-1 / 360, 0.0, 128 / 4275, 2197 / 75240, -1 / 50, -2 / 55)
#: How far the rates of all stages are from a polynomial of fourth order in time: their divided difference over the nodes, scaled
#: such that positive weights add up to 1. Of C/(t − a), a solution of ẏ = −y/(t − a), the error is zero, across its pole, too.
COARSE = (-385 / 10188, 352 / 849, -39424 / 48393, -28561 / 193572, 77 / 849, 140 / 283)
#: The weights of the powers of θ in the state at the share θ of a step: of fourth order, by a stage more.
#: They satisfy all conditions of that order, at θ = 1 they and their slope are those of the result; one was free.
EXTENSION = (
    (1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    (-91 / 36, 0.0, 896 / 171, -2197 / 684, 1.0, -2.0, 1.5),
    (68 / 27, 0.0, -21248 / 2565, 4394 / 513, -2.8, 4.0, -4.0),
    (-0.875, 0.0, 1024 / 285, -2197 / 456, 1.6, -2.0, 2.5),
)
MORE_NODES = (1.0,)
MORE_ROWS = (WEIGHTS,)


def stages(s: Scaled, t: float, h: float, v: Array, y: Array) -> Increments:
    """Six evaluations."""
    return tableau.stages(NODES, ROWS, s, t, h, v, y)


def step(s: Scaled, t: float, h: float, v: Array, y: Array) -> Blocks:
    """The fourth-order result, by the five stages that it has a weight for."""
    five = tableau.stages(NODES[:5], ROWS[:5], s, t, h, v, y)
    return tableau.plus(v, y, WEIGHTS[:5], five)


def extension(s: Scaled, t: float, h: float, v: Array, y: Array) -> Increments:
    """The coefficients of the powers of θ."""
    return tableau.powers(EXTENSION, tableau.stages((*NODES, *MORE_NODES), (*ROWS, *MORE_ROWS), s, t, h, v, y))
