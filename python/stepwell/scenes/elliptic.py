"""Jacobi's elliptic functions, for the exact solutions of pendulums and tops."""

from __future__ import annotations

import math

import numpy as np

from ..base.arrays import Array

#: The most iterations of the arithmetic-geometric mean, which doubles its digits with each: enough for any amplitude that is not
#: 180° as a float.
MAX_ITERATIONS = 40


def quarter(complement: float) -> float:
    """The quarter period K of Jacobi's functions, of the complementary modulus k'."""
    return 0.5 * math.pi / _means(complement)[0][-1]


def elliptic(u: Array, modulus: float, complement: float) -> tuple[Array, Array, Array]:
    """Jacobi's sn, cn and dn of u, within some periods of 0, by the arithmetic-geometric mean (Abramowitz and Stegun 16.4)."""
    a, c = _means(complement)
    angle = 2.0 ** (len(a) - 1) * a[-1] * u
    for n in range(len(a) - 1, 0, -1):
        angle = 0.5 * (angle + np.arcsin(np.clip(c[n] / a[n] * np.sin(angle), -1.0, 1.0)))
    sn, cn = np.sin(angle), np.cos(angle)
    # 1 − k²·sn², as a sum of terms that are not negative.
    return sn, cn, np.sqrt(complement * complement + modulus * modulus * cn * cn)


def _means(complement: float) -> tuple[list[float], list[float]]:
    """The successive arithmetic means that start from 1 and k', and half the difference of each pair."""
    a, b, means, halves = 1.0, complement, [1.0], [0.0]
    for _ in range(MAX_ITERATIONS):
        a, b, half = 0.5 * (a + b), math.sqrt(a * b), 0.5 * (a - b)
        means.append(a)
        halves.append(half)
        if half <= 1e-17 * a or half == 0.0 or abs(a - b) <= 2e-16 * a:
            break
    return means, halves
