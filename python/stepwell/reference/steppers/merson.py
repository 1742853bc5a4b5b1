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
#: The weights of the powers of θ in the state at the share θ of a step: of fourth order, by two more stages.
#: They satisfy all conditions of that order, at θ = 1 they and their slope are those of the result; one was free.
EXTENSION = (
    (1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    (-4.0, 0.0, 0.0, -4 / 3, -1.875, 2.0, 125 / 24),
    (17 / 3, 0.0, 0.0, 16 / 3, 53 / 12, -5.0, -125 / 12),
    (-2.5, 0.0, 0.0, -10 / 3, -2.375, 3.0, 125 / 24),
)
MORE_NODES = (1.0, 0.2)
MORE_ROWS = (
    WEIGHTS,
    (109 / 750, 0.0, 0.0, 26 / 375, 13 / 750, -0.032),
)


def stages(s: Scaled, t: float, h: float, v: Array, y: Array) -> Increments:
    """Five evaluations."""
    return tableau.stages(NODES, ROWS, s, t, h, v, y)


def step(s: Scaled, t: float, h: float, v: Array, y: Array) -> Blocks:
    """The fourth-order result."""
    return tableau.plus(v, y, WEIGHTS, stages(s, t, h, v, y))


def extension(s: Scaled, t: float, h: float, v: Array, y: Array) -> Increments:
    """The coefficients of the powers of θ."""
    return tableau.powers(EXTENSION, tableau.stages((*NODES, *MORE_NODES), (*ROWS, *MORE_ROWS), s, t, h, v, y))
