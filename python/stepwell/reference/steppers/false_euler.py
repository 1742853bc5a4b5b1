"""False Euler (§7)."""


def step(s, t, h, v, y):
    """The new ``v`` is used at once."""
    v = v + s.dv(t, v, y)
    return v, y + s.dy(t, v, y)
