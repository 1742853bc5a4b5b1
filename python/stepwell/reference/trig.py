"""Sine, the same to the last bit as the core's: see ``trig.rs`` for its error. The core needs no cosine.

Stability analysis steps the reference on numbers that the core never sees, and these have a sine here as well: complex ones whose
imaginary part is infinitesimal, and ones that count what is done to them.
"""

import numpy as np

from .types import Array

TWO_OVER_PI = 0.636619772367581343
MAGIC = 6755399441055744.0  # 1.5·2⁵²: adding it rounds to an integer, which then stands in the low bits
HALF_PI = (1.5707963267341256, 6.077100506303966e-11, 2.0222662487959506e-21)
S = (
    -1.66666666666666324348e-1,
    8.33333333332248946124e-3,
    -1.98412698298579493134e-4,
    2.75573137070700676789e-6,
    -2.50507602534068634195e-8,
    1.58969099521155010221e-10,
)
C = (
    4.16666666666666019037e-2,
    -1.38888888888741095749e-3,
    2.48015872894767294178e-5,
    -2.75573143513906633035e-7,
    2.08757232129817482790e-9,
    -1.13596475577881948265e-11,
)


def sin(x: Array) -> Array:
    """Sin x."""
    if np.iscomplexobj(x):  # an infinitesimal imaginary part is multiplied by the derivative
        return _sin(x.real, 0) + 1j * (x.imag * _sin(x.real, 1))
    return _sin(x, 0)


def cos(x: Array) -> Array:
    """Cos x, which is the sine a quadrant further."""
    return _sin(x, 1)


def _sin(x: Array, quadrants: int) -> Array:
    """Sin(x + quadrants·π/2): reduced by π/2 in three parts, then fdlibm's polynomials."""
    y = np.asarray(x * TWO_OVER_PI + MAGIC)
    n = y - MAGIC
    r = ((x - n * HALF_PI[0]) - n * HALF_PI[1]) - n * HALF_PI[2]
    z = r * r
    s = r + (r * z) * (S[0] + z * (S[1] + z * (S[2] + z * (S[3] + z * (S[4] + z * S[5])))))
    c = (1.0 - 0.5 * z) + (z * z) * (C[0] + z * (C[1] + z * (C[2] + z * (C[3] + z * (C[4] + z * C[5])))))
    if y.dtype == object:
        return s  # numbers without bits, which count what is done to them; both branches were done
    quadrant = y.view(np.uint64) + np.uint64(quadrants)
    a = np.asarray(np.where(quadrant & np.uint64(1) == 0, s, c))
    sign = (quadrant & np.uint64(2)) << np.uint64(62)
    signed: Array = (a.view(np.uint64) ^ sign).view(np.float64)
    return signed
