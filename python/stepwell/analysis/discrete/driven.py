"""The response of a method to an input that is known at every time of a step, x = e^(jωt)."""

from __future__ import annotations

from math import pi
from typing import Any

import numpy as np

from ...base.arrays import Array
from ...model.inputs import Sinusoid
from ...model.methods import Method
from ...model.systems import LinearSystem
from ...runs import engine
from ...runs.engine.linear import one_step
from .response import Complex, response
from .systems import of_states, slots_of


def of_method(system: LinearSystem, method: Method, dt: float, omega: Array) -> Complex:
    """Z/X at the samples of a run with that step, when its transients have decayed, shape (frequencies,).

    The system has one input, one output and one member. Q is the state after a step from rest: with x = cos ωt, plus j times that
    with x = sin ωt.
    """
    P, finish = slots_of(system, method, dt)
    free = system.with_inputs(None)
    turning = Sinusoid(1.0, omega, 0.5 * pi), Sinusoid(1.0, omega)
    parts = [one_step(engine.Plan(system.with_inputs(x), method, omega.shape, dt)) for x in turning]
    Q: Any = (parts[0] + 1j * parts[1])[:, np.newaxis]
    z = np.exp(1j * dt * omega)
    P, Q, after = of_states(free, method, dt, P, Q, np.zeros_like(Q), finish)
    n = len(P)
    C = np.eye(n) if system.C is None else system.C
    D = np.zeros((len(C), 1)) if system.D is None else system.D
    return response(P, Q + after * z, C, D, z)
