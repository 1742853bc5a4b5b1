"""Quaternions of attitudes, scalar first, as ``RigidBody`` has them: by a turn, multiplied, and as a matrix.

A quaternion stands along the first axis, shape (4, …); the other axes broadcast. For the saved states of a run of one member,
whose times come first, give ``run.y.T``.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..base import checks
from ..base.arrays import Array
from ..errors import ArgumentError, ShapeError
from ..reference import trig
from ..reference.systems import rigid_body as reference
from .inputs import LAST_ANGLE
from .parameters import aligned


def from_axis_angle(axis: Any, angle: Any) -> Array:
    """The attitude after a turn about an axis: (cos ½φ, n·sin ½φ).

    Args:
        axis: its direction, of any length above zero, shape (3, …).
        angle: φ in rad, counter-clockwise seen from the tip of the axis; broadcasts over the other axes.

    Returns:
        Unit quaternions, shape (4, …).

    Example:
        >>> sw.quaternion.from_axis_angle([0.0, 0.0, 1.0], 0.5 * np.pi)  # a quarter of a turn about the third axis
        array([0.70710678, 0.        , 0.        , 0.70710678])
    """
    axis = _along("axis", axis, 3)
    angle = checks.numbers("angle", angle, unit="rad")
    if (wrong := np.abs(angle) > LAST_ANGLE).any():
        raise ArgumentError(
            f"angle: expected at most {LAST_ANGLE:.3g} rad, beyond which a sine means nothing, got {angle[wrong][0]:g}"
        )
    rest = checks.batch_shape({"axis": axis.shape[1:], "angle": angle.shape})
    checks.fits("axis, angle: the quaternions", 16, rest, "ask for fewer")
    axis = aligned(axis, 1, rest)
    largest = np.abs(axis).max(axis=0)
    if not (largest > 0.0).all():
        raise ArgumentError("axis: expected a direction of a length above zero, got a vector that is zero")
    scaled = axis / largest  # whose squares neither overflow nor vanish
    unit = scaled / np.sqrt((scaled[0] * scaled[0] + scaled[1] * scaled[1]) + scaled[2] * scaled[2])
    half = 0.5 * angle
    across = unit * trig.sin(half)
    scalar = np.broadcast_to(trig.cos(half), rest)
    return np.stack([scalar, *np.broadcast_to(across, (3, *rest))])


def product(p: Any, q: Any) -> Array:
    """Multiply: p ⊗ q is the turn q and after it the turn p, both about axes of space.

    Args:
        p: quaternions, shape (4, …).
        q: quaternions, shape (4, …); their other axes broadcast.

    Returns:
        Quaternions, shape (4, …).

    Example:
        >>> quarter = sw.quaternion.from_axis_angle([0.0, 0.0, 1.0], 0.5 * np.pi)
        >>> sw.quaternion.product(quarter, quarter).round(12)  # half a turn about the third axis
        array([0., 0., 0., 1.])
    """
    p, q = _along("p", p, 4), _along("q", q, 4)
    rest = checks.batch_shape({"p": p.shape[1:], "q": q.shape[1:]})
    checks.fits("p, q: the quaternions", 12, rest, "ask for fewer")
    (a, b, c, d), q = aligned(p, 1, rest), aligned(q, 1, rest)
    return np.stack(
        [
            a * q[0] - b * q[1] - c * q[2] - d * q[3],
            a * q[1] + b * q[0] + c * q[3] - d * q[2],
            a * q[2] + c * q[0] + d * q[1] - b * q[3],
            a * q[3] + d * q[0] + b * q[2] - c * q[1],
        ]
    )


def matrix(q: Any) -> Array:
    """The matrix of rotation R, which takes a vector along body axes to one along the axes of space.

    It is that of q/|q|, so the length of q does not matter. Column i is the body's axis i as seen from space.

    Args:
        q: quaternions, shape (4, …), none of them zero.

    Returns:
        Matrices, shape (3, 3, …).

    Example:
        >>> quarter = sw.quaternion.from_axis_angle([0.0, 0.0, 1.0], 0.5 * np.pi)
        >>> (sw.quaternion.matrix(quarter) @ [1.0, 0.0, 0.0]).round(12)  # the first axis is turned into the second
        array([0., 1., 0.])
    """
    q = _along("q", q, 4)
    checks.fits("q: the matrices", 32, q.shape[1:], "ask for fewer")
    largest = np.abs(q).max(axis=0)
    if not (largest > 0.0).all():
        raise ArgumentError("q: expected quaternions that are not zero, got one that is")
    axes, square = reference.turned(q / largest)
    return np.stack([np.stack(row) for row in axes]) / square


def _along(argument: str, value: Any, n: int) -> Array:
    """An argument as an array with n numbers along the first axis."""
    numbers = checks.numbers(argument, value)
    if numbers.ndim == 0 or len(numbers) != n:
        raise ShapeError(f"{argument}: expected {n} numbers along the first axis, got shape {numbers.shape}")
    if 0 in numbers.shape:
        raise ShapeError(f"{argument}: expected at least one, got an empty array of shape {numbers.shape}")
    return numbers
