"""An aircraft that loops: its Euler angles have a trap above and below (Appendix E)."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...base.checks import number
from ...base.literals import AttitudeForm
from ...model.systems import Aircraft
from ..base import Scene


def gimbal_trap(form: AttitudeForm = "euler", roll: Any = 2.0, torque: Any = -1.5) -> Scene:
    """An aircraft without controllers loops, and its nose passes near the vertical, where Euler angles have no meaning.

    A constant torque lifts the nose; the dampers and the yaw rate by the roll angle act. The aircraft is rolled a little at the
    start, so the nose misses the vertical a little. There the roll and yaw angles change by half a turn within a moment. In the
    form ``"quaternion"`` the same motion has no such moment.

    Args:
        form: ``"euler"``, Hoffmann's program, or ``"quaternion"``; see ``stepwell.Aircraft``.
        roll: the roll angle at the start, in degrees. With 0 the nose passes through the vertical, where Euler angles jump.
        torque: about the pitch axis; below zero it lifts the nose.
    """
    roll, torque = number("roll", roll, unit="degrees"), number("torque", torque, unit="units of torque")
    system = Aircraft(form, pitch_torque=torque, controllers=False)
    return Scene(
        name="gimbal_trap",
        title="Loop through the gimbal trap",
        section="Appendix E",
        description="An aircraft loops past the vertical, where a step in Euler angles fails and one in quaternions does not.",
        error="as far from the true attitude or angular velocity as the largest true one",
        system=system,
        v=np.zeros(3),
        y=system.attitude(roll=roll),
        dt=0.1,
        horizon=10.0,
    )
