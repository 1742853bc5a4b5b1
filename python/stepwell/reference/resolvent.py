"""The transfer function of a linear system as polynomials: C·(Iz − A)⁻¹·B + D = num(z)/det(Iz − A)."""

import numpy as np

from ..base.arrays import Array
from .exact import Twice, product, total


def polynomials(A: Array, B: Array, C: Array, D: Array) -> tuple[Array, Array]:
    """The numerators, shape (n + 1, outputs, inputs, *batch), and det(Iz − A), shape (n + 1, *batch), highest power first.

    By Leverrier and Faddeev: Rₖ = A·Rₖ₋₁ + cₖ·I with cₖ = −trace(A·Rₖ₋₁)/k are the coefficients of the adjugate of Iz − A. The
    recursion loses digits from state to state, so it has twice the digits of a number.
    """
    n, axes = len(A), max(each.ndim for each in (A, B, C, D)) - 2

    def wide(matrix: Array) -> Twice:
        matrix = matrix.reshape(*matrix.shape[:2], *(1,) * (axes + 2 - matrix.ndim), *matrix.shape[2:])
        return matrix, np.zeros_like(matrix)

    a, b, c, d = map(wide, (A, B, C, D))
    unit = np.eye(n).reshape(n, n, *(1,) * axes)
    adjugate: Twice = (np.broadcast_to(unit, a[0].shape), np.zeros_like(a[0]))
    den, num = [np.ones_like(a[0][0, 0])], [d[0]]
    for k in range(1, n + 1):
        after = product(a, adjugate)
        trace: Twice = (after[0][0, 0], after[1][0, 0])
        for i in range(1, n):
            trace = total(trace, (after[0][i, i], after[1][i, i]))
        high = -trace[0] / k
        # What the division left of the trace, in the digits beyond those of its quotient.
        low = _remainder(trace, high, k)
        of_b = product(product(c, adjugate), b)
        num.append(of_b[0] + d[0] * high)
        den.append(high)
        adjugate = total(after, (unit * high, unit * low))
    shape = np.broadcast_shapes(*(each.shape for each in num))
    batch = np.broadcast_shapes(*(each.shape for each in den))
    return np.stack([np.broadcast_to(each, shape) for each in num]), np.stack([np.broadcast_to(each, batch) for each in den])


def _remainder(trace: Twice, quotient: Array, k: int) -> Array:
    """The remainder of −trace/k beyond its first number."""
    exact: Twice = product(_one(quotient), _one(np.full_like(quotient, k)))
    return np.asarray((-(trace[0] + exact[0][0, 0]) - (trace[1] + exact[1][0, 0])) / k)


def _one(number: Array) -> Twice:
    return number[np.newaxis, np.newaxis], np.zeros((1, 1, *number.shape))
