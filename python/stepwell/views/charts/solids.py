"""Bodies that turn in space, as data: an aircraft, and a rigid body as a box or a top, at each saved state."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from ...base.arrays import Array
from ...model.systems.attitude import rotation_of_quaternion
from .runs import LARGEST, RunPicture

#: Parts of a body by name: their corners along its axes, and how they are filled.
Parts = dict[str, tuple[tuple[tuple[float, float, float], ...], str]]

#: The parts of the aircraft, in its own axes (forward, left, up).
AIRCRAFT: Parts = {
    "fuselage": (((1.0, 0.0, 0.0), (0.55, 0.1, 0.0), (-0.9, 0.07, 0.0), (-0.9, -0.07, 0.0), (0.55, -0.1, 0.0)), "#4a4a4a"),
    "left wing": (((0.35, 0.08, 0.0), (-0.15, 0.95, 0.0), (-0.35, 0.95, 0.0), (-0.2, 0.08, 0.0)), "#f0f0f0"),
    "right wing": (((0.35, -0.08, 0.0), (-0.15, -0.95, 0.0), (-0.35, -0.95, 0.0), (-0.2, -0.08, 0.0)), "#8a8a8a"),
    "left tailplane": (((-0.65, 0.06, 0.0), (-0.85, 0.36, 0.0), (-0.95, 0.36, 0.0), (-0.9, 0.06, 0.0)), "#f0f0f0"),
    "right tailplane": (((-0.65, -0.06, 0.0), (-0.85, -0.36, 0.0), (-0.95, -0.36, 0.0), (-0.9, -0.06, 0.0)), "#8a8a8a"),
    "fin": (((-0.55, 0.0, 0.0), (-0.85, 0.0, 0.42), (-1.0, 0.0, 0.42), (-0.9, 0.0, 0.0)), "#000000"),
}

#: From where an aircraft is seen: degrees from straight ahead, to the left, and above the horizontal. A rigid body is seen from
#: higher above, so that a path around the vertical is open.
AZIMUTH, ELEVATION, BODY_ELEVATION = 215.0, 25.0, 35.0

#: Half the side of a panel with a body; the nose of the aircraft is 1 from its centre.
HALF_SIDE = 1.4

#: A rigid body leaves the path of its axis over this share of the run.
BODY_TRAIL = 0.25

#: The half length of a box's longest side, and the least of any side; how far the axis reaches.
LONGEST, THINNEST, REACH = 0.85, 0.06, 1.3

#: Faces of a box: the ends of the axis are darkest and white, which shows the way it points.
FRONT, BACK, SIDES = "#2b2b2b", "#ffffff", ("#c4c4c4", "#8f8f8f")

#: A top: corners of its disc, the disc's radius, and its height above the fixed point.
CORNERS, RADIUS, HEIGHT = 24, 0.75, 0.65


class Screen(NamedTuple):
    """The axes of a screen in space: to the right, up, and towards the viewer."""

    right: Array
    up: Array
    near: Array

    def flat(self, points: Array) -> Array:
        """Where points of space, shape (…, 3), are on the screen, shape (…, 2)."""
        return np.stack([points @ self.right, points @ self.up], axis=-1)


def viewed(azimuth: float = AZIMUTH, elevation: float = ELEVATION) -> Screen:
    """The screen of a viewer there."""
    a, e = np.radians([azimuth, elevation])
    near = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
    right = np.array([-np.sin(a), np.cos(a), 0.0])
    return Screen(right, np.cross(near, right), near)


@dataclass(frozen=True, eq=False)
class Solid:
    """A body at each saved state."""

    parts: Parts  # in its own axes
    matrices: Array  # rotations from its axes to those of the picture, shape (3, 3, saved)
    screen: Screen
    axis: int | None = None  # the one that is drawn
    reach: float = 0.0  # where the body meets that axis, below zero on its other side

    @property
    def tips(self) -> Array:
        """The direction of the tip of the axis, shape (saved, 3)."""
        assert self.axis is not None
        return np.asarray(np.copysign(1.0, self.reach) * self.matrices[:, self.axis].T)


def solid_of(chart: RunPicture) -> Solid:
    """The aircraft or the rigid body of a run."""
    system: Any = chart.run.system
    if chart.kind == "attitude":
        return Solid(AIRCRAFT, system.rotation(np.clip(chart.run.y, -LARGEST, LARGEST), axis=1), viewed())
    axis = main_axis(chart)
    matrices = np.einsum("ij,jkn->ikn", upright(chart), turns(chart.run.y))
    screen = viewed(elevation=BODY_ELEVATION)
    if system.centre is None:
        half = half_sides(system.inertia)
        return Solid(box(half, axis), matrices, screen, axis, float(half[axis]))
    height = HEIGHT if system.centre[axis] >= 0.0 else -HEIGHT
    return Solid(disc(axis, height), matrices, screen, axis, height)


def turns(y: Array) -> Array:
    """The rotation matrices of quaternions, shape (n, 4), of any length; shape (3, 3, n)."""
    with np.errstate(all="ignore"):
        return rotation_of_quaternion((y / np.abs(y).max(axis=1, keepdims=True)).T)


# ---- which way is up, and which axis is shown


def momentum(chart: RunPicture) -> Array:
    """The angular momentum of the first saved state along the body's axes."""
    system: Any = chart.run.system
    return np.asarray(system.inertia * chart.run.v[0])


