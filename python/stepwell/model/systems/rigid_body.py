"""The rigid body that turns in space."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from ...base import checks
from ...base.arrays import Array, Shape
from ...errors import ArgumentError, ShapeError
from ...reference.systems import rigid_body as reference
from ..inputs import Input, as_input, signal
from ..parameters import aligned
from .base import System, shown

#: A moment may exceed the sum of the others by this share of the sum, since in a flat body both are equal but for rounding.
FLAT_SLACK = 1e-12

#: No step keeps the length of a quaternion, and the attitude does not depend on it; a shorter one is told before it vanishes. One
#: that became very long is told as growth.
LEAST_LENGTH = 1e-3

AXES = 3


class RigidBody(System):
    """A rigid body that turns about its centre of mass or about a fixed point (§12): J·ω̇ = τ − ω × J·ω − d·ω, q̇ = ½·q ⊗ (0, ω).

    v is the angular velocity ω along the body's principal axes, shape (3,), in rad per unit of time. y is the quaternion q of
    the attitude, shape (4,), scalar first: (1, 0, 0, 0) is no turn at all, and (cos ½φ, n·sin ½φ) a turn by φ about the unit
    vector n. It takes a vector along body axes to one along the axes of space; ``stepwell.quaternion`` has its matrix.

    q should have the length 1. ``control=NormControl(k)`` adds k·(1 − q·q)·q to q̇, and ``control=Projection("norm")`` divides q
    by its length after every step. Without either the length drifts, and nothing else is wrong: the matrix of rotation is that
    of q/|q|, whatever the length.

    Its energy is ½·ω·J·ω, and the height of ``centre`` above the fixed point times ``weight``.

    Args:
        inertia: the three principal moments of inertia, above zero and none above the sum of the others, shape (3,) or
            (3, *batch); for ``weight`` those about the fixed point. Products of inertia are not provided for: turn the body
            axes to the principal ones.
        torque: torques along the body's axes, three of them: each a number, an array over the batch, ``Sinusoid``,
            ``Sampled``, or None for zero; an array of shape (3,) or (3, *batch) is three of them.
        space_torque: torques along the axes of space, likewise.
        damping: d, a torque per angular velocity, one number for all axes, or shape (3,) or (3, *batch). None leaves the term
            out.
        weight: a force down the third axis of space that acts at ``centre``, such as m·g: a heavy top. Broadcasts over the batch.
        centre: where it acts, from the fixed point along body axes, shape (3,) or (3, *batch).

    Attributes:
        quantities: ``"energy"``, ``"angular_momentum"``, along the axes of space, and ``"norm_error"``, q·q − 1, can be recorded.

    Raises:
        ArgumentError: if an argument is wrong.

    Example:
        >>> top = sw.RigidBody([1.0, 2.0, 3.0])
        >>> run = sw.integrate(top, "rk4", v=[0.01, 1.0, 0.01], y=[1.0, 0.0, 0.0, 0.0], dt=0.01, steps=1000)
    """

    kernel = "rigid_body"
    unchanged: ClassVar[dict[str, float]] = {"damping": checks.ANY, "weight": checks.ANY, "centre": checks.ANY}
    reference = reference.RigidBody
    complex_step = True
    constraint = "norm"
    axes = "body axes, or parts of the quaternion, scalar first"
    v_shape = (3,)
    y_shape = (4,)
    second_order = False
    velocity_term = "the gyroscopic torque"

    def __init__(
        self,
        inertia: Any,
        torque: Any = None,
        space_torque: Any = None,
        damping: Any = None,
        *,
        weight: Any = None,
        centre: Any = None,
    ) -> None:
        self.inertia = _vector("inertia", checks.numbers("inertia", inertia, positive=True))
        _possible(self.inertia)
        self.torque = _torques("torque", torque)
        self.space_torque = _torques("space_torque", space_torque)
        self.damping = None
        if damping is not None:
            damping = checks.numbers("damping", damping)
            self.damping = np.broadcast_to(damping, (AXES,)) if damping.ndim == 0 else _vector("damping", damping)
        if (weight is None) != (centre is None):
            raise ArgumentError(f"weight, centre: expected both or neither, got {'centre' if weight is None else 'weight'} alone")
        self.weight = None if weight is None else checks.numbers("weight", weight)
        self.centre = None if centre is None else _vector("centre", checks.numbers("centre", centre))
        vectors = {"inertia": self.inertia, "damping": self.damping, "centre": self.centre}
        self.batch = checks.batch_shape(
            {name: each.shape[1:] for name, each in vectors.items() if each is not None}
            | {name: each.batch for name, each in self.given_inputs().items()}
            | ({} if self.weight is None else {"weight": self.weight.shape})
        )

    def repr_arguments(self) -> list[str]:
        """Its arguments, for its repr."""
        inertia = self.inertia.tolist() if self.inertia.ndim == 1 else self.inertia
        centre = None if self.centre is None else self.centre.tolist() if self.centre.ndim == 1 else self.centre
        damping = self.damping
        if damping is not None and damping.ndim == 1:
            damping = damping[0] if (damping == damping[0]).all() else damping.tolist()
        arguments = shown(inertia=inertia, **self.given_inputs(), damping=damping, weight=self.weight, centre=centre)
        return [each.removeprefix("inertia=") for each in arguments]

    def given_inputs(self) -> dict[str, Input]:
        """Its torques by name, without those that are None."""
        return {
            f"{name}[{i}]": each
            for name, three in (("torque", self.torque), ("space_torque", self.space_torque))
            for i, each in enumerate(three or ())
            if each is not None
        }

    def equation_parameters(self, batch: Shape) -> dict[str, Any]:
        """The moments, damping, torques and weight, and the control of the norm."""
        vectors = {"inertia": self.inertia, "damping": self.damping, "centre": self.centre}
        inertia, damping, centre = (None if each is None else aligned(each, 1, batch) for each in vectors.values())
        torque, space_torque = (
            None if three is None else [signal(each) for each in three] for three in (self.torque, self.space_torque)
        )
        parameters = {"inertia": inertia, "damping": damping, "torque": torque, "space_torque": space_torque}
        return parameters | {"weight": self.weight, "centre": centre} | self.constraint_parameters()

    @property
    def torques_act(self) -> bool:
        """True if torques or damping act, so that the energy may change; the energy of a weight is included in it."""
        return bool(self.given_inputs()) or (self.damping is not None and bool((self.damping != 0.0).any()))

    def doubt(self, y: Array) -> tuple[str, Any] | None:
        """A message if a quaternion is zero, or very short in the first or last of these states."""
        zero = (y == 0.0).all(axis=1)
        if zero.any():
            return "a quaternion is zero, which is no attitude", zero.any(axis=0)
        with np.errstate(all="ignore"):
            length = np.sqrt((y[[0, -1]] ** 2).sum(axis=1))
            wrong = length < LEAST_LENGTH
        if not wrong.any():
            return None
        text = (
            f"a quaternion has the length {length[wrong][0]:.3g} in place of 1, which many long steps make of it if it is not "
            f'kept; control=NormControl(1.0) or Projection("norm") keeps it'
        )
        return text, wrong.any(axis=0)


def _vector(argument: str, numbers: Array) -> Array:
    """A number for each axis along the first axis."""
    if numbers.ndim == 0 or len(numbers) != AXES:
        raise ShapeError(f"{argument}: expected three numbers along the first axis, one for each, got shape {numbers.shape}")
    return numbers


def _possible(inertia: Array) -> None:
    """Raise if no body can have these moments: as J₁ = Σ m·(y² + z²), and so on, none is above the sum of the others."""
    with np.errstate(over="ignore"):
        others = np.stack([inertia[1] + inertia[2], inertia[2] + inertia[0], inertia[0] + inertia[1]])
    wrong = inertia > others * (1.0 + FLAT_SLACK)
    if wrong.any():
        each, most = inertia[wrong][0], others[wrong][0]
        raise ArgumentError(
            f"inertia: expected principal moments of which none is above the sum of the other two, got {each:g} above {most:g}"
        )


def _torques(argument: str, value: Any) -> tuple[Input | None, ...] | None:
    """An input or None for each axis; None if there is none at all."""
    if value is None:
        return None
    several = isinstance(value, (list, tuple)) or (isinstance(value, np.ndarray) and value.ndim > 0)
    if not several or len(value) != AXES:
        got = f"{len(value)}" if several else f"one {type(value).__name__}"
        raise ShapeError(f"{argument}: expected a sequence of three torques, one for each axis, got {got}")
    torques = tuple(as_input(f"{argument}[{i}]", each) for i, each in enumerate(value))
    return None if all(each is None for each in torques) else torques
