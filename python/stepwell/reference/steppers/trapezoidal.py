"""The implicit trapezoidal rule (Crank and Nicolson): the mean of the rates at both ends of the step."""

from ...base.arrays import Array, Blocks, Scaled
from .. import newton
from ..implicit import Implicit


def step(s: Scaled, t: float, h: float, v: Array, y: Array) -> Blocks:
    """The increment is the mean of those by the rates at both ends."""
    end = t + h
    start_v, start_y = 0.5 * s.dv(t, v, y), 0.5 * s.dy(t, v, y)

    def both(v: Array, y: Array) -> Blocks:
        return start_v + 0.5 * s.dv(end, v, y), start_y + 0.5 * s.dy(end, v, y)

    def residual(dv: Array, dy: Array) -> Blocks:
        both_v, both_y = both(v + dv, y + dy)
        return both_v - dv, both_y - dy

    dv, dy = newton.solved(Implicit(s, t, v, y), 0.5, both(v, y), residual)
    return v + dv, y + dy
