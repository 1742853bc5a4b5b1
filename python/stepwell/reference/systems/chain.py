"""A chain of n masses between two walls, joined by n + 1 springs."""

import numpy as np

from ...base.arrays import Array


class Chain:
    """Spring j pulls with f_j = k_j·(y_j − y_{j−1}), the walls at 0; v̇ᵢ = (f_{i+1} − f_i)/mᵢ, ẏ = v."""

    def __init__(self, h: float, stiffness: Array, mass: Array) -> None:
        self.h = h
        self.stiffness = stiffness
        self.by_mass = h / mass

    def dv(self, t: float, v: Array, y: Array) -> Array:
        """h·v̇."""
        wall = np.zeros((1, *y.shape[1:]))
        places = np.concatenate([wall, y, wall])
        f = self.stiffness * (places[1:] - places[:-1])
        dv: Array = (f[1:] - f[:-1]) * self.by_mass
        return dv

    def dy(self, t: float, v: Array, y: Array) -> Array:
        """h·ẏ."""
        return self.h * v

    def velocity(self, d: Array) -> Array:
        """The v whose increment of y is d."""
        return d / self.h
