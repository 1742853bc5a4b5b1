"""Surfaces that points cannot pass: floors, walls, balls and bowls (§1, elastic reflection)."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from ..base import checks
from ..base.arrays import Array, Shape
from ..base.immutable import Immutable, ValueEquality, changed
from ..base.reprs import brief
from ..errors import ArgumentError, DTypeError, ShapeError
from ..reference import contact
from .around import Part
from .parameters import aligned

if TYPE_CHECKING:
    from ..base.literals import ContactWay

#: The arguments whose first axis has the components of a vector.
VECTORS = ("normal", "centre")

WAYS: tuple[ContactWay, ...] = ("safe", "restitution", "flip", "spring")


class Surface(Immutable, ValueEquality, ABC):
    """The base class of ``Floor`` and ``Sphere``."""

    #: The kind of the surface in the core, and the names of the arguments that only this kind has.
    kind: ClassVar[str]
    own: ClassVar[tuple[str, ...]]

    def __init__(self, restitution: Any, friction: Any, way: ContactWay, omega: Any) -> None:
        self.way = checks.known("way", way, WAYS)
        self.restitution = checks.not_negative("restitution", restitution)
        if (self.restitution > 1.0).any():
            raise ArgumentError(f"restitution: expected numbers from 0 to 1, got {self.restitution.max():g}")
        self.friction = None if friction is None else checks.not_negative("friction", friction)
        self.omega = None if omega is None else checks.numbers("omega", omega, positive=True, unit="rad per unit of time")
        springs = way == "spring"
        if springs != (omega is not None):
            raise ArgumentError(
                "omega: expected the frequency of the spring, got None"
                if springs
                else f'omega: works with way="spring" only, got way={way!r}'
            )
        if way in ("flip", "spring") and (self.restitution != 1.0).any():
            raise ArgumentError(f'restitution: works with way="safe" or "restitution", got way={way!r}')
        if springs and friction is not None:
            raise ArgumentError('friction: works with ways other than "spring", which has no impulse')

    @property
    def batch(self) -> Shape:
        """The batch shape of its parameters."""
        numbers = {"restitution": self.restitution, "friction": self.friction, "omega": self.omega}
        shapes = {name: each.shape for name, each in numbers.items() if each is not None}
        return checks.batch_shape(shapes | self._shapes())

    @abstractmethod
    def _shapes(self) -> dict[str, Shape]:
        """The batch shapes of the arguments in ``own``."""

    @property
    @abstractmethod
    def dim(self) -> int | None:
        """The number of dimensions; None if the surface fits any."""

    @abstractmethod
    def place(self, dim: int) -> dict[str, Any]:
        """The parameters of its geometry by name, in ``dim`` dimensions. Vectors have their components along the first axis."""

    def parameters(self, dim: int) -> dict[str, Any]:
        """Its parameters by name, in ``dim`` dimensions."""
        common: dict[str, Any] = {"way": self.way}
        if self.way == "spring":
            common["omega"] = self.omega
        elif self.way != "flip":
            common["restitution"] = self.restitution
        return common | {"friction": self.friction} | self.place(dim)

    def member(self, one: Callable[..., Array]) -> Surface:
        """The surface for one member of a batch."""
        numbers = {name: value for name, value in vars(self).items() if isinstance(value, np.ndarray)}
        return changed(self, **{name: one(value, 1 if name in VECTORS else 0) for name, value in numbers.items()})

    def __repr__(self) -> str:
        names = (*self.own, "restitution", "friction", "way", "omega")
        values = {name: getattr(self, name) for name in names}
        arguments = (
            f"{name}={brief(value)}"
            for name, value in values.items()
            if value is not None and not (name == "restitution" and value.ndim == 0 and value == 1.0)
        )
        return f"{type(self).__name__}({', '.join(arguments)})"


class Floor(Surface):
    """A plane that points stay above: normal·y ≥ offset.

    | way | effect on a point that is behind the surface after a step | energy |
    |---|---|---|
    | ``"safe"`` | it leaves with e² of the energy of impact, as late as it arrived; or it rests | never added |
    | ``"restitution"`` | its normal velocity becomes −e times what it was, if it points inward | may be added |
    | ``"flip"`` | the same with e = 1 | may be added |
    | ``"spring"`` | a spring pushes it back with ω² times its depth | may be added |

    With ``"safe"`` no contact adds energy, for any method, step and time of impact, where the force is uniform over a step. A
    point whose next flight would be shorter than two steps comes to rest on the surface. See docs/howto/contact.md.

    Args:
        restitution: e, the velocity after an impact divided by that before it, 0 to 1, without a unit; broadcasts over the batch.
        friction: Coulomb's coefficient μ, without a unit, zero or more; broadcasts. None leaves the term out.
        normal: a vector that points out of the floor, of any length, shape (dim,) or (dim, *batch); the last axis if None.
        offset: distance of the plane from the origin along the normal, in units of length; broadcasts. Without ``normal`` it is
            the height of the floor.
        way: how points bounce; see the table.
        omega: ω of the spring in rad per unit of time, its stiffness per mass being ω²; with ``way="spring"`` only. Broadcasts.

    Raises:
        ArgumentError: if an argument is wrong.

    Example:
        >>> sw.Particles(floor=sw.Floor(restitution=0.8))
        Particles(masses=1.0, gravity=9.81, floor=Floor(offset=0.0, restitution=0.8, way='safe'))
    """

    kind = "plane"
    own = ("normal", "offset")

    def __init__(
        self,
        *,
        restitution: Any = 1.0,
        friction: Any = None,
        normal: Any = None,
        offset: Any = 0.0,
        way: ContactWay = "safe",
        omega: Any = None,
    ) -> None:
        super().__init__(restitution, friction, way, omega)
        self.normal = None if normal is None else _unit(_vector("normal", normal))
        self.offset = checks.numbers("offset", offset, unit="units of length")

    def _shapes(self) -> dict[str, Shape]:
        return {"offset": self.offset.shape} | ({} if self.normal is None else {"normal": self.normal.shape[1:]})

    @property
    def dim(self) -> int | None:
        """The number of dimensions of its normal; None without one."""
        return None if self.normal is None else len(self.normal)

    def place(self, dim: int) -> dict[str, Any]:
        """The unit normal and the offset."""
        normal = np.eye(dim)[-1] if self.normal is None else self.normal
        return {"normal": normal, "offset": self.offset}


class Sphere(Surface):
    """A ball that points stay outside of, or a bowl that they stay inside of; a circle in the plane.

    The ways are those of ``Floor``.

    Args:
        centre: shape (dim,) or (dim, *batch), in units of length.
        radius: in units of length, above zero; broadcasts over the batch.
        inside: whether points stay inside.
        restitution: e, as of ``Floor``.
        friction: Coulomb's coefficient, as of ``Floor``.
        way: the way of contact, as of ``Floor``.
        omega: ω of the spring, as of ``Floor``.

    Raises:
        ArgumentError: if an argument is wrong.

    Example:
        >>> sw.Particles(floor=sw.Sphere((0.0, 0.0), 1.0, inside=True))
        Particles(masses=1.0, gravity=9.81, floor=Sphere(centre=[0.0, 0.0], radius=1.0, inside=True, way='safe'))
    """

    kind = "sphere"
    own = ("centre", "radius", "inside")

    def __init__(
        self,
        centre: Any,
        radius: Any,
        *,
        inside: bool = False,
        restitution: Any = 1.0,
        friction: Any = None,
        way: ContactWay = "safe",
        omega: Any = None,
    ) -> None:
        super().__init__(restitution, friction, way, omega)
        self.centre = _vector("centre", centre)
        self.radius = checks.numbers("radius", radius, positive=True, unit="units of length")
        self.inside = checks.flag("inside", inside)

    def _shapes(self) -> dict[str, Shape]:
        return {"centre": self.centre.shape[1:], "radius": self.radius.shape}

    @property
    def dim(self) -> int:
        """The number of dimensions of its centre."""
        return len(self.centre)

    def place(self, dim: int) -> dict[str, Any]:
        """The side, the centre and the radius."""
        return {"side": "inside" if self.inside else "outside", "centre": self.centre, "radius": self.radius}


#: The most components of a vector: points are on a line, in the plane or in space.
MOST_DIMENSIONS = 3


def _vector(argument: str, value: Any) -> Array:
    """An argument as a vector, whose components are along the first axis."""
    vector = checks.numbers(argument, value)
    if vector.ndim == 0 or not 1 <= len(vector) <= MOST_DIMENSIONS:
        raise ShapeError(
            f"{argument}: expected a vector, 1 to {MOST_DIMENSIONS} components along the first axis, got shape {vector.shape}"
        )
    return vector


def _unit(vector: Array) -> Array:
    size = np.abs(vector).max(axis=0)
    if not (size > 0.0).all():
        raise ArgumentError("normal: expected a vector with a direction, got one of length 0")
    scaled = vector / size
    square = scaled[0] * scaled[0]
    for each in scaled[1:]:
        square = square + each * each
    return np.asarray(scaled / np.sqrt(square))


class Surfaces(Part):
    """The surfaces that the points of a system meet, in this order."""

    kind = "surfaces"
    is_scaled = True

    def __init__(self, surfaces: tuple[Surface, ...]) -> None:
        self.surfaces = surfaces

    @property
    def batch(self) -> Shape:
        """The batch shape of the parameters of all surfaces."""
        return checks.batch_shape(batches(self.surfaces))

    def parameters(self, y_shape: Shape, batch: Shape) -> dict[str, Any]:
        """The number of surfaces, and the kind, way and numbers of each."""
        parameters: dict[str, Any] = {"contacts": len(self.surfaces)}
        for i, surface in enumerate(self.surfaces):
            parameters[f"contact_{i}"] = surface.kind
            for name, value in surface.parameters(y_shape[-1]).items():
                parameters[f"contact_{i}_{name}"] = aligned(value, 1, batch) if name in VECTORS else value
        return parameters

    def own_axes(self, name: str) -> int:
        """1 for vectors, 0 for other parameters."""
        return 1 if name.endswith(VECTORS) else 0

    def wrap(self, s: Any, h: Any, parameters: dict[str, Any]) -> contact.Touching:
        """The system with contact of its points."""
        return contact.Touching(s, h, contact.surfaces(h, parameters))

    def member(self, one: Callable[..., Array]) -> Surfaces:
        """The surfaces for one member of a batch."""
        return Surfaces(tuple(surface.member(one) for surface in self.surfaces))

    def repr_arguments(self) -> list[str]:
        """The argument ``floor``."""
        return [f"floor={self.surfaces[0] if len(self.surfaces) == 1 else list(self.surfaces)}"]


def floors(argument: Any) -> tuple[Surface, ...]:
    """The surfaces of the argument ``floor``: a surface, a list of them, or None."""
    if argument is None:
        return ()
    surfaces = tuple(argument) if isinstance(argument, (list, tuple)) else (argument,)
    for surface in surfaces:
        if not isinstance(surface, Surface):
            raise DTypeError(f"floor: expected a Floor, a Sphere, a list of them or None, got {type(surface).__name__}")
    return surfaces


def around(surfaces: tuple[Surface, ...]) -> tuple[Part, ...]:
    """The surfaces as a part around a system; empty without surfaces."""
    return (Surfaces(surfaces),) if surfaces else ()


def batches(surfaces: tuple[Surface, ...]) -> dict[str, Shape]:
    """The batch shape of each surface, by the name that messages use."""
    return {f"floor {i}": surface.batch for i, surface in enumerate(surfaces)}


def dimensions(surfaces: tuple[Surface, ...]) -> dict[str, int]:
    """The number of dimensions of each surface, by the name that messages use. Surfaces that fit any are left out."""
    return {f"floor {i}": surface.dim for i, surface in enumerate(surfaces) if surface.dim is not None}
