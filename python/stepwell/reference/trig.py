"""Sine, the same to the last bit as the core's: see ``functions.rs`` for its error.

Stability analysis steps the reference on numbers that the core never sees, and these have a sine here as well: complex ones whose
imaginary part is infinitesimal, and ones that count what is done to them.
"""

import numpy as np

from ..base.arrays import Array
from . import bits
from .marks import differentiable

PER_HALF_TURN = 0.3183098861837907  # 1/π
MAGIC = 6755399441055744.0  # 1.5·2⁵²: adding it rounds to an integer, which is then in the low bits
PI = (3.1415926534682512, 1.2154201013012384e-10)
S = (
    -0.16666666666666666,
    0.008333333333333196,
    -0.00019841269841207676,
    2.75573192107121e-6,
    -2.505210682744121e-8,
    1.6058937294753282e-10,
    -7.64292781535996e-13,
    2.7205082501769597e-15,
)


@differentiable("sin", general=False)
def sin(x: Array) -> Array:
    """Sin x."""
    if np.iscomplexobj(x):  # an infinitesimal imaginary part is multiplied by the derivative
        return sin(x.real) + 1j * (x.imag * cos(x.real))
    if bits.is_single(x):
        return _single(x, 0.0)
    y = x * PER_HALF_TURN + MAGIC
    n = y - MAGIC
    return _half_turn((x - n * PI[0]) - n * PI[1], y)


@differentiable("cos", general=False)
def cos(x: Array) -> Array:
    """Cos x, which is the sine a quarter of a turn further."""
    if np.iscomplexobj(x):
        return cos(x.real) - 1j * (x.imag * sin(x.real))
    if bits.is_single(x):
        return _single(x, 0.5)
    y = (x * PER_HALF_TURN + 0.5) + MAGIC
    n = (y - MAGIC) - 0.5
    return _half_turn((x - n * PI[0]) - n * PI[1], y)


#: The same for float32, where the first two parts of π have 13 bits each.
SINGLE_MAGIC = 12582912.0
SINGLE_PI = (3.1416015625, -8.909031748771667e-06, 1.215420125655342e-10)
SINGLE_S = (-0.16666656732559204, 0.008333008736371994, -0.00019806012278422713, 2.5987430944951484e-06)


def _single(x: Array, turned: float) -> Array:
    """Sin(x + turned·π) of symbols of float32."""
    y = x * PER_HALF_TURN
    y = (y + turned if turned else y) + SINGLE_MAGIC
    n = y - SINGLE_MAGIC
    n = n - turned if turned else n
    r = ((x - n * SINGLE_PI[0]) - n * SINGLE_PI[1]) - n * SINGLE_PI[2]
    z = r * r
    s = r + (r * z) * (SINGLE_S[0] + z * (SINGLE_S[1] + z * (SINGLE_S[2] + z * SINGLE_S[3])))
    signed: Array = bits.turn_sign(s, y)
    return signed


def _half_turn(r: Array, y: Array) -> Array:
    """Sin r on [−π/2, π/2]; its sign turns if the integer in the low bits of y is odd."""
    z = r * r
    w = z * z
    odd = S[1] + w * (S[3] + w * (S[5] + w * S[7]))
    even = S[2] + w * (S[4] + w * S[6])
    s = r + (r * z) * (S[0] + z * (odd + z * even))
    signed: Array = bits.turn_sign(s, y)
    return signed
