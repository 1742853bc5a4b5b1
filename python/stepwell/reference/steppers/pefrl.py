"""PEFRL (Omelyan, Mryglod, Folk 2002): drifts of y with kicks of v between them."""

from ...base.arrays import Array, Blocks, Scaled

XI = 0.1786178958448091
LAMBDA = -0.2123418310626054
CHI = -0.06626458266981849


def step(s: Scaled, t: float, h: float, v: Array, y: Array) -> Blocks:
    """Five drifts, four kicks."""
    y = y + XI * s.dy(t, v, y)
    v = v + (0.5 - LAMBDA) * s.dv(t + XI * h, v, y)
    y = y + CHI * s.dy(t, v, y)
    v = v + LAMBDA * s.dv(t + (XI + CHI) * h, v, y)
    y = y + (1.0 - 2.0 * (CHI + XI)) * s.dy(t, v, y)
    v = v + LAMBDA * s.dv(t + (1.0 - (XI + CHI)) * h, v, y)
    y = y + CHI * s.dy(t, v, y)
    v = v + (0.5 - LAMBDA) * s.dv(t + (1.0 - XI) * h, v, y)
    y = y + XI * s.dy(t, v, y)
    return v, y
