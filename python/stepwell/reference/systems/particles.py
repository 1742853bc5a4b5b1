"""Free points in a uniform field, with viscous drag: v̇ = g − (d/m)·v, ẏ = v."""

import numpy as np

from ...base.arrays import Array


class Particles:
    """Blocks are of shape (points, dim, …), masses of shape (points, …), gravity of shape (dim, …).

    ``drag`` None means that there is no such term.
    """

    def __init__(self, h: float, dim: int, masses: Array, gravity: Array, drag: Array | None) -> None:
        self.h = h
        self.kick = h * gravity
        self.drag = None if drag is None else (h * drag) / masses

    def dv(self, t: float, v: Array, y: Array) -> Array:
        """h·v̇."""
        dv = np.broadcast_to(self.kick[np.newaxis], y.shape)
        return dv if self.drag is None else np.asarray(dv - self.drag[:, np.newaxis] * v)

    def dy(self, t: float, v: Array, y: Array) -> Array:
        """h·ẏ."""
        return self.h * v

    def velocity(self, d: Array) -> Array:
        """The v whose increment of y is d."""
        return d / self.h
