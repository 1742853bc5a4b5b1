"""The classical Runge-Kutta method (§12 names its professional kin)."""

from ..types import Array, Blocks, Scaled

SIXTH = 1.0 / 6.0


def step(s: Scaled, t: float, h: float, v: Array, y: Array) -> Blocks:
    """Four evaluations: at the start, twice in the middle, at the end."""
    half = t + 0.5 * h
    dv1, dy1 = s.dv(t, v, y), s.dy(t, v, y)
    v2, y2 = v + 0.5 * dv1, y + 0.5 * dy1
    dv2, dy2 = s.dv(half, v2, y2), s.dy(half, v2, y2)
    v3, y3 = v + 0.5 * dv2, y + 0.5 * dy2
    dv3, dy3 = s.dv(half, v3, y3), s.dy(half, v3, y3)
    v4, y4 = v + dv3, y + dy3
    dv4, dy4 = s.dv(t + h, v4, y4), s.dy(t + h, v4, y4)
    v = v + (((dv1 + 2.0 * dv2) + 2.0 * dv3) + dv4) * SIXTH
    y = y + (((dy1 + 2.0 * dy2) + 2.0 * dy3) + dy4) * SIXTH
    return v, y
