"""Transfer functions (§3), and linear systems joined to larger ones."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...base import checks
from ...base.reprs import brief
from ...errors import ArgumentError
from .linear import LinearSystem, is_gain, joined, part_of
from .realisation import Realisation, coefficients, of_gain, of_polynomials
from .realisation import feedback as fed_back
from .realisation import parallel as in_parallel
from .realisation import series as in_series


class TransferFunction(LinearSystem):
    """Z(s)/X(s) = num(s)/den(s), with one input and one output; equal degrees go through D (§3).

    It is the linear system in controllable form: the states are the derivatives of an intermediate variable w, with
    (den/den[0])(d/dt)·w = x, the highest derivative first, and w itself. So a state is not the output: that is C·state + D·x,
    which is ``run.z``. Of second degree the states are a velocity and a coordinate.

    Args:
        num: the coefficients of the numerator, highest power first as in SciPy, shape (degree + 1, *batch), or a number. Its
            degree is at most that of ``den``.
        den: those of the denominator, of degree 1 or more.
        x: the input: a number, an array over the batch, ``Sinusoid``, ``Sampled``, or None for zero.
        velocities: the states in the block v, as for ``LinearSystem``; by default the first n // 2.

    Attributes:
        num: the coefficients without leading zeros.
        den: likewise.

    Raises:
        ArgumentError: if an argument is wrong.

    Example:
        >>> lead = sw.TransferFunction([2.0, 1.0], [0.5, 1.0], x=1.0)  # (1 + 2s)/(1 + ½s), whose output jumps to 4
        >>> run = sw.integrate(lead, "rk4", v=0.0, y=0.0, dt=0.1, steps=20, every=10)
        >>> run.z[:, 0].round(3)
        array([4.   , 1.406, 1.055])
    """

    def __init__(self, num: Any, den: Any, *, x: Any = None, velocities: Any = None) -> None:
        self.num, self.den = coefficients("num", num), coefficients("den", den)
        checks.batch_shape({"num": self.num.shape[1:], "den": self.den.shape[1:]})
        part = of_polynomials(self.num[:, np.newaxis], self.den)
        if velocities is None:
            velocities = part.velocities
        super().__init__(part.A, part.B, part.C, part.D if part.D.any() else None, x=x, velocities=velocities)

    def repr_arguments(self) -> list[str]:
        """Its arguments, for its repr."""
        return [f"num={brief(self.num)}", f"den={brief(self.den)}"]


def series(first: Any, second: Any, *more: Any) -> LinearSystem:
    """Systems one after the other: the outputs of each are the inputs of the next.

    Args:
        first: a linear system, or a gain: a number, or an array over the batch. Its inputs x are those of the whole.
        second: likewise, without inputs x.
        more: likewise.

    Returns:
        The whole, whose states are those of the systems in their order. Common zeros and poles are not cancelled.

    Raises:
        ArgumentError: if the systems do not fit together, or another than the first has inputs of its own.

    Example:
        >>> filter = sw.series(2.0, sw.TransferFunction(1.0, [1.0, 1.0]), sw.TransferFunction(1.0, [0.1, 1.0]))
        >>> filter.A
        array([[ -1.,   0.],
               [  1., -10.]])
    """
    systems = _named(first, second, more)
    parts = _parts(systems)
    size = next((part.inputs for part in parts if part is not None), 1)
    whole: Realisation | None = None
    for (argument, each), part in zip(systems.items(), parts, strict=True):
        if part is None:
            size = size if whole is None else whole.outputs
            part = of_gain(argument, each, size, size)
        whole = part if whole is None else in_series(whole, part)
    assert whole is not None
    return joined(whole, "first, second")


def parallel(first: Any, second: Any, *more: Any) -> LinearSystem:
    """Systems side by side: they have the same inputs, and their outputs are added.

    Args:
        first: a linear system, or a gain: a number, or an array over the batch.
        second: likewise. One of them may have the inputs x.
        more: likewise.

    Returns:
        The whole, whose states are those of the systems in their order.

    Raises:
        ArgumentError: if the systems do not fit together, or have different inputs.

    Example:
        >>> pid = sw.parallel(2.0, sw.TransferFunction(0.5, [1.0, 0.0]), sw.TransferFunction([0.3, 0.0], [0.01, 1.0]))
        >>> pid.D
        array([[32.]])
    """
    systems = _named(first, second, more)
    parts = _parts(systems)
    like = next((part for part in parts if part is not None), None)
    r, m = (1, 1) if like is None else (like.outputs, like.inputs)
    whole: Realisation | None = None
    for (argument, each), part in zip(systems.items(), parts, strict=True):
        one = of_gain(argument, each, r, m) if part is None else part
        whole = one if whole is None else in_parallel(whole, one)
    assert whole is not None
    return joined(whole, "first, second")


def feedback(forward: Any, back: Any = 1.0, *, sign: int = -1) -> LinearSystem:
    """A closed loop: z = forward·(x + sign·back·z).

    Args:
        forward: a linear system or a gain, from the sum to the output z.
        back: a linear system or a gain, from the output back to the sum.
        sign: −1 for negative feedback, or +1.

    Returns:
        The loop, whose states are those of ``forward``, then those of ``back``, and whose input x is that of ``forward``.

    Raises:
        ArgumentError: if the systems do not fit together, or the output is not determined: 1 − sign·D₁·D₂ = 0.

    Example:
        >>> loop = sw.feedback(sw.TransferFunction(4.0, [1.0, 0.4, 0.0]))  # an oscillator, ω₀ = 2 and D = 0.1
        >>> loop.A
        array([[-0.4, -4. ],
               [ 1. ,  0. ]])
    """
    if checks.count("sign", sign, -1, 1) == 0:
        raise ArgumentError("sign: expected -1 or 1, got 0")
    one, other = _parts({"forward": forward, "back": back})
    r, m = (one.outputs, one.inputs) if one is not None else (other.inputs, other.outputs) if other is not None else (1, 1)
    one = of_gain("forward", forward, r, m) if one is None else one
    other = of_gain("back", back, m, r) if other is None else other
    return joined(fed_back(one, other, sign), "forward, back")


def _parts(systems: dict[str, Any]) -> list[Realisation | None]:
    """The matrices of each system by the name of its argument, None for a gain."""
    return [None if is_gain(each) else part_of(argument, each) for argument, each in systems.items()]


def _named(first: Any, second: Any, more: tuple[Any, ...]) -> dict[str, Any]:
    """Systems by the names of arguments."""
    return {"first": first, "second": second} | {f"more[{i}]": each for i, each in enumerate(more)}
