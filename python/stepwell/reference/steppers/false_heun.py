"""False Heun (§10)."""

from ...base.arrays import Array, Blocks, Scaled


def step(s: Scaled, t: float, h: float, v: Array, y: Array) -> Blocks:
    """Heun with the new ``v`` in both equations for ``y``."""
    dv1 = s.dv(t, v, y)
    v1 = v + dv1
    dy1 = s.dy(t, v1, y)
    y1 = y + dy1
    dv2 = s.dv(t + h, v1, y1)
    v2 = v + dv2
    dy2 = s.dy(t + h, v2, y1)
    return v + 0.5 * (dv1 + dv2), y + 0.5 * (dy1 + dy2)
