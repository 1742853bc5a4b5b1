"""Decomposes a linear system into smaller ones that together have the same eigenvalues of every step.

Rounding moves eigenvalues that nearly coincide far, but not those of a smaller part. A part that drives others but is not driven
by them (filters in series) is found exactly, by the elements of A that are zero. Where a step is then a function of a single
matrix, each eigenvalue of that matrix gives a part of one or two states. Two facts allow this for every method, because a
step only sums rates:

- A step of ṡ = A·s by a method that treats both blocks alike is a polynomial in h·A; its eigenvalues are that polynomial of h·λ.
- If three of the four blocks in v̇ = A_vv·v + A_vy·y, ẏ = A_yv·v + A_yy·y are multiples of the identity, every step is a
  function of the fourth. Each eigenvalue κ of the fourth gives a step of two numbers, with κ in place of that block.
"""

from __future__ import annotations

from functools import cache
from typing import Any, NamedTuple

import numpy as np

from ...base.arrays import Array
from ...errors import UnsupportedError
from ...model.compatibility import fits_together
from ...model.methods import Method
from ...model.systems import LinearSystem
from . import eigen, exact, maps
from .eigen import EPS, Complex
from .expansion import polynomials

#: An eigenvalue with a condition 1/|wᴴx| above this is computed in more digits: it nearly meets another.
MAX_CONDITION = 1e3

#: A rate is computed in more digits if rounding hides whether it grows and is above this fraction of it: others are much faster.
SLOW_RATE = 1e-9

#: A rate, or a real part, that the rounding of A explains counts as zero if it is below this fraction of the size.
ROUNDED_ZERO = 1e-6


class Part(NamedTuple):
    """A linear system: ``matrix`` of the rates in the order (v, y), and the number of its states that are velocities."""

    matrix: Array
    velocities: int


class Rates(NamedTuple):
    """Eigenvalues of a matrix of rates.

    Attributes:
        values: shape (n,); a pair has its positive angle first.
        decided: whether they are known to double precision, or well enough to decide which modes grow.
    """

    values: Complex
    decided: bool


def rates(matrix: Array) -> Rates:
    """The eigenvalues of a matrix of rates, refined to double precision where needed.

    The elements of a matrix are rounded, such as 2/3 in its last digit. A real or imaginary part below a millionth that this
    rounding explains is set to zero.
    """
    n = len(matrix)
    if n == 1:
        return Rates(np.array(matrix[0], dtype=np.complex128), True)
    spectrum = eigen.eigen(matrix)
    values, tolerance = spectrum.values, spectrum.tolerance(0.0)
    fastest = np.abs(values).max()
    meet = (tolerance > 16.0 * n * EPS * spectrum.size * MAX_CONDITION).any()
    slow = ((np.abs(values.real) <= tolerance) & (tolerance > SLOW_RATE * np.abs(values)) & (values != 0.0)).any()
    if n <= exact.MAX_ROWS and (meet or slow):
        values = exact.eigenvalues(matrix * spectrum.units / spectrum.units[:, np.newaxis], values)
        rounding = _by_rounding(matrix, values, spectrum)
        beside = np.minimum(rounding, ROUNDED_ZERO * np.abs(values))
    else:
        rounding = tolerance
        beside = np.minimum(rounding, ROUNDED_ZERO * fastest)
    values = np.where(np.abs(values.real) <= beside, 1j * values.imag, values)
    values = np.where(np.abs(values.imag) <= beside, values.real + 0j, values)
    values = np.where(np.abs(values) <= np.minimum(rounding, ROUNDED_ZERO * fastest), 0.0, values)
    return Rates(values, n <= exact.MAX_ROWS or not meet)


def _by_rounding(matrix: Array, values: Complex, spectrum: eigen.Eigen) -> Array:
    """How far eigenvalues move if each element of the matrix changes by some eps of itself, shape (n,).

    That is Σ|wᵢ||aᵢⱼ||xⱼ|/|wᴴx| with left and right vectors (Higham 2002, §3 and §7): much less than for a change by some eps of
    the norm where elements have very different sizes.
    """
    vectors = spectrum.vectors
    size = np.abs(matrix * spectrum.units / spectrum.units[:, np.newaxis])
    try:
        left = np.linalg.inv(vectors)
    except np.linalg.LinAlgError:
        return np.full(len(values), np.inf)
    moved = 4.0 * EPS * np.einsum("ki,ij,jk->k", np.abs(left), size, np.abs(vectors))
    return np.asarray(moved[np.abs(values[:, np.newaxis] - spectrum.values).argmin(axis=1)])


def parts(matrix: Array, velocities: int, method: Method) -> list[Part]:
    """The parts of ṡ = A·s, A in the order (v, y): their steps have all eigenvalues of its step but those that are always 1."""
    decomposed: list[Part] = []
    for states in components(matrix):
        part = Part(matrix[np.ix_(states, states)], int((states < velocities).sum()))
        if part.matrix.any():  # else it is constant
            decomposed += _split(part, method) if len(states) > 2 else [part]
    return decomposed


