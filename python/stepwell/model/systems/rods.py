"""Points joined by rods: pendulums of any number of rods, and other structures."""

from __future__ import annotations

from collections.abc import Iterable
from operator import index
from typing import Any, ClassVar

import numpy as np

from ...base import checks
from ...base.arrays import Array, Shape
from ...base.immutable import changed
from ...errors import ArgumentError, DTypeError, ShapeError, UnsupportedError
from ...reference.elimination import factored
from ...reference.systems import rods as reference
from .. import surfaces
from ..parameters import aligned
from .base import System, shown

#: The most rods: if all of them meet in one point, a step has some m³/3 operations for each evaluation of the rates.
MAX_RODS = 100

#: The most pairs of a point and a surface: a step near a surface computes all of them.
MAX_CONTACTS = 100

#: The relative error of the length of a rod in a saved state above which a run warns.
DOUBTFUL_LENGTH_ERROR = 0.1

#: If a pivot of rods that form loops is below this share of its diagonal entry at the start, one of them is redundant.
SINGULAR_PIVOT = 1e-10

#: An end of a rod: the number of a point, or the coordinates of a fixed anchor.
End = int | tuple[float, ...]


class RodSystem(System):
    """The base class of the pendulum in space and other systems of rods."""

    complex_step = True
    constraint = "length"
    velocity_term = "forces that do"

    def named(self, name: str, index: Shape) -> str:
        """The strength of a control is called c."""
        return super().named("c" if name == "strength" else name, index)

    def doubt(self, y: Array) -> tuple[str, Any] | None:
        """A message if a rod has another length in the first or last of these states."""
        y = y[[0, -1]]
        batch = y.shape[1 + len(self.y_shape) :]
        with np.errstate(all="ignore"):
            error = np.asarray([self.reference_at_step(1.0, batch).record("length_error", each, each) for each in y])
            wrong = np.isfinite(error) & (error > DOUBTFUL_LENGTH_ERROR)
        if not wrong.any():
            return None
        text = (
            f"a rod is {100.0 * error[wrong].max():.3g} % off its length in a saved state: the start has another, or the step is "
            f'too long; control=LengthControl(0.5) or Projection("length") keeps it'
        )
        return text, wrong.reshape(-1, *batch).any(axis=0)


def surfaces_for_rods(floor: Any, dims: set[int]) -> tuple[tuple[surfaces.Surface, ...], set[int]]:
    """The ``floor`` of points on rods, and the dimension of rods and surfaces: like ``dims`` a set of one number, or empty."""
    floors, dims = surfaces.floors(floor), set(dims)
    for i, each in enumerate(floors):
        if each.way != "safe":
            raise UnsupportedError(
                f'floor {i}: expected way="safe", got {each.way!r}; impulses of surfaces and pulls of rods depend on each other, '
                f"and no other way solves for both"
            )
        if each.dim is not None:
            expected = dims or {2, 3}
            if each.dim not in expected:
                raise ShapeError(
                    f"floor {i}: expected vectors of {' or '.join(map(str, sorted(expected)))} components, got {each.dim}"
                )
            dims.add(each.dim)
    return floors, dims


