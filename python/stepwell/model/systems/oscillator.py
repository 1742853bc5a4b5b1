"""The oscillator (§3), also with friction that sticks (§8)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from ...base import checks
from ...base.arrays import Array, Shape
from ...errors import ArgumentError
from ...reference.systems.oscillator import Oscillator as Reference
from ..around import StickFriction
from ..inputs import Input, Pulse, as_input, signal
from .base import System, shown

if TYPE_CHECKING:
    from ...base.literals import OscillatorForm

FORMS: tuple[OscillatorForm, ...] = ("canonical", "physical")


class Oscillator(System):
    """ÿ + 2Dω₀ẏ + ω₀²y = ω₀²x(t) + a(t), Hoffmann's test case (§3), and less friction·sgn ẏ where that is given (§8).

    **v is ẏ/ω₀ unless ``form="physical"``**: that is Hoffmann's canonical form, whose phase diagram is a circle. There a
    start with the velocity u is ``v=u / omega``.

    Its energy is that of spring and motion per unit of mass, ½ẏ² + ½ω₀²y²; in canonical form divided by ω₀², ½(v² + y²). What
    damping, friction and inputs do to it is not in it.

    Args:
        omega: ω₀ in radians per unit of time, above zero; broadcasts over the batch. In physical form it may be zero: a block
            on a plane, without a spring.
        damping: damping ratio D, without a unit; broadcasts. None leaves the term out.
        x: input, the point to which the spring pulls: a number, an array over the batch, ``Sinusoid`` or ``Sampled``.
        a: acceleration by an external force, likewise.
        friction: deceleration by Coulomb's friction, μN/m, in units of length per unit of time squared, zero or more; broadcasts.
            It acts against the motion, and at rest against the other forces: where these are not larger, the mass sticks.
        drag: d/m of a viscous force −d·ẏ, in 1 per unit of time, in place of ``damping``: both name one term, 2Dω₀ = d/m.
        form: ``"canonical"``, where v is the velocity divided by ω₀ and the phase diagram is a circle, or ``"physical"``, where
            v is the velocity.

    Raises:
        ArgumentError: if an argument is wrong.

    Example:
        >>> block = sw.Oscillator(0.0, friction=0.5 * 9.81, form="physical")  # slides on a plane, μ = 0.5
        >>> run = sw.integrate(block, "false_euler", v=3.0, y=0.0, dt=1e-3, steps=1000)
        >>> round(float(run.y[-1]), 3)  # 3²/(2·0.5·9.81) = 0.917, but for the step
        0.916
    """

    kernel = "oscillator"
    unchanged: ClassVar[dict[str, float]] = {"damping": checks.ANY, "drag": checks.NOT_NEGATIVE, "x": checks.ANY, "a": checks.ANY}
    reference = Reference
    complex_step = True
    linear = True
    input_names = ("x", "a")

    # Defaults, so that arguments that are None need no assignment: five take as long as all checks.
    damping: Array | None = None
    drag: Array | None = None
    friction: Array | None = None
    x: Input | None = None
    a: Input | None = None

    def __init__(
        self,
        omega: Any = 1.0,
        damping: Any = None,
        *,
        x: Any = None,
        a: Any = None,
        friction: Any = None,
        drag: Any = None,
        form: OscillatorForm = "canonical",
    ) -> None:
        self.form = checks.known("form", form, FORMS)
        if self.form == "canonical":
            self.omega = checks.numbers("omega", omega, positive=True, unit="rad per unit of time")
        else:
            self.omega = checks.not_negative("omega", omega, "rad per unit of time")
        if damping is not None and drag is not None:
            raise ArgumentError("damping, drag: expected one of them, got both; they name one term, 2·damping·omega = drag")
        if damping is not None:
            self.damping = checks.numbers("damping", damping)
        if drag is not None:
            self.drag = checks.not_negative("drag", drag)
        if friction is not None:
            self.friction = checks.not_negative("friction", friction)
        if x is not None:
            self.x = as_input("x", x)
        if a is not None:
            self.a = as_input("a", a)
        shapes = {"omega": self.omega.shape}
        for name, term in (("damping", self.damping), ("drag", self.drag), ("friction", self.friction)):
            if term is not None:
                shapes[name] = term.shape
                self.velocity_term = name if self.velocity_term is None else f"{self.velocity_term} and {name}"
        for name, each in self.given_inputs().items():
            shapes[name] = each.batch
        self.batch = checks.batch_shape(shapes)
        if self.friction is not None:
            self.linear = self.complex_step = False
            limit = self.friction if self.form == "physical" else np.asarray(self.friction / self.omega)
            self.around = (StickFriction(limit),)

    def repr_arguments(self) -> list[str]:
        """Its arguments, for its repr."""
        terms = shown(omega=self.omega, damping=self.damping, x=self.x, a=self.a, friction=self.friction, drag=self.drag)
        return [*terms, f"form={self.form!r}"]

    def given_inputs(self) -> dict[str, Input]:
        """Its inputs by name, without those that are None."""
        if self.x is None and self.a is None:
            return {}
        return {name: each for name, each in (("x", self.x), ("a", self.a)) if each is not None}

    def direct(self) -> dict[str, tuple[str, float]]:
        """All but a friction that is divided by omega, and an omega that divides one."""
        physical = self.form == "physical"
        own = {"friction": ("friction.limit", checks.NOT_NEGATIVE)} if physical else {}
        omega = {"omega": ("omega", checks.NOT_NEGATIVE if physical else checks.POSITIVE)}
        return super().direct() | own | (omega if physical or self.friction is None else {})

    def equation_parameters(self, batch: Shape) -> dict[str, Any]:
        """The form, the parameters and the inputs."""
        inputs = {"x": signal(self.x), "a": signal(self.a)}
        return {"form": self.form, "omega": self.omega, "damping": self.damping, "drag": self.drag, **inputs}

    def without_inputs(self) -> Oscillator:
        """The oscillator without inputs."""
        return self._driven({})

    def with_pulse(self, name: str, values: Array, interval: float, start: float = 0.0) -> Oscillator:
        """The oscillator with these samples as its only input."""
        return self._driven({name: Pulse(values, interval, start)})

    def _driven(self, inputs: dict[str, Input]) -> Oscillator:
        terms: dict[str, Any] = {"drag": self.drag, "friction": self.friction, "form": self.form}
        return Oscillator(self.omega, self.damping, **terms | inputs)
