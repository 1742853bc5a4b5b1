"""Control terms, which keep quantities that should be constant from drifting (§12, Appendix D)."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from ..base import checks
from ..base.arrays import Array, Shape
from ..base.immutable import Immutable, ValueEquality, changed
from ..errors import ArgumentError, DTypeError
from ..reference import control as reference
from .around import Part

if TYPE_CHECKING:
    from ..base.literals import ControlForm

FORMS: tuple[ControlForm, ...] = ("limited", "printed")


class OfEnergy(Part):
    """The base class of parts that keep the energy of a system constant."""

    kind = "control"

    @property
    def keeps_energy(self) -> bool:
        """Always, since that is its purpose."""
        return True

    def repr_arguments(self) -> list[str]:
        """None, because the repr of a system shows its control last."""
        return []


class EnergyControl(OfEnergy):
    """Keeps the energy E near a target by a push −C·(E − target)·v on every velocity.

    It pushes in every stage of a method; with PEFRL, in whose stages v and y belong to different times, after every step. A run
    with a tolerance needs ``gain``, since ``relative`` refers to steps of fixed length.

    In Hoffmann's form (Appendix D) a step multiplies velocities by 1 − h·C·ΔE. This overflows where h·C·K passes 1; K is the
    kinetic energy, which is not bounded at close encounters. The limited form integrates the decay of ΔE by backward Euler
    instead, and scales velocities by a factor between ½ and 2: it agrees to first order and stays finite.

    Args:
        gain: C, in 1 per energy and unit of time; broadcasts over the batch.
        form: ``"limited"`` or ``"printed"``.
        relative: in place of C, the dimensionless h·C·K at the start: a step removes twice that fraction of ΔE. Broadcasts.
        target: the energy to keep; that of the start if None. Broadcasts.

    Raises:
        ArgumentError: if an argument is wrong.

    Example:
        >>> bodies = sw.scenes.energy_control()
        >>> run = bodies.run("standard_euler", steps=300, control=sw.EnergyControl(0.3))
        >>> bool(run.work < 0.0)
        True
    """

    def __init__(self, gain: Any = None, form: ControlForm = "limited", *, relative: Any = None, target: Any = None) -> None:
        if (gain is None) == (relative is None):
            raise ArgumentError("gain, relative: expected one of them, got " + ("neither" if gain is None else "both"))
        self.form = checks.known("form", form, FORMS)
        self.gain = None if gain is None else checks.not_negative("gain", gain)
        self.relative = None if relative is None else checks.not_negative("relative", relative)
        self.target = None if target is None else checks.numbers("target", target)
        #: True if it pushes between steps: ``integrate`` sets it for methods in whose stages v and y belong to different times.
        self.between = False

    @property
    def batch(self) -> Shape:
        """The shape to which its numbers broadcast."""
        numbers = {"gain": self.gain, "relative": self.relative, "target": self.target}
        return checks.batch_shape({name: each.shape for name, each in numbers.items() if each is not None})

    def __repr__(self) -> str:
        strength = f"gain={self.gain}" if self.relative is None else f"relative={self.relative}"
        return f"EnergyControl({strength}, form={self.form!r})"

    def aimed(self, kinetic: Array, energy: Array, dt: float) -> EnergyControl:
        """The control with numbers for its gain and its target, from the energies at the start."""
        gain = self.gain
        if gain is None:
            if not (kinetic > 0).all():
                raise ArgumentError("relative: a start at rest has no kinetic energy to relate the gain to; give gain")
            gain = np.asarray(np.asarray(self.relative) / (dt * kinetic))
        return changed(self, gain=gain, target=np.asarray(energy) if self.target is None else self.target)

    def overshoots(self, dt: float, kinetic: Callable[[], Array]) -> tuple[str, Any] | None:
        """A warning if h·C·K is 1 or more at the start in the printed form, with the members concerned; or None."""
        if self.form != "printed" or self.gain is None:
            return None
        strength = dt * self.gain * kinetic()
        if not (largest := np.max(strength)) >= 1.0:
            return None
        text = (
            f"gain: h·C·K = {largest:.3g} at the start, expected below 1: the printed form overshoots and may overflow; "
            f'use a smaller gain or step, or form="limited"'
        )
        return text, strength >= 1.0

    def parameters(self, y_shape: Shape, batch: Shape) -> dict[str, Any]:
        """Its form, whether it acts between steps, its gain and its target."""
        numbers = {"control.gain": np.asarray(self.gain), "control.target": np.asarray(self.target)}
        words = {"control": "energy", "control.form": self.form} | ({"control.when": "between"} if self.between else {})
        return words | numbers

    def wrap(self, s: Any, h: Any, parameters: dict[str, Any]) -> reference.Controlled:
        """The system with the push."""
        gain, target = parameters["control.gain"], parameters["control.target"]
        return reference.Controlled(s, h, self.form, gain, target, between=self.between)


class Control(Immutable, ValueEquality):
    """Keeps an invariant I of a system near a target, by a push −gain·(I − target)·∇I/|∇I|² on both rates in every stage.

    The error of the invariant then decays as exp(−gain·t) (Baumgarte 1972). ∇I is derived from the operations of the invariant.
    Where it is zero, there is no push.

    Args:
        invariant: its name; see ``Definition.invariant``.
        gain: in 1 per unit of time, zero or more; broadcasts over the batch.
        form: ``"limited"`` uses gain/(1 + h·gain), as backward Euler would, which never overshoots; ``"printed"`` uses gain
            itself, and overshoots where h·gain is above 1. With adaptive steps the first depends on their lengths.
        target: the value to keep; that of the start if None. Broadcasts.

    Raises:
        ArgumentError: if an argument is wrong.

    Example:
        >>> @sw.system
        ... def pendulum(t, v, y):
        ...     return -np.sin(y)
        >>> @pendulum.invariant
        ... def energy(v, y):
        ...     return 0.5 * v * v - np.cos(y)
        >>> control = sw.Control("energy", 1.0)
        >>> run = sw.integrate(pendulum, "standard_euler", v=0.0, y=1.0, dt=0.01, steps=1000, control=control)
        >>> run.system.keeper.gain
        array(1.)
    """

    def __init__(self, invariant: str, gain: Any, form: ControlForm = "limited", *, target: Any = None) -> None:
        if not isinstance(invariant, str):
            raise DTypeError(f"invariant: expected a name, got {type(invariant).__name__}")
        self.invariant = invariant
        self.gain = checks.not_negative("gain", gain)
        self.form = checks.known("form", form, FORMS)
        self.target = None if target is None else checks.numbers("target", target)

    @property
    def batch(self) -> Shape:
        """The shape to which its numbers broadcast."""
        return checks.batch_shape({"gain": self.gain.shape} | ({} if self.target is None else {"target": self.target.shape}))

    def __repr__(self) -> str:
        return f"Control({self.invariant!r}, gain={self.gain}, form={self.form!r})"

    def aimed(self, kinetic: Array, value: Array, dt: float) -> Control:
        """The control with a number for its target."""
        return self if self.target is not None else changed(self, target=np.asarray(value))

    def overshoots(self, dt: float, kinetic: Callable[[], Array]) -> tuple[str, Any] | None:
        """A warning if h·gain is 1 or more in the printed form, with the members concerned; or None."""
        strength = dt * self.gain
        if self.form != "printed" or not (largest := np.max(strength)) >= 1.0:
            return None
        text = (
            f"gain: h·gain = {largest:.3g}, expected below 1: the printed form overshoots and may overflow; use a smaller "
            f'gain or step, or form="limited"'
        )
        return text, strength >= 1.0

    def own_parameters(self) -> dict[str, Any]:
        """Its parameters, which are among those of the equations, because it is a part of the rates."""
        return {"control.gain": self.gain, "control.target": np.asarray(self.target)}


class ConstraintControl(Immutable, ValueEquality):
    """The base class of controls of a system's own constraint; the system has the equations.

    Attributes:
        constraint: the name of the constraint, as in ``System.constraint``.
        of_a_step: whether its strength is relative to a step of fixed length, so that adaptive steps refuse it.
        strength: its strength, which broadcasts over the batch.
    """

    constraint: ClassVar[str]
    of_a_step: ClassVar[bool] = False
    strength: Array

    @property
    def batch(self) -> Shape:
        """The shape of its strength."""
        return self.strength.shape

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.strength})"


class LengthControl(ConstraintControl):
    """Returns the rods of a system to their lengths, as critically damped springs would (§12; Baumgarte 1972).

    In place of C̈ = 0 the constraint of a rod, C = ½(r·r − l²), obeys C̈ + 2αĊ + β²C = 0 with α = β = c/h. C is then an oscillator
    with Φ = c, so c has the stability limit of the method for a critically damped oscillator, whatever the step.

    Args:
        c: α·h = β·h, without a unit, zero or more; broadcasts over the batch.

    Raises:
        ArgumentError: what is wrong with ``c``.

    Example:
        >>> rods = sw.scenes.double_pendulum()
        >>> run = rods.run("rk4", steps=100, control=sw.LengthControl(0.5))
        >>> run.system.keeper
        LengthControl(0.5)
    """

    constraint = "length"
    of_a_step = True

    def __init__(self, c: Any) -> None:
        self.strength = checks.not_negative("c", c)


class NormControl(ConstraintControl):
    """Returns a quaternion q to the length 1 by a rate k·(1 − q·q)·q (§12).

    q·q − 1 decays as exp(−2kt), so h·k must stay below 1 for methods of the Euler family.

    Args:
        k: in 1 per unit of time, zero or more; broadcasts over the batch.

    Raises:
        ArgumentError: what is wrong with ``k``.

    Example:
        >>> body = sw.scenes.dzhanibekov()
        >>> run = body.run("rk4", steps=100, control=sw.NormControl(0.5))
        >>> float(round(np.linalg.norm(run.y[-1]), 6))
        0.999947
    """

    constraint = "norm"

    def __init__(self, k: Any) -> None:
        self.strength = checks.not_negative("k", k)


WAYS = ("scaling", "nacozy")


class Projection(OfEnergy):
    """Projects the state back to the target energy, or to that of another invariant, after every step.

    ``"scaling"`` multiplies all velocities by one factor, between ½ and 2. ``"nacozy"`` makes the smallest change of the state
    that suffices to first order: along the gradient of the energy, in velocities and coordinates (Nacozy 1971). The name of an
    invariant of a system of your own does the same for that invariant. ``"length"`` returns rods to their lengths, and ``"norm"``
    a quaternion to the length 1.

    Args:
        way: ``"scaling"``, ``"nacozy"``, the name of an invariant, or the constraint of a system.
        target: the energy to keep; that of the start if None. Broadcasts over the batch.

    Raises:
        ArgumentError: if an argument is wrong.

    Example:
        >>> bodies = sw.scenes.energy_control()
        >>> run = bodies.run("standard_euler", steps=300, every=300, control=sw.Projection("scaling"))
        >>> bool(abs(run.energy[-1] - run.energy[0]) < 1e-12)
        True
    """

    def __init__(self, way: str = "scaling", *, target: Any = None) -> None:
        own = isinstance(way, str) and way.isidentifier()
        self.way = way if own else checks.known("way", way, WAYS)
        #: The name of the invariant, in a system of own equations.
        self.invariant = "energy" if self.way in WAYS else self.way
        self.target = None if target is None else checks.numbers("target", target)

    acts_on_rates = False

    @property
    def batch(self) -> Shape:
        """The shape of its target."""
        return () if self.target is None else self.target.shape

    def __repr__(self) -> str:
        return f"Projection({self.way!r})"

    def aimed(self, kinetic: Array, energy: Array, dt: float) -> Projection:
        """The projection with a number for its target."""
        return self if self.target is not None else changed(self, target=np.asarray(energy))

    def parameters(self, y_shape: Shape, batch: Shape) -> dict[str, Any]:
        """Its way and its target."""
        return {"control": "projection", "control.way": self._known_way, "control.target": np.asarray(self.target)}

    def wrap(self, s: Any, h: Any, parameters: dict[str, Any]) -> reference.Projected:
        """The system with projection after every step."""
        return reference.Projected(s, h, self._known_way, parameters["control.target"])

    @property
    def _known_way(self) -> str:
        """The way of the core, which projects onto an invariant as ``"nacozy"`` does, along the gradient."""
        return self.way if self.way in WAYS else "nacozy"


AnyControl = EnergyControl | Projection | Control | ConstraintControl


def a_control(value: Any) -> Any:
    """Return the argument ``control`` if it is a control or None; it may have been read from a file of arrays."""
    if isinstance(value, np.ndarray) and value.ndim == 0 and value.dtype.kind == "O":
        value = value.item()
    if value is not None and not isinstance(value, (EnergyControl, Projection, Control, ConstraintControl)):
        raise DTypeError(
            f"control: expected an EnergyControl, a LengthControl, a NormControl, a Control or a Projection, got "
            f"{type(value).__name__}"
        )
    return value
