"""The exact step of a linear system, ṡ = A·s + B·x: by the exponential of a matrix, for held, linear and sinusoidal inputs.

exp(M) = exp(M/2ᵏ)^(2ᵏ) (Moler and Van Loan 2003, method 3): a Taylor polynomial of M/2ᵏ, squared k times. Each squaring doubles
the relative error, so all is computed with twice the digits of a number, and the last rounding is nearly the only one. Sums run
in one order, with no library for matrices, and each member has its own k: the bits are the same on every machine, in any batch.

Matrices are of shape (n, n, *batch). A number of twice the digits is the sum of two, (high, low).
"""

from fractions import Fraction
from math import factorial
from typing import Any

import numpy as np

from ..base.arrays import Array
from .fma import halves, two_product, two_sum

Twice = tuple[Array, Array]

#: The degree of the Taylor polynomial, and the norm of M/2ᵏ up to which its error, (1/8)¹⁷/17! = 1.2e-30, is below all digits.
DEGREE, NORM = 16, 0.125

#: Balancing brings rows and columns to similar size in at most this many rounds; a round halves the exponents that remain.
ROUNDS = 20

#: The most squarings: of M with a norm of 2⁶⁰ a step tells nothing but which states grow beyond all numbers.
MOST_SQUARINGS = 64


def held(A: Array, B: Array, h: Any) -> tuple[Array, Array]:
    """P and Q of a step with a constant input: s ← P·s + Q·x."""
    n, m = B.shape[:2]
    whole = exponential(*_scaled(_augmented(A, [[B]]), h))
    return whole[:n, :n], whole[:n, n : n + m]


def linear(A: Array, B: Array, h: Any) -> tuple[Array, Array, Array]:
    """P, Q and Q' of a step with an input on a straight line from x to x': s ← P·s + Q·x + Q'·x'."""
    n, m = B.shape[:2]
    zero, slope = np.zeros((m, m)), np.eye(m)  # x' − x is a state that drives x with the rate 1/h: here the step is 1
    M, low = _scaled(_augmented(A, [[B, None], [zero, slope]]), h)
    M[n : n + m, n + m :], low[n : n + m, n + m :] = slope.reshape(m, m, *(1,) * (M.ndim - 2)), 0.0
    whole = exponential(M, low)
    after = whole[:n, n + m :]
    return whole[:n, :n], whole[:n, n : n + m] - after, after


def sinusoidal(A: Array, B: Array, h: Any, omega: Any) -> tuple[Array, Array, Array]:
    """P, Q and Q' of a step with an input x = sin(ω·t + φ): s ← P·s + Q·sin(ω·t + φ) + Q'·cos(ω·t + φ).

    ``omega`` has a number for each input, shape (inputs, *batch).
    """
    n, m = B.shape[:2]
    omega = np.asarray(omega)
    turn = np.eye(m).reshape(m, m, *(1,) * (omega.ndim - 1)) * omega
    whole = exponential(*_scaled(_augmented(A, [[B, None], [np.zeros((m, m)), turn], [-turn, np.zeros((m, m))]]), h))
    return whole[:n, :n], whole[:n, n : n + m], whole[:n, n + m :]


def _augmented(A: Array, blocks: list[list[Array | None]]) -> Array:
    """The matrix of the states and, behind them, of inputs that follow linear equations; ``blocks`` are its columns behind A."""
    n, m = len(A), blocks[0][0].shape[1] if blocks[0][0] is not None else 0
    known = [A, *(each for row in blocks for each in row if each is not None)]
    axes = max(each.ndim for each in known) - 2

    def wide(block: Array) -> Array:
        return block.reshape(*block.shape[:2], *(1,) * (axes + 2 - block.ndim), *block.shape[2:])

    batch = np.broadcast_shapes(*(wide(each).shape[2:] for each in known))
    size = n + m * len(blocks[0])
    whole = np.zeros((size, size, *batch))
    whole[:n, :n] = wide(A)
    for i, row in enumerate(blocks):
        for j, block in enumerate(row):
            if block is not None:
                top = slice(0, n) if i == 0 else slice(n + m * (i - 1), n + m * i)
                whole[top, n + m * j : n + m * (j + 1)] = wide(block)
    return whole


def _scaled(M: Array, h: Any) -> Twice:
    """M·h, with twice the digits."""
    h = np.asarray(h, dtype=np.float64)
    axes = max(M.ndim - 2, h.ndim)
    M = M.reshape(*M.shape[:2], *(1,) * (axes + 2 - M.ndim), *M.shape[2:])
    with np.errstate(all="ignore"):
        high, low = two_product(M, h)
    return np.array(high), np.array(low)


