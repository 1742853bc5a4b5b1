"""Control of the energy (§12, Appendix D): a push −g·v in stages or between steps, or a projection after a step.

Both wrap a system that has ``energies``, and are a system themselves. Energies are multiplied by h.
"""

from typing import Any, Protocol

import numpy as np

from ..base.arrays import Array, Blocks, Scaled
from . import bits
from .around import Around

#: The bounds of the square of the factor of velocities, which is between ½ and 2.
MIN_SQUARE, MAX_SQUARE = 0.25, 4.0


class Conserving(Scaled, Protocol):
    """A system whose motion keeps its energy."""

    def energies(self, v: Array, y: Array) -> tuple[Array, Array, Array]:
        """h·v̇, h times the kinetic energy, and h times the whole energy."""

    def gradient(self, v: Array, y: Array, dv: Array) -> tuple[Array, Array, Array]:
        """The gradient of the energy in v and in y, and the square of its length; dv is h·v̇."""

    def record(self, name: str, v: Array, y: Array) -> Array:
        """A quantity of a state."""


class EnergyKeeping(Around):
    """The base of control and projection: the target, and the sum of the changes of the energy."""

    #: h times that sum.
    work: Any = 0.0

    def __init__(self, s: Conserving, h: Any, target: Array) -> None:
        super().__init__(s)
        self.h = h
        self.target = h * target


class Controlled(EnergyKeeping):
    """As printed g = h·C·ΔE; limited, 1 − g is the root of 1 − 2hC·ΔE/(1 + 2hC·K), limited to ½ … 2."""

    def __init__(self, s: Conserving, h: Any, form: str, gain: Array, target: Array, *, between: bool = False) -> None:
        super().__init__(s, h, target)
        self.form = form
        self.gain = gain
        self.between = between  # whether it pushes after each step, and not in its stages

    def dv(self, t: float, v: Array, y: Array) -> Array:
        """h·v̇ and the push."""
        if self.between:
            return np.asarray(self.s.dv(t, v, y))
        dv, kinetic, energy = self.s.energies(v, y)
        return np.asarray(dv - self.push(kinetic, energy) * v)

    def project(self, v: Array, y: Array) -> Blocks:
        """The state after a step, pushed if the push comes between steps."""
        if not self.between:
            return v, y
        _, kinetic, energy = self.s.energies(v, y)
        return np.asarray(v - self.push(kinetic, energy) * v), y

    def push(self, kinetic: Array, energy: Array) -> Array:
        """g, the share of the velocity that is taken away; what it changes of the energy alone is ((1 − g)² − 1)·K."""
        off = energy - self.target
        if self.form == "printed":
            g = np.asarray(self.gain * off)
        else:
            twice = 2.0 * self.gain
            square = 1.0 - (twice * off) / (1.0 + twice * kinetic)
            g = np.asarray(1.0 - np.sqrt(bits.clamp(square, MIN_SQUARE, MAX_SQUARE)))
        self.work = self.work - (g * (2.0 - g)) * kinetic
        return g


class Projected(EnergyKeeping):
    """Back onto the energy: all velocities by one factor, or the least change of the state along the energy's gradient.

    At rest there is nothing to scale, and where the gradient is zero no way to go: the state stays as it is.
    """

    def __init__(self, s: Conserving, h: Any, way: str, target: Array) -> None:
        super().__init__(s, h, target)
        self.way = way

    def project(self, v: Array, y: Array) -> Blocks:
        """The state after a step, set back onto its energy."""
        dv, kinetic, energy = self.s.energies(v, y)
        off = energy - self.target
        if self.way == "scaling":
            factor = np.sqrt(bits.clamp(1.0 - off / kinetic, MIN_SQUARE, MAX_SQUARE))
            factor = bits.where(bits.equal(kinetic, 0.0), 1.0, factor)  # h·E is below zero where h is
            self.work = self.work + (factor * factor - 1.0) * kinetic
            return v * factor, y
        along_v, along_y, square = self.s.gradient(v, y, dv)  # Nacozy
        flat = bits.at_most(square, 0.0)
        step = bits.where(flat, 0.0, (off / self.h) / square)
        self.work = self.work - bits.where(flat, 0.0, off)
        return v - step * along_v, y - step * along_y
