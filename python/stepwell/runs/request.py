"""What runs with fixed and with adaptive steps have in common."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..base import checks
from ..base.arrays import Array
from ..errors import ArgumentError
from ..model.systems import System

if TYPE_CHECKING:
    from ..base.literals import Backend
    from .result import Run

BACKENDS: tuple[Backend, ...] = ("rust", "numpy")

#: The memory of a run besides its saved states: so many numbers for each number of a state (the start, the carry, the final
#: state), and so many bytes for each saved time (its step number and the time).
NUMBERS_PER_STATE, BYTES_PER_TIME = 4, 16


def quantities(system: System, record: Any) -> list[str]:
    """What to record, each once; raise if the system does not have it."""
    if type(record) is tuple and not record:
        return []
    given = [record] if isinstance(record, str) else [] if record is None else checks.several("record", record, "quantities")
    known = list(dict.fromkeys(["energy", *system.quantities]))
    for name in given:
        checks.known("record", name, known)
    if "energy" in given and "energy" not in system.quantities:
        v, y = (np.zeros((*shape, *system.batch)) for shape in (system.v_shape, system.y_shape))
        system.energy(v, y)  # raises if there is none, before any work
    return list(dict.fromkeys(given))


def spread(array: Array, block: tuple[int, ...], batch: tuple[int, ...]) -> Array:
    """A state over the whole batch."""
    axes = array.shape[len(block) :]
    if axes == batch:
        return array
    if not array.ndim:
        return checks.over(array, batch)
    return np.broadcast_to(array.reshape((*block, *(1,) * (len(batch) - len(axes)), *axes)), (*block, *batch))


def time_of(run: Run, step: int, index: tuple[int, ...]) -> float:
    """The time of a step of fixed length of a member: t0 + k·dt."""
    return float(np.broadcast_to(run.t0, run.status.shape)[index]) + step * run.dt


def goes_with_times(has_tolerance: bool, at: Any) -> None:
    """Raise if one of ``tolerance`` and ``at`` is missing, saying what it is."""
    if at is None:
        raise ArgumentError("at: expected too with tolerance=: the times at which states are saved, such as at=[t1, t2]")
    if not has_tolerance:
        raise ArgumentError("tolerance: expected too with at=: the error that a step may have, such as tolerance=1e-6")


def bar_of(title: str) -> Any:
    """A progress bar."""
    from ..base.progress import bar

    return bar(title)
