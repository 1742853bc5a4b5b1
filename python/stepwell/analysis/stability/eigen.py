"""Eigenvalues, eigenvectors and modes of many small matrices at once.

A matrix has shape (n, n, *members), eigenvalues (n, *members), eigenvectors (n, n, *members) with the vectors as columns.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ...base.arrays import Array
from ...base.interrupts import heard

Complex = np.ndarray[Any, np.dtype[np.complex128]]
Truths = np.ndarray[Any, np.dtype[np.bool_]]

EPS = float(np.finfo(np.float64).eps)

#: The operations on matrices done in one call: some hundredths of a second, so that Ctrl-C is noticed in between.
OPERATIONS_AT_ONCE = 2e6

#: Eigenvalues and eigenvectors of a matrix of n rows take about this many operations times n³.
OPERATIONS_OF_EIG = 25

#: Up to this many rows an eigenvector is computed by a singular value decomposition, which takes some milliseconds at most.
SVD_MAX_ROWS = 40

#: Balancing brings rows and columns to similar size in at most this many rounds; a round halves the exponents of two that remain.
BALANCING_ROUNDS = 20

#: A row and a column are balanced only if that makes their sum smaller by this factor (Parlett and Reinsch 1969).
BALANCING_GAIN = 0.95

#: Eigenvalues that rounding may move by more than the first are computed in more digits. Where that is impossible, those that it
#: may move by more than the second stay undecided. The second is large, since two eigenvalues that meet on the circle are moved
#: by the root of some eps and still need a decision.
REFINE_ABOVE, UNDECIDED_ABOVE = 1e-9, 1e-4

#: Rounding moves both eigenvalues of two states by the root of some eps if their distance is below this fraction of their size.
NEARLY_DOUBLE = 1e-5

#: Eigenvalues of more than two states that are closer than this count as one: rounding moves a double eigenvalue by the square
#: root of its own size.
CLUSTER_DISTANCE = 1e-6


class Eigen(NamedTuple):
    """Eigenvalues and eigenvectors of matrices, in units of the states in which rows and columns have similar size.

    Attributes:
        values: the eigenvalues, shape (n, *members); a pair has its positive angle first; NaN where the matrix is not finite.
        vectors: the eigenvectors in these units, of unit length, shape (n, n, *members).
        units: the unit of each state, shape (n, *members): x in the matrix's own units is x/units in these.
        size: the norm of the matrix in these units, shape (*members).
    """

    values: Complex
    vectors: Complex
    units: Array
    size: Array

    @property
    def own(self) -> Complex:
        """The vectors in the matrix's own units."""
        return self.units[:, np.newaxis] * self.vectors

    def tolerance(self, least: float = 1.0) -> Array:
        """How far rounding may move each eigenvalue, shape (n, *members).

        The elements of a step's matrix are wrong by some eps of the sums that make them, and computing the eigenvalues adds as
        much: together this is a matrix of norm below 16·n·eps·max(least, ‖P‖). It moves an eigenvalue by at most that norm over
        |wᴴx|, with its left and right vectors of unit length; the factor is large where two eigenvalues nearly meet.
        """
        return 16.0 * len(self.values) * EPS * np.maximum(least, self.size) * _conditions(self.vectors)


def eigenvalues(matrix: Array) -> Complex:
    """Eigenvalues; a pair has its positive angle first. NaN where the matrix is not finite."""
    if len(matrix) == 1:
        return np.asarray(matrix[0], dtype=np.complex128)
    if len(matrix) == 2:
        return _of_two(matrix)
    return eigen(matrix).values


def _of_two(matrix: Array) -> Complex:
    """Both roots of z² − 2pz + q = 0 from the elements of P: p² − q = ((a − d)/2)² + bc has the smaller rounding."""
    (a, b), (c, d) = matrix
    with np.errstate(all="ignore"):
        p, half = 0.5 * (a + d), 0.5 * (a - d)
        under: Array = half * half + b * c
        size = np.maximum(half * half, np.abs(b * c))
        under = np.where(np.abs(under) <= 4.0 * EPS * size, 0.0, under)  # a double root to rounding
        root = np.sqrt(np.abs(under))
        far = p + np.copysign(root, p)
        near = np.where(under == 0.0, p, np.where(far == 0.0, 0.0, (a * d - b * c) / far))
        pair = under < 0.0
        imaginary = np.where(pair, root, 0.0)
        z: Complex = np.empty((2, *p.shape), dtype=np.complex128)
        z.real = np.where(pair, p, np.stack([far, near]))
        z.imag = np.stack([imaginary, -imaginary])
    return z


