"""Bogacki-Shampine 3(2): third order, with an estimate of its error."""

from ...base.arrays import Array, Blocks, Scaled
from .. import tableau
from ..tableau import Increments

NODES = (0.0, 0.5, 0.75, 1.0)
ROWS = (
    (),
    (0.5,),
    (0.0, 0.75),
    (2 / 9, 1 / 3, 4 / 9),
)
WEIGHTS = (2 / 9, 1 / 3, 4 / 9, 0.0)
#: The third-order result less the second-order one.
ERROR = (-5 / 72, 1 / 12, 1 / 9, -1 / 8)
#: The weights of the powers of θ in the state at the share θ of a step: Hermite's cubic, of third order.
EXTENSION = (
    (1.0, 0.0, 0.0, 0.0),
    (-4 / 3, 1.0, 4 / 3, -1.0),
    (5 / 9, -2 / 3, -8 / 9, 1.0),
)


def stages(s: Scaled, t: float, h: float, v: Array, y: Array) -> Increments:
    """Four evaluations."""
    return tableau.stages(NODES, ROWS, s, t, h, v, y)


def step(s: Scaled, t: float, h: float, v: Array, y: Array) -> Blocks:
    """The third-order result, without the last stage, which counts only in the estimate."""
    return tableau.plus(v, y, WEIGHTS[:-1], tableau.stages(NODES[:-1], ROWS[:-1], s, t, h, v, y))


def extension(s: Scaled, t: float, h: float, v: Array, y: Array) -> Increments:
    """The coefficients of the powers of θ."""
    return tableau.powers(EXTENSION, stages(s, t, h, v, y))
