"""The implicit trapezoidal rule (Crank and Nicolson): the mean of the rates at both ends of the step."""

from ...base.arrays import Array, Blocks, Scaled
from .. import newton


def step(s: Scaled, t: float, h: float, v: Array, y: Array) -> Blocks:
    """The increment is the mean of those by the rates at both ends."""
    end = t + h
    start_v, start_y = 0.5 * s.dv(t, v, y), 0.5 * s.dy(t, v, y)

    def both(v: Array, y: Array) -> Blocks:
        return start_v + 0.5 * s.dv(end, v, y), start_y + 0.5 * s.dy(end, v, y)

    dv, dy = newton.solved(s, t, (v, y), 0.5, both(v, y), lambda dv, dy: both(v + dv, y + dy))
    return v + dv, y + dy
