"""Checks of options, of states at the start and of times."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ... import _core
from ...base import checks, registry
from ...base.arrays import Array, Shape
from ...base.reprs import of_member
from ...errors import ArgumentError, UnknownNameError, UnsupportedError
from ...model.compatibility import fits_together, one_state, velocities
from ...model.controls import ConstraintControl, EnergyControl
from ...model.methods import Method
from ...model.methods import method as find_method
from ...model.systems import Sampled, Sinusoid, System
from ...model.systems.base import a_system
from .. import continuation

if TYPE_CHECKING:
    from ...base.literals import Backend, StepForm
    from ..continuation import Continuation
    from ..events import Event
    from . import Options

FORMS: tuple[StepForm, ...] = ("direct", "matrix")
BACKENDS: tuple[Backend, ...] = ("rust", "numpy")


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


def machine_of(device: Any, backend: str) -> Any:
    """The machine that makes the steps, or None for the CPU; without looking for any if it is that."""
    if (device is None and not _core.names_device()) or device == "cpu" or backend != "rust":
        if device not in (None, "cpu") and backend != "rust":
            raise ArgumentError(f"device: works with backend='rust' only, got backend={backend!r}")
        return None
    from ...device import device_of  # only such runs need it

    return device_of(device)


def controlled(system: System, method: Method, control: Any, v: Array, y: Array, dt: float) -> System:
    """The system under control, with the state as target if the control has none."""
    system = system.controlled(control, v, y, dt)
    fits_together(system, method)
    return system


def known_form(form: Any) -> StepForm:
    """The form; raise if there is none of that name, with what to write in place of the one that there was."""
    if isinstance(form, str) and form == "power":
        raise UnknownNameError(
            "form: there is no 'power' any more. Known: direct, matrix. Without inputs n steps are "
            "np.linalg.matrix_power(P, n) @ state, with P = sw.analyse(system, method, dt=dt).P"
        )
    return checks.known("form", form, FORMS)


def event_list(events: Any, form: str) -> list[Event]:
    """The events as a list."""
    from ..events.event import several

    if form != "direct":
        raise UnsupportedError(
            f"events: works with form='direct' only, got form={form!r}; a located event ends a shorter step, and a "
            f"matrix is of steps of one length"
        )
    return several(events)


def check_matrix_form(system: System, method: Method, form: str, force: Any) -> None:
    """Raise if there is no transition matrix."""
    if force is not None:
        raise UnsupportedError(
            f"force: works with form='direct' only, got form={form!r}; the matrices of a step have no term for it: "
            f"give the linear system an input"
        )
    if not system.linear:
        raise UnsupportedError(f"form: only linear systems have a transition matrix, and {system!r} is not linear")
    one_state("form", method)
    if method.takes_derivatives_by_time and any(map(_is_smooth, system.given_inputs().values())):
        raise UnsupportedError(
            f"form: {method.name} takes the derivatives of inputs too, and the transition matrix their values only; "
            f"use form='direct'"
        )


def _is_smooth(given: Any) -> bool:
    """True if an input changes within a step, so that it has a derivative there."""
    return isinstance(given, Sinusoid) or (isinstance(given, Sampled) and given.interpolation != "hold" and not given.constant)


def quantities(system: System, record: Any) -> list[str]:
    """The quantities to record, each once; raise if the system does not have one."""
    if type(record) is tuple and not record:
        return []
    names = [record] if isinstance(record, str) else checks.several("record", record, "quantities")
    known = list(dict.fromkeys(["energy", *system.recorded_shapes()]))
    for name in names:
        checks.known("record", name, known)
    if "energy" in names and "energy" not in system.quantities:
        v, y = (np.zeros((*shape, *system.batch)) for shape in (system.v_shape, system.y_shape))
        system.energy(v, y)  # raises if there is none, before any work
    return list(dict.fromkeys(names))


def block_like(block: Any, like: Array) -> Array:
    """A block as a request has it, of the shape of another."""
    array = np.asarray(0.0 if block is None else block, np.float64)
    return array if array.shape == like.shape else checks.over(array, like.shape)


def spread(array: Array, block: Shape, batch: Shape) -> Array:
    """Broadcast a block to the whole batch."""
    axes = array.shape[len(block) :]
    if axes == batch:
        return array
    if not array.ndim:
        return checks.over(array, batch)
    return np.broadcast_to(array.reshape((*block, *(1,) * (len(batch) - len(axes)), *axes)), (*block, *batch))


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
