"""Three bodies that fall out of step, with the energy kept by a control term (Appendix D)."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ...base.checks import known, number
from ...base.literals import BodyForce, ControlForm
from ...model.controls import EnergyControl
from ...model.systems import NBody
from ..base import Scene

#: Force and potential for each pair of them, as ``NBody`` names it.
PAIRS: dict[str, BodyForce] = {"matching": "logarithmic", "printed": "printed"}

#: Hoffmann's control factor, found by experiment.
GAIN = 0.3


def energy_control(pair: str = "matching", eps: Any = 0.01, form: ControlForm = "limited") -> Scene:
    """Three unit masses thrown out from the centre, one of them a little aside; Hoffmann's 100 000 steps of 0.01.

    The places are those of ``clover``, the velocities radial with speed 1, and the third body's gets ε in x (Appendix D).
    Hoffmann steps it by Standard Euler under energy control with C = 0.3. Without the control (``run(…, control=None)``) the
    bodies leave the picture. The motion is chaotic, so no solution is exact for long, and only bounds can be compared.

    With ε = 0 the three meet at the centre, where the true motion ends. A step goes past that: in the printed form the
    run then diverges and says when; in the limited form it stays finite, and means nothing.

    Args:
        pair: ``"matching"``, the 1/r force with the potential ln r that belongs to it; or ``"printed"``, the same force with
            Hoffmann's −1/r, which is no invariant of the motion.
        eps: ε in units of length per unit of time.
        form: of the control; Hoffmann's is ``"printed"``, see ``stepwell.EnergyControl``.
    """
    force = PAIRS[known("pair", pair, PAIRS)]
    eps = number("eps", eps, unit="units of length per unit of time")
    # The sine of 30° is one half to the last bit: the rest of a symmetric start would be magnified into an escape.
    co, si = math.cos(math.radians(30.0)), 0.5
    y = np.array([[-co, -si], [co, -si], [0.0, 1.0]])
    v = y + np.array([[0.0, 0.0], [0.0, 0.0], [eps, 0.0]])
    return Scene(
        name="energy_control",
        title="Energy control",
        section="Appendix D",
        description="Three bodies in chaos under the 1/r law; a control term keeps Standard Euler's energy from growing.",
        error="not measured: the motion is chaotic",
        system=NBody([1.0, 1.0, 1.0], force=force),
        v=v,
        y=y,
        dt=0.01,
        horizon=1000.0,
        control=EnergyControl(GAIN, form),
    )
