"""The pendulum."""

from __future__ import annotations

from typing import Any

import numpy as np

from .. import _checks
from .._checks import Array, Shape
from ..reference import trig
from ..reference.systems import pendulum as reference
from .base import Parameters, System, row, shown
from .inputs import Input, add_inputs, as_input


class Pendulum(System):
    """ÿ + 2Dω₀ẏ + ω₀²·sin y = a(t), a rod that swings or turns; y is its angle from below in radians and v the angular velocity.

    Args:
        omega: ω₀ of small swings in radians per unit of time, above zero: √(g/l); broadcasts over the batch.
        damping: damping ratio D of small swings, without a unit; broadcasts. None leaves the term out.
        a: angular acceleration from outside: a number, an array over the batch, ``Sinusoid`` or ``Sampled``.

    An angle is not brought back into one turn. The sine is that of the core up to 2⁵⁰ rad, and means nothing beyond.

    Raises:
        ArgumentError: what is wrong with which argument.
    """

    kernel = "pendulum"

    def __init__(self, omega: Any = 1.0, damping: Any = None, *, a: Any = None) -> None:
        self.omega = _checks.numbers("omega", omega, positive=True, unit="rad per unit of time")
        self.damping = None if damping is None else _checks.numbers("damping", damping)
        self.a = as_input("a", a)
        self.velocity_term = None if damping is None else "damping"
        self.batch = _checks.batch_shape(
            {"omega": self.omega.shape}
            | ({} if self.damping is None else {"damping": self.damping.shape})
            | ({} if self.a is None else {"a": self.a.batch})
        )

    def __repr__(self) -> str:
        return f"Pendulum({shown({'omega': self.omega, 'damping': self.damping, 'a': self.a})})"

    def given_inputs(self) -> dict[str, Input]:
        """The input that it was given, by name."""
        return {} if self.a is None else {"a": self.a}

    def scaled(self, h: float, batch: Shape) -> reference.Pendulum:
        """The NumPy reference, scaled to the step h."""
        return reference.Pendulum(h, self.omega, self.damping, None if self.a is None else self.a.signal())

    def parameters(self, batch: Shape) -> Parameters:
        """Options, rows and a table for the core, as ``pendulum.rs`` documents them."""
        damping = np.zeros((1, 1)) if self.damping is None else row(self.damping, batch)
        parameters = Parameters(["damped"] * (self.damping is not None), rows=[row(self.omega, batch), damping])
        add_inputs(parameters, self.given_inputs().values(), batch)
        return parameters

    def energy(self, v: Array, y: Array) -> Array:
        """Energy per moment of inertia, ½v² + ω₀²(1 − cos y), which is 0 at rest below."""
        half = trig.sin(0.5 * np.asarray(y))
        return np.asarray(0.5 * (v * v) + (2.0 * (self.omega * self.omega)) * (half * half))  # 1 − cos y loses digits near 0
