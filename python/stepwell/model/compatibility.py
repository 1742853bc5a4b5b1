"""Checks of combinations: of systems, methods, controls and options of a run."""

from __future__ import annotations

from math import prod
from typing import Any

import numpy as np

from ..base.immutable import changed
from ..errors import ArgumentError, UnsupportedError
from .controls import Control, EnergyControl, NormControl
from .methods import Method
from .systems import Sampled, Springs, System
from .systems.rods import RodSystem

#: Terms that depend on the velocity, and may turn it instead of slowing it.
TURNING = ("forces that do", "velocities in the rows of v", "the Coriolis force")


def fits_together(system: System, method: Method) -> None:
    """Raise if the method cannot step the system."""
    if method.is_exact:
        _has_exact_steps(system)
        return
    if system.mass_matrix is not None and not method.is_implicit:
        raise UnsupportedError(
            f"method: {method.name} needs the rate of every number of the state, and the algebraic equations of {system!r} give "
            f"none; take an implicit method, such as rodas5p"
        )
    if method.kept and isinstance(system, RodSystem) and system.contacts:
        raise UnsupportedError(
            f"method: {method.name} keeps {', '.join(method.kept)} of steps before, which do not hold after a bounce, and one on "
            f"rods changes all points at once; take a method that keeps nothing, such as rk4"
        )
    if not method.needs_acceleration:
        return
    if not system.second_order:
        raise UnsupportedError(f"{method.name} needs a second-order system, ÿ = a(t, y); {system!r} is not one")
    if (term := system.uncontrolled.velocity_term) is not None:
        # What turns the velocity, as a magnetic field does, makes false_euler grow at every step; what slows it does not.
        instead = "use rk4, or implicit_midpoint, which keeps what turns" if term in TURNING else "use false_euler"
        raise UnsupportedError(
            f"{method.name} needs forces that do not depend on the velocity, but {system!r} has {term}; "
            f"{instead}{'' if term == 'forces that do' else f', or leave {term} out'}"
        )
    if system.keeper is not None and method.carry is not None:
        raise UnsupportedError(
            f"control: {method.name} carries {method.carry} in place of v, so it cannot be combined with {system.keeper!r}, "
            f"which changes v between steps; use pefrl or false_euler"
        )


def _has_exact_steps(system: System) -> None:
    """Raise if the exact solution of a system over a step is no product with a matrix."""
    if not system.linear:
        raise UnsupportedError(
            f"method: exact steps linear systems, whose solution over a step is the exponential of a matrix; {system!r} is not "
            f"linear: take another method, or near a state LinearSystem(sw.jacobian(system, at=…).matrix)"
        )
    for name, each in system.given_inputs().items():
        if isinstance(each, Sampled) and each.interpolation == "cubic" and not each.constant:
            raise UnsupportedError(
                f"{name}: exact knows the solution for inputs that are constant, sinusoidal, held or on straight lines; give "
                f'interpolation="linear", with more samples, or take another method'
            )


def samples_meet_steps(system: System, method: Method, t0: Any, dt: float) -> None:
    """Raise if a sample of an input of the exact method begins within a step, which then has no one matrix.

    Nor does a series of fixed steps see a piece of the rates that the time chooses within a step.
    """
    if method.has_series and system.switches_by_time:
        raise UnsupportedError(
            f"dt: {system!r} compares the time, or rounds it, and a series takes what holds at the start of a step for all of "
            f"it, so a pulse within a step is lost; give tolerance= and at= with another method, such as dop853, whose steps end "
            f"where the time switches"
        )
    if not method.is_exact:
        return
    for name, each in system.given_inputs().items():
        if not isinstance(each, Sampled) or each.constant:
            continue
        steps, since = each.interval / abs(dt), (each.start - np.asarray(t0)) / dt
        if max(abs(steps - round(steps)), float(np.abs(since - np.round(since)).max())) > OFF_STEPS or round(steps) < 1:
            raise UnsupportedError(
                f"{name}: with exact a sample begins with a step, and here some begin within one (interval {each.interval:g}, "
                f"start {each.start:g}, dt {dt:g}); take dt so that it divides the interval and the start, or another method"
            )


#: By this share of a step a sample may be off its begin: rounding of times that are sums of thousands of steps.
OFF_STEPS = 1e-6


def not_with_exact(method: Method, **options: Any) -> None:
    """Raise if an option would change a system so that its solution is no longer known."""
    reasons = {
        "force": "give the linear system an input",
        "control": "it makes the equations nonlinear",
        "events": "a located event ends a shorter step, and the matrix is of steps of one length",
    }
    for name, option in options.items():
        if method.is_exact and option is not None:
            raise UnsupportedError(f"{name}: does not go with exact: {reasons[name]}")


def goes_with_a_controller(system: System, method: Method, **options: Any) -> None:
    """Raise if a method or an option does not work with the sampled controller of a system, if it has one."""
    if system.controller is None:
        return
    if method.carry is not None:
        raise UnsupportedError(
            f"method: {method.name} carries {method.carry} from the middle of a step to that of the next, and what a sampled "
            f"controller sets changes between them; take a method that carries v, such as false_euler or rk4"
        )
    reasons = {
        "tolerance": "a controller samples at whole numbers of steps of one length; give dt= and steps=",
        "events": "an event within a step is located by shorter steps, of which a period has another number",
    }
    for name, option in options.items():
        if option is not None:
            raise UnsupportedError(f"{name}: does not go with a sampled controller: {reasons[name]}")


def one_state(what: str, method: Method) -> None:
    """Raise if a step of the method goes on from more than v and y, so that it is no map from states to states."""
    if method.kept:
        raise UnsupportedError(
            f"{what}: a step of {method.name} goes on from more than v and y: from {', '.join(method.kept)}, which it keeps "
            f"between steps. What is asked for is that of a map from one state to the next; its limit on an oscillator is "
            f"{method.name}.limit"
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


def bounces_within_limits(system: System, method: Method, dt: float) -> None:
    """Raise if an implicit step is so long that what a bounce does to a net of springs adds energy.

    The step is solved for without the bounce, which then moves one end of a spring alone: with h²k above the mass that stretches
    the spring by more than the impact had in energy.
    """
    if not (method.is_implicit and isinstance(system, Springs) and any(surface.way != "spring" for surface in system.contacts)):
        return
    undamped = changed(system, damping=None, drag=None, velocity_term=None)  # damping only takes energy
    if abs(dt) > (longest := float(np.min(undamped.safe_step("false_euler")))):
        raise UnsupportedError(
            f"dt: expected at most {longest:.3g}, got {abs(dt):.3g}: {method.name} solves for the springs without the surfaces, "
            f"and a bounce after a longer step adds energy. Make several shorter steps a frame, which false_euler makes faster, "
            f'or take Floor(way="spring", omega=…), whose push linearly_implicit_euler solves for together with the springs'
        )


def goes_back(system: System, control: Any) -> None:
    """Raise if a system has no unique past, so that steps back in time have no meaning."""
    if system.has_stick_friction:
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
