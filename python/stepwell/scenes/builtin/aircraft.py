"""An aircraft that is commanded to roll to both sides (Appendix E)."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...base.checks import number
from ...base.literals import AttitudeForm
from ...model.systems import Aircraft, Sinusoid
from ..base import Scene

#: The time of a turn to both sides, and the number of these turns.
PERIOD, TURNS = 10.0, 2


def aircraft(form: AttitudeForm = "euler", roll: Any = 40.0, pitch: Any = -10.0) -> Scene:
    """Hoffmann's aircraft in turns to both sides, by its own step of 0.1.

    Hoffmann prints neither the start nor the commands nor the duration; they are chosen here. The aircraft is level and at
    rest at t = 0. The commanded roll is ``roll``·sin(2πt/10), the commanded pitch is constant. The motion lasts 20 units of
    time.

    Args:
        form: ``"euler"``, Hoffmann's program, or ``"quaternion"``; see ``stepwell.Aircraft``.
        roll: the largest commanded roll angle, in degrees.
        pitch: the commanded pitch angle, in degrees; below zero the nose is up.
    """
    roll, pitch = number("roll", roll, unit="degrees"), number("pitch", pitch, unit="degrees")
    system = Aircraft(form, roll=Sinusoid(roll, 2.0 * np.pi / PERIOD), pitch=pitch)
    return Scene(
        name="aircraft",
        title="Aircraft in turns",
        section="Appendix E",
        description="An aircraft is commanded to roll to one side and to the other; where it banks, it turns.",
        error="as far from the true attitude or angular velocity as the largest true one",
        system=system,
        v=np.zeros(3),
        y=system.attitude(),
        dt=0.1,
        horizon=TURNS * PERIOD,
    )