def eigen(matrix: Array, units: Array | None = None) -> Eigen:
    """Eigenvalues and eigenvectors, in these units of the states, or in units that balance the matrix."""
    finite: Any = np.isfinite(matrix).all(axis=(0, 1))
    matrix = np.where(finite, matrix, 0.0)
    if units is None:
        units = units_of(matrix)
    with np.errstate(over="ignore", invalid="ignore"):
        scaled = matrix * units / units[:, np.newaxis]
    finite = finite & np.isfinite(scaled).all(axis=(0, 1))  # those whose units are as far apart as numbers can be
    scaled = np.where(finite, scaled, 0.0)
    stacked = np.moveaxis(scaled, (0, 1), (-2, -1))
    n, members = len(matrix), stacked.shape[:-2]
    each = stacked.reshape(-1, n, n)
    at_once = max(1, int(OPERATIONS_AT_ONCE / (n**3 + 200)))
    work = OPERATIONS_OF_EIG * n**3
    chunks = [heard(work, np.linalg.eig, each[k : k + at_once]) for k in range(0, len(each), at_once)]
    values, vectors = (np.concatenate([chunk[i] for chunk in chunks]) for i in range(2))
    values, vectors = values.reshape(*members, n), vectors.reshape(*members, n, n)
    # LAPACK returns the positive angle of a pair first, and later sorting keeps that order.
    values = np.where(finite, np.moveaxis(values, -1, 0), np.nan).astype(np.complex128)
    vectors = np.moveaxis(vectors.astype(np.complex128), (-2, -1), (0, 1))
    with np.errstate(over="ignore"):  # the matrix of a step far beyond all that is stable has a norm of infinity
        norm = np.sqrt((scaled * scaled).sum(axis=(0, 1)))
    return Eigen(values, vectors, units, norm)


def vector(matrix: Array, value: complex) -> Complex:
    """An eigenvector of a known eigenvalue z, also a multiple one, shape (n,): the unit vector x with the least |P·x − z·x|."""
    n, units = len(matrix), units_of(matrix)
    less = matrix * units / units[:, np.newaxis] - value * np.eye(n)
    if n > SVD_MAX_ROWS:  # by inverse iteration, which is faster, where the inverse exists
        direction = np.cos(1.7 * np.arange(n)) + 0.5j * np.sin(2.3 * np.arange(n))
        try:
            for _ in range(3):
                direction = heard(n**3, np.linalg.solve, less, direction)
                direction /= np.sqrt((np.abs(direction) ** 2).sum())
        except np.linalg.LinAlgError:
            direction[:] = np.nan
        if np.isfinite(direction).all():
            return np.asarray(units * direction)
    return np.asarray(units * heard(OPERATIONS_OF_EIG * n**3, np.linalg.svd, less)[2][-1].conj())


def units_of(matrix: Array) -> Array:
    """Units of the states in which rows and columns of a matrix have similar size, shape (n, *members), all powers of two.

    In these, norms and angles do not depend on the user's units, and scaling by powers of two is exact. A state that drives no
    other, or that no other drives, has a column or a row of zeros; its row or column then becomes 1.
    """
    n = len(matrix)
    size = np.abs(matrix)
    size[range(n), range(n)] = 0.0
    units = np.ones(size.shape[1:])
    for _ in range(BALANCING_ROUNDS):
        changed = False
        for i in range(n):
            row, column = size[i].sum(axis=0), size[:, i].sum(axis=0)
            with np.errstate(all="ignore"):
                by = np.sqrt(np.where(row > 0.0, row, 1.0 / column) / np.where(column > 0.0, column, 1.0 / row))
                by = np.exp2(np.round(np.log2(by)))
                worth = column * by + row / by < BALANCING_GAIN * (column + row)
                by = np.where(worth & np.isfinite(by) & (by > 0.0), by, 1.0)
            if (by != 1.0).any():
                changed = True
                units[i] *= by
                size[:, i] *= by
                size[i] /= by
        if not changed:
            break
    return units


def product(subscripts: str, a: Any, b: Any) -> Any:
    """Products of the matrices of all members, by ``einsum``."""
    return heard(len(a) * max(a.size, b.size), np.einsum, subscripts, a, b)


