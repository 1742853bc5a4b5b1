"""A free body with two equal moments of inertia: it spins, and wobbles."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ...base.arrays import Array
from ...base.checks import number
from ...base.immutable import ValueEquality
from ...errors import ArgumentError
from ...model import quaternion
from ...model.systems import RigidBody
from ..base import Scene
from ..ranges import within


class Wobble(ValueEquality):
    """Both blocks of a free body of moments (1, 1, C) as functions of time: the sum of two steady turns.

    In the body ω turns about the third axis at (C − 1)·ω₃; in space that axis turns about the angular momentum at |L|.

    Args:
        axial: C.
        v: ω at the start.
        q: the attitude at the start.
    """

    def __init__(self, axial: float, v: tuple[float, ...], q: tuple[float, ...]) -> None:
        self.axial, self.v, self.q = axial, v, q

    def __call__(self, t: Array) -> tuple[Array, Array]:
        """Both blocks at these times."""
        t = np.asarray(t, dtype=np.float64)
        w, momentum = np.array(self.v), np.array(self.v) * [1.0, 1.0, self.axial]
        length = math.sqrt(float((momentum * momentum).sum()))
        back = (self.axial - 1.0) * w[2]
        cosine, sine = np.cos(back * t), np.sin(back * t)
        v = np.stack([w[0] * cosine - w[1] * sine, w[1] * cosine + w[0] * sine, np.full_like(t, w[2])], axis=-1)
        start = np.array(self.q)
        in_space = _turn(quaternion.matrix(start) @ momentum / length, length * t)
        in_body = _turn(np.array([0.0, 0.0, 1.0]), -back * t)
        return v, quaternion.product(quaternion.product(in_space, start), in_body).T


def _turn(axis: Array, angle: Array) -> Array:
    """The turn about a unit vector by many angles, shape (4, n)."""
    return np.concatenate([np.cos(0.5 * angle)[np.newaxis], np.multiply.outer(axis, np.sin(0.5 * angle))])


def symmetric_top(axial: Any = 1.6, spin: Any = 2.0, wobble: Any = 1.0) -> Scene:
    """A free body of moments (1, 1, C), thrown with a spin about its axis and a wobble across it, over ten turns of the axis.

    The axis goes round the angular momentum, which is vertical here, at the rate |L|, at an angle θ with cos θ = C·ω₃/|L|; in the
    body ω turns at (C − 1)·ω₃. Both are steady, so the motion has a formula.

    Args:
        axial: C, the moment about the axis, in the unit of the two others, above 0 and at most 2, that of a coin.
        spin: ω₃, in rad per unit of time, -1e6 to 1e6.
        wobble: ω₁ at the start, in rad per unit of time, 1e-6 to 1e6.
    """
    axial = number("axial", axial)
    if not 0.0 < axial <= 2.0:
        raise ArgumentError(f"axial: expected a moment above 0 and at most 2 in the unit of the others, got {axial:g}")
    spin = within("spin", spin, -1e6, 1e6, "rad per unit of time")
    wobble = within("wobble", wobble, 1e-6, 1e6, "rad per unit of time")
    momentum = math.hypot(wobble, axial * spin)
    v = np.array([wobble, 0.0, spin])
    # L = (wobble, 0, C·spin) in the body; a turn about the second axis takes it upright.
    half = -0.5 * math.atan2(wobble, axial * spin)
    q = np.array([math.cos(half), 0.0, math.sin(half), 0.0])
    return Scene(
        name="symmetric_top",
        title="Free symmetric top",
        section="§12",
        description="A free body of two equal moments spins and wobbles: its axis goes round the angular momentum steadily.",
        error="as far from the true angular velocity, or from the true quaternion, as the largest true one is long",
        system=RigidBody([1.0, 1.0, axial]),
        v=v,
        y=q,
        dt=0.3 / momentum,
        horizon=20.0 * math.pi / momentum,
        exact=Wobble(axial, tuple(v.tolist()), tuple(q.tolist())),
    )
