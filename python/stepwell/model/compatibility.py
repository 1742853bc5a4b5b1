"""Checks of combinations: of systems, methods, controls and options of a run."""

from __future__ import annotations

from math import prod
from typing import Any

import numpy as np

from ..errors import ArgumentError, UnsupportedError
from .controls import Control, EnergyControl, NormControl
from .methods import Method
from .systems import Sampled, System


def fits_together(system: System, method: Method) -> None:
    """Raise if the method cannot step the system."""
    if system.mass_matrix is not None and not method.is_implicit:
        raise UnsupportedError(
            f"method: {method.name} needs the rate of every number of the state, and the algebraic equations of {system!r} give "
            f"none; take an implicit method, such as rodas5p"
        )
    if not method.needs_acceleration:
        return
    if not system.second_order:
        raise UnsupportedError(f"{method.name} needs a second-order system, ÿ = a(t, y); {system!r} is not one")
    if (term := system.uncontrolled.velocity_term) is not None:
        raise UnsupportedError(
            f"{method.name} needs forces that do not depend on the velocity, but {system!r} has {term}; "
            f"use false_euler{'' if term == 'forces that do' else f', or leave {term} out'}"
        )
    if system.keeper is not None and method.carry is not None:
        raise UnsupportedError(
            f"control: {method.name} carries {method.carry} in place of v, so it cannot be combined with {system.keeper!r}, "
            f"which changes v between steps; use pefrl or false_euler"
        )


def not_of_a_step(control: Any) -> None:
    """Raise if a control does not work with adaptive steps."""
    if getattr(control, "relative", None) is not None and control.gain is None:
        raise UnsupportedError(
            f"tolerance: {control!r} relates its gain to steps of fixed length; give gain in place of relative"
        )
    if getattr(control, "of_a_step", False):
        raise UnsupportedError(
            f"tolerance: {control!r} is relative to steps of fixed length; use a projection, which works with any steps"
        )


def forced(system: System) -> None:
    """Raise if a system has no v̇ to which a force could be added."""
    if prod(system.v_shape) == 0:
        raise UnsupportedError(f"force: it is added to the rates of v, and {system!r} has no v; give it an input or a parameter")


def velocities(system: System, v: Any) -> Any:
    """The argument ``v``, which only a system without velocities may leave out."""
    if v is None and system.v_shape == (0,):
        return 0.0
    if v is None:
        raise ArgumentError(
            f"v: expected the velocities at the start, got None; {system!r} has velocities, unlike a system of first order"
        )
    return v


def fits_own_times(system: System, single: bool) -> None:
    """Raise if members of a system cannot have times of their own."""
    if single and system.has_time:
        raise UnsupportedError(
            "t0: an array works with float64 only, since in float32 t0 + k·dt would be rounded twice; make a run for each t0"
        )


def goes_back(system: System, control: Any) -> None:
    """Raise if a system has no unique past, so that steps back in time have no meaning."""
    if system.stick_friction is not None:
        raise UnsupportedError(
            f"dt: a negative step needs a unique past, and friction that sticks has none: {system!r} at rest may have had any "
            f"speed before; use dt above zero"
        )
    if any(surface.way != "spring" for surface in system.contacts):
        raise UnsupportedError(
            f'dt: a negative step cannot undo a bounce, got {system!r}; use way="spring", or, if nothing is lost, step −v '
            f"with dt above zero"
        )
    control = system.keeper if control is None else control
    if isinstance(control, (EnergyControl, Control, NormControl)):
        raise UnsupportedError(f"dt: with a negative step {control!r} would drive away from its target; use a projection")


def goes_on_by_a_rule(system: System) -> None:
    """Raise if the power form cannot advance an input over many steps."""
    for name, each in system.given_inputs().items():
        if isinstance(each, Sampled) and not each.constant:
            raise UnsupportedError(
                f"form: many steps are one power only if the inputs follow a formula, as constants and sinusoids do, but {name} "
                f"changes from sample to sample; use form='matrix' or 'direct'"
            )


def goes_with_series(system: System, control: Any) -> None:
    """Raise unless the rates are smooth within a step, so that the last terms of a series estimate its error."""
    instead = "use another method, such as dop853"
    if system.samples[0] < np.inf:
        raise UnsupportedError(f"tolerance: a series does not see that samples of an input change within a step; {instead}")
    if system.contacts:
        raise UnsupportedError(f"tolerance: a series does not see that a point meets a surface within a step; {instead}")
    if isinstance(control or system.control, EnergyControl):
        raise UnsupportedError(f"tolerance: EnergyControl pushes once a step, and a series has long steps; {instead}")
    if system.chooses:
        raise UnsupportedError(
            f"tolerance: {system!r} chooses between values (np.where, abs, minimum, floor, …), and a series does not see that "
            f"another one is chosen within a step; {instead}"
        )
