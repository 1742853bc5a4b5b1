"""Natural logarithm, the same to the last bit as the core's: see ``functions.rs`` for its error.

Stability analysis has logarithms of numbers that the core never sees, as it has sines of them: see ``trig``.
"""

from typing import NamedTuple

import numpy as np

from ..base.arrays import Array
from . import bits
from .marks import differentiable


class Constants(NamedTuple):
    """Constants of one precision.

    Attributes:
        ln2: ln 2; k times the first part, of 33 or 15 bits, is exact.
        log: ln((1 + s)/(1 − s)) = 2s + s·(l₀·z + l₁·z² + …), z = s².
        half_root: the bits of √½, cut: the mantissa is taken from √½ to √2.
    """

    ln2: tuple[float, float]
    log: tuple[float, ...]
    half_root: int


CONSTANTS = bits.PerPrecision(
    double=Constants(
        ln2=(6.93147180369123816490e-01, 1.90821492927058770002e-10),
        log=(
            6.666666666666735130e-01,
            3.999999999940941908e-01,
            2.857142874366239149e-01,
            2.222219843214978396e-01,
            1.818357216161805012e-01,
            1.531383769920937332e-01,
            1.479819860511658591e-01,
        ),
        half_root=0x3FE6A09E00000000,
    ),
    single=Constants(
        ln2=(0.693145751953125, 1.428606765330187e-06),
        log=(0.6666666269302368, 0.40000972151756287, 0.2849878966808319, 0.2427894026041031),
        half_root=0x3F350400,
    ),
)


@differentiable("log", general=False)
def log(x: Array) -> Array:
    """Ln x of a normal number above zero: x = 2ᵏ·(1 + f), then fdlibm's polynomial in f/(2 + f)."""
    if np.iscomplexobj(x):  # an infinitesimal imaginary part is multiplied by the derivative
        return log(x.real) + 1j * (x.imag / x.real)
    constants = CONSTANTS.of(x)
    k, f = split(x)
    s = f / (2.0 + f)
    z = s * s
    r = z * constants.log[-1]
    for c in constants.log[-2::-1]:
        r = z * (c + r)
    half = 0.5 * f * f
    value: Array = k * constants.ln2[0] - ((half - (s * (half + r) + k * constants.ln2[1])) - f)
    return value


def split(x: Array) -> tuple[Array, Array]:
    """The whole exponent k and the fraction f of x = 2ᵏ·(1 + f)."""
    precision, half_root = bits.PRECISIONS.of(x), CONSTANTS.of(x).half_root
    whole, places = precision.first_whole, precision.fraction_bits
    u = bits.add_bits(x, precision.pattern(1.0) - half_root)
    exponent = bits.or_bits(bits.shift_down(u, places), precision.pattern(whole)) - (whole + precision.bias)
    return exponent, bits.add_bits(bits.and_bits(u, (1 << places) - 1), half_root) - 1.0
