"""Bodies that attract each other."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

from ...base import checks
from ...base.arrays import Array, Shape
from ...base.immutable import changed
from ...errors import ShapeError, UnsupportedError
from ...reference.systems import nbody as reference
from .. import surfaces
from ..parameters import aligned
from .base import System

if TYPE_CHECKING:
    from ...base.literals import BodyForce

#: Fused, so many bodies are a tape, however many members there are: the core has a kernel for one system of more.
MOST_ON_TAPE = 9
FORCES: tuple[BodyForce, ...] = ("logarithmic", "newton", "printed")


class NBody(System):
    """Bodies that attract each other in the plane or in space (Appendix C, D). Blocks have shape (bodies, dim).

    | force | of a pair | potential of a pair |
    |---|---|---|
    | ``"logarithmic"`` | G·m·m/r, as Hoffmann prints it | G·m·m·ln r |
    | ``"newton"`` | G·m·m/r² | −G·m·m/r |
    | ``"printed"`` | G·m·m/r | −G·m·m/r, Hoffmann's potential, which belongs to Newton's force instead |

    Their energy is ½·Σ m·v² and the potential of every pair.

    Args:
        masses: one for each body, shape (bodies,) or (bodies, *batch), zero or more. A body without mass is attracted but does
            not attract. In an array of shape (bodies,) zeros make it cost no more than its pairs with bodies that have mass.
        force: the force and its potential, one of the table.
        G: gravitational constant, above zero; broadcasts over the batch.
        softening: length ε, which replaces distances r by √(r² + ε²) so that bodies may meet; broadcasts.
        floor: a ``Floor`` or ``Sphere`` that bodies meet, or a list of them; each body meets them by itself.
        dim: 2 or 3; if None, taken from the shape of the state.

    Attributes:
        massless: the numbers of the bodies without mass, which no other body meets for their sake; in an array of masses for each
            member there are none, for whether a body has mass decides the operations of a step.

    Raises:
        ArgumentError: if an argument is wrong.

    Example:
        >>> sun_and_planet = sw.NBody([1.0, 1e-3], force="newton", G=1.0)
        >>> v, y = [[0.0, 0.0], [0.0, 1.0]], [[0.0, 0.0], [1.0, 0.0]]
        >>> run = sw.integrate(sun_and_planet, "leapfrog", v=v, y=y, dt=0.01, steps=628)
        >>> run.y[-1, 1].round(2)
        array([1.  , 0.02])
    """

    kernel = "nbody"
    unchanged: ClassVar[dict[str, float]] = {"softening": checks.NOT_NEGATIVE}
    reference = reference.NBody
    complex_step = True
    #: True if products of the forces are fused, which a run decides.
    fused = False
    axes = "bodies, dim"

    def __init__(
        self,
        masses: Any = (1.0, 1.0, 1.0),
        *,
        force: BodyForce = "logarithmic",
        G: Any = 1.0,
        softening: Any = 0.0,
        floor: Any = None,
        dim: int | None = None,
    ) -> None:
        self.masses = checks.not_negative("masses", masses)
        if self.masses.ndim == 0 or len(self.masses) == 0:
            raise ShapeError(f"masses: expected one for each body along the first axis, got shape {self.masses.shape}")
        # Of a batch not by its numbers: the operations, and so the bits, of a member would depend on the others.
        self.massless = np.flatnonzero(self.masses == 0.0) if self.masses.ndim == 1 else np.empty(0, dtype=np.intp)
        self.force = checks.known("force", force, FORCES)
        self.G = checks.numbers("G", G, positive=True)
        self.softening = checks.not_negative("softening", softening, "lengths")
        self.dim = None if dim is None else checks.count("dim", dim, 2, 3)
        floors = surfaces.floors(floor)
        self.around = surfaces.around(floors)
        size = self.dim
        for name, components in surfaces.dimensions(floors).items():
            if components not in (2, 3) or components != (size or components):
                raise ShapeError(f"{name}: expected a vector of {size or '2 or 3'} components, as many as dim, got {components}")
            size = components
        self.dim = size
        self.v_shape = self.y_shape = (len(self.masses), size or 2)
        shapes = {"masses": self.masses.shape[1:], "G": self.G.shape, "softening": self.softening.shape}
        self.batch = checks.batch_shape(shapes | surfaces.batches(floors))

    def repr_arguments(self) -> list[str]:
        """Its arguments, for its repr."""
        n = len(self.masses)
        masses = self.masses.tolist() if self.masses.ndim == 1 and n <= 5 else f"{n} bodies"
        softening = [f"softening={self.softening}"] * bool(self.softening.any())
        return [f"masses={masses}", f"force={self.force!r}", f"G={self.G}", *softening]

    def for_state_shapes(self, *states: Any) -> NBody:
        """The bodies in as many dimensions as the states, v and y, have."""
        if self.dim is not None:
            return self
        n, dims = len(self.masses), set()
        shapes = [checks.shape_of(name, state) for name, state in zip(("v", "y"), states, strict=False)]
        for name, shape in zip(("v", "y"), shapes, strict=False):
            if shape and (len(shape) < 2 or shape[0] != n or shape[1] not in (2, 3)):
                raise ShapeError(
                    f"{name}: expected shape ({n}, 2 or 3, batch…) = ({self.axes}, batch…), got {shape}; batch axes come last"
                )
            dims |= set(shape[1:2])
        if len(dims) > 1:
            raise ShapeError(f"v and y: expected as many dimensions in both, got shapes {shapes[0]} and {shapes[1]}")
        if not dims:
            return self
        (dim,) = dims
        return changed(self, dim=dim, v_shape=(n, dim), y_shape=(n, dim))

    def member(self, index: tuple[int, ...], batch: Shape) -> NBody:
        """One member of a batch, alone."""

        def one(values: Array, own: int = 0) -> Array:
            return checks.member(np.broadcast_to(aligned(values, own, batch), (*values.shape[:own], *batch)), index)

        numbers = {"masses": one(self.masses, 1), "G": one(self.G), "softening": one(self.softening)}
        return changed(self, **numbers, batch=(), around=tuple(part.member(one) for part in self.around))

    def with_arguments(self, arguments: dict[str, Any]) -> Self:
        """Return these bodies with other numbers: those without mass stay so, since others do not meet them."""
        other = super().with_arguments(arguments)
        masses = other.masses[self.massless]
        if masses.any():
            body = int(self.massless[np.flatnonzero(masses.reshape(len(masses), -1).any(axis=1))[0]])
            raise UnsupportedError(
                f"masses: body {body} was without mass, so no other body is attracted by it, got a mass above zero; make another "
                f"NBody with these masses"
            )
        return other

    @property
    def massive(self) -> Any:
        """The numbers of the bodies that attract others."""
        return np.delete(np.arange(len(self.masses)), self.massless)

    def pairs(self) -> tuple[Any, Any]:
        """The two of each pair of which one attracts the other, the lower number first."""
        massive, massless = self.massive, self.massless
        first, second = np.triu_indices(len(massive), 1)
        one = np.concatenate([massive[first], np.repeat(massive, len(massless))])
        other = np.concatenate([massive[second], np.tile(massless, len(massive))])
        return np.minimum(one, other), np.maximum(one, other)

    @property
    def pair_count(self) -> int:
        """How many pairs there are."""
        return len(massive := self.massive) * (len(massive) - 1) // 2 + len(massive) * len(self.massless)

    def closest(self, y: Array) -> tuple[tuple[int, int], float]:
        """The two bodies that are closest to each other in one state, and their distance; only pairs of which one has mass."""
        massive, massless, best = self.massive, self.massless, ((0, 0), np.inf)
        for i, body in enumerate(massive):
            others = np.concatenate([massive[i + 1 :], massless])
            if not len(others):
                continue
            with np.errstate(all="ignore"):
                distance = np.sqrt(((y[others] - y[body]) ** 2).sum(axis=1))
            j = int(np.argmin(np.where(np.isnan(distance), np.inf, distance)))
            if distance[j] < best[1]:
                first, second = sorted((int(body), int(others[j])))
                best = (first, second), float(distance[j])
        return best

    def kinetic(self, v: Array) -> Array:
        """½·Σ m·v² of velocities with the blocks' axes first."""
        return np.asarray(0.5 * (aligned(self.masses, 1, v.shape[2:]) * (v * v).sum(axis=1)).sum(axis=0))

    @property
    def keeps_energy(self) -> bool:
        """True if the energy is constant in the true motion."""
        return self.control is None and not self.contacts and self.force != "printed"

    def with_fused_rates(self) -> NBody:
        """The bodies with the forces of ``fused=True``."""
        return changed(self, fused=True)

    @property
    def fuses_on_tape(self) -> bool:
        """True if there are so few that a step is one tape. More may be stepped in other ways, which must have the same bits."""
        return len(self.masses) <= MOST_ON_TAPE

    def equation_parameters(self, batch: Shape) -> dict[str, Any]:
        """The force, the dimension, masses, G·m, the softening and which bodies have no mass."""
        masses = aligned(self.masses, 1, batch)
        sizes: dict[str, Any] = {"force": self.force, "dim": self.y_shape[1]}
        if len(self.massless):
            sizes["massless"] = self.massless.astype("<u4").tobytes()
        return sizes | {"masses": masses, "strength": self.G * masses, "softening": self.softening}

    def own_parameters(self, batch: Shape) -> dict[str, Any]:
        """The parameters of the equations, of all members or some, and whether the forces are fused."""
        parameters = super().own_parameters(batch)
        return parameters | {"fused": 1} if self.fused else parameters

    def named(self, name: str, index: Shape) -> str:
        """The parameter of G·m is called Gm."""
        return super().named("Gm" if name == "strength" else name, index)
