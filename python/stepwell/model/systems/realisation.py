"""Linear systems as their four matrices: of transfer functions, of other libraries' objects, and joined to larger ones."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ...base import checks
from ...base.arrays import Array
from ...base.reprs import counted
from ...errors import ArgumentError, DTypeError, ShapeError, UnsupportedError
from ...reference.product import product
from ..inputs import Input
from ..parameters import aligned

EPS = float(np.finfo(np.float64).eps)


class Realisation(NamedTuple):
    """ṡ = A·s + B·x, z = C·s + D·x. A gain alone has no states. The batch is behind the rows and columns of the matrices.

    ``velocities`` are the states that are velocities, ``x`` the inputs, one for each column of B; None for zero.
    """

    A: Array
    B: Array
    C: Array
    D: Array
    velocities: tuple[int, ...] = ()
    x: tuple[Input | None, ...] = ()

    @property
    def size(self) -> int:
        """The number of states."""
        return len(self.A)

    @property
    def inputs(self) -> int:
        """The number of inputs."""
        return int(self.D.shape[1])

    @property
    def outputs(self) -> int:
        """The number of outputs."""
        return len(self.D)


def of_gain(argument: str, value: Any, outputs: int, inputs: int) -> Realisation:
    """A number, or one for each member, times each input."""
    if outputs != inputs:
        raise ShapeError(
            f"{argument}: a gain leads each input to one output, but here are {counted(inputs, 'input')} and "
            f"{counted(outputs, 'output')}; give a LinearSystem"
        )
    gain = checks.numbers(argument, value)
    checks.batch_shape({argument: gain.shape})
    unit = np.eye(outputs).reshape(outputs, outputs, *(1,) * gain.ndim)
    batch = (1,) * gain.ndim
    return Realisation(
        np.zeros((0, 0, *batch)), np.zeros((0, inputs, *batch)), np.zeros((outputs, 0, *batch)), unit * gain, x=(None,) * inputs
    )


# ---- transfer functions


def coefficients(argument: str, value: Any) -> Array:
    """The coefficients of a polynomial, highest power first, shape (degree + 1, *batch), without leading zeros."""
    array = checks.numbers(argument, value)
    array = array[np.newaxis] if array.ndim == 0 else array
    if not len(array):
        raise ShapeError(f"{argument}: expected the coefficients of a polynomial, highest power first, got none")
    used = np.flatnonzero(array.reshape(len(array), -1).any(axis=1))
    return array[used[0] if used.size else len(array) - 1 :]


def of_polynomials(num: Array, den: Array) -> Realisation:
    """The controllable form of num/den: the states are an intermediate variable's derivatives, the highest first, and itself.

    ``num`` may have an axis of outputs before those of the batch, as ``rows`` of a common ``den``: shape (degree + 1, rows, …).
    """
    if (wrong := den[0] == 0.0).any():
        what = "all are zero" if wrong.all() else f"it is zero in {counted(int(wrong.sum()), 'member')} and not in others"
        raise ArgumentError(f"den: expected a first coefficient other than zero, but {what}")
    n, degree = len(den) - 1, len(num) - 1
    if degree > n:
        raise ArgumentError(
            f"num: expected a degree of at most that of den, {n}, got {degree}: such a transfer function differentiates its "
            f"input, so it has no state space; give it a pole far beyond the frequencies of interest"
        )
    if n == 0:
        raise ArgumentError(f"den: expected a degree of 1 or more, got 0: {_GAIN}")
    batch = np.broadcast_shapes(num.shape[2:], den.shape[1:])
    num, den = aligned(num, 2, batch), aligned(den, 1, batch)
    a = den[1:] / den[0]
    b = num / den[0]
    b = np.concatenate([np.zeros((n - degree, *b.shape[1:])), b])
    A = np.zeros((n, n, *a.shape[1:]))
    A[0] = -a
    A[range(1, n), range(n - 1)] = 1.0
    B = np.zeros((n, 1, *(1,) * len(batch)))
    B[0] = 1.0
    C = np.moveaxis(b[1:] - b[0] * a[:, np.newaxis], 0, 1)
    return Realisation(A, B, C, b[0][:, np.newaxis], tuple(range(n // 2)), (None,))


_GAIN = "a gain alone has no state to step; multiply another system by the number"


# ---- other libraries' objects, known by their attributes


def of_object(argument: str, value: Any) -> Realisation:
    """The matrices of an object of SciPy or python-control."""
    step = getattr(value, "dt", None)
    if step is not None and (isinstance(step, bool) or step != 0):
        raise UnsupportedError(
            f"{argument}: expected a system of continuous time, got {type(value).__name__} with dt = {step}, which is sampled "
            f"already; give the system that it was made from"
        )
    matrices = [getattr(value, name, None) for name in "ABCD"]
    if all(each is not None for each in matrices):
        A, B, C, D = (checks.numbers(name, each) for name, each in zip("ABCD", matrices, strict=True))
        if not A.size:
            raise ArgumentError(f"A: expected at least one state, got none: {_GAIN}")
        return Realisation(A, B, C, D, (), (None,) * B.shape[-1])
    num, den = (getattr(value, name, None) for name in ("num", "den"))
    if num is not None and den is not None:
        return _of_table(num, den)
    zeros, poles, gain = (getattr(value, name, None) for name in ("zeros", "poles", "gain"))
    if gain is not None and not any(each is None or callable(each) for each in (zeros, poles)):
        num = _real("zeros", zeros) * checks.number("gain", gain)
        return of_polynomials(coefficients("num", num)[:, np.newaxis], _real("poles", poles))
    raise DTypeError(
        f"{argument}: expected a linear system of stepwell, or an object of SciPy or python-control with A, B, C and D, "
        f"with num and den, or with zeros, poles and gain, got {checks.short(value)} ({type(value).__name__})"
    )


def _of_table(num: Any, den: Any) -> Realisation:
    """Of SciPy's polynomials, of which ``num`` may have a row for each output, or of python-control's, a table of both."""
    if not isinstance(den, list):
        rows = checks.numbers("num", num)
        rows = rows[np.newaxis] if rows.ndim == 1 else rows
        return of_polynomials(coefficients("num", rows.T), coefficients("den", den))
    whole: Realisation | None = None
    for row in range(len(num)):
        for column in range(len(num[row])):
            n, d = coefficients("num", num[row][column]), coefficients("den", den[row][column])
            is_gain = len(d) == len(n) == 1
            one = of_gain("num", n[0] / d[0], 1, 1) if is_gain else of_polynomials(n[:, np.newaxis], d)
            r, m = len(num), len(num[row])
            B, C, D = np.zeros((one.size, m)), np.zeros((r, one.size)), np.zeros((r, m))
            B[:, column], C[row], D[row, column] = one.B[:, 0], one.C[0], one.D[0, 0]
            one = Realisation(one.A, B, C, D, one.velocities, (None,) * m)
            whole = one if whole is None else parallel(whole, one)
    if whole is None or not whole.size:
        raise ArgumentError(f"den: expected a degree of 1 or more, got 0: {_GAIN}")
    return whole


def _real(argument: str, roots: Any) -> Array:
    """The real polynomial with these roots."""
    polynomial = np.poly(np.atleast_1d(np.asarray(roots, dtype=np.complex128)))
    if np.iscomplexobj(polynomial):
        raise ArgumentError(f"{argument}: expected real numbers and conjugate pairs, got {checks.short(list(roots))}")
    return np.asarray(np.atleast_1d(polynomial), dtype=np.float64)


# ---- joined systems


def series(first: Realisation, second: Realisation) -> Realisation:
    """The outputs of the first are the inputs of the second."""
    if first.outputs != second.inputs:
        raise ShapeError(
            f"series: expected as many inputs of a system as the one before it has outputs, {first.outputs}, got {second.inputs}"
        )
    _undriven("series", "is the output of the system before it", second)
    return _joined(
        [
            [first.A, None, first.B],
            [times(second.B, first.C), second.A, times(second.B, first.D)],
            [times(second.D, first.C), second.C, times(second.D, first.D)],
        ],
        (first, second),
        first.x,
    )


def parallel(first: Realisation, second: Realisation) -> Realisation:
    """Both have the same inputs, and their outputs are added."""
    for what, ours, theirs in (("inputs", first.inputs, second.inputs), ("outputs", first.outputs, second.outputs)):
        if ours != theirs:
            raise ShapeError(f"parallel: expected systems with equally many {what}, got {ours} and {theirs}")
    x = first.x
    if all(each is None for each in x):
        x = second.x
    elif any(each is not None for each in second.x) and second.x != first.x:
        raise ArgumentError("parallel: expected one input for both systems, got two; give x to the first one only")
    return _joined(
        [[first.A, None, first.B], [None, second.A, second.B], [first.C, second.C, sum_of(first.D, second.D)]], (first, second), x
    )


def feedback(forward: Realisation, back: Realisation, sign: int) -> Realisation:
    """The outputs of ``forward``, through ``back``, are added to its inputs with this sign.

    e = x + sign·(C₂·s₂ + D₂·z), z = C₁·s₁ + D₁·e, so that (1 − sign·D₁·D₂)·z is known.
    """
    if (forward.outputs, forward.inputs) != (back.inputs, back.outputs):
        raise ShapeError(
            f"feedback: expected a system back with {counted(forward.outputs, 'input')} and {counted(forward.inputs, 'output')}, "
            f"got {back.inputs} and {back.outputs}"
        )
    _undriven("feedback", "is the output of the system forward", back)
    loop = _solved(times(forward.D, back.D), sign)
    C = (times(loop, forward.C), float(sign) * times(loop, times(forward.D, back.C)))
    D = times(loop, forward.D)
    # The inputs of the system forward: e = x + sign·(C₂·s₂ + D₂·z)
    e = (float(sign) * times(back.D, C[0]), float(sign) * sum_of(back.C, times(back.D, C[1])))
    unit = np.eye(forward.inputs).reshape(*forward.D.shape[1:2] * 2, *(1,) * (D.ndim - 2))
    of_x = sum_of(unit, float(sign) * times(back.D, D))
    return _joined(
        [
            [sum_of(forward.A, times(forward.B, e[0])), times(forward.B, e[1]), times(forward.B, of_x)],
            [times(back.B, C[0]), sum_of(back.A, times(back.B, C[1])), times(back.B, D)],
            [*C, D],
        ],
        (forward, back),
        forward.x,
    )


def _undriven(name: str, why: str, part: Realisation) -> None:
    if any(each is not None for each in part.x):
        raise ArgumentError(f"{name}: expected x of the first system only; that of another one {why}")


def _joined(rows: list[list[Array | None]], parts: tuple[Realisation, Realisation], x: tuple[Input | None, ...]) -> Realisation:
    """The system whose matrices are these blocks: A and B in two rows, C and D in the third. None is zero."""
    first, second = parts
    batches = (np.broadcast_shapes(*(each.shape[2:] for each in (part.A, part.B, part.C, part.D))) for part in parts)
    batch = checks.batch_shape({f"system {i + 1}": each for i, each in enumerate(batches)})
    D = rows[2][2]
    assert D is not None
    heights, widths = (first.size, second.size, D.shape[0]), (first.size, second.size, D.shape[1])
    whole = np.zeros((sum(heights), sum(widths), *batch))
    at = 0
    for height, row in zip(heights, rows, strict=True):
        left = 0
        for width, block in zip(widths, row, strict=True):
            if block is not None:
                whole[at : at + height, left : left + width] = aligned(block, 2, batch)
            left += width
        at += height
    n = first.size + second.size
    velocities = (*first.velocities, *(first.size + i for i in second.velocities))
    return Realisation(whole[:n, :n], whole[:n, n:], whole[n:, :n], whole[n:, n:], velocities, x)


def _pair(a: Array, b: Array) -> tuple[Array, Array]:
    """Two matrices with equally many batch axes."""
    batch = checks.batch_shape({"system 1": a.shape[2:], "system 2": b.shape[2:]})
    return aligned(a, 2, batch), aligned(b, 2, batch)


def times(a: Array, b: Array) -> Array:
    """The product of two matrices over their batch."""
    a, b = _pair(a, b)
    if not a.shape[1]:
        return np.zeros((len(a), b.shape[1], *(1,) * (a.ndim - 2)))
    return product(a, b)


def sum_of(a: Array, b: Array) -> Array:
    """The sum of two matrices over their batch."""
    a, b = _pair(a, b)
    return a + b


def _solved(loop: Array, sign: int) -> Array:
    """(1 − sign·D₁·D₂)⁻¹, by elimination with the largest pivot first in each column."""
    n, batch = len(loop), loop.shape[2:]
    unit = np.broadcast_to(np.eye(n).reshape(n, n, *(1,) * len(batch)), loop.shape)
    rows = np.concatenate([unit - float(sign) * loop, unit], axis=1)
    least = 4.0 * n * EPS * np.maximum(1.0, np.abs(loop).max(axis=(0, 1)))
    for k in range(n):
        best = k + np.abs(rows[k:, k]).argmax(axis=0)[np.newaxis, np.newaxis]
        pivot = np.take_along_axis(rows, np.broadcast_to(best, (1, 2 * n, *batch)), axis=0)[0]
        np.put_along_axis(rows, np.broadcast_to(best, (1, 2 * n, *batch)), rows[k : k + 1], axis=0)
        if (np.abs(pivot[k]) <= least).any():
            raise ArgumentError(
                "feedback: expected a loop whose output is determined, but the direct paths around it give 1 − sign·D₁·D₂ = 0 "
                "(an algebraic loop); leave out one of the feedthroughs, or give one of the systems a delay or a pole"
            )
        rows[k] = pivot / pivot[k]
        for i in range(n):
            if i != k:
                rows[i] = rows[i] - rows[i, k] * rows[k]
    return rows[:, n:]
