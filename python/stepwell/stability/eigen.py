"""Eigenvalues, eigenvectors and modes of many small matrices at once.

A matrix has shape (n, n, *members), eigenvalues (n, *members), eigenvectors (n, n, *members) with the vectors as columns.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from .._checks import Array

Complex = np.ndarray[Any, np.dtype[np.complex128]]

EPS = float(np.finfo(np.float64).eps)


def eigenvalues(matrix: Array) -> Complex:
    """Eigenvalues; a pair stands with its positive angle first. NaN where the matrix is not finite."""
    if len(matrix) == 1:
        return np.asarray(matrix[0], dtype=np.complex128)
    if len(matrix) == 2:
        return _of_two(matrix)
    return eigen(matrix)[0]


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


def eigen(matrix: Array) -> tuple[Complex, Complex]:
    """Eigenvalues and eigenvectors of unit length."""
    stacked = np.moveaxis(matrix, (0, 1), (-2, -1))
    finite: Any = np.isfinite(stacked).all(axis=(-2, -1), keepdims=True)
    values, vectors = np.linalg.eig(np.where(finite, stacked, 0.0))
    values = np.where(finite[..., 0], values, np.nan).astype(np.complex128)
    # The positive angle of a pair first: LAPACK gives it so, and what is sorted later keeps it.
    return np.moveaxis(values, -1, 0), np.moveaxis(vectors.astype(np.complex128), (-2, -1), (0, 1))


def tolerance(matrix: Array) -> Array:
    """How far an eigenvalue may be from where it is by rounding: 16·n·eps times the square of the matrix's norm.

    The elements are wrong by some eps of theirs, and so is the determinant, a sum of n-fold products; the eigenvalues of a pair
    on the unit circle move by as much. Not for double eigenvalues, which move by the square root.
    """
    n = len(matrix)
    squares: Array = np.maximum(1.0, (matrix * matrix).sum(axis=(0, 1)))
    return 16.0 * n * EPS * squares


def matched(values: Complex, vectors: Complex, exact: Complex, exact_vectors: Complex) -> Complex:
    """For each eigenvalue of a step the eigenvalue of the rates whose mode it continues.

    Modes are told apart by their shape: the pairs of vectors that overlap most belong together, those of equal overlap (as
    conjugate vectors of the same real shape) by the sign of their angle.
    """
    n = len(values)
    overlap = np.abs(np.einsum("ij...,ik...->jk...", vectors.conj(), exact_vectors))
    same_side = np.sign(values.imag)[:, np.newaxis] * np.sign(exact.imag)[np.newaxis]
    score = overlap + 1e-6 * same_side
    score = np.where(np.isfinite(score), score, 0.0)
    found = np.empty_like(values)
    members = score.shape[2:]
    score = score.reshape(n, n, -1)
    flat, true = found.reshape(n, -1), np.broadcast_to(exact, values.shape).reshape(n, -1)
    every = np.arange(score.shape[2])
    for _ in range(n):
        best = score.reshape(n * n, -1).argmax(axis=0)
        i, j = best // n, best % n
        flat[i, every] = true[j, every]
        score[i, :, every] = -np.inf
        score[:, j, every] = -np.inf
    return flat.reshape(n, *members)


#: Eigenvalues of more than two states that are nearer to each other than this count as one: rounding moves a double eigenvalue
#: by the square root of its own size.
NEAR = 1e-6


def settled(values: Complex, vectors: Complex) -> tuple[Complex, np.ndarray[Any, np.dtype[np.bool_]]]:
    """Eigenvalues with double ones put back together, and which of them have one vector only for two values.

    The mean of a double eigenvalue is as exact as a single one; its parts are not. A double eigenvalue that has two
    vectors (two equal oscillators that do not touch) is two single ones.
    """
    values = values.copy()
    single_vector = np.zeros(values.shape, dtype=np.bool_)
    n = len(values)
    for i in range(n):
        for j in range(i + 1, n):
            with np.errstate(invalid="ignore"):
                near = np.abs(values[i] - values[j]) < NEAR
            if near.any():
                overlap = np.abs((vectors[:, i].conj() * vectors[:, j]).sum(axis=0))
                double = near & (overlap > 1.0 - NEAR)
                mean = 0.5 * (values[i] + values[j])
                for k in (i, j):
                    values[k] = np.where(double, mean, values[k])
                    single_vector[k] |= double
    return values, single_vector


def order(values: Complex, first: Any) -> np.ndarray[Any, np.dtype[np.int64]]:
    """The order of eigenvalues in which the one that decides comes first.

    By magnitude; of equal ones those that ``first`` names, then by angle, the fastest first; pairs stay together.
    """
    with np.errstate(invalid="ignore"):
        size, angle = np.round(np.abs(values), 9), np.angle(values)
    return np.lexsort((-angle, -np.round(np.abs(angle), 9), ~first, -size), axis=0)
