"""What keeps the energy near its target (§12, Appendix D): a push −g·v in every stage, or a projection after the step."""

import numpy as np

from .types import Array


class EnergyControl:
    """Energies come times h. As printed g = h·C·ΔE; limited, 1 − g is the root of 1 − 2hC·ΔE/(1 + 2hC·K), held in ¼ … 4."""

    def __init__(self, h: float, form: str, gain: Array, target: Array) -> None:
        self.form = form
        self.gain = gain
        self.target = h * target

    def push(self, kinetic: Array, energy: Array) -> Array:
        """g, the share of the velocity that is taken away."""
        off = energy - self.target
        if self.form == "printed":
            return np.asarray(self.gain * off)
        twice = 2.0 * self.gain
        square = 1.0 - (twice * off) / (1.0 + twice * kinetic)
        held = np.where(square < 0.25, 0.25, square)
        held = np.where(held > 4.0, 4.0, held)
        return np.asarray(1.0 - np.sqrt(held))


class Projection:
    """Back onto the energy: all velocities by one factor, or the least change of the state along the energy's gradient."""

    def __init__(self, h: float, way: str, target: Array) -> None:
        self.h = h
        self.way = way
        self.target = h * target

    def off(self, energy: Array) -> Array:
        """H times how far the energy is off."""
        return np.asarray(energy - self.target)

    def factor(self, kinetic: Array, off: Array) -> Array:
        """The factor of the velocities, between ½ and 2."""
        square = 1.0 - off / kinetic
        held = np.where(square < 0.25, 0.25, square)
        held = np.where(held > 4.0, 4.0, held)
        return np.asarray(np.sqrt(held))
