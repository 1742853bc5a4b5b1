"""POLLU: 20 species and 25 reactions of air pollution (Verwer 1994; Test Set for IVP Solvers), and other truths of stiff systems.

The values at t = 60 are those of the test set; SciPy's Radau has the same to 13 digits with these rates at a tolerance of 1e-12.
"""

from __future__ import annotations

from decimal import Decimal, localcontext
from typing import Any

import numpy as np
import stepwell as sw

#: The rate constant of each reaction and the species that react, numbered from 1; then what each reaction takes and makes.
REACTIONS: tuple[tuple[float, tuple[int, ...], dict[int, int]], ...] = (
    (0.35, (1,), {1: -1, 2: 1, 3: 1}),
    (26.6, (2, 4), {2: -1, 4: -1, 1: 1}),
    (1.23e4, (5, 2), {5: -1, 2: -1, 6: 1, 1: 1}),
    (8.6e-4, (7,), {7: -1, 5: 2, 8: 1}),
    (8.2e-4, (7,), {7: -1, 8: 1}),
    (1.5e4, (7, 6), {7: -1, 6: -1, 5: 1, 8: 1}),
    (1.3e-4, (9,), {9: -1, 5: 1, 8: 1, 10: 1}),
    (2.4e4, (9, 6), {9: -1, 6: -1, 11: 1}),
    (1.65e4, (11, 2), {11: -1, 2: -1, 1: 1, 10: 1, 12: 1}),
    (9e3, (11, 1), {11: -1, 1: -1, 13: 1}),
    (0.022, (13,), {13: -1, 11: 1, 1: 1}),
    (1.2e4, (10, 2), {10: -1, 2: -1, 1: 1, 14: 1}),
    (1.88, (14,), {14: -1, 7: 1, 5: 1}),
    (1.63e4, (1, 6), {1: -1, 6: -1, 15: 1}),
    (4.8e6, (3,), {3: -1, 4: 1}),
    (3.5e-4, (4,), {4: -1, 16: 1}),
    (0.0175, (4,), {4: -1, 3: 1}),
    (1e8, (16,), {16: -1, 6: 2}),
    (4.44e11, (16,), {16: -1, 3: 1}),
    (1240.0, (17, 6), {17: -1, 6: -1, 5: 1, 18: 1}),
    (2.1, (19,), {19: -1, 2: 1}),
    (5.78, (19,), {19: -1, 1: 1, 3: 1}),
    (0.0474, (1, 4), {1: -1, 4: -1, 19: 1}),
    (1780.0, (19, 1), {19: -1, 1: -1, 20: 1}),
    (3.12, (20,), {20: -1, 1: 1, 19: 1}),
)
START = np.zeros(20)
START[[1, 3, 6, 7, 8, 16]] = 0.2, 0.04, 0.1, 0.3, 0.01, 0.007
AT_60 = np.array(
    [
        0.5646255480022769e-1, 0.1342484130422339, 0.4139734331099427e-8, 0.5523140207484359e-2, 0.2018977262302196e-6,
        0.1464541863493966e-6, 0.7784249118997964e-1, 0.3245075353396018, 0.7494013383880406e-2, 0.1622293157301561e-7,
        0.1135863833257075e-7, 0.2230505975721359e-2, 0.2087162882798630e-3, 0.1396921016840158e-4, 0.8964884856898295e-2,
        0.4352846369330103e-17, 0.6899219696263405e-2, 0.1007803037365946e-3, 0.1772146513969984e-5, 0.5682943292316392e-4,
    ]
)  # fmt: skip


def rates(t: Any, y: Any) -> list[Any]:
    """The rates of all species."""
    total: list[Any] = [0.0] * 20
    for constant, reacting, changes in REACTIONS:
        speed = constant * y[reacting[0] - 1] * (y[reacting[1] - 1] if len(reacting) > 1 else 1.0)
        for species, change in changes.items():
            total[species - 1] = total[species - 1] + change * speed
    return total


POLLU = sw.system(order=1)(rates)


def stiff_matrix(rng: np.random.Generator, n: int) -> Any:
    """A matrix with eigenvalues from −1e8 to −0.01 whose eigenvectors are far from orthogonal."""
    vectors = np.linalg.qr(rng.normal(size=(n, n)))[0] @ (np.eye(n) + np.triu(rng.normal(size=(n, n)), 1) * 5.0)
    return vectors @ np.diag(-(10.0 ** rng.uniform(-2, 8, n))) @ np.linalg.inv(vectors)


def of_function(function: Any, h: float, matrix: Any, s: Any) -> Any:
    """R(h·A)·s in 150 digits, of a rational function R."""
    with localcontext() as context:
        context.prec = 150
        exactly: Any = np.frompyfunc(lambda x: Decimal(float(x)), 1, 1)
        z, n = exactly(matrix) * Decimal(h), len(s)

        def of(coefficients: Any, start: Any) -> Any:
            """By Horner's rule."""
            parts = [Decimal(c.numerator) / Decimal(c.denominator) for c in coefficients]
            total = start * parts[-1]
            for c in reversed(parts[:-1]):
                total = z @ total + start * c
            return total

        below, right = of(function.below.coefficients, exactly(np.eye(n))), of(function.above.coefficients, exactly(s))
        for k in range(n):
            pivot = k + int(np.argmax([abs(x) for x in below[k:, k]]))
            below[[k, pivot]], right[[k, pivot]] = below[[pivot, k]], right[[pivot, k]]
            for i in range(k + 1, n):
                factor = below[i, k] / below[k, k]
                below[i, k:], right[i] = below[i, k:] - factor * below[k, k:], right[i] - factor * right[k]
        for k in reversed(range(n)):
            right[k] = (right[k] - sum(below[k, k + 1 :] * right[k + 1 :], Decimal(0))) / below[k, k]
        return right.astype(float)
