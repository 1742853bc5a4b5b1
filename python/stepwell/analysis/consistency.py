"""States at which algebraic equations hold: those from which a run of M·ẏ = f with a singular M can start."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..base import checks
from ..base.arrays import Array
from ..errors import ArgumentError, UnsupportedError
from ..model.derivatives import traced
from ..model.systems import System
from ..model.systems.base import a_system
from ..reference import pivoting

#: The most passes of Newton's method. Each doubles the number of right digits; a start far off may need some more.
MOST_PASSES = 50
#: A pass that changes no number by more than this share of the largest is the last one.
ROUNDING = 1e-14
#: Algebraic equations do not determine the numbers that they are for if the least singular value of the derivatives is below this
#: share of their terms.
LEAST_DETERMINED = 1e-11
#: Algebraic equations do not hold at a state that they would change by more than this share of the size of a number.
MOST_BROKEN = 0.1
#: The share of the largest component that counts as rounding.
LEAST = 1e-12
#: The part of a step over which equations are compared for their derivative by the time.
PART = 1e-4


def consistent_start(system: System, y: Any, *, t0: Any = 0.0) -> Array:
    """A state near this one at which the algebraic equations of a system hold, for a run to start from.

    The system has a singular mass matrix M, M·ẏ = f(t, y). Newton's method changes y by multiples of the vectors that M takes to
    zero: M·y stays what it is, so that a number whose rate is known keeps its value if no other rate is in its equation.

    Args:
        system: a system with algebraic equations; parameters may be arrays.
        y: the state to start from, shape (*block, *batch), or one number for all. Numbers that are not known may be guessed.
        t0: the time at which the equations are to hold.

    Returns:
        The state, shape (*block, *members).

    Raises:
        ArgumentError: what was given and what was expected; and if no such state was found, so that another start is needed.
        UnsupportedError: if the system has no algebraic equations, or if they do not determine what they are for (their index is
            above 1).

    Example:
        >>> @sw.system(order=1, mass=[[1, 0], [0, 0]])
        ... def divider(t, y, *, resistance=2.0):  # a charge, and the current that it drives
        ...     charge, current = y
        ...     return [-current, charge - resistance * current]
        >>> sw.consistent_start(divider(), y=[3.0, 0.0])
        array([3. , 1.5])
    """
    system = a_system(system).for_state_shapes(0.0, y)
    if system.mass_matrix is None:
        raise UnsupportedError(f"system: expected one with algebraic equations (a singular mass=), got {system!r}")
    y = checks.block("y", y, system.y_shape, system.axes)
    t0 = checks.numbers("t0", t0, unit="units of time")
    members = traced.together(system, np.empty(0), y, t0=t0)
    y = np.array(checks.spread(y, system.y_shape, members))
    for _ in range(MOST_PASSES):
        change = correction(system, y, t0)
        y += change
        if not np.isfinite(y).all():
            break
        if (np.abs(change) <= ROUNDING * np.abs(y).max(axis=_own(system), initial=0.0)).all():
            return np.asarray(y)
    raise ArgumentError(
        f"y: Newton's method found no state at which the algebraic equations of {system!r} hold; start from another one"
    )


def _own(system: System) -> tuple[int, ...]:
    return tuple(range(len(system.y_shape)))


def correction(system: System, y: Array, t: Any) -> Array:
    """The change of states by one pass of Newton's method for the algebraic equations, of the shape of y."""
    equations = _Algebraic(system, y, t).determined()
    return equations.change(-equations.values[equations.places]).reshape(y.shape)


def rates(system: System, y: Array, t: Any, h: Any) -> Array:
    """ẏ of states at which algebraic equations hold, also of the numbers that these determine, of the shape of y.

    The equations go on to hold: their derivatives along ẏ, and by the time, add up to zero. The latter are differences over a
    part of the length h, since rates serve to see which way a quantity goes.
    """
    equations = _Algebraic(system, y, t).determined()
    known = equations.values.copy()
    known[equations.places] = 0.0
    ahead, behind = (_Algebraic(system, y, t + sign * PART * h).values[equations.places] for sign in (1.0, -1.0))
    along = np.einsum("ij...,j...->i...", equations.matrix[equations.places], known)
    with np.errstate(all="ignore"):
        return (known + equations.change(-(along + (ahead - behind) / (2.0 * PART * h)))).reshape(y.shape)


