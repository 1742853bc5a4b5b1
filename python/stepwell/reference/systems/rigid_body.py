"""The rigid body: J·ω̇ = τ − ω × J·ω − d·ω in body axes, q̇ = ½·q ⊗ (0, ω)."""

from collections.abc import Sequence

import numpy as np

from ...base.arrays import Array, Blocks, Signal
from ..quantities import Quantity, Recorded, of_spin

Vector = tuple[Array, Array, Array]


class RigidBody(Recorded):
    """v is ω in body axes, shape (3, …); y is q, which turns body axes into those of space, scalar first, shape (4, …).

    J is diagonal. ``torque`` is along body axes and ``space_torque`` along those of space, a signal or None for each axis;
    ``weight`` pulls down the third axis of space at ``centre`` in the body. ``keeps`` is "control", which adds
    k·(1 − q·q)·q to q̇ with k = ``strength``, "projection" or None.
    """

    def __init__(
        self,
        h: float,
        inertia: Array,
        damping: Array | None,
        torque: Sequence[Signal | None] | None,
        space_torque: Sequence[Signal | None] | None,
        weight: Array | None,
        centre: Array | None,
        keeps: str | None,
        strength: Array | None,
    ) -> None:
        self.half = 0.5 * np.asarray(h)
        self.inertia = inertia
        self.by_inertia = h / inertia
        differences = (inertia[1] - inertia[2], inertia[2] - inertia[0], inertia[0] - inertia[1])
        self.gyration = [by * difference for by, difference in zip(self.by_inertia, differences, strict=True)]
        self.drag = None if damping is None else self.by_inertia * damping
        components = [None] * 3 if torque is None else torque
        self.torque = [None if each is None else each.scaled(by) for each, by in zip(components, self.by_inertia, strict=True)]
        self.space_torque = space_torque
        self.weight = None if weight is None or centre is None else (weight, centre)
        self.moment = None if self.weight is None else [self.weight[0] * each for each in self.weight[1]]
        self.gain = None if keeps != "control" or strength is None else h * strength
        self.projects = keeps == "projection"

    def dv(self, t: float, v: Array, y: Array) -> Array:
        """h·ω̇."""
        dv = [
            self.gyration[0] * (v[1] * v[2]),
            self.gyration[1] * (v[2] * v[0]),
            self.gyration[2] * (v[0] * v[1]),
        ]
        if self.drag is not None:
            dv = [each - drag * w for each, drag, w in zip(dv, self.drag, v, strict=True)]
        dv = [each if own is None else each + own.at(t) for each, own in zip(dv, self.torque, strict=True)]
        outer = self.outer(t, y)
        if outer is not None:
            dv = [each + by * turned for each, by, turned in zip(dv, self.by_inertia, outer, strict=True)]
        return np.stack(dv)

    def outer(self, t: float, y: Array) -> Vector | None:
        """The torques from outside along body axes: R(q)ᵀ·(space torque) + centre × R(q)ᵀ·(weight); None without any."""
        if self.space_torque is None and self.moment is None:
            return None
        axes, square = turned(y)
        sums: list[Array | None] = [None, None, None]
        for row, signal in zip(axes, self.space_torque or (), strict=False):
            if signal is not None:
                pull = signal.at(t)
                sums = [plus(each, pull * along) for each, along in zip(sums, row, strict=True)]
        if self.moment is not None:
            up, (a, b, c) = axes[2], self.moment
            lever = (c * up[1] - b * up[2], a * up[2] - c * up[0], b * up[0] - a * up[1])  # up × moment
            sums = [plus(each, more) for each, more in zip(sums, lever, strict=True)]
        x, y, z = (each / square for each in sums if each is not None)
        return x, y, z

    def dy(self, t: float, v: Array, y: Array) -> Array:
        """h·q̇."""
        a, b, c, d = y
        dy = [
            self.half * -((b * v[0] + c * v[1]) + d * v[2]),
            self.half * ((a * v[0] + c * v[2]) - d * v[1]),
            self.half * ((a * v[1] + d * v[0]) - b * v[2]),
            self.half * ((a * v[2] + b * v[1]) - c * v[0]),
        ]
        if self.gain is not None:
            pull = self.gain * (1.0 - square(y))
            dy = [each + pull * part for each, part in zip(dy, y, strict=True)]
        return np.stack(dy)

    def project(self, v: Array, y: Array) -> Blocks:
        """The state after a step, q divided by its length if the system projects."""
        return (v, y / np.sqrt(square(y))) if self.projects else (v, y)


def plus(total: Array | None, more: Array) -> Array:
    """A sum that may have no terms yet."""
    return more if total is None else total + more


def square(q: Array) -> Array:
    """q·q."""
    length: Array = ((q[0] * q[0] + q[1] * q[1]) + q[2] * q[2]) + q[3] * q[3]
    return length


def turned(q: Array) -> tuple[tuple[Vector, Vector, Vector], Array]:
    """q·q times the axes of space along those of the body, the rows of the matrix of rotation R, and q·q.

    R is divided by q·q, so that a quaternion whose length has drifted still turns without stretching.
    """
    a, b, c, d = q
    aa, bb, cc, dd = a * a, b * b, c * c, d * d
    bc, bd, cd, ab, ac, ad = b * c, b * d, c * d, a * b, a * c, a * d
    x = ((aa + bb) - (cc + dd), 2.0 * (bc - ad), 2.0 * (bd + ac))
    y = (2.0 * (bc + ad), (aa + cc) - (bb + dd), 2.0 * (cd - ab))
    z = (2.0 * (bd - ac), 2.0 * (cd + ab), (aa + dd) - (bb + cc))
    return (x, y, z), square(q)


def energy(s: RigidBody, v: Array, y: Array) -> Array:
    """½·ω·J·ω, and the height of ``centre`` above the fixed point times ``weight``."""
    whole: Array = 0.5 * ((s.inertia[0] * v[0] * v[0] + s.inertia[1] * v[1] * v[1]) + s.inertia[2] * v[2] * v[2])
    if s.weight is None:
        return whole
    (weight, centre), (axes, length) = s.weight, turned(y)
    up = axes[2]
    height: Array = ((up[0] * centre[0] + up[1] * centre[1]) + up[2] * centre[2]) / length
    return whole + weight * height


def angular_momentum(s: RigidBody, v: Array, y: Array) -> Array:
    """R(q)·J·ω, along the axes of space."""
    own = s.inertia * v
    axes, length = turned(y)
    return np.stack([((row[0] * own[0] + row[1] * own[1]) + row[2] * own[2]) / length for row in axes])


def norm_error(s: RigidBody, v: Array, y: Array) -> Array:
    """q·q − 1."""
    return square(y) - 1.0


RigidBody.quantities = {
    "energy": Quantity(energy),
    "angular_momentum": Quantity(angular_momentum, of_spin),
    "norm_error": Quantity(norm_error),
}
