"""The linear oscillator (§3)."""

from __future__ import annotations

from typing import Any

from .. import _checks
from .._checks import Array, Shape
from ..reference.systems.oscillator import Oscillator as Reference
from .base import System, shown
from .inputs import Input, Sampled, as_input, signal

FORMS = ("canonical", "physical")


class Oscillator(System):
    """ÿ + 2Dω₀ẏ + ω₀²y = ω₀²x(t) + a(t), the document's test case (§3).

    Args:
        omega: ω₀ in radians per unit of time, above zero; broadcasts over the batch.
        damping: damping ratio D, without a unit; broadcasts. None leaves the term out.
        x: input, the point to which the spring pulls: a number, an array over the batch, ``Sinusoid`` or ``Sampled``.
        a: acceleration by an external force, likewise.
        form: ``"canonical"``, where v is the velocity divided by ω₀ and the phase diagram is a circle, or ``"physical"``, where
            v is the velocity.

    Raises:
        ArgumentError: what is wrong with which argument.
    """

    kernel = "oscillator"
    reference = Reference
    complex_step = True
    linear = True
    input_names = ("x", "a")

    def __init__(self, omega: Any = 1.0, damping: Any = None, *, x: Any = None, a: Any = None, form: str = "canonical") -> None:
        self.omega = _checks.numbers("omega", omega, positive=True, unit="rad per unit of time")
        self.damping = None if damping is None else _checks.numbers("damping", damping)
        self.x = as_input("x", x)
        self.a = as_input("a", a)
        self.form = _checks.known("form", form, FORMS)
        self.velocity_term = None if damping is None else "damping"
        self.batch = _checks.batch_shape(
            {"omega": self.omega.shape}
            | ({} if self.damping is None else {"damping": self.damping.shape})
            | {name: given.batch for name, given in self.given_inputs().items()}
        )

    def said(self) -> list[str]:
        """Its arguments, for its repr."""
        return [*shown(omega=self.omega, damping=self.damping, x=self.x, a=self.a), f"form={self.form!r}"]

    def given_inputs(self) -> dict[str, Input]:
        """Its inputs by name, without those that were not given."""
        if self.x is None and self.a is None:
            return {}
        return {name: given for name, given in (("x", self.x), ("a", self.a)) if given is not None}

    def given(self, batch: Shape) -> dict[str, Any]:
        """Form, parameters, inputs."""
        inputs = {"x": signal(self.x), "a": signal(self.a)}
        return {"form": self.form, "omega": self.omega, "damping": self.damping} | inputs

    def energy(self, v: Array, y: Array) -> Array:
        """Energy per unit of mass of spring and motion, ½ẏ² + ½ω₀²y²; in canonical form divided by ω₀², ½(v² + y²)."""
        if self.form == "canonical":
            return 0.5 * (v * v + y * y)
        return 0.5 * (v * v + (self.omega * self.omega) * (y * y))

    def without_inputs(self) -> Oscillator:
        """The same oscillator without inputs."""
        return Oscillator(self.omega, self.damping, form=self.form)

    def with_pulse(self, name: str, values: Array, interval: float) -> Oscillator:
        """The same oscillator with these samples as its only input."""
        pulse: dict[str, Any] = {name: Sampled(values, interval)}
        return Oscillator(self.omega, self.damping, form=self.form, **pulse)
