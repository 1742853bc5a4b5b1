"""Systems, states and times at the start of a run."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..base import checks, registry
from ..base.arrays import Array, Shape
from ..base.reprs import of_member
from ..errors import ArgumentError
from ..model.compatibility import fits_together, velocities
from ..model.controls import ConstraintControl, EnergyControl
from ..model.methods import Method
from ..model.methods import method as find_method
from ..model.systems import System
from ..model.systems.base import a_system
from . import continuation

if TYPE_CHECKING:
    from .continuation import Continuation
    from .options import Options

#: The share of a component by which it may be off at the start of a run whose steps have no tolerance.
UNTOLD = 1e-6


def under_control(system: System, control: Any, v: Array | None, y: Array | None, batch: Shape, dt: float | None) -> System:
    """The system under control. Without a state the control needs all of its numbers, but not if there is no ``dt`` either."""
    if v is not None and y is not None and dt is not None:
        return system.controlled(control, v, y, dt)
    if dt is not None and not system.keeps(control) and not isinstance(control, ConstraintControl) and control.target is None:
        raise ArgumentError("control: expected one with a target, or v and y, whose energy it keeps")
    if dt is not None and isinstance(control, EnergyControl) and control.gain is None:
        raise ArgumentError("control: expected one with gain=, or v and y, since relative= refers to them")
    return system.under(control, batch)


def options_of_resumed(options: Options) -> tuple[Options, Continuation]:
    """The options, with those of the run that goes on for options that were left out."""
    before = continuation.of(options.resume)
    for name in ("t0", "start_step"):
        if getattr(options, name) is not None:
            raise ArgumentError(
                f"{name}: the run that goes on has its own, got {checks.short(getattr(options, name))}; to begin elsewhere, "
                f"start anew from its last state: v=run.v[-1], y=run.y[-1]"
            )
    known = {"v": before.v, "y": before.y} | before.options
    return options._replace(**{name: each for name, each in known.items() if getattr(options, name) is None}), before


def checked_system(system: Any, method: str | Method, v: Any, y: Any) -> tuple[Method, System, Any]:
    """Method and system of a run, and the velocities at its start."""
    method = find_method(method)
    system = a_system(system)
    if y is None:
        raise ArgumentError("y: expected the coordinates at the start, got None; or the run that goes on, resume=run")
    system = system.for_state_shapes(v, y)
    v = velocities(system, v)
    fits_together(system, method)
    return method, system, v


def check_algebraic(system: System, y: Array, t: Any, tolerances: Any = None) -> None:
    """Raise if algebraic equations of a system do not hold at the start, within the tolerance or 1e-6 of each number."""
    if system.mass_matrix is None:
        return
    relative = UNTOLD if tolerances is None else float(tolerances.relative.max())
    absolute = 0.0 if tolerances is None or tolerances.absolute is None else float(tolerances.absolute.max())
    registry.task("algebraic_start")(system, y, t, relative, absolute)


def controlled(system: System, method: Method, control: Any, v: Array, y: Array, dt: float) -> System:
    """The system under control, with the state as target if the control has none."""
    system = system.controlled(control, v, y, dt)
    fits_together(system, method)
    return system


def block_like(block: Any, like: Array) -> Array:
    """A block as a request has it, of the shape of another."""
    array = np.asarray(0.0 if block is None else block, np.float64)
    return array if array.shape == like.shape else checks.over(array, like.shape)


def last_time(t0: Any, dt: float, start_step: int, steps: int) -> float:
    """The largest |t| of a run; raise if a time does not advance or is not finite."""
    begin, end = t0 + start_step * dt, t0 + (start_step + steps) * dt
    index: Shape = ()
    if isinstance(t0, np.ndarray):
        wrong = (begin == end) | ~np.isfinite(end)
        if not wrong.any():
            return float(max(np.abs(each).max(initial=0.0) for each in (begin, end)))
        index = tuple(np.argwhere(wrong)[0].tolist())
        begin, end = begin[index], end[index]
    elif begin != end and np.isfinite(end):
        return float(max(abs(begin), abs(end)))
    raise ArgumentError(
        f"dt, t0: expected a time that moves on and stays finite, got t = {begin:g} at step {start_step} and t = {end:g} "
        f"after {steps} steps of {dt:g}{of_member(index)}"
    )