class _Algebraic:
    """Algebraic equations at states of a system, with their derivatives.

    Attributes:
        values: the right-hand sides of all equations, shape (n, *members).
        matrix: their derivatives, shape (n, n, *members).
        places: which equations are algebraic.
        along: the derivatives of the algebraic ones along the vectors that M takes to zero, shape (count, count, *members).
        singular: whether they determine nothing at a member's state.
    """

    def __init__(self, system: System, y: Array, t: Any) -> None:
        assert system.mass_matrix is not None
        self._system, matrix_rows = system, system.mass_matrix.rows
        members = y.shape[len(system.y_shape) :]
        with np.errstate(all="ignore"):
            self.matrix, self.values = traced.matrix(system, "equations", None, members, np.empty((0, *members)), y, t)
        self.places = [number for number, row in enumerate(matrix_rows) if not row]
        count = len(self.places)
        # One such vector for each algebraic equation, as the other rows of M are [I, B].
        self._null = np.zeros((len(self.values), count))
        for i, place in enumerate(self.places):
            self._null[place, i] = 1.0
            for row, entries in enumerate(matrix_rows):
                self._null[row, i] -= dict(entries).get(place, 0.0)
        with np.errstate(all="ignore"):
            products = [
                self.matrix[self.places][:, number, np.newaxis] * self._null[number].reshape(1, -1, *(1,) * len(members))
                for number in np.flatnonzero(self._null.any(axis=1))
            ]
            self.along, terms = np.asarray(sum(products)), np.asarray(sum(map(np.abs, products)))
        self.singular = _singular(_stacked(self.along), _stacked(terms)).reshape(members)

    def change(self, right: Array) -> Array:
        """The change of states, along the vectors that M takes to zero, by which the algebraic equations change so."""
        count = len(self.places)
        with np.errstate(all="ignore"):
            rows = [[self.along[i, j] if np.any(self.along[i, j]) else None for j in range(count)] for i in range(count)]
            shares = pivoting.solved(pivoting.factored(rows), list(right))
            change = np.zeros(self.values.shape)
            for share, vector in zip(shares, self._null.T, strict=True):
                for at in np.flatnonzero(vector):
                    change[at] += vector[at] * share
        return change

    def sides(self) -> Array:
        """The sign of the determinant of ``along``, which changes where the equations determine nothing in between."""
        with np.errstate(all="ignore"):
            return np.asarray(np.linalg.slogdet(_stacked(self.along))[0]).reshape(self.singular.shape)

    def determined(self) -> _Algebraic:
        """Return these equations, or raise if they do not determine the numbers that they are for."""
        if self.singular.any():
            raise UnsupportedError(
                f"mass: the algebraic equations of {self._system!r} do not determine the numbers that they are for (their index "
                f"is above 1); put the derivative of the constraint by the time, with the rates put in, in its place"
            )
        return self


def _stacked(matrices: Array) -> Array:
    """Matrices of shape (n, n, *members) as a row of matrices."""
    return np.moveaxis(matrices.reshape(*matrices.shape[:2], -1), -1, 0)


def lost(system: System, start: tuple[Array, Any], end: tuple[Array, Any], sizes: Array) -> tuple[Any, Any]:
    """The members that lost their algebraic equations on the way from a state and time to others.

    Returns:
        Those at whose end these would change a number by more than ``MOST_BROKEN`` of its size or determine none, and those of
        which they determined nothing at a place in between.
    """
    equations = _Algebraic(system, *end)
    change = np.abs(equations.change(-equations.values[equations.places])).reshape(end[0].shape)
    broken = (change > MOST_BROKEN * sizes).any(axis=_own(system)) | equations.singular
    return np.asarray(broken), np.asarray(_Algebraic(system, *start).sides() * equations.sides() < 0.0)


def _singular(matrices: Array, terms: Array) -> np.ndarray[Any, np.dtype[np.bool_]]:
    """True where algebraic equations do not determine the numbers that they are for, as with an index above 1.

    Of a full M their derivatives are sums, of which an index above 1 leaves rounding: that is little beside the ``terms``.
    """
    finite = np.asarray(np.isfinite(matrices).all(axis=(1, 2)))
    matrices, terms = (np.where(finite[:, np.newaxis, np.newaxis], each, np.eye(each.shape[1])) for each in (matrices, terms))
    rows = terms.max(axis=2, keepdims=True)
    rows = np.where(rows > 0.0, rows, 1.0)
    columns = (terms / rows).max(axis=1, keepdims=True)
    scaled = matrices / rows / np.where(columns > 0.0, columns, 1.0)
    return np.asarray(np.linalg.svd(scaled, compute_uv=False)[:, -1] <= LEAST_DETERMINED)


def check_start(system: System, y: Array, t: Any, relative: Any, absolute: Any) -> None:
    """Raise if the algebraic equations do not hold at the start of a run, within what is tolerated of each number."""
    change = np.abs(correction(system, y, t))
    own = _own(system)
    largest = np.abs(y).max(axis=own, keepdims=True, initial=0.0)
    bound = absolute + relative * np.abs(y) + LEAST * largest
    wrong = change > bound
    if not wrong.any():
        return
    excess = np.where(wrong, change / np.where(bound > 0.0, bound, np.finfo(float).tiny), 0.0)
    index = np.unravel_index(int(np.argmax(excess)), y.shape)
    number, member = ([int(i) for i in each] for each in (index[: len(own)], index[len(own) :]))
    of_member = f" (of member {tuple(member)})" if member else ""
    would = y[index] + correction(system, y, t)[index]
    would = 0.0 if abs(would) <= LEAST * float(np.broadcast_to(largest, y.shape)[index]) else would
    raise ArgumentError(
        f"y: expected a start at which the algebraic equations hold, and for them y{number or ''}{of_member} would be about "
        f"{would:.6g}, got {y[index]:.6g}; take y=sw.consistent_start(system, y)"
    )
