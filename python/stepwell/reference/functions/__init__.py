"""Interim."""

import numpy as np

from .. import bits, trig
from .. import log as _log
from ..bits import at_most, less
from ..trig import cos, sin


def _sym(x):
    return hasattr(x, "xor_bits")


def equal(a, b):
    if _sym(a):
        return a.equals(b)
    if _sym(b):
        return b.equals(a)
    return np.equal(a, b)


def where(m, a, b):
    if isinstance(m, (bool, np.bool_)):
        return a if m else b
    return bits.where(m, a, b)


def sqrt(x):
    return x.sqrt() if _sym(x) else np.sqrt(x)


def floor(x):
    return x.floor() if _sym(x) else np.floor(x)


def abs(x):
    return bits.and_bits(x, 2**63 - 1)


def square(x):
    return x * x


def power(x, n):
    if isinstance(n, float) and n.is_integer() and 0 < n <= 16:
        r = x
        for _ in range(int(n) - 1):
            r = r * x
        return r
    raise NotImplementedError


def log(x):
    return _log.log(x)


def tan(x):
    return sin(x) / cos(x)


def minimum(a, b):
    return where(less(b, a), b, a)


def maximum(a, b):
    return where(less(a, b), b, a)


def mod(a, b):
    return a - floor(a / b) * b


def _later(*a):
    raise NotImplementedError


arcsin = arccos = arctan = arctan2 = sinh = cosh = tanh = exp = exp2 = expm1 = log2 = log10 = log1p = cbrt = hypot = sign = (
    copysign
) = ceil = trunc = round = deg2rad = rad2deg = _later
