"""Eigenvalues in as many digits as needed, for matrices whose eigenvalues nearly meet.

Rounding of ε moves each of m eigenvalues that nearly meet by the m-th root of ε: in double precision eight that meet are known
to two digits. Here the arithmetic for a matrix of n rows has more than 24·n digits, and the results are right to double precision
for the matrix exactly as it is.
"""

from __future__ import annotations

from decimal import Context, Decimal, localcontext
from fractions import Fraction
from typing import Any

import numpy as np

from ...base.arrays import Array
from ...model.methods import Method
from ...model.systems import LinearSystem
from . import eigen
from .eigen import Complex
from .expansion import polynomials

#: Matrices of more rows than this are not computed exactly: the work grows with the fifth power.
MAX_ROWS = 32

#: Digits for each row (the n-th root of ε = 10^(−24·n) is 10⁻²⁴), and guard digits besides.
DIGITS_PER_ROW, GUARD_DIGITS = 24, 30

#: The most rounds of the iteration for the roots. At an m-fold root a round leaves the fraction (m − 1)/(m + 1) of the distance,
#: so every ``AITKEN_EVERY``-th round extrapolates to the sum of all that would follow.
MAX_ITERATIONS, AITKEN_EVERY = 2000, 4

#: The iteration for the roots has converged when they move by less than this fraction of their size.
ROOT_TOLERANCE = 1e-22

#: An imaginary part below the first fraction of a root is rounding, and so is a root below the second fraction of the largest.
REAL_TOLERANCE, ZERO_TOLERANCE = 1e-20, 1e-30

Number = np.ndarray[Any, np.dtype[np.object_]]


def digits(matrix: Any) -> int:
    """The digits needed for the eigenvalues of a matrix of floats or decimals, by its rows and by the range of its elements."""
    powers = [Decimal(x).adjusted() for x in np.ravel(matrix).tolist() if x]
    return DIGITS_PER_ROW * len(matrix) + GUARD_DIGITS + 2 * (max(powers, default=0) - min(powers, default=0))


def context(digits: int) -> Context:
    """Arithmetic with this many digits."""
    return Context(prec=digits, Emin=-999999, Emax=999999)


#: Floats or fractions as decimals: floats without rounding, fractions to the digits of the context.
decimals: Any = np.frompyfunc(
    lambda x: Decimal(x.numerator) / Decimal(x.denominator) if isinstance(x, Fraction) else Decimal(float(x)), 1, 1
)


def eigenvalues(matrix: Any, near: Complex) -> Complex:
    """The eigenvalues of one matrix, shape (n,), right to double precision; a pair has its positive angle first.

    The matrix has floats or decimals; ``near`` are the eigenvalues as computed in double precision.
    """
    with localcontext(context(digits(matrix))):
        elements = matrix.copy() if matrix.dtype == object else decimals(matrix)
        x, y = _roots(_characteristic(elements), np.asarray(near))
    return _in_pairs(x, y)


def unrounded(rates: Array, velocities: int, method: Method) -> tuple[Any, int]:
    """P of ṡ = A·s as exact polynomials in dt/2ᵏ, or quotients of them, shape (n, n), in units that balance A, and k.

    In that unit of time all elements of A are whole numbers, which ``polynomials`` takes as they are; other floats it replaces by
    simple fractions that round to them.
    """
    units = eigen.units_of(rates)
    scaled = rates * units / units[:, np.newaxis]
    clock = max(Fraction(x).denominator.bit_length() - 1 for x in scaled.ravel().tolist())
    return polynomials(LinearSystem(np.ldexp(scaled, clock), velocities=velocities), method), clock


class Step:
    """A step of ṡ = A·s in as many digits as needed; the rates A are in the order (v, y), with so many velocities."""

    def __init__(self, rates: Array, velocities: int, method: Method) -> None:
        P, self.clock = unrounded(rates, velocities, method)
        self.digits = digits(rates) + GUARD_DIGITS
        self.above, self.below = (self._powers(P, side) for side in (0, 1))

    def _powers(self, P: Any, side: int) -> list[Number]:
        """The coefficients of each power of dt in the polynomials above or below the line."""
        polynomials = np.frompyfunc(lambda p: p.fraction[side], 1, 1)(P)
        with localcontext(context(self.digits)):
            most = max(len(p.coefficients) for p in polynomials.flat)
            return [decimals(np.frompyfunc(lambda p, k=k: p[k], 1, 1)(polynomials)) for k in range(most)]

    def eigenvalues(self, dt: float) -> Complex:
        """The eigenvalues of P, right to double precision, shape (n,)."""
        return eigenvalues(*self._matrix(dt))

    def beyond(self, dt: float) -> float:
        """How far the largest eigenvalue of P is outside the unit circle, with more digits than |z| − 1 of doubles has."""
        matrix, near = self._matrix(dt)
        with localcontext(context(digits(matrix))):
            x, y = _roots(_characteristic(matrix), near)
            return float((x * x + y * y).max().sqrt() - 1)

    def _matrix(self, dt: float) -> tuple[Number, Complex]:
        """P, and its eigenvalues as computed in double precision."""
        with localcontext(context(self.digits)):
            h = Decimal(dt) / (1 << self.clock)
            P, below = self._at(h, self.above), self._at(h, self.below)
            if len(self.below) > 1:
                P = P / below
            rough = P.astype(float)
        return P, eigen.eigenvalues(rough)

    @staticmethod
    def _at(h: Decimal, powers: list[Number]) -> Number:
        """Polynomials at a step, by Horner's rule."""
        value = powers[-1]
        for power in powers[-2::-1]:
            value = value * h + power
        return value


