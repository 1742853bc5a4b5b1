"""The pendulum."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from ...base import checks
from ...base.arrays import Array, Shape
from ...reference.systems.pendulum import Pendulum as Reference
from ..inputs import LAST_ANGLE, LAST_SINGLE_ANGLE, Input, as_input, signal
from .base import System, shown


class Pendulum(System):
    """ÿ + 2Dω₀ẏ + ω₀²·sin y = a(t), a rod that swings or turns; y is its angle in rad, 0 hanging down, v its angular velocity.

    Args:
        omega: ω₀ of small swings in radians per unit of time, above zero: √(g/l); broadcasts over the batch.
        damping: damping ratio D of small swings, without a unit; broadcasts. None leaves the term out.
        a: external angular acceleration: a number, an array over the batch, ``Sinusoid`` or ``Sampled``.

    Its energy, per moment of inertia, is ½v² + ω₀²(1 − cos y), which is 0 at rest hanging down.

    The angle is not reduced to one turn. Its sine is accurate up to 2⁵⁰ rad and meaningless beyond;
    a run that saves such an angle gives an ``AccuracyWarning``.

    Raises:
        ArgumentError: if an argument is wrong.

    Example:
        >>> run = sw.integrate(sw.Pendulum(), "rk4", v=0.0, y=np.radians([10.0, 170.0]), dt=0.01, steps=740)
        >>> np.degrees(run.y[-1]).round(1)
        array([   4.5, -169.7])
    """

    kernel = "pendulum"
    unchanged: ClassVar[dict[str, float]] = {"omega": checks.POSITIVE, "damping": checks.ANY, "a": checks.ANY}
    reference = Reference
    complex_step = True

    def __init__(self, omega: Any = 1.0, damping: Any = None, *, a: Any = None) -> None:
        self.omega = checks.numbers("omega", omega, positive=True, unit="rad per unit of time")
        self.damping = None if damping is None else checks.numbers("damping", damping)
        self.a = as_input("a", a)
        self.velocity_term = None if damping is None else "damping"
        self.batch = checks.batch_shape(
            {"omega": self.omega.shape}
            | ({} if self.damping is None else {"damping": self.damping.shape})
            | ({} if self.a is None else {"a": self.a.batch})
        )

    def repr_arguments(self) -> list[str]:
        """Its arguments, for its repr."""
        return shown(omega=self.omega, damping=self.damping, a=self.a)

    def given_inputs(self) -> dict[str, Input]:
        """Its input by name, if it has one."""
        return {} if self.a is None else {"a": self.a}

    def equation_parameters(self, batch: Shape) -> dict[str, Any]:
        """The parameters and the input."""
        return {"omega": self.omega, "damping": self.damping, "a": signal(self.a)}

    def doubt(self, y: Array) -> tuple[str, Any] | None:
        """A message if an angle is too large for its sine to be known."""
        last = LAST_SINGLE_ANGLE if y.dtype == np.float32 else LAST_ANGLE
        with np.errstate(invalid="ignore"):
            beyond = np.isfinite(y) & (np.abs(y) > last)
        if not beyond.any():
            return None
        largest = np.abs(y[beyond]).max()
        return f"an angle grew to {largest:.3g} rad, and beyond {last:.3g} rad its sine means nothing", beyond.any(axis=0)
