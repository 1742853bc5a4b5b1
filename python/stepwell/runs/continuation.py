"""How a run or a world goes on: its state, what its method carries, and whether that still holds.

A carry holds for one system and one state. With another system, or from another state, a run begins anew at the saved state.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import zip_longest
from typing import Any, NamedTuple, Protocol

import numpy as np

from ..base import checks
from ..base.arrays import Array, Shape, Whole
from ..base.reprs import share
from ..errors import ArgumentError, DTypeError, UnsupportedError
from ..model.methods import Method
from ..model.systems import System
from . import engine
from .result import AdaptiveState, Run, Status

ANEW = "to go on with another, start anew from its last state: v=run.v[-1], y=run.y[-1], t0=run.t[-1]"


class Continuation(NamedTuple):
    """Where a run or a world stands.

    Attributes:
        system: what was stepped, with its control.
        method: the method.
        v: velocities of all members, shape (*block, *batch).
        y: coordinates, likewise.
        options: further arguments of ``integrate``, for those that are not given again.
        carry: what the method carries in place of v; with adaptive steps the state of the step-size controller; or None.
        first_bad_step: the step at which each member diverged, −1 for none; None if no member did.
        changed_by: names of the events that changed the state.
        adaptive: whether its steps are adaptive.
        memory: what a sampled controller remembers, rows of one number for each member; None without one.
    """

    system: System
    method: Method
    v: Array
    y: Array
    options: dict[str, Any]
    carry: Array | AdaptiveState | None = None
    first_bad_step: Whole | None = None
    changed_by: tuple[str, ...] = ()
    adaptive: bool = False
    memory: Array | None = None

    @property
    def batch(self) -> Shape:
        """The shape of its batch."""
        return self.y.shape[len(self.system.y_shape) :]

    def remembered(self, system: System, batch: Shape) -> Array | None:
        """The memory of the controller of a system, if it is the one of this system, with the same period and delay in steps.

        Its parameters, the system's and the state may be others.
        """
        before, now = self.system.controller, system.controller
        if self.memory is None or now is None:
            return None
        before = before.over_steps(self.options["dt"])
        if before.loop_key != now.loop_key:
            return None
        memory = self.memory.reshape(len(self.memory), *(1,) * (len(batch) - self.memory.ndim + 1), *self.memory.shape[1:])
        return np.array(np.broadcast_to(memory, (len(memory), *batch)), dtype=np.float64)

    def holds(self, system: System, batch: Shape, v: Array, y: Array, force: Array | None = None) -> bool:
        """True if the carry holds for a system and a state, which it does if all of their bits are the same as here.

        With adaptive steps ``force`` counts, too, since it acted in the held step.
        """
        before = self.options["force"] if self.adaptive else None
        one, other = _bits_of(self.system, self.batch, self.v, self.y, before), _bits_of(system, batch, v, y, force)
        return all(a == b for a, b in zip_longest(one, other))


class Standing(Protocol):
    """A ``World``, as far as a run that goes on from it needs it."""

    def _standing(self) -> Continuation: ...


def of(resume: Any, *, stopped: bool = False) -> Continuation:
    """Where a run or a world stands, from which another goes on; also of members that an event stopped, if ``stopped``.

    Raises:
        DTypeError: if it is neither.
        UnsupportedError: if a terminal event stopped a member, which has a time of its own.
    """
    if isinstance(resume, Run):
        return _of_run(resume, stopped)
    if isinstance(resume, Continuation):
        return resume
    if (standing := getattr(resume, "_standing", None)) is None:
        raise DTypeError(f"resume: expected a Run or a World that goes on, got {checks.short(resume)}")
    here: Continuation = standing()
    return here


def _of_run(run: Run, goes_on_stopped: bool) -> Continuation:
    if run.is_part:
        raise ArgumentError("resume: expected a run with its last state, got a part of one without it, as of run.select")
    if not goes_on_stopped and (stopped := int(np.count_nonzero(run.status >= Status.EVENT))) > 0:
        raise UnsupportedError(
            f"resume: {share(stopped, run.status.shape, run.status.size)} stopped at an event, "
            f"{'at a time of its' if stopped == 1 else 'at times of their'} own; begin a new run "
            + (
                "for each member i: v=run.v[-1][..., i], y=run.y[-1][..., i], t0=float(run.stopped_at[i])"
                if run.status.shape
                else "from there: v=run.v[-1], y=run.y[-1], t0=float(run.stopped_at)"
            )
        )
    # Arrays of a message from another process may begin at an odd place in memory.
    v, y = (np.require(each, requirements="A") for each in (run.v[-1], run.y[-1]))
    carry = None if run.carry is None else np.require(run.carry, requirements="A")
    options = {"fused": run.fused, "dtype": run.dtype, "control": run.system.keeper, "force": run.force, "t0": run.t0}
    options |= run.options
    if (state := run.controller_state) is not None:
        # Members that stopped have no state at the last time; theirs is that of the stop.
        there = is_there(state.pace)
        state = state._replace(**{name: np.require(getattr(state, name), requirements="A") for name in ("v", "y", "pace")})
        v, y = (np.where(there, saved, last) for saved, last in ((v, state.v), (y, state.y)))
        return Continuation(run.system, run.method, v, y, options, state, None, run.changed_by, adaptive=True)
    options |= {"start_step": run.start_step + run.steps, "dt": run.dt, "start": run.start}
    bad = run.first_bad_step if run.status.any() else None
    carry, memory = _parted(run.system, run.method, run.dt, carry)
    return Continuation(run.system, run.method, v, y, options, carry, bad, run.changed_by, memory=memory)


def _parted(system: System, method: Method, dt: float, carry: Array | None) -> tuple[Array | None, Array | None]:
    """The carry of a method, and behind it the memory of a sampled controller."""
    if carry is None or system.controller is None:
        return carry, None
    numbers = system.controller.over_steps(dt).remembers(system)
    return (carry[:-numbers] if method.begins else None), carry[-numbers:]


def _bits_of(system: System, batch: Shape, v: Array, y: Array, force: Array | None) -> Iterator[Any]:
    """All bits that identify a system with its control and a state of a batch."""
    yield system.kernel
    yield batch
    yield from bits_of_parameters(system, batch)
    for block, axes in ((v, len(system.v_shape)), (y, len(system.y_shape))):
        whole = np.broadcast_to(block, (*np.shape(block)[:axes], *batch))
        yield np.asarray(whole, dtype=np.float64).tobytes()
    if force is not None:
        yield np.asarray(force, dtype=np.float64).tobytes()


def bits_of_parameters(system: System, batch: Shape) -> Iterator[Any]:
    """All bits that identify a system with its control."""
    for name, value in system.parameters(batch):
        yield name
        for part in value if isinstance(value, tuple) else (value,):
            yield _bits(part) if isinstance(part, np.ndarray) else _word(system, part)


def _bits(rows: Array) -> bytes:
    """The bits of each member's numbers; of one member if all have the same, however they were given."""
    bits = np.ascontiguousarray(rows).view(np.int64)
    if bits.shape[1] > 1 and (bits == bits[:, :1]).all():
        bits = bits[:, :1]
    return repr(bits.shape).encode() + bits.tobytes()


