"""A fused multiply-add, a·b + c rounded once, which NumPy does not have."""

from fractions import Fraction
from typing import Any

import numpy as np

from ..base.arrays import Array

#: Half of a number's bits and one more: what splits it into two halves (Veltkamp).
SPLIT = 2.0**27 + 1.0
#: Between these sizes no part of a product or of a sum overflows or is too small to be exact.
SMALL, LARGE = 2.0**-900, 2.0**900


def two_sum(a: Array, b: Array) -> tuple[Array, Array]:
    """The sum rounded, and what was rounded away (Knuth)."""
    s = a + b
    t = s - a
    return s, (a - (s - t)) + (b - t)


def halves(a: Array) -> tuple[Array, Array]:
    """Two numbers of half the bits whose sum is a (Veltkamp)."""
    c = SPLIT * a
    high = c - (c - a)
    return high, a - high


def two_product(a: Array, b: Array) -> tuple[Array, Array]:
    """The product rounded, and what was rounded away (Dekker)."""
    p = a * b
    (a1, a2), (b1, b2) = halves(a), halves(b)
    return p, a2 * b2 - (((p - a1 * b1) - a2 * b1) - a1 * b2)


def odd_sum(a: Array, b: Array) -> Array:
    """The sum rounded to odd: where it is not exact, to the neighbour whose last bit is set."""
    s, rest = two_sum(a, b)
    even = (s.view(np.uint64) & np.uint64(1)) == 0
    beside = np.nextafter(s, np.copysign(np.inf, rest))
    return np.where((rest != 0) & even, beside, s)


def exact_fma(a: float, b: float, c: float) -> float:
    """a·b + c of finite numbers, by rational arithmetic."""
    exact = Fraction(a) * Fraction(b) + Fraction(c)
    try:
        return float(exact) if exact else a * b + c  # what cancels has the sign that the sum has
    except OverflowError:
        return np.inf if exact > 0 else -np.inf


def double_fma(a: Any, b: Any, c: Any) -> Array:
    """Of float64 (Boldo and Melquiond 2008), arrays that broadcast."""
    a, b, c = (np.asarray(x, dtype=np.float64) for x in (a, b, c))
    with np.errstate(all="ignore"):
        p, p_rest = two_product(a, b)
        s, s_rest = two_sum(c, p_rest)
        t, t_rest = two_sum(p, s)
        out = np.asarray(t + odd_sum(s_rest, t_rest))
        inside = (np.abs(p) >= SMALL) & (np.abs(p) <= LARGE) & (np.abs(a) <= LARGE) & (np.abs(b) <= LARGE) & (np.abs(c) <= LARGE)
        if inside.all():
            return out  # as almost always
        a, b, c, inside = np.broadcast_arrays(a, b, c, inside)
        plain = a * b + c
        # A product of a zero is exact. What is not finite goes its own way, but a finite product added to an infinity is that.
        finite = np.isfinite(a) & np.isfinite(b)
        zero = finite & ((a == 0) | (b == 0))
        out = np.where(zero | ~finite | np.isnan(c), plain, out)
        out = np.where(finite & np.isinf(c), c, out)
        for at in np.argwhere(finite & np.isfinite(c) & ~zero & ~inside):
            i = tuple(at)
            out[i] = exact_fma(float(a[i]), float(b[i]), float(c[i]))
    return out


def single_fma(a: Any, b: Any, c: Any) -> Any:
    """Of float32, arrays that broadcast.

    The product of two numbers of 24 bits has 48, so in float64 it is exact. The sum is rounded to odd there, which keeps what the
    second rounding has to know: 53 bits are more than the 24 + 2 that this takes (Boldo and Melquiond 2008).
    """
    product, c = np.broadcast_arrays(np.multiply(a, b, dtype=np.float64), np.asarray(c, dtype=np.float64))
    plain = product + c
    return np.where(np.isfinite(plain) & (plain != 0.0), odd_sum(product, c), plain).astype(np.float32)


def fma(a: Any, b: Any, c: Any) -> Any:
    """Of the precision of its operands."""
    single = any(getattr(each, "dtype", None) == np.float32 for each in (a, b, c))
    return single_fma(a, b, c) if single else double_fma(a, b, c)
