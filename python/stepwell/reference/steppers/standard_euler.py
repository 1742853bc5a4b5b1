"""Standard Euler (§5)."""


def step(s, t, h, v, y):
    """Both blocks move by the old rates."""
    dv = s.dv(t, v, y)
    dy = s.dy(t, v, y)
    return v + dv, y + dy