def _word(system: System, value: Any) -> bytes:
    if isinstance(value, (str, int, float, bytes)):
        return repr(value).encode()
    digest: str = system.digest  # type: ignore[attr-defined]  # of an own system, whose function is a list of operations
    return digest.encode()


def goes_on_alike(before: Continuation, method: Method, dt: float | None = None) -> None:
    """Raise if a run goes on with another method, whose carry means something else, or another step."""
    if dt is not None and dt != before.options["dt"]:
        raise ArgumentError(f"dt: expected the step of the run that goes on, {before.options['dt']!r}, got {dt!r}; {ANEW}")
    if before.carry is not None and before.method is not method:
        raise ArgumentError(
            f"method: expected {before.method.name!r}, the method of the run that goes on, which carries more than its state, "
            f"got {method.name!r}; {ANEW}"
        )


def changes_on(before: Continuation, events: Any) -> None:
    """Raise if a run goes on without the events that changed the state so far, since another motion would follow silently."""
    if events is None and before.changed_by:
        raise ArgumentError(
            f"events: expected the events of the run that goes on, whose state was changed by {', '.join(before.changed_by)}, "
            f"got None; give them again, or events=[] to go on without"
        )


def taken_up(
    plan: engine.Plan, pacing: engine.Pacing, before: Continuation, v: Array, y: Array
) -> tuple[Array, Array, Array, bool]:
    """The step-size controllers and states of members, and whether they begin anew, as with another system or state."""
    assert isinstance(before.carry, AdaptiveState)
    pace, state = before.carry.pace.copy(), before.carry
    pace[engine.WORK] = 0.0  # no control has done anything yet in this run
    # A run that saved only its start did not know the length of the run, on which the first step from rest may depend.
    begins = not pace[engine.COUNTS].any() and not pace[engine.HELD].any() and bool((pace[engine.STEP] == engine.BLIND).any())
    if begins or not before.holds(plan.system, plan.batch, v, y, plan.force):
        return _begun_anew(plan, pacing, pace), v, y, True
    return pace, state.v, state.y, False


def is_there(pace: Array) -> np.ndarray[Any, np.dtype[np.bool_]]:
    """Which members reached the last output time; others stopped before."""
    there: np.ndarray[Any, np.dtype[np.bool_]] = (pace[engine.HELD] > 0.0) | (pace[engine.TIME] >= pace[engine.TARGET])
    return there


def standing(pace: Array) -> Array:
    """The times from which members go on: the last output time, or the time of their stop."""
    times: Array = np.where(is_there(pace), pace[engine.TARGET], pace[engine.TIME])
    return times


def _begun_anew(plan: engine.Plan, pacing: engine.Pacing, pace: Array) -> Array:
    """The step-size controllers of members that begin anew, with their tolerance, where they were saved or stopped."""
    time = standing(pace)
    groups = engine.groups_of(plan)
    own = engine.own_tolerances(pace, groups, engine.low_numbers(plan))
    relative, absolute = (own[:groups], own[groups:]) if len(own) else (pace[engine.RELATIVE], pace[engine.ABSOLUTE])
    lasts = bool((pace[engine.LASTS] > 0.0).all())
    tolerances = engine.Tolerances(relative, None if lasts else absolute, len(own) > 0)
    numbers = engine.paces(plan._replace(t0=time), None, tolerances, pace[engine.MOST_STEP], pacing)
    axes = numbers.shape[1:] or len(plan.batch) * (1,)
    begun = np.array(np.broadcast_to(numbers.reshape(len(numbers), *axes), pace.shape))
    begun[engine.COUNTS] = pace[engine.COUNTS]
    return begun
