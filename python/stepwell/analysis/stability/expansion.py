"""A method on the undamped oscillator as exact polynomials in Φ or quotients of them, and the series of its errors (Appendix A).

The reference step is run with h = Φ, an unknown, and ω₀ = 1. P then has polynomials for elements, from which p, q = r₁² and the
series of Ψ/Φ follow by the rules of power series; no number is rounded.
"""

from __future__ import annotations

from fractions import Fraction
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from ...model.compatibility import one_state
from ...model.methods import Method
from ...model.methods import of_operations as find_method
from ...model.systems import LinearSystem, Oscillator, System
from . import maps
from .numbers import Polynomial, Rational

#: The number of terms of series in Φ²; the last is lost where a series is divided by Φ².
TERMS = 8

#: A coefficient this small is rounding of the method's coefficients and not a term of the series.
NEGLIGIBLE = Fraction(1, 10**12)


class Series(NamedTuple):
    """A method on the undamped oscillator, as functions of Φ.

    Attributes:
        p: half the trace of P, a polynomial, or a quotient of two if a step solves equations.
        q: the determinant of P, likewise: r₁² of a conjugate pair.
        ratio: the first terms of the series of Ψ/Φ.
    """

    p: Polynomial | Rational
    q: Polynomial | Rational
    ratio: Polynomial

    def __repr__(self) -> str:
        return f"<series in Φ: r₁² − 1 = {text(self.radius_terms())}, Ψ/Φ − 1 = {text(self.ratio_terms())}>"

    def radius_terms(self, most: int = 2) -> list[tuple[int, Fraction]]:
        """The first powers of Φ in r₁² − 1 of a conjugate pair, with their coefficients; none if it is 0."""
        return _terms(self.q - 1, most)

    def ratio_terms(self, most: int = 2) -> list[tuple[int, Fraction]]:
        """The first powers of Φ in Ψ/Φ − 1 with their coefficients."""
        return _terms(self.ratio - 1, most)


def series(method: str | Method) -> Series:
    """The exact polynomials and the series of a method on the undamped oscillator.

    Args:
        method: its name, or what ``stepwell.method`` returns.

    Example:
        >>> sw.stability.series("rk4")
        <series in Φ: r₁² − 1 = −Φ⁶/72 + Φ⁸/576, Ψ/Φ − 1 = −Φ⁴/120 + Φ⁶/336>
    """
    return _series(find_method(method))


def polynomials(system: System, method: Method) -> Any:
    """P of a linear system as exact polynomials in the step, or quotients of them, shape (n, n, *members)."""
    one_state("P", method)
    system = system.without_inputs()
    if method.is_implicit and sum(maps.size(system)) > 1:
        return _of_rates(system, method)
    dt: Any = Polynomial(0, 1)
    v, y = maps.unit(system, system.batch)
    exactly: Any = np.frompyfunc(Polynomial, 1, 1)
    n = sum(maps.size(system))
    s: Any = system.scaled(dt, (n, *system.batch))
    blocks = method.steps.step(s, 0.0, 0.0, exactly(v), exactly(y))
    return maps.rows(system, *(np.asarray(block, dtype=object) for block in blocks))


def _of_rates(system: System, method: Method) -> Any:
    """P of a method that treats both blocks alike: R(h·A) with its stability function R, which needs no choice of pivots."""
    alone = polynomials(LinearSystem([[1.0]], velocities=0), method)[0, 0]
    A = maps.rates(system)
    scaled: Any = np.frompyfunc(lambda x: Polynomial(0, x), 1, 1)(A)
    identity: Any = np.frompyfunc(Polynomial, 1, 1)(np.eye(len(A)).reshape(A.shape[:2] + (1,) * (A.ndim - 2)))
    above, below = np.zeros(A.shape, dtype=object), np.zeros(A.shape, dtype=object)
    power = np.broadcast_to(identity, A.shape)
    for k in range(max(len(p.coefficients) for p in alone.fraction)):
        above, below = (total + power * p[k] for total, p in zip((above, below), alone.fraction, strict=True))
        power = np.einsum("ij...,jk...->ik...", power, scaled)
    # Elimination: at h = 0 the matrix below is the identity, so no pivot is zero.
    n = len(A)
    for k in range(n):
        over = 1 / below[k, k]
        below[k], above[k] = below[k] * over, above[k] * over
        for i in range(n):
            if i != k:
                factor = below[i, k]
                below[i], above[i] = below[i] - factor * below[k], above[i] - factor * above[k]
    return above