def exponential(high: Array, low: Array | None = None) -> Array:
    """exp(M) of the sum M of two matrices."""
    with np.errstate(all="ignore"):
        low = np.zeros_like(high) if low is None else low
        unit = _balancing(high)
        by = unit[np.newaxis] - unit[:, np.newaxis]
        M = np.ldexp(high, by), np.ldexp(low, by)
        k = np.clip(np.frexp(_norm(M[0]) / NORM)[1], 0, MOST_SQUARINGS)
        power = _polynomial((np.ldexp(M[0], -k), np.ldexp(M[1], -k)))
        for done in range(int(k.max(initial=0))):
            square = product(power, power)
            power = np.where(done < k, square[0], power[0]), np.where(done < k, square[1], power[1])
        return np.asarray(np.ldexp(power[0] + power[1], -by))


def product(a: Twice, b: Twice) -> Twice:
    """The product of two matrices with twice the digits, summed in the order of the columns of the first."""
    (a1, a2), (b1, b2) = halves(a[0]), halves(b[0])
    whole = rest = np.zeros((len(a[0]), b[0].shape[1], *(1,) * (a[0].ndim - 2)))
    for j in range(a[0].shape[1]):
        left, right = (slice(None), j, np.newaxis), (j, np.newaxis)
        p = a[0][left] * b[0][right]
        off = a2[left] * b2[right] - (((p - a1[left] * b1[right]) - a2[left] * b1[right]) - a1[left] * b2[right])
        whole, lost = two_sum(whole, p)
        rest = rest + (lost + (off + (a[0][left] * b[1][right] + a[1][left] * b[0][right])))
    return two_sum(whole, rest)


def total(a: Twice, b: Twice) -> Twice:
    """The sum of two matrices or numbers with twice the digits."""
    s, rest = two_sum(a[0], b[0])
    return two_sum(s, rest + (a[1] + b[1]))


def _times(c: tuple[float, float], a: Twice) -> Twice:
    """A number times a matrix."""
    p, rest = two_product(np.asarray(c[0]), a[0])
    return two_sum(p, rest + (c[0] * a[1] + c[1] * a[0]))


def _coefficient(i: int) -> tuple[float, float]:
    """1/i! with twice the digits."""
    exact = Fraction(1, factorial(i))
    return float(exact), float(exact - Fraction(float(exact)))


def _polynomial(M: Twice) -> Twice:
    """Σ Mⁱ/i! by powers of M⁴ (Paterson and Stockmeyer 1973), which takes six products instead of fifteen."""
    n = len(M[0])
    one = np.broadcast_to(np.eye(n).reshape(n, n, *(1,) * (M[0].ndim - 2)), M[0].shape)
    square = product(M, M)
    powers: list[Twice] = [(one, np.zeros_like(one)), M, square, product(square, M)]
    fourth = product(square, square)
    whole = _times(_coefficient(DEGREE), powers[0])
    for first in range(DEGREE - 4, -1, -4):
        whole = product(whole, fourth)
        for i, power in enumerate(powers):
            whole = total(whole, _times(_coefficient(first + i), power))
    return whole


def _norm(M: Array) -> Array:
    """The largest sum of a column's magnitudes, by sums in one order."""
    sums = np.abs(M[0])
    for row in M[1:]:
        sums = sums + np.abs(row)
    return np.where(np.isfinite(worst := sums.max(axis=0)), worst, 0.0)


def _balancing(M: Array) -> Any:
    """Exponents e of each state: in units of 2^e rows and columns have similar size (Parlett and Reinsch 1969)."""
    n = len(M)
    size = np.abs(M)
    size[range(n), range(n)] = 0.0
    exponents = np.zeros((n, *M.shape[2:]), dtype=np.int64)
    for _ in range(ROUNDS):
        changed = False
        for i in range(n):
            row, column = size[i].max(axis=0), size[:, i].max(axis=0)
            half = (np.frexp(row)[1] - np.frexp(column)[1]) // 2
            half = np.where((row > 0.0) & (column > 0.0) & np.isfinite(row) & np.isfinite(column), half, 0)
            half = np.where(np.abs(half) > 1, half, 0)
            if half.any():
                changed = True
                exponents[i] += half
                size[:, i] = np.ldexp(size[:, i], half)
                size[i] = np.ldexp(size[i], -half)
        if not changed:
            break
    return exponents
