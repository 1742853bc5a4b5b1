"""A run step by step, by the core or by the reference."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from math import prod
from typing import Any

import numpy as np

from ... import _core
from ...base import buffer_pool
from ...base.arrays import Array, Blocks, Whole
from ...model.parameters import rows
from ...reference import contact
from ...reference import run as reference
from ...reference.signal import of_slot, over
from .by_tape import evaluated, evaluated_slot, evaluated_step, rows_of
from .plan import Arrays, Outcome, Plan, model, per_step

Looped = tuple[Array, Array, Blocks, Whole]


def advance_direct(plan: Plan, v: Array, y: Array, before: Whole | None = None, *, carried: bool = False) -> Outcome:
    """Make the run step by step: see ``advance``."""
    before = first_bad_steps(plan, before)
    if plan.backend == "numpy":
        return _run_by_reference(plan, v, y, before, carried)
    return run_by_core(plan, model(plan), v, y, before, carried)


def first_bad_steps(plan: Plan, before: Whole | None) -> Whole:
    """A copy of the first bad steps of earlier runs; −1 for members that were finite so far."""
    if before is not None:
        return before.copy()
    none: Whole = buffer_pool.empty(plan.batch, np.int64)
    none.fill(-1)
    return none


def _run_by_reference(plan: Plan, v: Array, y: Array, before: Whole, carried: bool) -> Outcome:
    steps, remembered = plan.method.steps, None
    if plan.system.controller is not None:
        loop, of_loop = plan.stepped.looped(plan.dt, plan.batch, plan.force)
        remembered = [row.astype(plan.dtype) for row in plan.memory]  # type: ignore[union-attr]  # there is one
        s = of_loop(loop.held(remembered))
    else:
        s = plan.scaled()
    if plan.single:
        v, y = v.astype(plan.dtype), y.astype(plan.dtype)

    def plain(t: float, v: Array, y: Array, kept: list[Array]) -> Any:
        return contact.step(steps, s, plan.choice, t, plan.dt, v, y, *kept)

    def in_loop(t: float, v: Array, y: Array, kept: list[Array]) -> Any:
        work, memory = getattr(s, "work", None), kept[len(plan.method.kept) :]
        out, memory = loop.step(t, v, y, memory)
        now = of_loop(out)
        if work is not None:
            now.work = work
        stepped = contact.step(steps, now, plan.choice, t, plan.dt, v, y, *kept[: len(plan.method.kept)])
        if work is not None:
            s.work = now.work
        return *stepped, *memory

    make = evaluated_step(plan, s) if plan.by_tape else plain if remembered is None else in_loop
    slot, *kept = to_blocks(plan, v if carried else to_slot(plan, v, y))
    kept += remembered or []

    memories = [remembered]

    def step(t: float, v: Array, y: Array) -> Blocks:
        nonlocal kept
        v, y, *kept = make(t, v, y, kept)
        if remembered is not None and plan.record:
            memories.append(kept[len(plan.method.kept) :])
        return v, y

    slot, y, saved, first_bad = looped(plan, step, slot, y, before, plan.block_axes, to_velocity(plan))
    out = finished(plan, slot, saved, first_bad)
    if plan.keeps:
        out = out._replace(slot=_joined(plan, [slot, *kept]))

    def recorded_of(name: str, i: int) -> Array:
        if name in plan.system.quantities:
            return np.asarray(s.record(name, out.v[i], out.y[i]))
        return np.asarray(plan.system.controller.held(plan.system, name, memories[plan.saves[i]]))

    with np.errstate(all="ignore"):
        recorded = {
            name: _stacked((recorded_of(name, i) for i in range(plan.save_count)), plan.save_count) for name in plan.record
        }
    work = None if plan.system.control is None else np.broadcast_to(np.asarray(s.work), plan.batch).copy()
    return out._replace(recorded=recorded, work=per_step(plan, work))


def to_blocks(plan: Plan, slot: Array) -> list[Array]:
    """v, or what is carried in its place, and the blocks that the method keeps."""
    if not plan.method.kept:
        return [slot]
    shapes = [plan.system.v_shape, *((plan.system.y_shape, plan.system.v_shape)[of_v] for of_v in plan.method.kept_of_v)]
    ends = np.cumsum([prod(shape) for shape in shapes])[:-1]
    parts = np.split(slot, ends)
    return [part.reshape((*shape, *slot.shape[1:])) for part, shape in zip(parts, shapes, strict=True)]


def _joined(plan: Plan, blocks: list[Any]) -> Array:
    """V and the blocks that the method keeps, as rows: undoes ``to_blocks``."""
    shapes = [plan.system.v_shape, *((plan.system.y_shape, plan.system.v_shape)[of_v] for of_v in plan.method.kept_of_v)]
    shapes += [()] * (len(blocks) - len(shapes))  # what a controller remembers
    wide = [np.broadcast_to(block, (*shape, *plan.batch)) for block, shape in zip(blocks, shapes, strict=True)]
    return np.concatenate([block.reshape((prod(shape), *plan.batch)) for block, shape in zip(wide, shapes, strict=True)])


def _stacked(states: Iterable[Array], count: int) -> Array:
    """Stack ``count`` arrays of one shape without a list of them."""
    stack = np.empty(0)
    for i, state in enumerate(states):
        if i == 0:
            stack = np.empty((count, *state.shape))
        stack[i] = state
    return stack


def to_velocity(plan: Plan) -> reference.Velocity | None:
    """A function from the carry to velocities at a time; None if the method carries velocities."""
    if plan.method.carry is None:
        return None
    if plan.by_tape:
        return evaluated_slot(plan, "finish")
    s, finish = plan.scaled(), plan.method.steps.finish

    def velocity(t: float, slot: Array, y: Array) -> Array:
        return np.asarray(over(of_slot(t, plan.dt), finish, s, plan.choice, t, slot, y))

    return velocity


def looped(
    plan: Plan,
    step: reference.Step,
    v: Array,
    y: Array,
    before: Whole,
    block_axes: tuple[int, int],
    velocity: reference.Velocity | None,
) -> Looped:
    """The steps of the plan by the reference, with calls of ``progress``."""
    done, every = 0, max(1, plan.steps // 100)

    def step_with_progress(t: float, v: Array, y: Array) -> Blocks:
        nonlocal done
        done += 1
        if plan.progress is not None and done % every == 0:
            plan.progress(done / plan.steps)
        return step(t, v, y)

    counts: Any = {"h": plan.dt, "t0": plan.t0, "first": plan.first, "steps": plan.steps, "saves": plan.saves}
    return reference.run(step_with_progress, v, y, before, block_axes, velocity=velocity, **counts)


def to_slot(plan: Plan, v: Array, y: Array) -> Array:
    """The carry of the method at the first step; if it keeps blocks, v and these as rows."""
    if not plan.method.begins:
        return v
    t = plan.t0 + plan.first * plan.dt
    with np.errstate(all="ignore"):
        if plan.method.kept:
            if plan.by_tape:
                memory = [] if plan.memory is None else list(plan.memory)
                n_v, n_y = prod(plan.system.v_shape), prod(plan.system.y_shape)
                before = [*rows_of(plan, v, y), *[np.zeros(plan.batch)] * (plan.slot_numbers - n_v), *memory]
                rows = evaluated(plan, "start")(before, t)
                return np.concatenate([rows[:n_v], rows[n_v + n_y : n_y + plan.slot_numbers]])
            steps: Any = plan.method.steps
            return _joined(plan, [v, *over(of_slot(t, plan.dt), steps.start, _begun(plan), plan.choice, t, plan.dt, v, y)])
        if plan.by_tape:
            return evaluated_slot(plan, "start")(t, v, y)
        return np.asarray(over(of_slot(t, plan.dt), plan.method.steps.start, plan.scaled(), plan.choice, t, v, y))


def _begun(plan: Plan) -> Any:
    """The system as it is before the first step."""
    if plan.memory is None:
        return plan.scaled()
    loop, of_loop = plan.stepped.looped(plan.dt, plan.batch, plan.force)
    return of_loop(loop.held(list(plan.memory)))


def finished(plan: Plan, slot: Array, saved: Blocks, first_bad: Any) -> Outcome:
    """The outcome with velocities from the saved slots, which are overwritten."""
    v, y = saved
    if velocity := to_velocity(plan):
        if np.shares_memory(slot, v):
            slot = slot.copy()
        with np.errstate(all="ignore"):
            for i, step in enumerate(plan.saves):
                v[i] = velocity(plan.t0 + (plan.first + int(step)) * plan.dt, v[i], y[i])
    return Outcome(v, y, slot, np.asarray(first_bad, dtype=np.int64))


def run_by_core(
    plan: Plan,
    model: _core.ModelSpec,
    v: Array,
    y: Array,
    before: Whole,
    carried: bool,
    carries: bool | None = None,
    make: Callable[..., bool] = _core.run,
) -> Outcome:
    """The run by the core. ``carries`` is whether it returns a carry, as the plan does if None; ``make`` makes the steps."""
    carries = plan.begins if carries is None else carries
    count = plan.save_count
    empty = np.empty if count * (v.size + y.size) < buffer_pool.LEAST_POOLED // 8 else buffer_pool.empty
    shape_of_v = (*plan.system.v_shape, *plan.batch) if plan.keeps else v.shape
    saved_v, saved_y = empty((count, *shape_of_v), plan.dtype), empty((count, *y.shape), plan.dtype)
    carry = np.empty(plan.slot_shape if plan.keeps else v.shape, plan.dtype) if carries else None
    recorded = None
    if plan.record:
        known = plan.system.recorded_shapes()
        shapes = {name: known[name] for name in plan.record}
        recorded = buffer_pool.empty((count, sum(map(prod, shapes.values())), *plan.batch), plan.dtype)
    work = None if plan.system.control is None else np.empty(plan.batch, plan.dtype)
    if plan.watched is not None:
        work = None  # what is watched stands behind it
    tally = None if work is None else work.reshape(-1)
    rows_v, rows_y = rows(v, plan.batch), rows(y, plan.batch)
    if plan.memory is not None:
        members = plan.members if rows_v.shape[1] != 1 or plan.batch else 1
        of_v, memory = (
            np.broadcast_to(each, (len(each), members)) for each in (rows_v, plan.memory.reshape(len(plan.memory), -1))
        )
        rows_v = np.ascontiguousarray(np.concatenate([of_v, memory]))
    arrays = Arrays(rows_v, rows_y, carried, saved_v, saved_y, recorded, tally, carry, before.reshape(-1))
    if plan.device is None:
        diverged = make(model, plan.of_core(), arrays)
    else:
        from ...device import fixed  # only such runs need it

        diverged = fixed.run(plan.device, model, plan.of_core(), arrays)
    by_name: dict[str, Array] = {}
    if recorded is not None:
        for name, shape in shapes.items():
            mine, recorded = recorded[:, : prod(shape)], recorded[:, prod(shape) :]
            by_name[name] = np.asarray(mine.reshape(count, *shape, *plan.batch), np.float64)
    work = None if work is None else per_step(plan, work)
    return Outcome(saved_v, saved_y, saved_v[-1] if carry is None else carry, before, by_name, work, diverged)