def slot_units(finish: Array, units: Array) -> Array:
    """Units of the slots for states with these units, shape (n, *members): in them no element of ``finish`` is above about 1.

    A step is analysed in the units of the rates. Units that balance its own matrix may hide its rounding: near z = −1 velocity
    and coordinate of a mode seem independent of each other, whatever happened within the step.
    """
    with np.errstate(all="ignore"):
        unit = 1.0 / np.abs(finish / units[:, np.newaxis]).max(axis=0)
        return np.where(np.isfinite(unit) & (unit > 0.0), np.exp2(np.round(np.log2(unit))), 1.0)


def _conditions(vectors: Complex) -> Array:
    """1/|wᴴx| of each eigenvalue's left and right vectors, shape (n, *members); infinite where vectors depend on each other."""
    stacked = np.moveaxis(vectors, (0, 1), (-2, -1))
    flat = stacked.reshape(-1, *stacked.shape[-2:])
    left = np.full_like(flat, np.inf)
    at_once = max(1, int(OPERATIONS_AT_ONCE / (len(vectors) ** 3 + 200)))
    for k in range(0, len(flat), at_once):
        try:
            left[k : k + at_once] = heard(len(vectors) ** 3, np.linalg.inv, flat[k : k + at_once])
        except np.linalg.LinAlgError:  # one singular matrix is enough for that
            for i, each in enumerate(flat[k : k + at_once], k):
                try:
                    left[i] = heard(len(vectors) ** 3, np.linalg.inv, each)
                except np.linalg.LinAlgError:
                    continue
    left = left.reshape(stacked.shape)
    with np.errstate(all="ignore"):
        conditions = np.sqrt((left.real**2 + left.imag**2).sum(axis=-1))
    return np.moveaxis(np.where(np.isnan(conditions), np.inf, conditions), -1, 0)


def tolerance(matrix: Array) -> Array:
    """How far rounding may move an eigenvalue of one or two states off the unit circle, shape (*members).

    The elements of P are wrong by some eps. So are its trace and its determinant, sums of at most two products, and with them the
    radius of a pair: by 16·n·eps times the square of the norm of P in units in which b = c. This does not hold for double
    eigenvalues, which move by the square root.
    """
    n = len(matrix)
    with np.errstate(over="ignore"):  # with very long steps
        squares = matrix[0, 0] ** 2
        if n > 1:
            squares = squares + matrix[1, 1] ** 2 + 2.0 * np.abs(matrix[0, 1] * matrix[1, 0])
    return np.asarray(16.0 * n * EPS * np.maximum(1.0, squares))


def matched(values: Complex, states: Complex, exact: Eigen) -> Complex:
    """For each eigenvalue of a step the eigenvalue of the rates whose mode it continues.

    Modes are matched by their shapes, which are the columns of ``states`` for the step: those that overlap most belong together,
    and where overlaps are equal (for conjugate vectors of the same real shape) the sign of the angle decides.
    """
    n = len(values)
    with np.errstate(all="ignore"):
        states = states / exact.units[:, np.newaxis]
        states = states / np.sqrt((np.abs(states) ** 2).sum(axis=0))
        overlap = np.abs(product("ij...,ik...->jk...", states.conj(), exact.vectors))
    same_side = np.sign(values.imag)[:, np.newaxis] * np.sign(exact.values.imag)[np.newaxis]
    score = overlap + 1e-6 * same_side
    score = np.where(np.isfinite(score), score, 0.0)
    continued = np.empty_like(values)
    members = score.shape[2:]
    score = score.reshape(n, n, -1)
    flat, true = continued.reshape(n, -1), np.broadcast_to(exact.values, values.shape).reshape(n, -1)
    every = np.arange(score.shape[2])
    for _ in range(n):
        best = score.reshape(n * n, -1).argmax(axis=0)
        i, j = best // n, best % n
        flat[i, every] = true[j, every]
        score[i, :, every] = -np.inf
        score[:, j, every] = -np.inf
    return flat.reshape(n, *members)


