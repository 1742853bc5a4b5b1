"""The pendulum: v̇ = −ω₀²·sin y − 2Dω₀v + a, ẏ = v."""

import numpy as np

from ...base.arrays import Array, Signal
from .. import trig
from ..quantities import Quantity, Recorded


class Pendulum(Recorded):
    """y is the angle from below and v its velocity.

    ``damping`` None means that there is no such term; a driven pendulum always has it.
    """

    def __init__(self, h: float, omega: Array, damping: Array | None, a: Signal | None) -> None:
        self.h = np.asarray(h)
        self.square = omega * omega
        self.stiffness = h * self.square
        self.input = None if a is None else a.scaled(self.h)
        if damping is None and a is not None:
            damping = np.zeros(())
        self.drag = None if damping is None else (2.0 * damping) * (h * omega)

    def dv(self, t: float, v: Array, y: Array) -> Array:
        """h·v̇."""
        dv = -(self.stiffness * trig.sin(y))
        if self.drag is not None:
            dv = dv - self.drag * v
        if self.input is not None:
            dv = dv + self.input.at(t)
        return dv

    def dy(self, t: float, v: Array, y: Array) -> Array:
        """h·ẏ."""
        return self.h * v

    def velocity(self, d: Array) -> Array:
        """The v whose increment of y is d."""
        velocity: Array = d / self.h
        return velocity


def energy(s: Pendulum, v: Array, y: Array) -> Array:
    """½v² + ω₀²(1 − cos y) per moment of inertia, which is 0 at rest hanging down."""
    half = trig.sin(0.5 * y)
    whole: Array = 0.5 * (v * v) + (2.0 * s.square) * (half * half)  # 1 − cos y loses digits near 0
    return whole


Pendulum.quantities = {"energy": Quantity(energy)}
