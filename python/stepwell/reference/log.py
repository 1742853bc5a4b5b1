"""Natural logarithm, the same to the last bit as the core's: see ``functions.rs`` for its error.

Stability analysis has logarithms of numbers that the core never sees, as it has sines of them: see ``trig``.
"""

import numpy as np

from ..base.arrays import Array
from . import bits
from .marks import differentiable

LN2 = (6.93147180369123816490e-01, 1.90821492927058770002e-10)
L = (
    6.666666666666735130e-01,
    3.999999999940941908e-01,
    2.857142874366239149e-01,
    2.222219843214978396e-01,
    1.818357216161805012e-01,
    1.531383769920937332e-01,
    1.479819860511658591e-01,
)
HALF_ROOT = 0x3FE6A09E00000000  # √½, cut: the mantissa is taken from √½ to √2
TO_ONE = 0x3FF0000000000000 - HALF_ROOT
MANTISSA = 0x000FFFFFFFFFFFFF
TWO_52 = 0x4330000000000000  # its low bits hold a whole number


@differentiable("log", general=False)
def log(x: Array) -> Array:
    """Ln x of a normal number above zero: x = 2ᵏ·(1 + f), then fdlibm's polynomial in f/(2 + f)."""
    if np.iscomplexobj(x):  # an infinitesimal imaginary part is multiplied by the derivative
        return log(x.real) + 1j * (x.imag / x.real)
    if bits.is_single(x):
        return _single(x)
    k, f = split(x)
    s = f / (2.0 + f)
    z = s * s
    r = z * (L[0] + z * (L[1] + z * (L[2] + z * (L[3] + z * (L[4] + z * (L[5] + z * L[6]))))))
    half = 0.5 * f * f
    value: Array = k * LN2[0] - ((half - (s * (half + r) + k * LN2[1])) - f)
    return value


def split(x: Array) -> tuple[Array, Array]:
    """The whole exponent k and the fraction f of x = 2ᵏ·(1 + f)."""
    u = bits.add_bits(x, TO_ONE)
    exponent = bits.or_bits(bits.shift_down(u, 52), TWO_52) - (4503599627370496.0 + 1023.0)
    return exponent, bits.add_bits(bits.and_bits(u, MANTISSA), HALF_ROOT) - 1.0


SINGLE_LN2 = (0.693145751953125, 1.428606765330187e-06)
SINGLE_L = (0.6666666269302368, 0.40000972151756287, 0.2849878966808319, 0.2427894026041031)
SINGLE_HALF_ROOT = 0x3F350400
SINGLE_TO_ONE = 0x3F800000 - SINGLE_HALF_ROOT
SINGLE_MANTISSA = 0x007FFFFF
TWO_23 = 0x4B000000


def _single(x: Array) -> Array:
    """The same of symbols of float32."""
    u = bits.add_bits(x, SINGLE_TO_ONE)
    k = bits.or_bits(bits.shift_down(u, 23), TWO_23) - (8388608.0 + 127.0)
    f = bits.add_bits(bits.and_bits(u, SINGLE_MANTISSA), SINGLE_HALF_ROOT) - 1.0
    s = f / (2.0 + f)
    z = s * s
    r = z * (SINGLE_L[0] + z * (SINGLE_L[1] + z * (SINGLE_L[2] + z * SINGLE_L[3])))
    half = 0.5 * f * f
    value: Array = k * SINGLE_LN2[0] - ((half - (s * (half + r) + k * SINGLE_LN2[1])) - f)
    return value
