"""Bodies that attract each other."""

from __future__ import annotations

import copy
from typing import Any

import numpy as np

from .. import _checks
from .._checks import Array, Shape
from ..control import EnergyControl, Projection
from ..errors import ArgumentError, ShapeError
from ..reference.systems import nbody as reference
from .base import Parameters, System, rows

FORCES = ("logarithmic", "newton", "printed")


class NBody(System):
    """Bodies that attract each other in the plane or in space (Appendix C, D). Blocks have shape (bodies, dim).

    | force | of a pair | potential of a pair |
    |---|---|---|
    | ``"logarithmic"`` | G·m·m/r, as the document prints it | G·m·m·ln r |
    | ``"newton"`` | G·m·m/r² | −G·m·m/r |
    | ``"printed"`` | G·m·m/r | −G·m·m/r, which the document prints with it and which belongs to the other |

    Args:
        masses: one for each body, shape (bodies,) or (bodies, *batch), zero or more. A body without mass is pulled and does
            not pull.
        force: named after its potential.
        G: constant of gravity, above zero; broadcasts over the batch.
        softening: length ε that is added to distances, r² + ε², so that bodies may meet; broadcasts.
        dim: 2 or 3; if None, what the state's shape says.

    Raises:
        ArgumentError: what is wrong with which argument.
    """

    kernel = "nbody"
    axes = "bodies, dim"

    def __init__(
        self,
        masses: Any = (1.0, 1.0, 1.0),
        *,
        force: str = "logarithmic",
        G: Any = 1.0,
        softening: Any = 0.0,
        dim: int | None = None,
    ) -> None:
        self.masses = _checks.numbers("masses", masses)
        if self.masses.ndim == 0 or len(self.masses) == 0:
            raise ShapeError(f"masses: expected one for each body along the first axis, got shape {self.masses.shape}")
        if (self.masses < 0).any():
            raise ArgumentError(f"masses: expected numbers of zero or more, got {self.masses.min():g}")
        self.force = _checks.known("force", force, FORCES)
        self.G = _checks.numbers("G", G, positive=True)
        self.softening = _checks.numbers("softening", softening)
        if (self.softening < 0).any():
            raise ArgumentError(f"softening: expected lengths of zero or more, got {self.softening.min():g}")
        self.dim = None if dim is None else _checks.count("dim", dim, 2, 3)
        self._shape(self.dim or 2)
        self.control: EnergyControl | Projection | None = None
        self.batch = _checks.batch_shape({"masses": self.masses.shape[1:], "G": self.G.shape, "softening": self.softening.shape})

    def _shape(self, dim: int) -> None:
        self.v_shape = self.y_shape = (len(self.masses), dim)

    def __repr__(self) -> str:
        n = len(self.masses)
        masses = self.masses.tolist() if self.masses.ndim == 1 and n <= 5 else f"{n} bodies"
        given = [f"masses={masses}", f"force={self.force!r}", f"G={self.G}"]
        given += [f"softening={self.softening}"] * bool(self.softening.any()) + ([repr(self.control)] if self.control else [])
        return f"NBody({', '.join(given)})"

    def sized(self, *states: Any) -> NBody:
        """The same bodies in as many dimensions as the states, v and y, have."""
        if self.dim is not None:
            return self
        n, dims = len(self.masses), set()
        for name, state in zip(("v", "y"), states, strict=False):
            shape = np.shape(state)
            if shape and (len(shape) < 2 or shape[0] != n or shape[1] not in (2, 3)):
                raise ShapeError(
                    f"{name}: expected shape ({n}, 2 or 3, batch…) = ({self.axes}, batch…), got {shape}; batch axes come last"
                )
            dims |= set(shape[1:2])
        if len(dims) > 1:
            raise ShapeError(
                f"v and y: expected as many dimensions in both, got shapes {np.shape(states[0])} and {np.shape(states[1])}"
            )
        bound = copy.copy(self)
        if dims:
            (bound.dim,) = dims
            bound._shape(bound.dim)
        return bound

    def member(self, index: tuple[int, ...], batch: Shape) -> NBody:
        """One member of a batch, alone."""

        def one(values: Array, own: int = 0) -> Array:
            wide = values.reshape((*values.shape[:own], *(1,) * (len(batch) - values.ndim + own), *values.shape[own:]))
            return _checks.member(np.broadcast_to(wide, (*values.shape[:own], *batch)), index)

        alone = copy.copy(self)
        alone.masses, alone.G, alone.softening = one(self.masses, 1), one(self.G), one(self.softening)
        alone.batch = ()
        if self.control is not None:
            alone.control = self.control.member(one)
        return alone

    def closest(self, y: Array) -> tuple[tuple[int, int], float]:
        """The two bodies that are nearest to each other in one state, and their distance."""
        n, best = len(y), ((0, 0), np.inf)
        for i in range(n - 1):
            with np.errstate(all="ignore"):
                distance = np.sqrt(((y[i + 1 :] - y[i]) ** 2).sum(axis=1))
            j = int(np.argmin(np.where(np.isnan(distance), np.inf, distance)))
            if distance[j] < best[1]:
                best = (i, i + 1 + j), float(distance[j])
        return best

    def _parts(self, batch: Shape) -> list[Array]:
        """Masses, G·m and softening with as many batch axes as the states have."""
        masses = self.masses.reshape(len(self.masses), *(1,) * (len(batch) - self.masses.ndim + 1), *self.masses.shape[1:])
        return [masses, self.G * masses, np.asarray(self.softening)]

    def scaled(self, h: float, batch: Shape) -> reference.NBody:
        """The NumPy reference, scaled to the step h."""
        masses, strength, softening = self._parts(batch)
        keeps: dict[str, Any] = {} if self.control is None else self.control.scaled(h)
        return reference.NBody(h, self.force, masses, strength, softening, **keeps)

    def parameters(self, batch: Shape) -> Parameters:
        """Options, sizes and rows for the core, as ``nbody/mod.rs`` documents them."""
        masses, strength, softening = self._parts(batch)
        given = [rows(strength, batch), rows(masses, batch), rows(softening[np.newaxis], batch)]
        options = [self.force]
        if self.control is not None:
            options.append(self.control.option)
            given += [rows(np.asarray(each)[np.newaxis], batch) for each in self.control.rows()]
        return Parameters(options, list(self.y_shape), given)

    @property
    def quantities(self) -> dict[str, Shape]:
        """What can be recorded: energy, momentum, angular momentum (about the origin), and the least distance of two bodies."""
        dim = self.dim or 2
        return {"energy": (), "momentum": (dim,), "angular_momentum": () if dim == 2 else (3,), "closest": ()}

    def recordable(self, name: str, v: Array, y: Array, dt: float) -> Array:
        """A quantity of states of a run with that step, the same to the bit as if it had been recorded."""
        return self._left_alone().scaled(dt, np.broadcast_shapes(v.shape[2:], y.shape[2:])).record(name, v, y)

    def energy(self, v: Array, y: Array) -> Array:
        """½·Σ m·v² and the potential of every pair; see the table above."""
        return self._energies(v, y)[1]

    def _energies(self, v: Array, y: Array) -> tuple[Array, Array]:
        """The kinetic and the whole energy."""
        batch = np.broadcast_shapes(v.shape[2:], y.shape[2:])
        with np.errstate(all="ignore"):
            _, kinetic, whole = self._left_alone().scaled(1.0, batch).energies(v, y)
        return kinetic, whole

    def _left_alone(self) -> NBody:
        free = copy.copy(self)
        free.control = None
        free.velocity_term = None
        return free

    def controlled(self, control: EnergyControl | Projection, v: Array, y: Array, dt: float) -> NBody:
        """The same bodies under energy control, the target that of the state if the control has none."""
        bound = self._left_alone()
        bound.control = control.aimed(*self._energies(v, y), dt)
        bound.velocity_term = "energy control"
        return bound
