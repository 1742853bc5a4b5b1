"""Sine, the same to the last bit as the core's: see ``functions.rs`` for its error.

Stability analysis steps the reference on numbers that the core never sees, and these have a sine here as well: complex ones whose
imaginary part is infinitesimal, and ones that count what is done to them.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ..base.arrays import Array
from . import bits
from .marks import differentiable

PER_HALF_TURN = 0.3183098861837907  # 1/π


def _by_parity(r: Array, s: tuple[float, ...]) -> Array:
    """Sin r = r + r³·(s₀ + s₁·r² + …) of eight terms: odd and even powers are summed apart, to wait for less."""
    z = r * r
    w = z * z
    odd = s[1] + w * (s[3] + w * (s[5] + w * s[7]))
    even = s[2] + w * (s[4] + w * s[6])
    return r + (r * z) * (s[0] + z * (odd + z * even))


def _in_turn(r: Array, s: tuple[float, ...]) -> Array:
    """Sin r = r + r³·(s₀ + s₁·r² + …) of four terms, each of which waits for the one before."""
    z = r * r
    return r + (r * z) * (s[0] + z * (s[1] + z * (s[2] + z * s[3])))


class Constants(NamedTuple):
    """Constants of one precision.

    Attributes:
        pi: π in parts; n times each but the last is exact, for n < 2²⁰ or 2¹¹.
        sin: (sin r − r)/r³ in powers of r², on [−π/2, π/2].
        polynomial: from r and these the sine of r.
    """

    pi: tuple[float, ...]
    sin: tuple[float, ...]
    polynomial: Callable[[Array, tuple[float, ...]], Array]


CONSTANTS = bits.PerPrecision(
    double=Constants(
        pi=(3.1415926534682512, 1.2154201013012384e-10),
        sin=(
            -0.16666666666666666,
            0.008333333333333196,
            -0.00019841269841207676,
            2.75573192107121e-6,
            -2.505210682744121e-8,
            1.6058937294753282e-10,
            -7.64292781535996e-13,
            2.7205082501769597e-15,
        ),
        polynomial=_by_parity,
    ),
    single=Constants(
        pi=(3.1416015625, -8.909031748771667e-06, 1.215420125655342e-10),
        sin=(-0.16666656732559204, 0.008333008736371994, -0.00019806012278422713, 2.5987430944951484e-06),
        polynomial=_in_turn,
    ),
)


@differentiable("sin", general=False)
def sin(x: Array) -> Array:
    """Sin x."""
    if np.iscomplexobj(x):  # an infinitesimal imaginary part is multiplied by the derivative
        return sin(x.real) + 1j * (x.imag * cos(x.real))
    magic = bits.PRECISIONS.of(x).magic
    turn = x * PER_HALF_TURN + magic
    return _half_turn(x, turn - magic, turn)


@differentiable("cos", general=False)
def cos(x: Array) -> Array:
    """Cos x, which is the sine a quarter of a turn further."""
    if np.iscomplexobj(x):
        return cos(x.real) - 1j * (x.imag * sin(x.real))
    magic = bits.PRECISIONS.of(x).magic
    turn = (x * PER_HALF_TURN + 0.5) + magic
    return _half_turn(x, (turn - magic) - 0.5, turn)


def _half_turn(x: Array, n: Array, turn: Array) -> Array:
    """Sin(x − nπ), in [−π/2, π/2]; its sign turns if the integer in the low bits of ``turn`` is odd."""
    constants = CONSTANTS.of(x)
    r = x
    for part in constants.pi:
        r = r - n * part
    signed: Array = bits.turn_sign(constants.polynomial(r, constants.sin), turn)
    return signed
