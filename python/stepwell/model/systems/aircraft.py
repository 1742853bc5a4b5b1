"""The rotation of an aircraft (Appendix E)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, cast

import numpy as np

from ...base import checks
from ...base.arrays import Array, Shape
from ...errors import ArgumentError, ShapeError
from ..controls import AnyControl, NormControl, Projection
from ..equations.trace import Equations
from ..inputs import Sampled, Sinusoid
from . import attitude
from .aircraft_equations import DAMPING, GAINS, INERTIA, euler, quaternion
from .base import System
from .own import OwnSystem

if TYPE_CHECKING:
    from ...base.literals import AttitudeForm

FORMS: tuple[AttitudeForm, ...] = ("euler", "quaternion")


class Aircraft(OwnSystem):
    """The rotation of a rigid aircraft with dampers, an attitude controller and torque commands (Appendix E).

    v is the angular velocity about the principal axes of the aircraft, in radians per unit of time. The signs are those of axes
    that point forward, to the left and up: a roll angle above zero lowers the right wing, and the aircraft then turns to the
    right, ψ̇ < 0; a pitch angle above zero lowers the nose. (Hoffmann displays φ, −θ and −ψ.) The torques are

    - T_x = −d_x·ω_x − g_x·(φ − ``roll``) + ``roll_torque``,
    - T_y = −d_y·ω_y − g_y·(θ − ``pitch``) + ``pitch_torque``,
    - T_z = −d_z·ω_z − g_z·sin φ·cos θ + ``yaw_torque``,

    with the dampers d and the gains g, in Euler's equations J·ω̇ = T − ω × J·ω. In T_x and T_y the angles are without whole turns,
    from −180° to 180°.

    In the form ``"euler"`` y is the roll, pitch and yaw angle φ, θ, ψ in degrees. False Euler with a step of 0.1 is then
    Hoffmann's program. The rates of φ and ψ are divided by cos θ, of which at least 10⁻⁵ is taken. So near θ = ±90°
    they are large, at most 10⁵·|ω|, and a step then sets φ and ψ to angles that mean nothing. Angles are not reduced to one turn;
    ``angles`` does that. From 2⁵⁰ rad on they have no sine, and a run diverges.

    In the form ``"quaternion"`` y is the quaternion of the same rotation, scalar first; it has no such place. The torques are
    the same while |θ| < 90°. Beyond, the controllers take other angles of this attitude, with θ from −90° to 90°. A method
    changes the quaternion's length; ``NormControl(k)`` and ``Projection("norm")`` keep it at 1.

    Args:
        form: ``"euler"`` or ``"quaternion"``.
        inertia: the principal moments of inertia J_x, J_y, J_z, above zero, shape (3, *batch).
        damping: d_x, d_y, d_z, in units of torque times time, shape (3, *batch).
        gains: g_x and g_y in torque per degree, g_z in torque, shape (3, *batch).
        roll: the commanded roll angle in degrees: a number, an array over the batch, ``Sinusoid`` or ``Sampled``.
        pitch: the commanded pitch angle in degrees, likewise.
        roll_torque: a torque about the first axis, likewise. None leaves the term out.
        pitch_torque: about the second axis.
        yaw_torque: about the third axis.
        controllers: whether the controllers of roll and pitch are on, Hoffmann's switch CO. Without them there are no
            commanded angles. The dampers and the yaw rate by the roll angle remain; ``damping=np.zeros(3)`` and
            ``gains=np.zeros(3)`` leave the aircraft to itself.

    Attributes:
        form: as given.
        controllers: as given.

    Raises:
        ArgumentError: if an argument is wrong.

    Example:
        >>> aircraft = sw.Aircraft(roll=30.0)
        >>> run = sw.integrate(aircraft, "false_euler", v=0.0, y=0.0, dt=0.1, steps=600)
        >>> run.y[-1][:2].round(3)
        array([27.177,  6.667])
    """

    axes = "components"

    def __init__(
        self,
        form: AttitudeForm = "euler",
        inertia: Any = (0.6, 1.0, 1.5),
        *,
        damping: Any = (2.0, 3.0, 1.0),
        gains: Any = (0.06, 0.10, 1.0),
        roll: Any = 0.0,
        pitch: Any = 0.0,
        roll_torque: Any = None,
        pitch_torque: Any = None,
        yaw_torque: Any = None,
        controllers: bool = True,
    ) -> None:
        self.form = checks.known("form", form, FORMS)
        self.controllers = checks.flag("controllers", controllers)
        values: dict[str, Any] = {
            "inertia": _of_axes("inertia", inertia, positive=True),
            "damping": _of_axes("damping", damping),
            "gains": _of_axes("gains", gains),
        }
        for name, angle in (("roll", roll), ("pitch", pitch)):
            command = _command(name, angle, "degrees")
            if self.controllers:
                values[name] = command
            elif not isinstance(command, np.ndarray) or command.any():
                raise ArgumentError(f"{name}: expected no commanded angle with controllers=False, got {checks.short(angle)}")
        for name, torque in (("roll_torque", roll_torque), ("pitch_torque", pitch_torque), ("yaw_torque", yaw_torque)):
            if torque is not None:
                values[name] = _command(name, torque, "units of torque")
        batches = {name: each.shape[1:] for name, each in values.items() if name in ("inertia", "damping", "gains")}
        batches |= {
            name: each.shape if isinstance(each, np.ndarray) else each.batch
            for name, each in values.items()
            if name not in batches
        }
        checks.batch_shape(batches)
        definition = euler if self.form == "euler" else quaternion
        super().__init__(definition, values)
        self.v_shape, self.y_shape = (3,), (3,) if self.form == "euler" else (4,)
        own = {name: np.shape(default) for name, default in definition.parameters.items()}
        in_time = {name: None for name, each in values.items() if isinstance(each, (Sinusoid, Sampled))}
        self.equations = Equations(definition, self.v_shape, self.y_shape, own | in_time)
        self.velocity_term = "forces that do"

    def __repr__(self) -> str:
        return System.__repr__(self)

    @property
    def kind_name(self) -> str:
        """The name of its kind of system."""
        return type(self).__name__

    @property
    def keeper(self) -> AnyControl | None:
        """The control or projection that acts on it, or None."""
        return super().keeper if self.kept is None else self.kept

    @property
    def torques_act(self) -> bool:
        """True if dampers, controllers or torques act, so that the energy is not constant."""
        values = self.parameters_given
        gains = values["gains"] if self.controllers else values["gains"][2]
        return bool(values["damping"].any() or gains.any() or any(name.endswith("torque") for name in values))

    def commanded(self, name: str, t: Any) -> Array:
        """A commanded angle at given times.

        Args:
            name: ``"roll"`` or ``"pitch"``.
            t: times, shape (times,).

        Returns:
            The angle in degrees, shape (times, *batch); NaN without controllers.

        Raises:
            ArgumentError: if an argument is wrong.
        """
        name, times = checks.known("name", name, ("roll", "pitch")), checks.numbers("t", t, unit="units of time")
        if times.ndim != 1:
            raise ShapeError(f"t: expected times along one axis, got shape {times.shape}")
        command = self.parameters_given.get(name, np.asarray(np.nan))
        if isinstance(command, np.ndarray):
            return np.broadcast_to(command, (*times.shape, *command.shape))
        signal = command.signal()
        if not len(times):
            return np.empty((0, *command.batch))
        return np.stack([np.broadcast_to(signal.at(each), command.batch) for each in times])

    def repr_arguments(self) -> list[str]:
        """Its arguments, for its repr, without those that have Hoffmann's values."""
        usual = {"inertia": INERTIA, "damping": DAMPING, "gains": GAINS, "roll": np.zeros(()), "pitch": np.zeros(())}
        arguments = [f"form={self.form!r}"]
        for name, value in self.parameters_given.items():
            if name in usual and isinstance(value, np.ndarray) and np.array_equal(value, usual[name]):
                continue
            short = isinstance(value, np.ndarray) and value.shape == (3,) and name in ("inertia", "damping", "gains")
            shape = f"array{value.shape}" if isinstance(value, np.ndarray) and value.ndim else value
            arguments.append(f"{name}={tuple(value.tolist()) if short else shape}")
        return arguments if self.controllers else [*arguments, "controllers=False"]

    def for_state_shapes(self, *states: Any) -> Aircraft:
        """Itself: its size is fixed."""
        return self

    def _fresh(self, arguments: dict[str, Any]) -> dict[str, Any]:
        """All parameters, with these in place of some, checked as for a new aircraft."""
        fresh = type(self)(self.form, controllers=self.controllers, **(self.parameters_given | arguments))
        return dict(fresh.parameters_given)

    def direct(self) -> dict[str, tuple[str, float]]:
        """All parameters that are numbers; those of inertia are above zero."""
        return super().direct() | {"inertia": ("inertia", checks.POSITIVE)}

    def equation_parameters(self, batch: Shape) -> dict[str, Any]:
        """The parameters, commands and inputs, and the strength of a control of the quaternion's length."""
        return super().equation_parameters(batch) | (
            {} if self.kept is None else {"strength": self.constraint_parameters()["strength"]}
        )

    # ---- controls of the quaternion's length

    def controlled(self, control: Any, v: Array, y: Array, dt: float) -> Aircraft:
        """The aircraft under a control, whose target is the value of the state, or 1 for the length of a quaternion."""
        if self.keeps(control):
            return self._with_constraint_control(control)
        return cast("Aircraft", super().controlled(_of_length_one(control), v, y, dt))

    def under(self, control: Any, batch: Shape) -> Aircraft:
        """The aircraft under a control, for unknown states of that batch shape."""
        if self.keeps(control):
            return self._with_constraint_control(control)
        return cast("Aircraft", super().under(_of_length_one(control), batch))

    def keeps(self, control: Any) -> bool:
        """True if a control acts on the quaternion's length through the rates; a projection is that of an invariant."""
        return self.form == "quaternion" and isinstance(control, NormControl)

    def _with_constraint_control(self, control: Any) -> Aircraft:
        controlled = super()._with_constraint_control(control)
        controlled._core, controlled._single = None, {}  # its rates have another term
        return controlled

    # ---- attitudes

    def attitude(self, roll: Any = 0.0, pitch: Any = 0.0, yaw: Any = 0.0) -> Array:
        """The coordinates y of an attitude, for the start of a run.

        Args:
            roll: the roll angle φ in degrees; a number or an array over the batch.
            pitch: the pitch angle θ in degrees, likewise.
            yaw: the yaw angle ψ in degrees, likewise.

        Returns:
            The angles, shape (3, *batch), or the quaternion of length 1, shape (4, *batch).

        Raises:
            ArgumentError: if an argument is wrong.

        Example:
            >>> sw.Aircraft("quaternion").attitude(pitch=180.0).round(3)
            array([0., 0., 1., 0.])
        """
        arguments = {"roll": roll, "pitch": pitch, "yaw": yaw}
        angles = {name: checks.numbers(name, angle, unit="degrees") for name, angle in arguments.items()}
        batch = checks.batch_shape({name: angle.shape for name, angle in angles.items()})
        checks.fits("roll, pitch, yaw: the attitudes", 16, batch, "ask for fewer")
        block = np.stack([np.broadcast_to(angle, batch) for angle in angles.values()])
        return block if self.form == "euler" else attitude.quaternion_of_angles(attitude.wrapped(block))

    def angles(self, y: Any, axis: int = 0) -> Array:
        """Roll, pitch and yaw angle of coordinates, in degrees.

        Args:
            y: coordinates, such as ``run.y``.
            axis: along which of their axes the numbers of a state lie: 1 for ``run.y``, 0 for a state.

        Returns:
            Angles from −180 to 180 in place of the numbers of a state. Those of a quaternion have the pitch from −90 to 90.

        Raises:
            ArgumentError: if an argument is wrong.

        Example:
            >>> roll, pitch, yaw = aircraft.angles(run.y[-1])
        """
        block, axis = self._block(y, axis)
        with np.errstate(all="ignore"):
            if self.form == "euler":
                angles = attitude.wrapped(block)
            else:
                angles = attitude.angles_of_rotation(attitude.rotation_of_quaternion(block))
        return np.moveaxis(angles, 0, axis)

    def rotation(self, y: Any, axis: int = 0) -> Array:
        """The rotation matrix from the aircraft to space, R = R_z(ψ)·R_y(θ)·R_x(φ), of the coordinates themselves.

        Hoffmann computes it from the sines before the step, so its picture is a step late.

        Args:
            y: coordinates, such as ``run.y``.
            axis: along which of their axes the numbers of a state lie: 1 for ``run.y``, 0 for a state.

        Returns:
            Matrices along the first two axes, shape (3, 3, *other axes of y). Their columns are the axes of the aircraft, which
            point forward, to the left and up.

        Raises:
            ArgumentError: if an argument is wrong.
        """
        block, _ = self._block(y, axis)
        with np.errstate(all="ignore"):
            return attitude.rotation_of_angles(block) if self.form == "euler" else attitude.rotation_of_quaternion(block)

    def _block(self, y: Any, axis: int) -> tuple[Array, int]:
        """Coordinates with the numbers of a state first, and the axis along which they lay."""
        block = checks.numbers("y", y, finite=False)
        axis = checks.count("axis", axis, 0)
        (size,) = self.y_shape
        if axis >= block.ndim or block.shape[axis] != size:
            raise ShapeError(f"y: expected {size} numbers along axis {axis}, got shape {block.shape}")
        checks.fits("y: the angles", 24, (block.size // size,), "ask for fewer")
        return np.moveaxis(block, axis, 0), axis


def _of_axes(name: str, value: Any, *, positive: bool = False) -> Array:
    """A number for each of the three axes, and those of a batch after them."""
    array = checks.numbers(name, value, positive=positive)
    if array.ndim == 0 or len(array) != 3:
        raise ShapeError(f"{name}: expected three numbers along the first axis, got shape {array.shape}")
    return array


def _command(name: str, value: Any, unit: str) -> Any:
    """A number, an array over the batch, or an input."""
    return value if isinstance(value, (Sinusoid, Sampled)) else checks.numbers(name, value, unit=unit)


def _of_length_one(control: Any) -> Any:
    """The control; a projection of the quaternion's length without a target has the target 1, not the length at the start."""
    if isinstance(control, Projection) and control.way == "norm" and control.target is None:
        return Projection("norm", target=1.0)
    return control
