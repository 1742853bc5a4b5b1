"""False Euler (§7)."""

from ...base.arrays import Array, Blocks, Scaled


def step(s: Scaled, t: float, h: float, v: Array, y: Array) -> Blocks:
    """The new ``v`` is used at once."""
    v = v + s.dv(t, v, y)
    return v, y + s.dy(t, v, y)