class Rods(RodSystem):
    """Point masses joined by rods without mass, under gravity, in a plane or in space (§12). Blocks have shape (points, dim).

    The last coordinate is the height. Every evaluation of the rates solves for the pulls of all rods, so a rod keeps its length
    but for the errors of the method. ``LengthControl`` returns it to its length, ``Projection("length")`` resets it after every
    step. A start with other lengths is not refused: without either the rods keep these, and the run warns.

    Their energy is Σ m·(½v² + g·height), which is zero at rest at height 0.

    Args:
        masses: one for each point, shape (points,) or (points, *batch), above zero.
        rods: pairs of ends. An end is the number of a point, from 0 on, or the coordinates of a fixed anchor. A chain is solved
            fastest if its rods are in order from one end to the other.
        lengths: of the rods, above zero: one for all, or shape (rods,) or (rods, *batch).
        gravity: acceleration downwards, in units of length per unit of time squared; broadcasts over the batch.
        floor: a ``Floor`` or ``Sphere`` that the points meet, or a list of them; with ``way="safe"`` only.
        dim: 2 or 3; if None, that of the anchors or of ``floor``, or else that of the state.

    Up to 100 rods, and not more than there are coordinates. Rods may form loops as long as each of them still restricts the
    motion.

    Raises:
        ArgumentError: if an argument is wrong; and before a run, if the ends of a rod are in one place, or if a rod
            is redundant.

    Example:
        >>> pendulum = sw.Rods([1.0, 1.0], [((0.0, 0.0), 0), (0, 1)], 1.0)
        >>> run = sw.integrate(pendulum, "rk4", v=0.0, y=[[1.0, 0.0], [2.0, 0.0]], dt=0.01, steps=1000)
    """

    kernel = "rods"
    unchanged: ClassVar[dict[str, float]] = {"masses": checks.POSITIVE, "lengths": checks.POSITIVE, "gravity": checks.ANY}
    reference = reference.Rods
    axes = "points, dim"

    def __init__(
        self, masses: Any, rods: Any, lengths: Any, *, gravity: Any = 1.0, floor: Any = None, dim: int | None = None
    ) -> None:
        self.masses = checks.numbers("masses", masses, positive=True)
        if self.masses.ndim == 0 or len(self.masses) == 0:
            raise ShapeError(f"masses: expected one for each point along the first axis, got shape {self.masses.shape}")
        self.rods = _ends(rods, len(self.masses))
        anchored = {len(end) for rod in self.rods for end in rod if isinstance(end, tuple)}
        dims = anchored | (set() if dim is None else {checks.count("dim", dim, 2, 3)})
        if len(dims) > 1:
            raise ShapeError(f"rods, dim: expected one number of dimensions, got {' and '.join(map(str, sorted(dims)))}")
        floors, dims = surfaces_for_rods(floor, dims)
        self.around = surfaces.around(floors)
        self.dim = next(iter(dims), None)
        if len(floors) * len(self.masses) > MAX_CONTACTS:
            raise ArgumentError(
                f"floor: expected at most {MAX_CONTACTS} pairs of a point and a surface, got {len(self.masses)} points and "
                f"{len(floors)} surfaces"
            )
        lengths = checks.numbers("lengths", lengths, positive=True)
        if lengths.ndim and len(lengths) != len(self.rods):
            raise ShapeError(f"lengths: expected one for each of {len(self.rods)} rods, or one number, got shape {lengths.shape}")
        self.lengths = lengths if lengths.ndim else np.full(len(self.rods), lengths)
        self.gravity = checks.numbers("gravity", gravity)
        self.v_shape = self.y_shape = (len(self.masses), self.dim or 3)
        if len(self.rods) > np.prod(self.y_shape):
            raise ArgumentError(f"rods: expected at most as many as coordinates, {np.prod(self.y_shape)}, got {len(self.rods)}")
        shapes = {"masses": self.masses.shape[1:], "lengths": self.lengths.shape[1:], "gravity": self.gravity.shape}
        self.batch = checks.batch_shape(shapes | surfaces.batches(floors))

    @property
    def anchors(self) -> tuple[tuple[float, ...], ...]:
        """The fixed ends, each once."""
        return tuple(dict.fromkeys(end for rod in self.rods for end in rod if isinstance(end, tuple)))

    @property
    def has_loops(self) -> bool:
        """True if rods form a loop, where all anchors count as one point."""
        groups: dict[End, End] = {}

        def group(end: End) -> End:
            while (up := groups.get(end, end)) != end:
                end = up
            return end

        for rod in self.rods:
            a, b = (group(() if isinstance(end, tuple) else end) for end in rod)
            if a == b:
                return True
            groups[b] = a
        return False

    def repr_arguments(self) -> list[str]:
        """Its arguments, for its repr."""
        n = len(self.masses)
        masses = self.masses.tolist() if self.masses.ndim == 1 and n <= 5 else f"{n} points"
        rods = list(self.rods) if len(self.rods) <= 5 else f"{len(self.rods)} rods"
        return [str(masses), str(rods), *shown(gravity=self.gravity)]

    def for_state_shapes(self, *states: Any) -> Rods:
        """The rods in as many dimensions as the states, v and y, have.

        Raises:
            ShapeError: if these are not states of such rods.
            ArgumentError: if at these coordinates a rod has no direction or is redundant.
        """
        n, bound = len(self.masses), self
        shapes = {name: checks.shape_of(name, state) for name, state in zip("vy", states, strict=False) if state is not None}
        dims = set()
        for name, shape in shapes.items():
            if shape and (len(shape) < 2 or shape[0] != n or shape[1] not in ((2, 3) if self.dim is None else (self.dim,))):
                dim = "2 or 3" if self.dim is None else self.dim
                raise ShapeError(
                    f"{name}: expected shape ({n}, {dim}, batch…) = ({self.axes}, batch…), got {shape}; batch axes come last"
                )
            dims |= set(shape[1:2])
        if len(dims) > 1:
            raise ShapeError(f"v and y: expected as many dimensions in both, got shapes {shapes['v']} and {shapes['y']}")
        if dims and self.dim is None:
            (dim,) = dims
            bound = changed(self, dim=dim, v_shape=(n, dim), y_shape=(n, dim))
            if len(self.rods) > np.prod(bound.y_shape):
                raise ArgumentError(
                    f"rods: expected at most as many as coordinates, {np.prod(bound.y_shape)}, got {len(self.rods)}"
                )
        if len(states) > 1 and states[1] is not None:
            bound._check_start(checks.numbers("y", states[1], finite=False))
        return bound

    def _check_start(self, y: Array) -> None:
        """Raise if the equations of the pulls cannot be solved at these coordinates."""
        y = checks.block("y", y, self.y_shape, self.axes, finite=False)
        s = self.reference_at_step(1.0, y.shape[2:])
        with np.errstate(all="ignore"):
            d = s.spans(y)
            for rod, span in zip(self.rods, d, strict=True):
                if (reference.dot(span, span) == 0.0).any():
                    raise ArgumentError(f"y: expected the ends of each rod apart, got those of the rod {rod} in one place")
            if not self.has_loops:
                return  # taken from the outermost inwards, each rod has an end that the later ones do not move
            rows = s.matrix(d)
            pivots = factored(rows)[1]
            for rod, pivot, row in zip(self.rods, pivots, rows, strict=True):
                if (pivot <= SINGULAR_PIVOT * row[-1]).any():
                    raise ArgumentError(
                        f"rods: expected each to restrict the motion, but at the start the rod {rod} adds nothing to those "
                        f"before it; leave it out"
                    )

    def equation_parameters(self, batch: Shape) -> dict[str, Any]:
        """The dimension, ends, masses, lengths, anchors and gravity, and the control of the lengths."""
        n, anchors = len(self.masses), self.anchors
        number = {end: n + i for i, end in enumerate(anchors)}
        ends = [[end if isinstance(end, int) else number[end] for end in rod] for rod in self.rods]
        masses, lengths = (aligned(each, 1, batch) for each in (self.masses, self.lengths))
        fixed = aligned(np.array(anchors), 2, batch) if anchors else None
        sizes = {"dim": self.y_shape[1], "rods": ends}
        return (
            sizes
            | {"masses": masses, "lengths": lengths, "anchors": fixed, "gravity": self.gravity}
            | self.constraint_parameters()
        )


