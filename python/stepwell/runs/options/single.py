"""Checks of single options."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ... import _core
from ...base import checks
from ...errors import ArgumentError, UnknownNameError, UnsupportedError
from ...model.compatibility import one_state
from ...model.methods import Method
from ...model.systems import Sampled, Sinusoid, System

if TYPE_CHECKING:
    from ...base.literals import Backend, StepForm
    from ..events import Event

FORMS: tuple[StepForm, ...] = ("direct", "matrix")
BACKENDS: tuple[Backend, ...] = ("rust", "numpy")


def machine_of(device: Any, backend: str) -> Any:
    """The machine that makes the steps, or None for the CPU; without looking for any if it is that."""
    if (device is None and not _core.names_device()) or device == "cpu" or backend != "rust":
        if device not in (None, "cpu") and backend != "rust":
            raise ArgumentError(f"device: works with backend='rust' only, got backend={backend!r}")
        return None
    from ...device import device_of  # only such runs need it

    return device_of(device)


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


def names_of_sensitivities(system: System, sensitivity: Any) -> tuple[str, ...]:
    """The names of what states are differentiated by: "v" and "y" at the start, and parameters."""
    from ...model.derivatives.columns import parameters_of  # only such runs need it

    names = [sensitivity] if isinstance(sensitivity, str) else checks.several("sensitivity", sensitivity, "names")
    known = (*(("v",) if system.v_shape != (0,) else ()), "y", *parameters_of(system))
    for name in names:
        checks.known("sensitivity", name, known)
    if twice := [name for i, name in enumerate(names) if name in names[:i]]:
        raise ArgumentError(f"sensitivity: expected each name once, got {twice[0]!r} twice")
    return tuple(names)


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
