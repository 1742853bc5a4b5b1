"""Products of matrices of which each member of a batch has its own, summed in the order of the columns.

Fused, each product after the first is added by one fused multiply-add, which rounds once.
"""

from collections.abc import Sequence

import numpy as np

from ..base.arrays import Array


def times(matrix: Array, columns: "Sequence[Array] | Array", *, fused: bool = False) -> Array:
    """The matrix, of shape (rows, columns, *batch), times a column of numbers."""
    total: Array = matrix[:, 0] * columns[0]
    if fused:
        from .fma import double_fma  # only fused products need it

        for j in range(1, len(columns)):
            total = double_fma(matrix[:, j], columns[j], total)
    else:
        for j in range(1, len(columns)):
            total = total + matrix[:, j] * columns[j]
    return total


def product(a: Array, b: Array) -> Array:
    """The matrix product of a and b."""
    return times(a[:, :, np.newaxis], b)
