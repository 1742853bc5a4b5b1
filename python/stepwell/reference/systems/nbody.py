"""Three equal bodies in the plane under the 1/r law (Appendix C)."""

import numpy as np

from ..types import Array


class NBody:
    """v̇ᵢ = G·m·Σⱼ (yⱼ − yᵢ)/r², ẏ = v. Blocks are of shape (bodies, 2)."""

    def __init__(self, h: float, strength: Array) -> None:
        self.h = h
        self.strength = h * strength

    def dv(self, t: float, v: Array, y: Array) -> Array:
        """h·v̇: both bodies of a pair move, in opposite directions."""
        dv = np.zeros_like(y)
        for i, j in ((0, 1), (0, 2), (1, 2)):
            d = y[j] - y[i]
            pull = self.strength / (d[0] * d[0] + d[1] * d[1])
            dv[i] = dv[i] + d * pull
            dv[j] = dv[j] - d * pull
        return dv

    def dy(self, t: float, v: Array, y: Array) -> Array:
        """h·ẏ."""
        return self.h * v

    def velocity(self, d: Array) -> Array:
        """The v whose increment of y is d."""
        return d / self.h
