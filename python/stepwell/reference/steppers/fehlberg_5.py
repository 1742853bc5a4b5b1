"""Runge-Kutta-Fehlberg with local extrapolation (§12): goes on with the fifth-order result."""

from ...base.arrays import Array, Blocks, Scaled
from .. import tableau
from ..tableau import Increments
from . import fehlberg
from .fehlberg import COARSE as COARSE
from .fehlberg import ERROR as ERROR
from .fehlberg import stages as stages

WEIGHTS = (16 / 135, 0.0, 6656 / 12825, 28561 / 56430, -9 / 50, 2 / 55)
#: The weights of the powers of θ in the state at the share θ of a step: of fourth order, by a stage more.
#: They satisfy all conditions of that order, at θ = 1 they and their slope are those of the result; one was free.
EXTENSION = (
    (1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    (-14677 / 5760, 0.0, 23336 / 4275, -3609671 / 1203840, 0.85375, -997 / 440, 1.5),
    (22207 / 8640, 0.0, -5968 / 675, 762359 / 95040, -2.4275, 1029 / 220, -4.0),
    (-347 / 384, 0.0, 1112 / 285, -10985 / 2432, 1.39375, -2.375, 2.5),
)
MORE_NODES = (1.0,)
MORE_ROWS = (WEIGHTS,)


def step(s: Scaled, t: float, h: float, v: Array, y: Array) -> Blocks:
    """The fifth-order result."""
    return tableau.plus(v, y, WEIGHTS, stages(s, t, h, v, y))


def extension(s: Scaled, t: float, h: float, v: Array, y: Array) -> Increments:
    """The coefficients of the powers of θ."""
    return tableau.powers(EXTENSION, tableau.stages((*fehlberg.NODES, *MORE_NODES), (*fehlberg.ROWS, *MORE_ROWS), s, t, h, v, y))
