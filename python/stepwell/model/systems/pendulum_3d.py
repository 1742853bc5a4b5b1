"""The pendulum in space."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from ...base import checks
from ...base.arrays import Shape
from ...errors import ArgumentError
from ...reference.systems.pendulum_3d import Pendulum3D as Reference
from ...reference.systems.rods import dot
from .. import surfaces
from .base import shown
from .rods import RodSystem, surfaces_for_rods


class Pendulum3D(RodSystem):
    """The rod pendulum in x, y, z (§12): a point mass on a rod without mass, whose other end is fixed at the origin.

    Blocks have shape (3,); the last coordinate is the height, so at rest the mass hangs at (0, 0, −length). The pull of the rod
    is the solution of C̈ = 0, with C = ½(y·y − length²), so the rod keeps its length but for the errors of the method.
    ``LengthControl`` returns it to its length, ``Projection("length")`` resets it after every step. ``Rods`` has any number of
    rods. The energy per mass is ½v·v + g·height, which is zero at rest at the height of the fixed end.

    Args:
        length: of the rod, above zero; broadcasts over the batch.
        gravity: acceleration downwards, in units of length per unit of time squared; broadcasts.
        floor: a ``Floor`` or ``Sphere`` that the mass meets, or a list of them; with ``way="safe"`` only.

    Raises:
        ArgumentError: if an argument is wrong; and before a run, if the mass is at the origin, where the rod has no
            direction.

    Example:
        >>> start = {"v": [0.0, 0.3, 0.0], "y": [1.0, 0.0, 0.0]}
        >>> run = sw.integrate(sw.Pendulum3D(), "rk4", **start, dt=0.01, steps=1000, control=sw.LengthControl(0.5))
    """

    kernel = "pendulum_3d"
    unchanged: ClassVar[dict[str, float]] = {"length": checks.POSITIVE, "gravity": checks.ANY}
    reference = Reference
    axes = "x, y and z"
    v_shape = y_shape = (3,)

    def __init__(self, length: Any = 1.0, gravity: Any = 1.0, *, floor: Any = None) -> None:
        self.length = checks.numbers("length", length, positive=True)
        self.gravity = checks.numbers("gravity", gravity)
        floors, _ = surfaces_for_rods(floor, {3})
        self.around = surfaces.around(floors)
        shapes = {"length": self.length.shape, "gravity": self.gravity.shape}
        self.batch = checks.batch_shape(shapes | surfaces.batches(floors))

    def repr_arguments(self) -> list[str]:
        """Its arguments, for its repr."""
        return shown(length=self.length, gravity=self.gravity)

    def for_state_shapes(self, *states: Any) -> Pendulum3D:
        """The pendulum itself.

        Raises:
            ArgumentError: if the mass is at the origin.
        """
        if len(states) > 1 and states[1] is not None:
            y = checks.block("y", states[1], self.y_shape, self.axes, finite=False)
            with np.errstate(all="ignore"):
                if (dot(y, y) == 0.0).any():
                    raise ArgumentError("y: expected the mass away from the origin, where its rod ends, got (0, 0, 0)")
        return self

    def equation_parameters(self, batch: Shape) -> dict[str, Any]:
        """The length, gravity, and the control of the length."""
        return {"length": self.length, "gravity": self.gravity} | self.constraint_parameters()