def main_axis(chart: RunPicture) -> int:
    """The axis that is drawn: of a top the one nearest to ``centre``, else that of most of the angular momentum at the start."""
    system: Any = chart.run.system
    return int(np.argmax(np.abs(momentum(chart) if system.centre is None else system.centre)))


def upright_by_momentum(chart: RunPicture) -> bool:
    """True if the angular momentum at the start is drawn upright: a body without a vertical of its own."""
    system: Any = chart.run.system
    return system.weight is None and system.space_torque is None and bool(momentum(chart).any())


def upright(chart: RunPicture) -> Array:
    """The shortest turn of space that makes the upright direction the third axis, shape (3, 3)."""
    if not upright_by_momentum(chart):
        return np.eye(3)
    direction = turns(chart.run.y)[..., 0] @ momentum(chart)
    x, y, z = direction / np.linalg.norm(direction)
    if z < -1.0 + 1e-12:
        return np.diag([1.0, -1.0, -1.0])
    cross = np.array([[0.0, 0.0, -x], [0.0, 0.0, -y], [x, y, 0.0]])
    return np.asarray(np.eye(3) + cross + cross @ cross / (1.0 + z))


# ---- boxes and tops


def half_sides(inertia: Array) -> Array:
    """Half the sides of the box with these moments, a₁² ∝ J₂ + J₃ − J₁, scaled to the longest."""
    half = np.sqrt(np.maximum(inertia.sum() - 2.0 * inertia, 0.0))
    return np.asarray(np.maximum(LONGEST * half / half.max(), THINNEST))


def box(half: Array, axis: int) -> Parts:
    """Six faces, each named by the sign and the number of its axis."""
    faces: Parts = {}
    for i in range(3):
        a, b = (i + 1) % 3, (i + 2) % 3
        for sign in (1.0, -1.0):
            corners = np.zeros((4, 3))
            corners[:, i] = sign * half[i]
            corners[:, a] = half[a] * np.array([1, 1, -1, -1])
            corners[:, b] = half[b] * np.array([1, -1, -1, 1])
            fill = (FRONT if sign > 0.0 else BACK) if i == axis else SIDES[(i - axis) % 3 - 1]
            faces["+-"[int(sign < 0.0)] + str(i + 1)] = (_points(corners), fill)
    return faces


def disc(axis: int, height: float) -> Parts:
    """A disc across the axis, whose two halves are filled differently to show its spin."""
    a, b = (axis + 1) % 3, (axis + 2) % 3
    around = np.linspace(0.0, 2.0 * np.pi, CORNERS + 1)
    faces: Parts = {}
    for half in (0, 1):
        arc = around[half * CORNERS // 2 : (half + 1) * CORNERS // 2 + 1]
        rim = np.zeros((len(arc), 3))
        rim[:, a], rim[:, b], rim[:, axis] = RADIUS * np.cos(arc), RADIUS * np.sin(arc), height
        faces[f"half {half + 1}"] = (_points(rim), (SIDES[0], FRONT)[half])
    return faces


def _points(corners: Array) -> tuple[tuple[float, float, float], ...]:
    return tuple((x, y, z) for x, y, z in corners.tolist())
