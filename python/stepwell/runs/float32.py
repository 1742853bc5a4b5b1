"""What runs of float32 are checked for, before any work."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.checks import LARGEST_SINGLE
from ..errors import ArgumentError, UnsupportedError
from ..model.inputs import LAST_SINGLE_ANGLE
from ..model.systems import Sampled, Sinusoid

if TYPE_CHECKING:
    from ..model.methods import Method
    from ..model.systems import System


def step(system: System, how: Method, form: str, dt: float, *, events: bool = False) -> float:
    """The step in float32; raise if there is none, or nothing of float32 goes with what is asked for."""
    if form != "direct":
        raise UnsupportedError(f"dtype: float32 goes with form='direct' only, got form={form!r}")
    if how.has_series:
        raise UnsupportedError(
            f"dtype: float32 does not go with {how.name}, whose series are computed in float64 only; use float64, or a "
            f"Runge-Kutta method such as rk4"
        )
    if events:
        raise UnsupportedError(
            "dtype: float32 does not go with events=, which are located in float64 only; use float64, or look for them in the "
            "saved states"
        )
    if system.contacts and _is_of_rods(system):
        raise UnsupportedError(
            f"dtype: float32 does not go with rods that meet surfaces, whose joints are decided by more digits than it has, got "
            f"{system!r}; use float64"
        )
    return rounded_step(dt)


def _is_of_rods(system: System) -> bool:
    from ..model.systems import Pendulum3D, Rods  # only systems with surfaces need them

    return isinstance(system, (Pendulum3D, Rods))


def rounded_step(dt: float) -> float:
    """A step, rounded to float32; raise if nothing is left of it."""
    rounded = float(np.float32(dt)) if abs(dt) <= LARGEST_SINGLE else np.inf
    if not 0.0 < abs(rounded) < np.inf:
        raise ArgumentError(f"dt: expected a number of size 1.4e-45 to 3.4e38 units of time in float32, got {dt!r}")
    return rounded


def check_inputs(system: System, last: float) -> None:
    """Raise if an input is not defined in float32 up to a time."""
    for name, given in system.all_inputs().items():
        if isinstance(given, Sampled) and not given.constant:
            raise UnsupportedError(
                f"dtype: float32 does not go with samples, whose times take more digits than it has, and {name} has some; use "
                f"float64, or a force that is constant over each of several runs"
            )
        if isinstance(given, Sinusoid):
            angle = float(np.abs(given.omega).max() * abs(last) + np.abs(given.phase).max())
            if angle > LAST_SINGLE_ANGLE:
                raise ArgumentError(
                    f"{name}: in float32 a sinusoid's angle may grow to {LAST_SINGLE_ANGLE:.3g} rad, but reaches {angle:.3g} rad "
                    f"by t = {last:g}"
                )


def check_control(system: Any) -> None:
    """Raise if a control does not go with float32."""
    from ..model.systems.own import OwnSystem

    if isinstance(system, OwnSystem) and system.keeper is not None:
        raise UnsupportedError(
            f"dtype: float32 does not go with a control of your own equations, got {system.keeper!r}; use float64"
        )
