"""The linear oscillator (§3): ÿ + 2Dω₀ẏ + ω₀²y = ω₀²x + a."""

import numpy as np

from ...base.arrays import Array, Signal
from ..quantities import Quantity, Recorded


class Oscillator(Recorded):
    """Canonical: v̇ = −ω₀(y + 2Dv − x) + a/ω₀, ẏ = ω₀v. Physical: v̇ = −ω₀²y − 2Dω₀v + ω₀²x + a, ẏ = v.

    ``damping`` None means that there is no such term; a driven oscillator always has it. ``drag`` is 2Dω₀ in its place.
    """

    def __init__(
        self, h: float, form: str, omega: Array, damping: Array | None, drag: Array | None, x: Signal | None, a: Signal | None
    ) -> None:
        self.square = None if form == "canonical" else omega * omega
        if self.square is None:
            self.stiffness = self.speed = by_x = h * omega
            by_a = h / omega
        else:
            self.stiffness = by_x = h * self.square
            self.speed = by_a = np.asarray(h)
        inputs = [signal.scaled(by) for signal, by in ((x, by_x), (a, by_a)) if signal is not None]
        if damping is None and inputs:
            damping = np.zeros(())
        self.drag = None if drag is None else h * drag
        if drag is None and damping is not None:
            self.drag = (2.0 * damping) * (h * omega)
        self.inputs = inputs

    def dv(self, t: float, v: Array, y: Array) -> Array:
        """h·v̇."""
        dv = -(self.stiffness * y)
        if self.drag is not None:
            dv = dv - self.drag * v
        if self.inputs:
            drive = self.inputs[0].at(t)
            for more in self.inputs[1:]:
                drive = drive + more.at(t)
            dv = dv + drive
        return dv

    def dy(self, t: float, v: Array, y: Array) -> Array:
        """h·ẏ."""
        return self.speed * v

    def velocity(self, d: Array) -> Array:
        """The v whose increment of y is d."""
        return d / self.speed


def energy(s: Oscillator, v: Array, y: Array) -> Array:
    """½ẏ² + ½ω₀²y² per mass, of spring and motion; in canonical form divided by ω₀²."""
    spring = y * y if s.square is None else s.square * (y * y)
    whole: Array = 0.5 * (v * v + spring)
    return whole


Oscillator.quantities = {"energy": Quantity(energy)}
