"""Backward Euler: the rates of the end of the step."""

from ...base.arrays import Array, Blocks, Scaled
from .. import newton


def step(s: Scaled, t: float, h: float, v: Array, y: Array) -> Blocks:
    """The increment is that of the rates at the end."""
    end = t + h

    def rates(dv: Array, dy: Array) -> Blocks:
        v1, y1 = v + dv, y + dy
        return s.dv(end, v1, y1), s.dy(end, v1, y1)

    dv, dy = newton.solved(s, t, (v, y), 1.0, (s.dv(end, v, y), s.dy(end, v, y)), rates)
    return v + dv, y + dy
