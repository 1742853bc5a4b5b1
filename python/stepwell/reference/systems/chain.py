"""A chain of n masses between two walls, joined by n + 1 springs."""

import numpy as np


class Chain:
    """Spring j pulls with f_j = k_j·(y_j − y_{j−1}), the walls at 0; v̇ᵢ = (f_{i+1} − f_i)/mᵢ, ẏ = v."""

    def __init__(self, h, stiffness, mass):
        self.h = h
        self.stiffness = stiffness
        self.by_mass = h / mass

    def dv(self, t, v, y):
        """h·v̇"""
        k = self.stiffness
        first = k[:1] * y[:1]
        between = k[1:-1] * (y[1:] - y[:-1])
        last = k[-1:] * -y[-1:]
        f = np.concatenate([first, between, last])
        return (f[1:] - f[:-1]) * self.by_mass

    def dy(self, t, v, y):
        """h·ẏ"""
        return self.h * v

    def velocity(self, d):
        """The v whose increment of y is d."""
        return d / self.h
