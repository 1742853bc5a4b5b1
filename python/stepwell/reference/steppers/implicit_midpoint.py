"""Implicit midpoint: the rates halfway between both ends of the step."""

from ...base.arrays import Array, Blocks, Scaled
from .. import newton


def step(s: Scaled, t: float, h: float, v: Array, y: Array) -> Blocks:
    """The increment is that of the rates in the middle of time and state."""
    middle = t + 0.5 * h

    def rates(dv: Array, dy: Array) -> Blocks:
        v1, y1 = v + 0.5 * dv, y + 0.5 * dy
        return s.dv(middle, v1, y1), s.dy(middle, v1, y1)

    dv, dy = newton.solved(s, t, (v, y), 0.5, (s.dv(middle, v, y), s.dy(middle, v, y)), rates)
    return v + dv, y + dy
