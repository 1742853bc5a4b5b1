"""The rates of an aircraft (Appendix E), with its attitude in Euler angles or as a quaternion, for core and reference.

A command, a torque or a control that is left out has its default, the number 0, and adds no operation to a step.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..equations import system

#: Hoffmann's moments of inertia, its dampers, and its gains of roll and pitch, per degree, and of the yaw rate.
INERTIA, DAMPING, GAINS = np.array([0.6, 1.0, 1.5]), np.array([2.0, 3.0, 1.0]), np.array([0.06, 0.10, 1.0])

#: Hoffmann's trap: this replaces a smaller cosine of the pitch angle.
SMALLEST_COSINE = 1e-5


def is_given(parameter: Any) -> bool:
    """True if a parameter has a value of the system; the default, which means none, is a float."""
    return not isinstance(parameter, float)


def wrapped(angle: Any) -> Any:
    """An angle in degrees without whole turns, from −180 to 180, as by Hoffmann's loops, which hang on huge angles."""
    turns = np.floor((180.0 - np.abs(angle)) / 360.0)  # zero or less
    return angle - np.copysign(360.0 * turns, angle)


def torques(v: Any, angles: Any, bank: Any, damping: Any, gains: Any, commands: Any, added: Any) -> list[Any]:
    """The torques of the dampers, of the yaw rate by the roll angle, and of the commands that are given.

    ``angles`` are roll and pitch in degrees, as the controllers take them, ``bank`` is sin φ·cos θ. The gains are those of roll,
    pitch and yaw rate, the commands are for roll and pitch, and those ``added`` for torques about the three axes.
    """
    along = [-damping[axis] * v[axis] for axis in range(3)]
    along[2] = along[2] - gains[2] * bank
    along = [torque + command if is_given(command) else torque for torque, command in zip(along, added, strict=True)]
    for axis in range(2):
        if is_given(commands[axis]):
            along[axis] = along[axis] - gains[axis] * (angles[axis] - commands[axis])
    return along


def turning(v: Any, torque: Any, inertia: Any) -> Any:
    """Euler's equations: the rates of the angular velocity about the principal axes."""
    x, y, z = v
    j_x, j_y, j_z = inertia
    return np.array(
        [
            (y * z * (j_y - j_z) + torque[0]) / j_x,
            (z * x * (j_z - j_x) + torque[1]) / j_y,
            (x * y * (j_x - j_y) + torque[2]) / j_z,
        ]
    )


@system(blocks=2, shape=((3,), (3,)))
def euler(
    t: Any,
    v: Any,
    y: Any,
    *,
    inertia: Any = INERTIA,
    damping: Any = DAMPING,
    gains: Any = GAINS,
    roll: Any = 0.0,
    pitch: Any = 0.0,
    roll_torque: Any = 0.0,
    pitch_torque: Any = 0.0,
    yaw_torque: Any = 0.0,
) -> Any:
    """Hoffmann's program: v in rad per unit of time, y the roll, pitch and yaw angle in degrees."""
    sin_roll, cos_roll = np.sin(np.radians(y[0])), np.cos(np.radians(y[0]))
    sin_pitch, cos_pitch = np.sin(np.radians(y[1])), np.cos(np.radians(y[1]))
    angles, added = (wrapped(y[0]), wrapped(y[1])), (roll_torque, pitch_torque, yaw_torque)
    torque = torques(v, angles, sin_roll * cos_pitch, damping, gains, (roll, pitch), added)
    trapped = np.where(cos_pitch > 0.0, SMALLEST_COSINE, -SMALLEST_COSINE)
    yaw = (v[1] * sin_roll + v[2] * cos_roll) / np.where(np.abs(cos_pitch) < SMALLEST_COSINE, trapped, cos_pitch)
    return turning(v, torque, inertia), np.degrees(np.array([v[0] + yaw * sin_pitch, v[1] * cos_roll - v[2] * sin_roll, yaw]))


@euler.invariant
def energy(v: Any, y: Any, *, inertia: Any) -> Any:
    """The energy of the rotation, which is constant without torques."""
    return 0.5 * (inertia[0] * (v[0] * v[0]) + inertia[1] * (v[1] * v[1]) + inertia[2] * (v[2] * v[2]))


@system(blocks=2, shape=((3,), (4,)))
def quaternion(
    t: Any,
    v: Any,
    q: Any,
    *,
    inertia: Any = INERTIA,
    damping: Any = DAMPING,
    gains: Any = GAINS,
    roll: Any = 0.0,
    pitch: Any = 0.0,
    roll_torque: Any = 0.0,
    pitch_torque: Any = 0.0,
    yaw_torque: Any = 0.0,
    strength: Any = 0.0,
) -> Any:
    """``euler`` with a quaternion as attitude, scalar first, whose rate has no singularity. A NormControl has ``strength``."""
    w, x, y, z = q
    square = w * w + x * x + y * y + z * z
    # The last row of the rotation matrix, which is (−sin θ, sin φ·cos θ, cos φ·cos θ), times q·q.
    down, across, up = 2.0 * (x * z - w * y), 2.0 * (y * z + w * x), (w * w + z * z) - (x * x + y * y)
    angles = np.degrees(np.arctan2(across, up)), np.degrees(np.arctan2(-down, np.sqrt(across * across + up * up)))
    added = (roll_torque, pitch_torque, yaw_torque)
    torque = torques(v, angles, across / square, damping, gains, (roll, pitch), added)
    a, b, c = v
    rate = 0.5 * np.array([-(x * a + y * b + z * c), w * a + (y * c - z * b), w * b + (z * a - x * c), w * c + (x * b - y * a)])
    if is_given(strength):
        rate = rate + (strength * (1.0 - square)) * q
    return turning(v, torque, inertia), rate


quaternion.invariant(energy)


@quaternion.invariant
def norm(v: Any, q: Any) -> Any:
    """The length of the quaternion. It is linear along its gradient, so the projection to first order is exactly q/|q|."""
    return np.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
