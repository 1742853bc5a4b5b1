"""``jacobian``: the derivative of a system's rates at a state."""

from __future__ import annotations

from math import prod
from typing import Any

import numpy as np

from ...base import checks
from ...base.arrays import Array
from ...base.immutable import ValueEquality
from ...base.reprs import cell, counted, facts, table
from ...model.derivatives import traced
from ...model.systems import System
from ...model.systems.base import a_system
from ..stability import eigen, maps
from ..stability.analysis import names_of, velocities
from ..stability.eigen import Complex

#: For states with more numbers than this the complex step is used if the system allows it: a tape of derivatives would be long.
MAX_TRACED_NUMBERS = 64


class Jacobian(ValueEquality):
    """The derivative of the rates (v̇, ẏ) with respect to the state (v, y), for n numbers of a state and a batch of members.

    Attributes:
        system: the system.
        v: the velocities of the state, shape (*block, *batch).
        y: its coordinates, likewise.
        t: its time.
        matrix: shape (n, n, *members): rows are the numbers of v̇, then those of ẏ; columns those of v, then those of y. In 1 per
            unit of time, times the unit of the row's number over that of the column's.
        rates: v̇ and ẏ themselves, shape (n, *members).
        names: the names of the n numbers.
    """

    def __init__(self, system: System, v: Array, y: Array, t: float, matrix: Array, rates: Array) -> None:
        self.system = system
        self.v, self.y, self.t = v, y, t
        self.matrix = matrix
        self.rates = rates
        self.names = tuple(names_of("v", system.v_shape) + names_of("y", system.y_shape))

    def _block(self, row: int, column: int) -> Array:
        n_v = maps.size(self.system)[0]
        halves = slice(0, n_v), slice(n_v, None)
        return self.matrix[halves[row], halves[column]]

    @property
    def vv(self) -> Array:
        """∂v̇/∂v: damping and gyroscopic terms."""
        return self._block(0, 0)

    @property
    def vy(self) -> Array:
        """∂v̇/∂y: minus the stiffness, per mass."""
        return self._block(0, 1)

    @property
    def yv(self) -> Array:
        """∂ẏ/∂v: the identity where ẏ = v."""
        return self._block(1, 0)

    @property
    def yy(self) -> Array:
        """∂ẏ/∂y."""
        return self._block(1, 1)

    @property
    def eigenvalues(self) -> Complex:
        """The rates λ at which small disturbances grow and rotate, shape (n, *members), the largest real part first."""
        return by_growth(self.matrix)

    def _repr_html_(self) -> str:
        if self.matrix.ndim > 2:
            return facts(
                "Jacobian",
                [("system", repr(self.system)), ("members", prod(self.matrix.shape[2:])), ("numbers", len(self.names))],
            )
        rows = [[f"rate of {name}", *map(cell, row)] for name, row in zip(self.names, self.matrix.tolist(), strict=True)]
        grown = ", ".join(cell(each) for each in self.eigenvalues[:8])
        return table(
            f"Jacobian of {self.system!r}", ["", *(f"by {name}>" for name in self.names)], rows, [f"eigenvalues: {grown}"]
        )

    def __repr__(self) -> str:
        members = self.matrix.shape[2:]
        what = counted(prod(members), "member") if members else f"largest growth {self.eigenvalues[0].real:.6g}"
        return f"<Jacobian of {self.system!r}: {len(self.matrix)} × {len(self.matrix)}, {what}>"


def jacobian(system: System, *, y: Any, v: Any = None, t: float = 0.0) -> Jacobian:
    """The derivative of a system's rates at a state, exact up to rounding.

    The rates are traced and their tape is differentiated, operation by operation; nothing is approximated by differences. This
    holds for your own equations as well as for built-in systems. For a built-in system of more than 64 numbers the complex step
    is used, which is equally exact.

    Args:
        system: the system; parameters may be arrays.
        y: the coordinates, shape (*block, *batch), or one number for all.
        v: the velocities, likewise; None for a system without velocities.
        t: the time; it has no influence if the rates depend on time only through added inputs.

    Returns:
        A ``Jacobian``: ``matrix`` of shape (n, n, *members), and its blocks ``vv``, ``vy``, ``yv`` and ``yy``.

    Raises:
        UnsupportedError: if the rates depend on the state through an operation that has no derivative.

    Example:
        >>> sw.jacobian(sw.Pendulum(omega=2.0), v=0.0, y=0.0).matrix
        array([[ 0., -4.],
               [ 1.,  0.]])
    """
    system = a_system(system).for_state_shapes(v, y)
    v = checks.block("v", velocities(system, v), system.v_shape, system.axes)
    system.not_in_a_loop("jacobian")
    y = checks.block("y", y, system.y_shape, system.axes)
    t = checks.number("t", t, unit="units of time")
    n = sum(maps.size(system))
    checks.fits("the matrices", 2 * n * n + n, traced.together(system, v, y), "ask for fewer")
    return Jacobian(system, v, y, t, *linearised(system, v, y, t))


def linearised(system: System, v: Array, y: Array, t: Any = 0.0) -> tuple[Array, Array]:
    """The derivative of the rates at states, shape (n, n, *members), and the rates there, shape (n, *members)."""
    members = traced.together(system, v, y, t=t)
    if _is_traced(system):
        return traced.matrix(system, "rates", None, members, v, y, t)
    matrix = np.broadcast_to(maps.rates(system, t, v, y), (*[sum(maps.size(system))] * 2, *members))
    return matrix, rates_at(system, v, y, t)


def rates_at(system: System, v: Array, y: Array, t: Any = 0.0) -> Array:
    """The rates at states, shape (n, *members)."""
    members = traced.together(system, v, y, t=t)
    if _is_traced(system):
        return traced.rates(system, members, v, y, t)
    v, y = (checks.spread(block, shape, members) for block, shape in ((v, system.v_shape), (y, system.y_shape)))
    with np.errstate(all="ignore"):
        s = system.scaled(1.0, members)
        return np.concatenate([s.dv(t, v, y).reshape(-1, *members), s.dy(t, v, y).reshape(-1, *members)])


def _is_traced(system: System) -> bool:
    return not system.complex_step or sum(maps.size(system)) <= MAX_TRACED_NUMBERS


def by_growth(matrix: Array, zeros: int = 0) -> Complex:
    """Eigenvalues, and further ``zeros``, the largest real part first; then the fastest first, in a pair the positive angle."""
    values = eigen.eigenvalues(matrix)
    values = np.concatenate([values, np.zeros((zeros, *values.shape[1:]))])
    size = np.abs(values).max(axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        real = np.round(values.real / np.where(size > 0.0, size, 1.0), 9)
    return np.take_along_axis(values, np.lexsort((-values.imag, -np.abs(values.imag), -real), axis=0), axis=0)
