"""What keeps the energy near its target (§12, Appendix D): a push −g·v in every stage, or a projection after the step.

Both wrap a system that has ``energies``, and are a system themselves. Energies are multiplied by h.
"""

from typing import Any, Protocol

import numpy as np

from . import bits
from .types import Array, Blocks, Scaled

#: The square of what velocities are multiplied by is held between these, the factor between ½ and 2.
MIN_SQUARE, MAX_SQUARE = 0.25, 4.0


class Conserving(Scaled, Protocol):
    """A system whose motion keeps its energy."""

    def energies(self, v: Array, y: Array) -> tuple[Array, Array, Array]:
        """h·v̇, h times the kinetic energy, and h times the whole energy."""

    def gradient(self, v: Array, y: Array, dv: Array) -> tuple[Array, Array, Array]:
        """The gradient of the energy in v and in y, and the square of its length; dv is h·v̇."""

    def record(self, name: str, v: Array, y: Array) -> Array:
        """A quantity of a state."""


class Kept:
    """A system, and what was changed of its energy."""

    def __init__(self, s: Conserving, h: float, target: Array) -> None:
        self.s = s
        self.h = h
        self.target = h * target
        self.work: Any = 0.0  # h times what was changed of the energy

    def dv(self, t: float, v: Array, y: Array) -> Array:
        """h·v̇."""
        return self.s.dv(t, v, y)

    def dy(self, t: float, v: Array, y: Array) -> Array:
        """h·ẏ."""
        return self.s.dy(t, v, y)

    def velocity(self, d: Array) -> Array:
        """The v whose increment of y is d."""
        return self.s.velocity(d)

    def project(self, v: Array, y: Array) -> Blocks:
        """The state after a step, set right."""
        return v, y

    def record(self, name: str, v: Array, y: Array) -> Array:
        """A quantity of a state."""
        return self.s.record(name, v, y)


class Controlled(Kept):
    """As printed g = h·C·ΔE; limited, 1 − g is the root of 1 − 2hC·ΔE/(1 + 2hC·K), held in ½ … 2."""

    def __init__(self, s: Conserving, h: float, form: str, gain: Array, target: Array) -> None:
        super().__init__(s, h, target)
        self.form = form
        self.gain = gain

    def dv(self, t: float, v: Array, y: Array) -> Array:
        """h·v̇ and the push."""
        dv, kinetic, energy = self.s.energies(v, y)
        g = self.push(kinetic, energy)
        self.work = self.work - (g * (2.0 - g)) * kinetic  # what the push alone would change: ((1 − g)² − 1)·K
        return np.asarray(dv - g * v)

    def push(self, kinetic: Array, energy: Array) -> Array:
        """g, the share of the velocity that is taken away."""
        off = energy - self.target
        if self.form == "printed":
            return np.asarray(self.gain * off)
        twice = 2.0 * self.gain
        square = 1.0 - (twice * off) / (1.0 + twice * kinetic)
        return np.asarray(1.0 - np.sqrt(bits.held(square, MIN_SQUARE, MAX_SQUARE)))


class Projected(Kept):
    """Back onto the energy: all velocities by one factor, or the least change of the state along the energy's gradient."""

    def __init__(self, s: Conserving, h: float, way: str, target: Array) -> None:
        super().__init__(s, h, target)
        self.way = way

    def project(self, v: Array, y: Array) -> Blocks:
        """The state after a step, set back onto its energy."""
        dv, kinetic, energy = self.s.energies(v, y)
        off = energy - self.target
        if self.way == "scaling":
            factor = np.sqrt(bits.held(1.0 - off / kinetic, MIN_SQUARE, MAX_SQUARE))
            self.work = self.work + (factor * factor - 1.0) * kinetic
            return v * factor, y
        along_v, along_y, square = self.s.gradient(v, y, dv)  # Nacozy
        step = (off / self.h) / square
        self.work = self.work - off
        return v - step * along_v, y - step * along_y
