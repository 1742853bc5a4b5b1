"""Frequency responses from matrices."""

from __future__ import annotations

from math import inf
from typing import Any

import numpy as np

from ...base import checks
from ...base.arrays import Array
from ...base.interrupts import heard
from ...model.parameters import aligned
from ..stability import eigen

Complex = eigen.Complex


def response(A: Array, B: Any, C: Array, D: Array, s: Complex, B_next: Any = None) -> Complex:
    """C·(I·s − A)⁻¹·(B + B_next·s) + D at these s, of shape (*frequencies, r, m, *batch), or without r and m if both are 1.

    B may depend on the frequency: shape (n, m, frequencies, *batch). It is infinite at an eigenvalue of A.
    """
    s = np.asarray(s, dtype=np.complex128)
    shape, s = s.shape, s.reshape(-1)
    of_each = B.ndim > 2 and B.dtype.kind == "c"
    batch = np.broadcast_shapes(*(each.shape[2:] for each in (A, C, D)), B.shape[3:] if of_each else B.shape[2:])
    (n, m), r = B.shape[:2], len(C)
    checks.fits("omega: the matrices", 4.0 * len(s) * n * (n + m + r), batch, "ask for fewer frequencies")
    A, C, D = (aligned(each, 2, batch) for each in (A, C, D))
    at = s.reshape(-1, *(1,) * len(batch))
    right = B if of_each else aligned(B, 2, batch)[:, :, np.newaxis]
    if B_next is not None:
        right = right + aligned(B_next, 2, batch)[:, :, np.newaxis] * at
    unit = np.eye(n).reshape(n, n, 1, *(1,) * len(batch))
    left = np.broadcast_to(unit * at - A[:, :, np.newaxis], (n, n, len(s), *batch))
    right = np.broadcast_to(right, (n, m, len(s), *batch))
    states = _solved(np.moveaxis(left, (0, 1), (-2, -1)), np.moveaxis(right, (0, 1), (-2, -1)))
    with np.errstate(invalid="ignore"):
        z = np.moveaxis(C[:, :, np.newaxis], (0, 1), (-2, -1)) @ states + np.moveaxis(D[:, :, np.newaxis], (0, 1), (-2, -1))
    z = np.where(np.isinf(states.real).any(axis=-2, keepdims=True), inf, z)
    z = np.moveaxis(z, (-2, -1), (1, 2))
    z = z[:, 0, 0] if (r, m) == (1, 1) else z
    return np.asarray(np.reshape(z, (*shape, *z.shape[1:])))[()]


def _solved(left: Any, right: Any) -> Any:
    """The solutions of many equations; infinite where there is none."""
    n = left.shape[-1]
    try:
        return heard(float(left.size) * n, np.linalg.solve, left, right)
    except np.linalg.LinAlgError:  # one singular matrix is enough for that
        flat, of_right = left.reshape(-1, n, n), right.reshape(-1, *right.shape[-2:])
        solved = np.full(of_right.shape, complex(inf, inf))
        for i, (each, other) in enumerate(zip(flat, of_right, strict=True)):
            try:
                solved[i] = np.linalg.solve(each, other)
            except np.linalg.LinAlgError:
                continue
        return solved.reshape(right.shape)
