"""Linearly implicit Euler (Baraff and Witkin, Large steps in cloth simulation)."""

from ...base.arrays import Array, Blocks, Scaled
from ..implicit import Implicit


def step(s: Scaled, t: float, h: float, v: Array, y: Array) -> Blocks:
    """One solution of linear equations, with the rates at the end of the step for the state at its start."""
    end = t + h
    dv, dy = Implicit(s, t, v, y).solve(1.0, s.dv(end, v, y), s.dy(end, v, y))
    return v + dv, y + dy
