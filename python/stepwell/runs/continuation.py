"""What a run carries to the next piece, and for which system and state it holds.

A carry is of one system and one state: the step that it holds was made by them. Of another system, or from another state, a run
begins anew at the saved state.
"""

from __future__ import annotations

from math import prod
from string import hexdigits
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base import checks
from ..base.arrays import Array, Shape
from ..errors import ArgumentError
from ..model.systems import System
from . import engine

if TYPE_CHECKING:
    from .result import Run


#: How many letters a digest has.
LENGTH = 64


def identity(system: System, batch: Shape, v: Array, y: Array, force: Array | None = None) -> str:
    """By what a system, with its control, and a state of a batch are known: equal only if all of their bits are.

    With adaptive steps the ``force`` counts, too: the step that is held was made under it.
    """
    import hashlib  # only runs that go on need it

    found = hashlib.sha256(f"{system.kernel} {batch}".encode())
    for name, value in system.parameters(batch):
        found.update(f" {name} ".encode())
        for part in value if isinstance(value, tuple) else (value,):
            found.update(_bits(part) if isinstance(part, np.ndarray) else _word(system, part))
    for block, axes in ((v, len(system.v_shape)), (y, len(system.y_shape))):
        whole = np.broadcast_to(block, (*np.shape(block)[:axes], *batch))
        found.update(np.ascontiguousarray(whole, dtype=np.float64).data)
    if force is not None:
        found.update(np.ascontiguousarray(force, dtype=np.float64).data)
    return found.hexdigest()


def _bits(rows: Array) -> bytes:
    """The numbers of each member; those of one where all have the same, since it does not matter how they were given."""
    bits = np.ascontiguousarray(rows).view(np.int64)
    if bits.shape[1] > 1 and (bits == bits[:, :1]).all():
        bits = bits[:, :1]
    return repr(bits.shape).encode() + bits.tobytes()


def _word(system: System, value: Any) -> bytes:
    if isinstance(value, (str, int, float, bytes)):
        return repr(value).encode()
    digest: str = system.digest  # type: ignore[attr-defined]  # of an own system, whose function is a list of operations
    return digest.encode()


def a_digest(carried_for: Any) -> str:
    """What a carry holds for, as ``resume`` has it, or a file of arrays."""
    text = str(carried_for) if isinstance(carried_for, (str, np.ndarray)) else ""
    if len(text) != LENGTH or not set(text) <= set(hexdigits):
        raise ArgumentError(f"carried_for: expected the digest in run.resume, got {checks.short(carried_for)}")
    return text


def holds(carried_for: Any, system: System, batch: Shape, v: Array, y: Array) -> bool:
    """Whether a carry of fixed steps holds for a system and a state; one of which it is not said is taken as it is."""
    return carried_for is None or a_digest(carried_for) == identity(system, batch, v, y)


def with_tolerance(run: Run) -> dict[str, Any]:
    """Arguments with which a run with a tolerance goes on: the state at the last time, and the pace and the state of the carry.

    Members that stopped have no state at the last time but where they stopped.
    """
    assert run.controller_state is not None
    at, pace, batch = run.controller_state, run.controller_state.pace, run.status.shape
    there = is_there(pace)
    v, y = (np.where(there, saved[-1], last) for saved, last in ((run.v, at.v), (run.y, at.y)))
    carry = np.concatenate([pace, *(block.reshape(-1, *batch) for block in (at.v, at.y))])
    state: dict[str, Any] = {"v": v, "y": y, "t0": run.t0}
    if run.system.keeper is not None:
        state["control"] = run.system.keeper
    if run.force is not None:
        state["force"] = run.force
    carried_for = identity(run.system, batch, v, y, run.force)
    return state | at.options | {"carry": carry, "carried_by": at.method, "carried_for": carried_for}


def taken_up(
    plan: engine.Plan, pacing: engine.Pacing, carry: Array, carried_for: str, v: Array, y: Array
) -> tuple[Array, Array, Array, bool]:
    """Where members go on, their states there, and whether they begin anew: of another system, or from another state."""
    numbers, n_v = engine.pace_numbers(plan), prod(plan.system.v_shape)
    pace, state = carry[:numbers].copy(), carry[numbers:]
    pace[engine.WORK] = 0.0  # no control has done anything yet in this run
    # A run that saved its start alone did not know of a time of the run, of which the first step from rest may be a part.
    begins = not pace[engine.COUNTS].any() and not pace[engine.HELD].any() and bool((pace[engine.STEP] == engine.BLIND).any())
    if begins or carried_for != identity(plan.system, plan.batch, v, y, plan.force):
        return _begun_anew(plan, pacing, pace), v, y, True
    return pace, state[:n_v].reshape(v.shape), state[n_v:].reshape(y.shape), False


def is_there(pace: Array) -> np.ndarray[Any, np.dtype[np.bool_]]:
    """Members that reached the last output time; others stopped at a time of their own."""
    there: np.ndarray[Any, np.dtype[np.bool_]] = (pace[engine.HELD] > 0.0) | (pace[engine.TIME] >= pace[engine.TARGET])
    return there


def _begun_anew(plan: engine.Plan, pacing: engine.Pacing, pace: Array) -> Array:
    """The pace of members that begin with the same tolerance where they were saved, or where they stopped before."""
    time = np.where(is_there(pace), pace[engine.TARGET], pace[engine.TIME])
    groups = engine.groups_of(plan)
    own = pace[engine.PACE_NUMBERS + groups :]
    relative, absolute = (own[:groups], own[groups:]) if len(own) else (pace[engine.RELATIVE], pace[engine.ABSOLUTE])
    lasts = bool((pace[engine.LASTS] > 0.0).all())
    tolerances = engine.Tolerances(relative, None if lasts else absolute, len(own) > 0)
    numbers = engine.paces(plan._replace(t0=time), None, tolerances, pace[engine.MOST_STEP], pacing)
    axes = numbers.shape[1:] or len(plan.batch) * (1,)
    begun = np.array(np.broadcast_to(numbers.reshape(len(numbers), *axes), pace.shape))
    begun[engine.COUNTS] = pace[engine.COUNTS]
    return begun