@cache
def _series(method: Method) -> Series:
    (a, b), (c, d) = polynomials(Oscillator(), method)
    p, q = (a + d) / 2, a * d - b * c
    return Series(p, q, _ratio(p, q))


def _ratio(p: Polynomial | Rational, q: Polynomial | Rational) -> Polynomial:
    """The series of Ψ/Φ = arctan(√(q − p²)/p)/Φ.

    With P(−Φ) = S·P(Φ)·S, S = diag(1, −1), both p and q are even in Φ; in u = Φ² the root is Φ·√w(u), w(0) = 1, and with
    x = Φ·g(u) the arctangent is Φ·Σ (−1)ᵏ g²ᵏ⁺¹ uᵏ/(2k + 1).
    """
    p_u, q_u = _even(p), _even(q)
    under = [x - y for x, y in zip(q_u, _times(p_u, p_u), strict=True)]
    w = [*under[1:], Fraction(0)]
    g = _times(_root(w), _inverse(p_u))
    square = _times(g, g)
    power, total = g, [Fraction(0)] * TERMS
    for k in range(TERMS):
        for i in range(TERMS - k):
            total[i + k] += (-1) ** k * power[i] / (2 * k + 1)
        power = _times(power, square)
    ratio = [Fraction(0)] * (2 * TERMS - 3)
    ratio[::2] = total[:-1]
    return Polynomial(*ratio)


def _even(p: Polynomial | Rational) -> list[Fraction]:
    """The power series of a function of Φ² by its powers of u."""
    return p.terms(2 * TERMS)[::2]


def _times(a: list[Fraction], b: list[Fraction]) -> list[Fraction]:
    return [sum((a[i] * b[k - i] for i in range(k + 1)), Fraction(0)) for k in range(TERMS)]


def _inverse(a: list[Fraction]) -> list[Fraction]:
    coefficients = [1 / a[0]]
    for k in range(1, TERMS):
        coefficients.append(-sum((a[i] * coefficients[k - i] for i in range(1, k + 1)), Fraction(0)) / a[0])
    return coefficients


def _root(a: list[Fraction]) -> list[Fraction]:
    """The square root of a series that begins with 1."""
    coefficients = [Fraction(1)]
    for k in range(1, TERMS):
        coefficients.append((a[k] - sum((coefficients[i] * coefficients[k - i] for i in range(1, k)), Fraction(0))) / 2)
    return coefficients


def _terms(p: Polynomial | Rational, most: int) -> list[tuple[int, Fraction]]:
    terms = [(k, c) for k, c in enumerate(p.terms(2 * TERMS)) if abs(c) > NEGLIGIBLE]
    return terms[:most]


SUPERSCRIPTS = str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹")


def text(terms: list[tuple[int, Fraction]]) -> str:
    """Terms as text: −Φ⁶/72 + Φ⁸/576."""
    written = ""
    for power, c in terms:
        sign = "−" if c < 0 else "+"
        symbol = "Φ" + (str(power).translate(SUPERSCRIPTS) if power > 1 else "")
        top, bottom = abs(c.numerator), c.denominator
        if bottom > 100_000:
            term = f"{float(abs(c)):.4g}·{symbol}"
        else:
            term = (f"{top}{symbol}" if top > 1 else symbol) + (f"/{bottom}" if bottom > 1 else "")
        written += f" {sign} {term}" if written else f"{sign if c < 0 else ''}{term}"
    return written or "0"
