"""Attitudes: Euler angles, quaternions and rotation matrices, there and back, and the document's matrix."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.model.systems import attitude
from support.mistakes import mistaken

#: Half a unit in the last place of 1.
U = 2.0**-53

RNG = np.random.default_rng(3)
#: Roll, pitch and yaw in degrees.
ANGLES = np.stack([RNG.uniform(-180.0, 180.0, 99), RNG.uniform(-89.0, 89.0, 99), RNG.uniform(-180.0, 180.0, 99)])


def printed(angles: Any) -> Any:
    """The matrix of Appendix E, o11 to o33, in Python's floats."""
    phi, theta, psi = (math.radians(float(angle)) for angle in angles)
    (sf, st, sp), (cf, ct, cp) = map(math.sin, (phi, theta, psi)), map(math.cos, (phi, theta, psi))
    return np.array(
        [
            [cp * ct, -sp * cf + cp * st * sf, sp * sf + cp * st * cf],
            [sp * ct, cp * cf + sp * st * sf, -cp * sf + sp * st * cf],
            [-st, ct * sf, ct * cf],
        ]
    )


def agrees(module: Any) -> bool:
    """Whether all are the same rotations. Some twenty roundings of numbers up to 1; the angles divide by cos 89°, 1/57, twice."""
    matrices = np.stack([printed(angles) for angles in ANGLES.T], axis=-1)
    q = module.quaternion_of_angles(ANGLES)
    return (
        np.abs(module.rotation_of_angles(ANGLES) - matrices).max() < 40 * U
        and np.abs((q * q).sum(axis=0) - 1.0).max() < 40 * U
        and np.abs(module.rotation_of_quaternion(q) - matrices).max() < 40 * U
        and np.abs(module.rotation_of_quaternion(3.0 * q) - matrices).max() < 40 * U
        and np.abs(module.angles_of_rotation(matrices) - ANGLES).max() < 57.3 * 57.3 * 40 * U
    )


def test_angles_matrices_and_quaternions_are_the_same_rotations() -> None:
    assert agrees(attitude)


@pytest.mark.mutant
@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("cx * cy * cz + sx * sy * sz", "cx * cy * cz - sx * sy * sz"),
        ("sx * cy * cz - cx * sy * sz", "sx * cy * cz + cx * sy * sz"),
        ("cx * sy * cz + sx * cy * sz", "cx * sy * cz - sx * cy * sz"),
        ("cx * cy * sz - sx * sy * cz", "cx * cy * sz + sx * sy * cz"),
        ("2.0 * (x * y - w * z)", "2.0 * (x * y + w * z)"),
        ("2.0 * (y * z - w * x)", "2.0 * (y * z + w * x)"),
        ("(w * w + y * y) - (x * x + z * z)", "(w * w + x * x) - (y * y + z * z)"),
        ("each / square for each", "each for each"),
        ("cz * sy * sx - sz * cx", "cz * sy * sx + sz * cx"),
        ("sz * sy * cx - cz * sx", "sz * sy * cx + cz * sx"),
        ("[-sy, cy * sx", "[sy, cy * sx"),
        ("arctan2(-rotation[2, 0], level)", "arctan2(rotation[2, 0], level)"),
        ("arctan2(rotation[1, 0], rotation[0, 0])", "arctan2(rotation[0, 1], rotation[0, 0])"),
        ("arctan2(rotation[2, 1], rotation[2, 2])", "arctan2(rotation[1, 2], rotation[2, 2])"),
    ],
)
def test_a_mistake_is_noticed(old: str, new: str) -> None:
    wrong = mistaken(attitude, old, new)
    assert not agrees(wrong)


def test_an_aircraft_has_them_in_its_own_coordinates() -> None:
    one, two = sw.Aircraft(), sw.Aircraft("quaternion")
    angles, q = one.attitude(*ANGLES), two.attitude(*ANGLES)
    np.testing.assert_array_equal(angles, ANGLES)
    np.testing.assert_array_equal(one.angles(angles + 720.0), attitude.wrapped(angles + 720.0))
    np.testing.assert_array_equal(two.angles(q), attitude.angles_of_rotation(attitude.rotation_of_quaternion(q)))
    np.testing.assert_array_equal(one.rotation(angles), attitude.rotation_of_angles(angles))
    # Saved states have the time first.
    np.testing.assert_array_equal(two.angles(q.T, axis=1), two.angles(q).T)
    np.testing.assert_array_equal(two.rotation(q.T, axis=1), two.rotation(q))
    np.testing.assert_array_equal(two.attitude(10.0, [20.0, 30.0])[:, 1], two.attitude(10.0, 30.0))
    # A whole turn more is the same attitude, to the rounding of the angle.
    np.testing.assert_allclose(two.attitude(730.0, -340.0), two.attitude(10.0, 20.0), rtol=0, atol=4 * U)
