"""Standard Heun (§9)."""

from ...base.arrays import Array, Blocks, Scaled


def step(s: Scaled, t: float, h: float, v: Array, y: Array) -> Blocks:
    """A predictor, then the mean of the increments at both ends."""
    dv1 = s.dv(t, v, y)
    dy1 = s.dy(t, v, y)
    v1 = v + dv1
    y1 = y + dy1
    dv2 = s.dv(t + h, v1, y1)
    dy2 = s.dy(t + h, v1, y1)
    return v + 0.5 * (dv1 + dv2), y + 0.5 * (dy1 + dy2)
