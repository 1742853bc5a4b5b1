"""Runge-Kutta-Merson (§12): fourth order, with an estimate of its error."""

from ...base.arrays import Array, Blocks, Scaled
from .. import tableau
from ..tableau import Increments

NODES = (0.0, 1 / 3, 1 / 3, 0.5, 1.0)
ROWS = (
    (),
    (1 / 3,),
    (1 / 6, 1 / 6),
    (1 / 8, 0.0, 3 / 8),
    (1 / 2, 0.0, -3 / 2, 2.0),
)
WEIGHTS = (1 / 6, 0.0, 0.0, 2 / 3, 1 / 6)
ERROR = (1 / 15, 0.0, -0.3, 4 / 15, -1 / 30)


def stages(s: Scaled, t: float, h: float, v: Array, y: Array) -> Increments:
    """Five evaluations."""
    return tableau.stages(NODES, ROWS, s, t, h, v, y)


def step(s: Scaled, t: float, h: float, v: Array, y: Array) -> Blocks:
    """The fourth-order result."""
    return tableau.plus(v, y, WEIGHTS, stages(s, t, h, v, y))