def matched_of_two(matrix: Array, values: Complex, rates: Array, exact: Complex, finish: Array) -> Complex:
    """``matched`` for two states, without the work of ``eigen``: only two real eigenvalues can be in the wrong order.

    ``finish`` maps slots to states.
    """

    def vectors(m: Array, z: Complex) -> Array:
        """Solutions x of (m − z)·x = 0 by the row with the larger m − z, which has more digits; shape (2, *members)."""
        (a, b), (c, d) = m
        by_a, by_d = z.real - a, z.real - d
        first = np.abs(by_a) >= np.abs(by_d)
        return np.stack([np.where(first, b, by_d), np.where(first, by_a, c)])

    with np.errstate(all="ignore"):
        unit = np.sqrt(np.abs(rates[0, 1] / rates[1, 0]))  # of the first state, in which both elements are of like size
        unit = np.where(np.isfinite(unit) & (unit > 0.0), unit, 1.0)

        def likeness(x: Array, y: Array) -> Array:
            """The magnitude of the cosine between two vectors."""
            (a, b), (c, d) = (np.stack([v[0] / unit, v[1]]) for v in (x, y))
            return np.asarray(np.abs(a * c + b * d) / np.sqrt((a * a + b * b) * (c * c + d * d)))

        states = [np.einsum("ij...,j...->i...", finish, vectors(matrix, z)) for z in values]
        shapes = [vectors(rates, z) for z in exact]
        straight = likeness(states[0], shapes[0]) + likeness(states[1], shapes[1])
        crossed = likeness(states[0], shapes[1]) + likeness(states[1], shapes[0])
    real = (values.imag == 0.0).all(axis=0) & (exact.imag == 0.0).all(axis=0)
    return np.where(real & (crossed > straight), exact[::-1], exact)


def nearest(values: Complex, rates: Complex, exact: Complex) -> Complex:
    """For each eigenvalue of one step the rate whose exact eigenvalue e^(λ·dt) is closest, each rate once, shape (n,)."""
    with np.errstate(all="ignore"):
        distance = np.nan_to_num(np.abs(values[:, np.newaxis] - exact), nan=np.inf)
    continued = np.empty_like(values)
    for _ in values:
        i, j = np.unravel_index(distance.argmin(), distance.shape)
        continued[i] = rates[j]
        distance[i], distance[:, j] = np.inf, np.inf
    return continued


def one_vector(matrix: Array, values: Complex) -> Truths:
    """Which eigenvalues of one matrix are multiple with fewer eigenvectors than their multiplicity, shape (n,)."""
    n = len(values)
    units = units_of(matrix)
    scaled = matrix * units / units[:, np.newaxis]
    least = CLUSTER_DISTANCE * max(1.0, float(np.sqrt((scaled * scaled).sum())))
    defective = np.zeros(n, dtype=np.bool_)
    for i in range(n):
        if (one := np.abs(values - values[i]) < CLUSTER_DISTANCE).sum() > 1:
            singular = np.linalg.svd(scaled - values[one].mean() * np.eye(n), compute_uv=False)
            defective[i] = (singular < least).sum() < one.sum()
    return defective


def settled(spectrum: Eigen) -> tuple[Complex, Array, Truths]:
    """Eigenvalues in which the two parts of a double one are replaced by their mean, tolerances, and which have only one vector.

    The mean is as exact as a single eigenvalue; the parts are not. A double eigenvalue that has two vectors (two equal
    oscillators that do not touch) counts as two single ones.
    """
    values, tolerances = spectrum.values.copy(), spectrum.tolerance()
    single_vector = np.zeros(values.shape, dtype=np.bool_)
    n = len(values)
    for i in range(n):
        for j in range(i + 1, n):
            with np.errstate(invalid="ignore"):
                near = np.abs(values[i] - values[j]) < CLUSTER_DISTANCE
            if near.any():
                overlap = np.abs((spectrum.vectors[:, i].conj() * spectrum.vectors[:, j]).sum(axis=0))
                double = near & (overlap > 1.0 - CLUSTER_DISTANCE)
                mean = 0.5 * (values[i] + values[j])
                for k in (i, j):
                    values[k] = np.where(double, mean, values[k])
                    single_vector[k] |= double
    of_one = 16.0 * n * EPS * np.maximum(1.0, spectrum.size**2)
    return values, np.where(single_vector, np.minimum(tolerances, of_one), tolerances), single_vector


def order(values: Complex, tolerances: Array, first: Truths) -> np.ndarray[Any, np.dtype[np.int64]]:
    """The order of eigenvalues in which the one that decides comes first.

    First those outside the unit circle by more than their tolerance, then those on it, then those inside; in each by magnitude;
    among equal ones those of ``first``, then by angle, the fastest first. Pairs stay together.
    """
    with np.errstate(invalid="ignore"):
        beyond, angle = np.abs(values) - 1.0, np.angle(values)
        side = np.where(np.abs(beyond) <= tolerances, 0, np.sign(beyond))
    size = np.where(side == 0, 0.0, np.round(beyond, 9))
    return np.lexsort((-angle, -np.round(np.abs(angle), 9), ~first, -size, -side), axis=0)