def _characteristic(m: Number) -> list[Decimal]:
    """Coefficients of det(xI − M), highest power first, by Hessenberg's form. ``m`` is overwritten."""
    n = len(m)
    zero, one = Decimal(0), Decimal(1)
    for k in range(n - 2):
        pivot = k + 1 + int(np.abs(m[k + 1 :, k]).argmax())
        if not m[pivot, k]:
            continue
        m[[k + 1, pivot]] = m[[pivot, k + 1]]
        m[:, [k + 1, pivot]] = m[:, [pivot, k + 1]]
        factors = m[k + 2 :, k] / m[k + 1, k]
        m[k + 2 :] -= factors[:, np.newaxis] * m[k + 1]
        m[:, k + 1] += m[:, k + 2 :] @ factors
    polynomials = [np.array([one], dtype=object)]
    for k in range(n):
        p = np.concatenate([polynomials[k], [zero]])
        p[1:] -= m[k, k] * polynomials[k]
        under = one
        for i in range(k - 1, -1, -1):
            under *= m[i + 1, i]
            if not under:
                break
            p[k - i + 1 :] -= under * m[i, k] * polynomials[i]
        polynomials.append(p)
    return list(polynomials[n])


def _roots(coefficients: list[Decimal], near: Complex) -> tuple[Number, Number]:
    """Real and imaginary parts of all roots at once (Ehrlich 1967, Aberth 1973).

    The values of the polynomial have all digits; the corrections, and the differences of roots in them, are in double precision.
    """
    n = len(near)
    size = float(np.abs(near).max(initial=0.0)) or 1.0
    # The starts are apart from each other, and no two are mirror images.
    start = near + 1e-9 * (np.abs(near) + 1e-3 * size) * np.exp(1j * (0.7 + 2.0 * np.pi * np.arange(n) / n))
    x, y = decimals(start.real), decimals(start.imag)
    before = np.full(n, np.nan + 0j)
    for k in range(MAX_ITERATIONS):
        one = Decimal(1)
        p, p_i = np.full(n, one, dtype=object), np.full(n, Decimal(0), dtype=object)
        d, d_i = np.full(n, Decimal(0), dtype=object), np.full(n, Decimal(0), dtype=object)
        for c in coefficients[1:]:
            d, d_i = d * x - d_i * y + p, d * y + d_i * x + p_i
            p, p_i = p * x - p_i * y + c, p * y + p_i * x
        norm = d * d + d_i * d_i
        none = np.array([not a for a in norm])
        norm[none] = one
        newton = ((p * d + p_i * d_i) / norm).astype(float) + 1j * ((p_i * d - p * d_i) / norm).astype(float)
        at_root = np.array([not (a or b) for a, b in zip(p, p_i, strict=True)])
        between = (x[:, np.newaxis] - x).astype(float) + 1j * (y[:, np.newaxis] - y).astype(float)
        with np.errstate(all="ignore"):
            inverse = np.where(between == 0.0, 0.0, 1.0 / between)
            move = newton / (1.0 - newton * inverse.sum(axis=1))
        move = np.where(at_root, 0.0, np.where(np.isfinite(move) & ~none, move, 1e-6 * size * np.exp(0.3j * np.arange(n))))
        if k % AITKEN_EVERY == AITKEN_EVERY - 1:  # at a multiple root each round leaves the same fraction: extrapolate
            with np.errstate(all="ignore"):
                share = move / before
                move = np.where(np.abs(share) < 0.99, move / (1.0 - share), move)
        before = move
        x, y = x - decimals(move.real), y - decimals(move.imag)
        here = np.hypot(x.astype(float), y.astype(float))
        # A root is within n times Newton's correction; ``move`` alone may be small because two guesses are close together.
        if (
            np.maximum(np.abs(move), np.where(at_root, 0.0, np.abs(newton)))
            <= ROOT_TOLERANCE * np.maximum(here, ROOT_TOLERANCE * size)
        ).all():
            break
    return x, y


def _in_pairs(x: Number, y: Number) -> Complex:
    """Roots as doubles: imaginary parts that are rounding removed, the others in pairs, the positive angle first."""
    z = x.astype(float) + 1j * y.astype(float)
    z[np.abs(z) <= ZERO_TOLERANCE * np.abs(z).max()] = 0.0
    real = np.abs(z.imag) <= REAL_TOLERANCE * np.abs(z)
    up, down = z[~real & (z.imag > 0.0)], z[~real & (z.imag < 0.0)]
    if len(up) != len(down):  # a real root so nearly double that its imaginary part is above the tolerance
        return np.concatenate([z[real], up, down])
    return np.concatenate([z[real].real + 0j, np.stack([up, up.conj()], axis=1).ravel()])