def _ends(rods: Any, points: int) -> tuple[tuple[End, End], ...]:
    """The rods as pairs of ends; an anchor is the first end."""
    pairs = checks.several("rods", rods, "pairs of ends")
    if not 1 <= len(pairs) <= MAX_RODS:
        raise ArgumentError(f"rods: expected 1 to {MAX_RODS}, got {len(pairs)}")
    ends: list[tuple[End, End]] = []
    for k, pair in enumerate(pairs):
        both = checks.several(f"rods[{k}]", pair, "two ends")
        if len(both) != 2:
            raise ShapeError(f"rods[{k}]: expected two ends, got {len(both)}")
        a, b = (_end(f"rods[{k}][{i}]", end, points) for i, end in enumerate(both))
        if isinstance(a, tuple) and isinstance(b, tuple):
            raise ArgumentError(f"rods[{k}]: expected a point at one end, got two anchors")
        if a == b:
            raise ArgumentError(f"rods[{k}]: expected two different points, got {a} twice")
        rod = (b, a) if isinstance(b, tuple) else (a, b)
        for earlier, known in enumerate(ends):
            if set(known) == set(rod):
                raise ArgumentError(f"rods[{k}]: expected each rod once, got {rod} as rods[{earlier}] already")
        ends.append(rod)
    if free := set(range(points)) - {end for rod in ends for end in rod if isinstance(end, int)}:
        raise ArgumentError(f"rods: expected every point at the end of one, got none for point {min(free)}")
    return tuple(ends)


def _end(argument: str, end: Any, points: int) -> End:
    """The number of a point, or an anchor."""
    is_text_or_number = isinstance(end, (str, bytes)) or getattr(end, "shape", None) == ()
    if isinstance(end, Iterable) and not is_text_or_number:
        anchor = checks.numbers(argument, end)
        if anchor.ndim != 1 or len(anchor) not in (2, 3):
            raise ShapeError(f"{argument}: expected an anchor of 2 or 3 coordinates, got shape {anchor.shape}")
        return tuple((anchor + 0.0).tolist())
    expected = f"a point, 0 to {points - 1}, or the coordinates of an anchor"
    try:
        number = index(end)
    except TypeError:
        raise DTypeError(f"{argument}: expected {expected}, got {checks.short(end)} ({type(end).__name__})") from None
    if isinstance(end, (bool, np.bool_)) or not 0 <= number < points:
        raise ArgumentError(f"{argument}: expected {expected}, got {checks.short(end)}")
    return number