def components(matrix: Array) -> list[np.ndarray[Any, np.dtype[np.intp]]]:
    """The strongly connected components of the states: groups whose states all drive each other, in their order."""
    drives = matrix != 0.0  # which column drives which row

    def reached(drives: eigen.Truths, start: int) -> eigen.Truths:
        seen = np.zeros(len(drives), dtype=np.bool_)
        seen[start] = True
        while (more := seen | drives[:, seen].any(axis=1)).sum() > seen.sum():
            seen = more
        return seen

    groups, left = [], np.ones(len(matrix), dtype=np.bool_)
    for i in range(len(matrix)):
        if left[i]:
            both = reached(drives, i) & reached(drives.T, i)
            groups.append(np.flatnonzero(both))
            left &= ~both
    return groups


def spectra(matrix: Array, velocities: int, method: Method, dt: Array) -> tuple[Complex, Complex]:
    """The eigenvalues of steps ``dt`` of ṡ = A·s, by parts, and the rates that they continue, both of shape (n, steps)."""
    z, exactly = np.ones((len(matrix), len(dt)), dtype=np.complex128), np.zeros((len(matrix), len(dt)), dtype=np.complex128)
    k = 0  # states that are in no part are constant: z = 1
    for part in parts(matrix, velocities, method):
        n = len(part.matrix)
        rows = slice(k, k := k + n)
        if n > 2:
            step, own = exact.Step(*part, method), rates(part.matrix).values
            for i, h in enumerate(dt.tolist()):
                z[rows, i] = step.eigenvalues(h)
                exactly[rows, i] = eigen.nearest(z[rows, i], own, np.exp(own * h))
            continue
        system = LinearSystem(part.matrix, velocities=part.velocities)
        P, own = maps.transition(system, method, dt), eigen.eigenvalues(part.matrix)[:, np.newaxis]
        z[rows], exactly[rows] = eigen.eigenvalues(P), own
        if n == 2:
            for i in np.flatnonzero(np.abs(z[k - 2, :] - z[k - 1, :]) < eigen.NEARLY_DOUBLE * np.abs(z[k - 2, :])).tolist():
                z[rows, i] = exact.Step(*part, method).eigenvalues(float(dt[i]))
            A = part.matrix[:, :, np.newaxis]
            exactly[rows] = eigen.matched_of_two(P, z[rows], A, own, maps.finish(system, method, dt, dt.shape))
    return z, exactly


def _split(part: Part, method: Method) -> list[Part]:
    """A connected part, split further if its step is a function of one matrix."""
    matrix, n_v = part
    n = len(matrix)
    if 2 * n_v == n:
        blocks = [[matrix[:n_v, :n_v], matrix[:n_v, n_v:]], [matrix[n_v:, :n_v], matrix[n_v:, n_v:]]]
        multiples = [[_multiple(b) for b in row] for row in blocks]
        for i, j in ((0, 1), (1, 0)):
            if all(multiples[k][m] is not None for k in range(2) for m in range(2) if (k, m) != (i, j)):
                eigenvalues = rates(blocks[i][j])
                if eigenvalues.decided:
                    return [_with(multiples, i, j, value) for value in eigenvalues.values if value.imag >= 0.0]
    if function_of_rates(method) or n_v in (0, n):
        eigenvalues = rates(matrix)
        if eigenvalues.decided:
            turning = n_v // n * 2 if n_v in (0, n) else 1
            ones = [value for value in eigenvalues.values if value.imag >= 0.0 and value != 0.0]
            return [Part(_turning(z), turning) if z.imag else Part(np.array([[z.real]]), n_v // n) for z in ones]
    return [part]


def _multiple(block: Array) -> float | None:
    """The number c if a block is c times the identity, else None."""
    value = block[0, 0]
    return float(value) if (block == value * np.eye(len(block))).all() else None


def _turning(z: complex) -> Array:
    """The real matrix with the eigenvalues z and its conjugate."""
    return np.array([[z.real, -z.imag], [z.imag, z.real]])


def _with(multiples: list[list[float | None]], i: int, j: int, value: complex) -> Part:
    """A part of two numbers, or of four for a complex eigenvalue, with the eigenvalue in place of a block."""
    one = np.eye(2) if value.imag else np.eye(1)
    rows = [[one * (m or 0.0) for m in row] for row in multiples]
    rows[i][j] = _turning(value) if value.imag else value.real * one
    return Part(np.block(rows), len(one))


@cache
def function_of_rates(method: Method) -> bool:
    """True if a step of ṡ = A·s is a function of h·A: the method treats both blocks alike. Tested exactly on one matrix.

    An implicit step is, since it has the Jacobian of both blocks.
    """
    if method.is_implicit:
        return True
    a = np.array([[2.0, 3.0], [-5.0, 7.0]])
    both = LinearSystem(a, velocities=1)
    try:
        fits_together(both, method)
    except UnsupportedError:
        return False
    P, alone = polynomials(both, method), polynomials(LinearSystem([[1.0]], velocities=0), method)[0, 0]
    power = np.eye(2, dtype=int).astype(object)
    for k in range(max(len(alone.coefficients), *(len(p.coefficients) for p in P.flat))):
        if any(p[k] != alone[k] * int(q) for p, q in zip(P.flat, power.flat, strict=True)):
            return False
        power = power @ a.astype(int).astype(object)
    return True
