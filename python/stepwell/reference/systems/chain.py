"""A chain of n masses between two walls, joined by n + 1 springs."""

import numpy as np

from ...base.arrays import Array
from ..quantities import Quantity, Recorded
from .nbody import total


class Chain(Recorded):
    """Spring j pulls with f_j = k_j·(y_j − y_{j−1}), the walls at 0; v̇ᵢ = (f_{i+1} − f_i)/mᵢ, ẏ = v."""

    def __init__(self, h: float, stiffness: Array, mass: Array) -> None:
        self.h = h
        self.stiffness = stiffness
        self.mass = mass
        self.by_mass = h / mass

    def stretches(self, y: Array) -> Array:
        """How much longer each spring is than at rest."""
        wall = np.zeros((1, *y.shape[1:]))
        places = np.concatenate([wall, y, wall])
        longer: Array = places[1:] - places[:-1]
        return longer

    def dv(self, t: float, v: Array, y: Array) -> Array:
        """h·v̇."""
        f = self.stiffness * self.stretches(y)
        dv: Array = (f[1:] - f[:-1]) * self.by_mass
        return dv

    def dy(self, t: float, v: Array, y: Array) -> Array:
        """h·ẏ."""
        return self.h * v

    def velocity(self, d: Array) -> Array:
        """The v whose increment of y is d."""
        return d / self.h


def energy(s: Chain, v: Array, y: Array) -> Array:
    """½·Σ m·v² + ½·Σ k·(stretch of a spring)²."""
    stretches = s.stretches(y)
    return 0.5 * total(s.mass * v * v) + 0.5 * total(s.stiffness * stretches * stretches)


Chain.quantities = {"energy": Quantity(energy)}
