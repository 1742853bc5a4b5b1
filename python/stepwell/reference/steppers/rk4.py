"""The classical Runge-Kutta method (§12 names its professional kin)."""

from ...base.arrays import Array, Blocks, Scaled

SIXTH = 1.0 / 6.0


def step(s: Scaled, t: float, h: float, v: Array, y: Array) -> Blocks:
    """Four evaluations: at the start, twice in the middle, at the end."""
    middle = t + 0.5 * h
    dv1, dy1 = s.dv(t, v, y), s.dy(t, v, y)
    v2, y2 = v + 0.5 * dv1, y + 0.5 * dy1
    dv2, dy2 = s.dv(middle, v2, y2), s.dy(middle, v2, y2)
    v3, y3 = v + 0.5 * dv2, y + 0.5 * dy2
    dv3, dy3 = s.dv(middle, v3, y3), s.dy(middle, v3, y3)
    v4, y4 = v + dv3, y + dy3
    dv4, dy4 = s.dv(t + h, v4, y4), s.dy(t + h, v4, y4)
    # (d1 + 2·d2 + 2·d3 + d4)/6: half of d1 is known already, and halves and doubles are exact.
    v = v + SIXTH * (2.0 * ((0.5 * dv1 + dv2) + dv3) + dv4)
    y = y + SIXTH * (2.0 * ((0.5 * dy1 + dy2) + dy3) + dy4)
    return v, y
