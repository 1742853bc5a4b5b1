"""Bodies that attract each other."""

from __future__ import annotations

from typing import Any

import numpy as np

from .. import _checks
from .._checks import Array, Shape
from ..errors import UnsupportedError
from ..reference.systems import nbody as reference
from .base import Parameters, System, row

FORCES = ("logarithmic",)


class NBody(System):
    """Three equal bodies in the plane that attract each other by the 1/r law (Appendix C).

    The force of a pair is G·m²/r, its potential G·m²·ln r. Blocks have shape (bodies, dim) = (3, 2).

    Args:
        masses: three equal masses. Other numbers of bodies and unequal masses are not there yet, and are refused.
        force: ``"logarithmic"``, named after its potential.
        G: constant of gravity, above zero; broadcasts over the batch.

    Raises:
        UnsupportedError: for bodies that have no kernel yet.
    """

    kernel = "nbody"
    axes = "bodies, dim"
    v_shape = y_shape = (3, 2)

    def __init__(self, masses: Any = (1.0, 1.0, 1.0), *, force: str = "logarithmic", G: Any = 1.0) -> None:
        self.masses = _checks.numbers("masses", masses, positive=True)
        if self.masses.shape != (3,) or np.ptp(self.masses) != 0:
            raise UnsupportedError(f"masses: only three equal masses have a kernel so far, got {masses!r}")
        self.force = _checks.known("force", force, FORCES)
        self.G = _checks.numbers("G", G, positive=True)
        self.strength = np.asarray(self.G * self.masses[0])
        self.batch = self.G.shape

    def __repr__(self) -> str:
        return f"NBody(masses={self.masses.tolist()}, force={self.force!r}, G={self.G})"

    def scaled(self, h: float, batch: Shape) -> reference.NBody:
        """The NumPy reference, scaled to the step h."""
        return reference.NBody(h, self.strength)

    def parameters(self, batch: Shape) -> Parameters:
        """Options and rows for the core, as ``nbody.rs`` documents them."""
        return Parameters(["logarithmic", "planar", "three"], rows=[row(self.strength, batch)])

    def energy(self, v: Array, y: Array) -> Array:
        """½·m·Σv² + G·m²·Σ ln r over the pairs."""
        kinetic = 0.5 * (v * v).sum(axis=(0, 1))
        distances = [np.sqrt(((y[j] - y[i]) ** 2).sum(axis=0)) for i, j in ((0, 1), (0, 2), (1, 2))]
        return np.asarray(self.masses[0] * (kinetic + self.strength * sum(np.log(r) for r in distances)))
