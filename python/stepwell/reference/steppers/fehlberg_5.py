"""Runge-Kutta-Fehlberg with local extrapolation (§12): goes on with the fifth-order result."""

from ...base.arrays import Array, Blocks, Scaled
from .. import tableau
from .fehlberg import COARSE as COARSE
from .fehlberg import ERROR as ERROR
from .fehlberg import stages as stages

WEIGHTS = (16 / 135, 0.0, 6656 / 12825, 28561 / 56430, -9 / 50, 2 / 55)


def step(s: Scaled, t: float, h: float, v: Array, y: Array) -> Blocks:
    """The fifth-order result."""
    return tableau.plus(v, y, WEIGHTS, stages(s, t, h, v, y))
