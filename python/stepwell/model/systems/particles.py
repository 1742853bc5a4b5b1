"""Free points, which fall and bounce."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from ...base import checks
from ...base.arrays import Shape
from ...base.immutable import changed
from ...errors import ShapeError
from ...reference.systems.particles import Particles as Reference
from .. import surfaces
from ..parameters import aligned
from .base import System, shown


class Particles(System):
    """Points in a uniform field, v̇ = g − (d/m)·v, that may meet floors and spheres. Blocks have shape (points, dim).

    Their energy is Σ m·(½v² − g·y), without the springs of floors.

    Args:
        masses: one for all, or one for each point, shape (points,) or (points, *batch), above zero.
        gravity: acceleration of free fall, in length per unit of time squared: a number, down the last axis, or a vector of shape
            (dim,) or (dim, *batch).
        drag: coefficient d of viscous drag, force per velocity, zero or more; broadcasts. None leaves the term out.
        floor: a ``Floor`` or ``Sphere``, or a list of them; they act in this order.
        dim: 1, 2 or 3; if None, taken from the shape of the state.

    If ``masses`` is one number, there are as many points as the state has.

    Raises:
        ArgumentError: if an argument is wrong.

    Example:
        >>> ball = sw.Particles(gravity=9.81, floor=sw.Floor(restitution=0.8))
        >>> run = sw.integrate(ball, "leapfrog", v=[[1.0, 0.0]], y=[[0.0, 1.0]], dt=1 / 60, steps=600, every=1)
    """

    kernel = "particles"
    unchanged: ClassVar[dict[str, float]] = {"drag": checks.NOT_NEGATIVE}
    reference = Reference
    complex_step = True
    axes = "points, dim"

    def __init__(
        self, masses: Any = 1.0, *, gravity: Any = 9.81, drag: Any = None, floor: Any = None, dim: int | None = None
    ) -> None:
        self.masses = checks.numbers("masses", masses, positive=True)
        if self.masses.ndim and len(self.masses) == 0:
            raise ShapeError(f"masses: expected one for each point along the first axis, got shape {self.masses.shape}")
        self.gravity = checks.numbers("gravity", gravity, unit="length per unit of time squared")
        self.drag = None if drag is None else checks.not_negative("drag", drag)
        self.velocity_term = None if drag is None else "drag"
        floors = surfaces.floors(floor)
        self.around = surfaces.around(floors)
        self.dim = None if dim is None else checks.count("dim", dim, 1, surfaces.MOST_DIMENSIONS)
        if self.gravity.ndim and not 1 <= len(self.gravity) <= surfaces.MOST_DIMENSIONS:
            raise ShapeError(f"gravity: expected a number, or a vector along the first axis, got shape {self.gravity.shape}")
        self.points = len(self.masses) if self.masses.ndim else None
        vectors = {"gravity": len(self.gravity)} if self.gravity.ndim else {}
        vectors |= surfaces.dimensions(floors)
        self.dim = next(iter(vectors.values()), None) if self.dim is None else self.dim
        if different := [f"{name} {size}" for name, size in vectors.items() if size != self.dim]:
            raise ShapeError(f"{', '.join(different)}: expected vectors of {self.dim} components, as many as the points have")
        self.batch = checks.batch_shape(
            {
                "masses": self.masses.shape[1:],
                "gravity": self.gravity.shape[1:],
                "drag": () if self.drag is None else self.drag.shape,
            }
            | surfaces.batches(floors)
        )
        self.v_shape = self.y_shape = (self.points or 1, self.dim or 2)

    def repr_arguments(self) -> list[str]:
        """Its arguments, for its repr."""
        return [*shown(masses=self.masses, gravity=self.gravity, drag=self.drag)]

    def for_state_shapes(self, *states: Any) -> Particles:
        """The system with as many points in as many dimensions as the states, v and y, have."""
        points, dim = self.points, self.dim
        for name, state in zip(("v", "y"), states, strict=False):
            shape = () if state is None else checks.shape_of(name, state)
            if not shape:
                continue
            n, dims = points or "n", dim or f"1 to {surfaces.MOST_DIMENSIONS}"
            fits = len(shape) > 1 and shape[0] == (points or max(1, shape[0]))
            if not fits or shape[1] != (dim or min(shape[1], surfaces.MOST_DIMENSIONS)) or shape[1] == 0:
                raise ShapeError(
                    f"{name}: expected shape ({n}, {dims}, batch…) = ({self.axes}, batch…), got {shape}; batch axes come last"
                )
            points, dim = shape[:2]
        size = (points or 1, dim or 2)
        return changed(self, points=points, dim=dim, v_shape=size, y_shape=size)

    def equation_parameters(self, batch: Shape) -> dict[str, Any]:
        """The dimension, masses, gravity and drag."""
        points, dim = self.y_shape
        masses = np.broadcast_to(self.masses, (points,)) if self.masses.ndim == 0 else aligned(self.masses, 1, batch)
        if self.gravity.ndim:
            gravity = aligned(self.gravity, 1, batch)
        else:
            gravity = np.zeros(dim)
            gravity[-1] = -self.gravity
            gravity = aligned(gravity, 1, batch)
        return {"dim": dim, "masses": aligned(masses, 1, batch), "gravity": gravity, "drag": self.drag}
