"""The restricted problem of three bodies, in the frame that turns with the two heavy ones."""

import numpy as np

from ...base.arrays import Array
from ..quantities import Quantity, Recorded


class RestrictedThreeBody(Recorded):
    """ẍ = x + 2ẏ − (1 − μ)(x + μ)/r₁³ − μ(x − 1 + μ)/r₂³, ÿ = y − 2ẋ − (1 − μ)y/r₁³ − μy/r₂³; blocks are of shape (2, …)."""

    def __init__(self, h: float, mu: Array) -> None:
        self.h = h
        self.mu = mu
        self.heavy = h * (1.0 - mu)
        self.light = h * mu

    def dv(self, t: float, v: Array, y: Array) -> Array:
        """h·v̇."""
        from_heavy = y[0] + self.mu
        from_light = (y[0] - 1.0) + self.mu  # in this order, because near the light body the difference is exact
        across = y[1] * y[1]
        square = from_heavy * from_heavy + across
        by_heavy = self.heavy / (square * np.sqrt(square))
        square = from_light * from_light + across
        by_light = self.light / (square * np.sqrt(square))
        turn = self.h + self.h
        along = ((self.h * y[0] + turn * v[1]) - by_heavy * from_heavy) - by_light * from_light
        beside = ((self.h * y[1] - turn * v[0]) - by_heavy * y[1]) - by_light * y[1]
        return np.stack([along, beside])

    def dy(self, t: float, v: Array, y: Array) -> Array:
        """h·ẏ."""
        return self.h * v

    def velocity(self, d: Array) -> Array:
        """The v whose increment of y is d."""
        return d / self.h


def energy(s: RestrictedThreeBody, v: Array, y: Array) -> Array:
    """Jacobi's integral, ½|v|² − ½(x² + y²) − (1 − μ)/r₁ − μ/r₂, the only energy that the motion conserves in this frame."""
    across = y[1] * y[1]
    from_heavy, from_light = y[0] + s.mu, (y[0] - 1.0) + s.mu
    pull = (1.0 - s.mu) / np.sqrt(from_heavy * from_heavy + across)
    pull = pull + s.mu / np.sqrt(from_light * from_light + across)
    whole: Array = 0.5 * (v[0] * v[0] + v[1] * v[1]) - 0.5 * (y[0] * y[0] + across) - pull
    return whole


RestrictedThreeBody.quantities = {"energy": Quantity(energy)}
