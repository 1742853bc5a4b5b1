"""Standard Euler (§5)."""

from ...base.arrays import Array, Blocks, Scaled


def step(s: Scaled, t: float, h: float, v: Array, y: Array) -> Blocks:
    """Both blocks move by the old rates."""
    dv = s.dv(t, v, y)
    dy = s.dy(t, v, y)
    return v + dv, y + dy
