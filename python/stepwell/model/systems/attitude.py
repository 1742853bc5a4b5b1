"""Attitudes: from Euler angles in degrees to quaternions and rotation matrices, and back, to the same bits on every machine.

The rotation from the body to space is R = R_z(ψ)·R_y(θ)·R_x(φ), with the roll angle φ, the pitch angle θ and the yaw angle ψ. The
columns of R are the axes of the body, seen in space. Axes of a batch or of time come last in arrays.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ...base.arrays import Array
from ...reference import functions

WHOLE_TURN = 360.0


def wrapped(angles: Array) -> Array:
    """Angles in degrees without whole turns, from −180 to 180."""
    turns = np.floor((0.5 * WHOLE_TURN - np.abs(angles)) / WHOLE_TURN)
    return np.asarray(angles - np.copysign(WHOLE_TURN * turns, angles))


def quaternion_of_angles(angles: Any) -> Array:
    """The quaternion, scalar first, shape (4, …), of roll, pitch and yaw in degrees, shape (3, …)."""
    halves = [functions.deg2rad(0.5 * angle) for angle in angles]
    (sx, sy, sz), (cx, cy, cz) = ([function(half) for half in halves] for function in (functions.sin, functions.cos))
    return np.stack(
        [
            cx * cy * cz + sx * sy * sz,
            sx * cy * cz - cx * sy * sz,
            cx * sy * cz + sx * cy * sz,
            cx * cy * sz - sx * sy * cz,
        ]
    )


def rotation_of_quaternion(q: Array) -> Array:
    """The rotation matrix, shape (3, 3, …), of a quaternion of any length but 0, shape (4, …)."""
    w, x, y, z = q
    square = w * w + x * x + y * y + z * z
    rows = [
        [(w * w + x * x) - (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), (w * w + y * y) - (x * x + z * z), 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), (w * w + z * z) - (x * x + y * y)],
    ]
    return np.stack([np.stack([each / square for each in row]) for row in rows])


def rotation_of_angles(angles: Any) -> Array:
    """The rotation matrix, shape (3, 3, …), of roll, pitch and yaw in degrees, shape (3, …); Hoffmann's o11 … o33."""
    radians = [functions.deg2rad(angle) for angle in angles]
    (sx, sy, sz), (cx, cy, cz) = ([function(angle) for angle in radians] for function in (functions.sin, functions.cos))
    rows = [
        [cz * cy, cz * sy * sx - sz * cx, cz * sy * cx + sz * sx],
        [sz * cy, sz * sy * sx + cz * cx, sz * sy * cx - cz * sx],
        [-sy, cy * sx, cy * cx],
    ]
    return np.stack([np.stack(row) for row in rows])


def angles_of_rotation(rotation: Array) -> Array:
    """Roll, pitch and yaw in degrees, shape (3, …), of a rotation matrix: pitch from −90 to 90, the others from −180 to 180."""
    level = functions.sqrt(rotation[2, 1] * rotation[2, 1] + rotation[2, 2] * rotation[2, 2])
    return np.stack(
        [
            functions.rad2deg(functions.arctan2(rotation[2, 1], rotation[2, 2])),
            functions.rad2deg(functions.arctan2(-rotation[2, 0], level)),
            functions.rad2deg(functions.arctan2(rotation[1, 0], rotation[0, 0])),
        ]
    )
