"""One rod from the origin to a point in space: v̇ = −pull·y − g, where the pull follows from the length (§12)."""

from typing import Any

import numpy as np

from ...base.arrays import Array, Blocks
from .. import rod_contact
from ..quantities import Quantity, Recorded, of_spin
from .rods import Rods, dot, largest, spin


class Pendulum3D(Recorded):
    """The pull is that for which C̈ = 0, with C = ½(y·y − l²); under control C̈ + 2αĊ + α²C = 0, α = c/h.

    Blocks are of shape (3, …).
    """

    def __init__(self, h: float, length: Array, gravity: Array, keeps: str | None, strength: Array | None) -> None:
        self.h = h
        self.length = length
        self.square = length * length
        self.gravity = gravity
        self.fall = h * gravity
        self.projects = keeps == "projection"
        self.damping: Any = None
        self.stiffness: Any = None
        if strength is not None:
            self.damping, self.stiffness = 2.0 * strength, 0.5 * ((strength * strength) / h)

    def dv(self, t: float, v: Array, y: Array) -> Array:
        """h·v̇."""
        square = dot(y, y)
        pull = self.h * dot(v, v) - self.fall * y[2]
        if self.damping is not None:
            pull = (pull + self.damping * dot(y, v)) + self.stiffness * (square - self.square)
        pushed = -((pull / square) * y)
        return np.concatenate([pushed[:2], pushed[2:] - self.fall])

    def dy(self, t: float, v: Array, y: Array) -> Array:
        """h·ẏ."""
        return self.h * v

    def velocity(self, d: Array) -> Array:
        """The v whose increment of y is d."""
        return d / self.h

    def project(self, v: Array, y: Array) -> Blocks:
        """The state after a step, with a rod of its length and no velocity along it, if the system projects."""
        if not self.projects:
            return v, y
        y = y * (self.length / np.sqrt(dot(y, y)))
        return v - (dot(y, v) / self.square) * y, y

    def contacts(self, h: Any, surfaces: list[Any]) -> Any:
        """How it meets surfaces in a step h: as a point of mass 1 at a rod from an anchor."""
        anchor, one = np.zeros((1, 3)), np.ones(1)
        rod = Rods(self.h, 3, [[1, 0]], one, np.asarray(self.length)[np.newaxis], anchor, self.gravity, None, None)
        return rod_contact.RodContacts(h, rod, 1, surfaces)


def energy(s: Pendulum3D, v: Array, y: Array) -> Array:
    """½v·v + g·height per mass, which is zero at rest at the height of the fixed end."""
    whole: Array = 0.5 * dot(v, v) + s.gravity * y[2]
    return whole


def length_error(s: Pendulum3D, v: Array, y: Array) -> Array:
    """|length/l − 1|."""
    return largest([np.sqrt(dot(y, y)) / s.length - 1.0])


def angular_momentum(s: Pendulum3D, v: Array, y: Array) -> Array:
    """The spin y × v per mass."""
    return np.stack(spin(y, v, [(1, 2), (2, 0), (0, 1)]))


Pendulum3D.quantities = {
    "energy": Quantity(energy),
    "length_error": Quantity(length_error),
    "angular_momentum": Quantity(angular_momentum, of_spin),
}
