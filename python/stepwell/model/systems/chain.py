"""A chain of masses and springs."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from ...base import checks
from ...base.arrays import Array, Shape
from ...errors import ShapeError
from ...reference.systems.chain import Chain as Reference
from ..parameters import aligned
from .base import System


class Chain(System):
    """n masses between two walls, joined by n + 1 springs. Blocks have shape (n,); y[i] is the displacement of mass i from rest.

    Its energy is ½·Σ m·v² + ½·Σ k·(difference of neighbours)², the walls at 0.

    Args:
        n: number of masses, one or more.
        stiffness: stiffness of the springs: one number, or an array with the n + 1 springs (or 1, for all) along its first axis
            and the batch along the others. A first or last spring of stiffness 0 leaves that end of the chain free.
        mass: the masses, likewise, with n (or 1) along the first axis.

    Raises:
        ArgumentError: if an argument is wrong.

    Example:
        >>> chain = sw.Chain(3, stiffness=2.0, mass=1.0)
        >>> run = sw.integrate(chain, "leapfrog", v=0.0, y=[1.0, 0.0, 0.0], dt=0.1, steps=10)
        >>> run.y[-1].round(4)
        array([-0.3092,  0.4724,  0.1099])
    """

    kernel = "chain"
    unchanged: ClassVar[dict[str, float]] = {"stiffness": checks.NOT_NEGATIVE, "mass": checks.POSITIVE}
    reference = Reference
    complex_step = True
    axes = "masses"
    linear = True

    def __init__(self, n: int, *, stiffness: Any = 1.0, mass: Any = 1.0) -> None:
        self.n = checks.count("n", n, 1)
        checks.fits("n: stiffnesses and masses", 2 * self.n + 1, (), "take fewer masses")
        self.stiffness = _per_row("stiffness", checks.not_negative("stiffness", stiffness), self.n + 1, "springs")
        self.mass = _per_row("mass", checks.numbers("mass", mass, positive=True), self.n, "masses")
        self.v_shape = self.y_shape = (self.n,)
        self.batch = checks.batch_shape({"stiffness": self.stiffness.shape[1:], "mass": self.mass.shape[1:]})

    def repr_arguments(self) -> list[str]:
        """Its arguments, for its repr."""
        return [str(self.n)]

    def equation_parameters(self, batch: Shape) -> dict[str, Any]:
        """The stiffnesses and masses."""
        return {"stiffness": aligned(self.stiffness, 1, batch), "mass": aligned(self.mass, 1, batch)}


def _per_row(argument: str, array: Array, rows: int, what: str) -> Array:
    """One number for each row; a number for all rows is broadcast, so that making a long chain takes no time."""
    if array.ndim == 0:
        return np.broadcast_to(array, (rows,))
    if array.shape[0] not in (1, rows):
        raise ShapeError(f"{argument}: expected {rows} {what} (or 1) along the first axis, got shape {array.shape}")
    return np.broadcast_to(array, (rows, *array.shape[1:]))
