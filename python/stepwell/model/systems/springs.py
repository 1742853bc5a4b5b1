"""Particles joined by springs."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from ...base import checks, registry
from ...base.arrays import Array, Shape
from ...base.immutable import changed
from ...base.reprs import counted
from ...errors import ArgumentError, DTypeError, ShapeError, UnsupportedError
from ...reference.systems import springs as reference
from ...reference.systems.nbody import square
from .. import surfaces
from ..parameters import aligned
from .base import System, shown

if TYPE_CHECKING:
    from ..methods import Method

#: The core numbers particles and ends of springs in 32 bits.
MOST_PARTICLES = MOST_SPRINGS = 2**30


class Springs(System):
    """n particles joined by springs, on a line, in the plane or in space. Blocks have shape (n, dim).

    A spring from particle i to j, of length ℓ and along the unit vector n from i to j, pulls i with the force
    k·(ℓ − ℓ₀) + c·((vⱼ − vᵢ)·n) along n, and j with the opposite one. A spring of no length has no direction, and no force.
    A fixed particle keeps its velocity: given v = 0 it stays where it is to the last bit, and given another it is led along.

    Their energy is ½·Σ m·v² − Σ m·g·y of the particles that are not fixed, and ½·Σ k·(ℓ − ℓ₀)² of the springs.

    Args:
        pairs: the two particles of each spring, from 0 on, shape (springs, 2). No two springs join the same particles. The
            forces on a particle are summed in the order of the springs.
        stiffness: k, force per length, zero or more: one number, or an array with the springs (or 1, for all) along its first
            axis and the batch along the others.
        rest: lengths ℓ₀ at which springs do not pull, likewise; if None, the lengths that they have in the ``layout``.
        layout: places of the particles with the springs at rest, shape (n, dim) or (n, dim, *batch).
        damping: c, force per speed at which a spring becomes longer, zero or more, likewise; none if None.
        masses: one number, or an array with the particles along its first axis and the batch along the others, above zero.
        fixed: the particles on which no force acts, by their numbers or as a mask of all particles; or None.
        gravity: acceleration of all particles: a number, down the last axis, or a vector of shape (dim,) or (dim, *batch), such
            as (0, -9.81); none if None.
        drag: force per speed of a particle against its motion, zero or more, given like ``masses``; none if None.
        floor: a ``Floor`` or ``Sphere`` that particles meet, or a list of them; fixed particles pass through it.
        dim: 1, 2 or 3; if None, that of ``layout``, ``gravity`` or ``floor``, or else taken from the shape of the state.

    The number of particles follows from ``layout``, else from ``masses``, else from the largest number in ``pairs``. With
    damping or drag, forces depend on the velocity, and Verlet, leapfrog and PEFRL refuse the system. ``safe_step`` returns a
    step that is safe. Lengths, masses and times may have any consistent units.

    Raises:
        ArgumentError: if an argument is wrong.

    Example:
        >>> pendulum = sw.Springs([(0, 1)], stiffness=100.0, rest=1.0, fixed=[0], gravity=(0.0, -9.81))
        >>> pendulum.safe_step("false_euler")
        0.2
    """

    kernel = "springs"
    unchanged: ClassVar[dict[str, float]] = dict.fromkeys(("stiffness", "rest", "damping", "drag"), checks.NOT_NEGATIVE) | {
        "masses": checks.POSITIVE
    }
    reference = reference.Springs
    complex_step = True
    axes = "particles, dim"

    def __init__(
        self,
        pairs: Any,
        *,
        stiffness: Any = 1.0,
        rest: Any = None,
        layout: Any = None,
        damping: Any = None,
        masses: Any = 1.0,
        fixed: Any = None,
        gravity: Any = None,
        drag: Any = None,
        floor: Any = None,
        dim: int | None = None,
    ) -> None:
        self.pairs = _pairs(pairs)
        placed = None if layout is None else _layout(layout)
        self.masses = _per_row("masses", checks.numbers("masses", masses, positive=True), None, "particles")
        self.n = self._count(placed)
        self.gravity = None if gravity is None else _gravity(gravity)
        floors = surfaces.floors(floor)
        self.around = surfaces.around(floors)
        self.dim = _dimensions(dim, placed, self.gravity, surfaces.dimensions(floors))
        self.fixed = _particles("fixed", fixed, self.n)
        if len(self.fixed) == self.n:
            raise ArgumentError(f"fixed: expected at least one particle that is free, got all {self.n}")
        if rest is not None:
            lengths = checks.not_negative("rest", rest, "lengths")
        elif placed is not None:
            lengths = _lengths(self.pairs, placed)
        else:
            raise ArgumentError("rest: expected the lengths of the springs at rest, or layout= with the places, got None")
        springs = len(self.pairs)
        self.stiffness = _not_negative_per_row("stiffness", stiffness, springs, "springs")
        self.rest = _per_row("rest", lengths, springs, "springs")
        self.damping = _not_negative_per_row("damping", damping, springs, "springs")
        self.drag = _not_negative_per_row("drag", drag, self.n, "particles")
        self.velocity_term = "damping" if self.damping is not None else "drag" if self.drag is not None else None
        self.v_shape = self.y_shape = (self.n, self.dim or 2)
        arrays = {name: getattr(self, name) for name in ("stiffness", "rest", "damping", "masses", "gravity", "drag")}
        shapes = {name: each.shape[1:] for name, each in arrays.items() if each is not None}
        self.batch = checks.batch_shape(shapes | surfaces.batches(floors))

    def _count(self, placed: Array | None) -> int:
        """The number of particles; raise if masses, pairs or the layout disagree."""
        last = int(self.pairs.max())
        n = len(placed) if placed is not None else len(self.masses) if len(self.masses) > 1 else last + 1
        if len(self.masses) not in (1, n):
            raise ShapeError(f"masses: expected {n} particles (or 1) along the first axis, got shape {self.masses.shape}")
        if last >= n:
            spring = int(np.argmax((self.pairs >= n).any(axis=1)))
            raise ArgumentError(f"pairs: expected particles below {n}, since there are {n}, got {last} in spring {spring}")
        return n

    def repr_arguments(self) -> list[str]:
        """Its arguments, for its repr."""
        optional = {"damping": self.damping, "gravity": self.gravity, "drag": self.drag}
        shorter = {name: each[0] if each is not None and each.shape == (1,) else each for name, each in optional.items()}
        fixed = [f"fixed={counted(len(self.fixed), 'particle')}"] * bool(len(self.fixed))
        return [f"{counted(len(self.pairs), 'spring')}, {counted(self.n, 'particle')}", *fixed, *shown(**shorter)]

    def for_state_shapes(self, *states: Any) -> Springs:
        """The net in as many dimensions as the states, v and y, have."""
        if self.dim is not None:
            return self
        dims = set()
        for name, state in zip(("v", "y"), states, strict=False):
            shape = checks.shape_of(name, state)
            if shape and (len(shape) < 2 or shape[0] != self.n or shape[1] not in (1, 2, 3)):
                raise ShapeError(
                    f"{name}: expected shape ({self.n}, 1 to 3, batch…) = ({self.axes}, batch…), got {shape}; "
                    "batch axes come last"
                )
            dims |= set(shape[1:2])
        if len(dims) > 1:
            raise ShapeError("v and y: expected as many dimensions in both")
        if not dims:
            return self
        (dim,) = dims
        return changed(self, dim=dim, v_shape=(self.n, dim), y_shape=(self.n, dim))

    @property
    def acceleration(self) -> Array | None:
        """The acceleration of gravity as a vector, or None without gravity."""
        if self.gravity is None or self.gravity.ndim:
            return self.gravity
        return np.append(np.zeros(self.y_shape[1] - 1), -self.gravity)

    def equation_parameters(self, batch: Shape) -> dict[str, Any]:
        """The numbers of particles and dimensions, the ends of springs, and all quantities."""
        numbers = {name: getattr(self, name) for name in ("masses", "stiffness", "rest", "damping", "gravity", "drag")}
        lists = {"pairs": self.pairs.tobytes(), "fixed": self.fixed.tobytes() if len(self.fixed) else None}
        numbers["gravity"] = self.acceleration
        rows = {name: None if each is None else aligned(each, 1, batch) for name, each in numbers.items()}
        return {"n": self.n, "dim": self.y_shape[1], **lists, **rows}

    def named(self, name: str, index: Shape) -> str:
        """A number that is common to all rows has no index."""
        numbers = getattr(self, name, None)  # None for a parameter of a part around the system
        alone = name != "gravity" and numbers is not None and numbers.shape[:1] == (1,)
        return super().named(name, () if alone else index)

    def safe_step(self, method: str | Method) -> Any:
        """A step below which a method is stable, known before any run, for any number of springs.

        No mode of an undamped net swings faster than ω, ω² = max (Wᵢ/mᵢ + Wⱼ/mⱼ) over the springs from i to j, where W is the sum
        of the stiffnesses at a particle, and a fixed one has 1/m = 0. That holds in every position, for any rest lengths. With
        damping or drag the rate of damping has a similar bound, and every pair of frequency and rate within both bounds must be
        stable. For one spring, and for lattices whose particles can swing against all of their neighbours, there is no longer
        safe step; for other small nets ``stability_limit(springs, method, v=v, y=y)`` is the exact limit at one state.

        The bound leaves surfaces out. A particle that rests on one is like a fixed one, which makes no mode faster; but a surface
        with ``way="spring"`` is a further spring. A motion that grows by itself, as where a compressed spring gives way sideways,
        does so at any step. For Damped Euler, False Heun and Semi-False Heun with damping the step is an estimate, which is exact
        if all modes are damped in proportion; for False Euler and the Runge-Kutta methods it is a bound with damping, too.

        Args:
            method: a method, or its name.

        Returns:
            The step in units of time, of the shape of the batch; 0 if no step of the method is stable without damping.

        Raises:
            UnsupportedError: if the method cannot step the system.

        Example:
            >>> sw.Springs([(0, 1)], stiffness=2.0, rest=1.0).safe_step("leapfrog")
            1.0
        """
        return registry.task("safe_step")(self, method)

    def _controllable(self, control: Any) -> None:
        if self.velocity_term is not None:
            raise UnsupportedError(f"control: {self!r} loses energy by its {self.velocity_term}, so there is none to keep")
        super()._controllable(control)


def _whole(argument: str, value: Any, what: str) -> Any:
    """An argument as an array of whole numbers of zero or more; ``what`` is its description in messages."""
    array = checks.as_array(argument, value)
    if array.size and array.dtype.kind not in "iu":
        raise DTypeError(f"{argument}: expected {what}, got {checks.short(value)}")
    if array.size and (array.min() < 0 or array.max() >= MOST_PARTICLES):
        wrong = array.min() if array.min() < 0 else array.max()
        raise ArgumentError(f"{argument}: expected {what}, from 0 on and below 2^30, got {wrong}")
    return array


def _pairs(pairs: Any) -> Any:
    what = "two whole numbers for each spring, shape (springs, 2)"
    array = _whole("pairs", pairs, what)
    if array.ndim != 2 or array.shape[1] != 2 or not len(array):
        raise ShapeError(f"pairs: expected {what} with at least one spring, got shape {array.shape}")
    if len(array) > MOST_SPRINGS:
        raise ArgumentError(f"pairs: expected at most 2^30 springs, got {len(array)}")
    if (same := array[:, 0] == array[:, 1]).any():
        spring = int(np.argmax(same))
        raise ArgumentError(f"pairs: expected two different particles, got {int(array[spring, 0])} twice in spring {spring}")
    low, high = array.min(axis=1).astype(np.int64), array.max(axis=1).astype(np.int64)
    _, first, count = np.unique(low * MOST_PARTICLES + high, return_index=True, return_counts=True)
    if (count > 1).any():
        spring = int(first[np.argmax(count > 1)])
        raise ArgumentError(f"pairs: expected each pair of particles once, got {tuple(array[spring].tolist())} more than once")
    return np.ascontiguousarray(array, dtype="<u4")


def _particles(argument: str, particles: Any, n: int) -> Any:
    """The numbers of particles in ascending order, each once."""
    if particles is None:
        return np.empty(0, dtype="<u4")
    what = "numbers of particles"
    if _is_mask(particles):
        mask = np.asarray(particles)
        if mask.shape != (n,):
            raise ShapeError(f"{argument}: expected a mask of {n} particles, or {what}, got a mask of shape {mask.shape}")
        return np.flatnonzero(mask).astype("<u4")
    array = np.atleast_1d(_whole(argument, particles, what))
    if array.ndim != 1:
        raise ShapeError(f"{argument}: expected {what} along one axis, got shape {array.shape}")
    if array.size and array.max() >= n:
        raise ArgumentError(f"{argument}: expected particles below {n}, since there are {n}, got {array.max()}")
    return np.unique(array).astype("<u4")


def _is_mask(particles: Any) -> bool:
    if isinstance(particles, np.ndarray):
        return bool(particles.dtype == np.bool_)
    return (
        isinstance(particles, (list, tuple)) and bool(particles) and all(isinstance(each, (bool, np.bool_)) for each in particles)
    )


def _layout(layout: Any) -> Array:
    array = checks.numbers("layout", layout)
    if array.ndim < 2 or array.shape[1] not in (1, 2, 3):
        raise ShapeError(f"layout: expected shape (n, 1 to 3, batch…) = (particles, dim, batch…), got {array.shape}")
    return array


def _gravity(gravity: Any) -> Array:
    array = checks.numbers("gravity", gravity, unit="length per time squared")
    if array.ndim and array.shape[0] not in (1, 2, 3):
        raise ShapeError(f"gravity: expected a number, or a vector of 1 to 3 numbers such as (0, -9.81), got shape {array.shape}")
    return array


def _dimensions(dim: Any, placed: Array | None, gravity: Array | None, floors: dict[str, int]) -> int | None:
    """The number of dimensions, None if no argument has one; raise if arguments disagree."""
    dimensions = {} if dim is None else {"dim": checks.count("dim", dim, 1, 3)}
    dimensions |= {} if placed is None else {"layout": placed.shape[1]}
    dimensions |= {} if gravity is None or gravity.ndim == 0 else {"gravity": gravity.shape[0]}
    dimensions |= floors
    if len(set(dimensions.values())) > 1:
        sizes = ", ".join(f"{name} of {number}" for name, number in dimensions.items())
        raise ShapeError(f"{' and '.join(dimensions)}: expected one number of dimensions, got {sizes}")
    return next(iter(dimensions.values()), None)


def _lengths(pairs: Any, layout: Array) -> Array:
    """The distance between the ends of each spring."""
    lengths: Array = np.sqrt(square(layout[pairs[:, 1]] - layout[pairs[:, 0]]))
    if not np.isfinite(lengths).all():
        raise ArgumentError("layout: expected places whose distances are finite, got some that are too large")
    return lengths


def _not_negative_per_row(argument: str, value: Any, rows: int, what: str) -> Any:
    """Numbers of zero or more for each row, or None."""
    return None if value is None else _per_row(argument, checks.not_negative(argument, value), rows, what)


def _per_row(argument: str, array: Array, rows: int | None, what: str) -> Array:
    """Numbers along the first axis, one for each row or one for all; any number of rows if None."""
    if array.ndim == 0:
        return array.reshape(1)
    if array.shape[0] == 0 or (rows is not None and array.shape[0] not in (1, rows)):
        number = "" if rows is None else f"{rows} "
        raise ShapeError(f"{argument}: expected {number}{what} (or 1) along the first axis, got shape {array.shape}")
    return array
