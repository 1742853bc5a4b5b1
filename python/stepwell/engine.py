"""Slots in, slots out: the same run by the Rust core or by the NumPy reference, in direct, matrix or power form.

A slot is what stands in the place of a block between steps: v for most methods, something else for those with a carry. Everything
above this file speaks of states, everything below of slots.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from itertools import count
from math import floor, prod
from typing import Any, NamedTuple

import numpy as np

from . import _core
from ._checks import Array, Shape
from .control import EnergyControl
from .methods import Method
from .reference import run as reference
from .reference.types import Blocks, Whole
from .systems import Sampled, System
from .systems.base import flat, rows

Looped = tuple[Array, Array, list[Blocks], Whole]


class Plan(NamedTuple):
    """What to run. ``choice`` is the number of the method's start, ``threads`` 0 for as many as pay."""

    system: System
    method: Method
    batch: Shape
    dt: float
    t0: float = 0.0
    first: int = 0
    steps: int = 1
    every: int | None = None
    choice: int = 0
    threads: int = 0
    backend: str = "rust"
    form: str = "direct"
    progress: Callable[[float], object] | None = None
    record: tuple[str, ...] = ()

    @property
    def saves(self) -> Whole:
        """The steps, counted from the first, at which the state is kept: every so many, and the last."""
        if self.every is None:
            return np.array([self.steps], dtype=np.int64)
        every = min(self.every, self.steps)
        kept = np.arange(0, self.steps + every, every, dtype=np.int64)  # an array, for there may be millions of them
        kept[-1] = self.steps
        return kept

    @property
    def members(self) -> int:
        """How many trajectories."""
        return prod(self.batch)

    @property
    def block_axes(self) -> tuple[int, int]:
        """How many axes a block of v and one of y have."""
        return len(self.system.v_shape), len(self.system.y_shape)


class Arrays(NamedTuple):
    """What a run begins with and what it fills, for the core.

    Attributes:
        v: rows of the v slot, of one number for each member or one for all.
        y: rows of y, likewise.
        carried: whether the v slot holds what the method carries, and no velocities.
        saved_v: the kept velocities (of the matrix form: v slots), shape (kept, *block, *batch).
        saved_y: the kept coordinates.
        recorded: what is recorded, shape (kept, numbers, *batch).
        tally: for each member what a control or projection added up; empty without one.
        carry: the last v slots; empty if the method carries nothing but v.
        first_bad: for each member the first step that was not finite, −1 for none; read and written.
    """

    v: Array
    y: Array
    carried: bool
    saved_v: Array
    saved_y: Array
    recorded: Array
    tally: Array
    carry: Array
    first_bad: Whole


class Outcome(NamedTuple):
    """Kept states, last slots, the first step of each member that was not finite, what was recorded, and what a control did."""

    v: Array
    y: Array
    slot: Array
    first_bad: Whole
    recorded: dict[str, Array] | None = None
    work: Array | None = None


def advance(plan: Plan, v: Array, y: Array, before: Whole | None = None, *, carried: bool = False) -> Outcome:
    """Make the run. ``v`` holds what the method carries if ``carried``; both have the shape of a block and a batch.

    ``before`` has the first bad steps of earlier runs, −1 for members that were finite so far.
    """
    before = np.full(plan.batch, -1, dtype=np.int64) if before is None else before.copy()
    if plan.form == "matrix":
        return _matrix(plan, v, y, before, carried)
    if plan.form == "power":
        return _power(plan, v, y, before, carried)
    if plan.backend == "numpy":
        return _numpy(plan, v, y, before, carried)
    return _rust(plan, model(plan), v, y, before, carried)


def _numpy(plan: Plan, v: Array, y: Array, before: Whole, carried: bool) -> Outcome:
    steps, s = plan.method.steps, plan.system.scaled(plan.dt, plan.batch)
    settle = getattr(s, "settle", None)  # only what keeps a system on its energy has it

    def step(t: float, v: Array, y: Array) -> Blocks:
        v, y = steps.step(s, t, plan.dt, v, y)
        return settle(v, y) if settle else (v, y)

    slot = v if carried else _start(plan, v, y)
    slot, y, kept, first_bad = _loop(plan, step, slot, y, before, plan.block_axes)
    out = _finished(plan, slot, kept, first_bad)
    with np.errstate(all="ignore"):
        states = list(zip(out.v, out.y, strict=True)) if plan.record else []
        recorded = {name: np.stack([s.record(name, *state) for state in states]) for name in plan.record}
    work = None if plan.system.control is None else np.broadcast_to(np.asarray(s.work), plan.batch).copy()
    return out._replace(recorded=recorded, work=_per_step(plan, work))


def _per_step(plan: Plan, work: Array | None) -> Array | None:
    """What a control did, in units of energy, from h times the sum over all evaluations."""
    if work is None:
        return None
    evaluations = plan.method.evaluations if isinstance(plan.system.control, EnergyControl) else 1
    return np.asarray(work / (evaluations * plan.dt))


def _loop(plan: Plan, step: reference.Step, v: Array, y: Array, before: Whole, block_axes: tuple[int, int]) -> Looped:
    done, every = 0, max(1, plan.steps // 100)

    def told(t: float, v: Array, y: Array) -> Blocks:
        nonlocal done
        done += 1
        if plan.progress is not None and done % every == 0:
            plan.progress(done / plan.steps)
        return step(t, v, y)

    return reference.run(
        told, v, y, before, block_axes, h=plan.dt, t0=plan.t0, first=plan.first, steps=plan.steps, saves=plan.saves.tolist()
    )


def _start(plan: Plan, v: Array, y: Array) -> Array:
    """What the method carries at the first step."""
    if plan.method.carry is None:
        return v
    s = plan.system.scaled(plan.dt, plan.batch)
    with np.errstate(all="ignore"):
        return np.asarray(plan.method.steps.start(s, plan.choice, plan.t0 + plan.first * plan.dt, v, y))


def _finished(plan: Plan, slot: Array, kept: list[Blocks], first_bad: Any) -> Outcome:
    """The states from the kept slots."""
    v = [pair[0] for pair in kept]
    y = [pair[1] for pair in kept]
    if plan.method.carry is not None:
        s = plan.system.scaled(plan.dt, plan.batch)
        times = (plan.t0 + (plan.first + plan.saves) * plan.dt).tolist()
        with np.errstate(all="ignore"):
            v = [plan.method.steps.finish(s, plan.choice, *state) for state in zip(times, v, y, strict=True)]
    return Outcome(np.stack(v), np.stack(y), slot, np.asarray(first_bad, dtype=np.int64))


def model(plan: Plan) -> _core.ModelSpec:
    """What to step, as the core takes it."""
    given = plan.system.parameters(plan.batch)
    return _core.ModelSpec(plan.system.kernel, plan.method.name, given, record=list(plan.record))


def _rust(
    plan: Plan, model: _core.ModelSpec, v: Array, y: Array, before: Whole, carried: bool, carries: bool | None = None
) -> Outcome:
    carries = plan.method.carry is not None if carries is None else carries
    kept = len(plan.saves)
    saved_v, saved_y = (np.empty((kept, *a.shape)) for a in (v, y))
    carry = np.empty(v.shape if carries else 0)
    shapes = {name: plan.system.quantities[name] for name in plan.record}
    recorded = np.empty((kept, sum(prod(shape) for shape in shapes.values()), *plan.batch))
    work = None if plan.system.control is None else np.empty(plan.batch)
    tally = np.empty(0) if work is None else work.reshape(-1)
    rows_v, rows_y = rows(v, plan.batch), rows(y, plan.batch)
    _core.run(model, plan, Arrays(rows_v, rows_y, carried, saved_v, saved_y, recorded, tally, carry, before.reshape(-1)))
    by_name: dict[str, Array] = {}
    for name, shape in shapes.items():
        mine, recorded = recorded[:, : prod(shape)], recorded[:, prod(shape) :]
        by_name[name] = mine.reshape(kept, *shape, *plan.batch)
    return Outcome(saved_v, saved_y, carry if carries else saved_v[-1], before, by_name, _per_step(plan, work))


# ---- the transition-matrix form


def transition(plan: Plan) -> Array:
    """P of shape (n, n, *batch), from one step of each unit vector of the slots (v slot first)."""
    n_v, n_y = (prod(shape) for shape in (plan.system.v_shape, plan.system.y_shape))
    n = n_v + n_y
    unit = np.broadcast_to(np.eye(n).reshape(n, n, *(1,) * len(plan.batch)), (n, n, *plan.batch))
    v, y = (
        unit[:n_v].reshape(*plan.system.v_shape, n, *plan.batch),
        unit[n_v:].reshape(*plan.system.y_shape, n, *plan.batch),
    )
    return one_step(plan._replace(system=plan.system.without_inputs(), batch=(n, *plan.batch)), v, y)


def pulses(plan: Plan, inputs: Iterable[str]) -> Array:
    """Q of shape (nodes, inputs, n, *batch), from one step from rest with a unit pulse of one input at one node."""
    grid = _grid(plan.method.nodes)
    n = prod(plan.system.v_shape) + prod(plan.system.y_shape)
    inputs = list(inputs)
    q = np.zeros((len(plan.method.nodes), len(inputs), n, *plan.batch))
    for i, node in enumerate(plan.method.nodes):
        pulse = np.zeros(grid + 1)
        pulse[_bin(node, grid)] = 1.0
        for j, name in enumerate(inputs):
            q[i, j] = one_step(plan._replace(system=plan.system.with_pulse(name, pulse, plan.dt / grid)))
    return q


def _bin(node: float, grid: int) -> int:
    """Which of so many parts of a step holds a node."""
    return floor(node * grid + 1e-6)


def _grid(nodes: Iterable[float]) -> int:
    """The least number of parts of a step that hold its nodes apart, none of them near the end of its part."""
    nodes = list(nodes)
    return next(
        n for n in count(1) if len({_bin(c, n) for c in nodes}) == len(nodes) and all(c * n - _bin(c, n) < 0.9 for c in nodes)
    )


def one_step(plan: Plan, v: Array | None = None, y: Array | None = None) -> Array:
    """The slots after one step at t = 0, from rest if not from ``v`` and ``y``, as rows: those of v, then those of y."""
    if v is None or y is None:
        v, y = (np.zeros((*shape, *plan.batch)) for shape in (plan.system.v_shape, plan.system.y_shape))
    one = plan._replace(t0=0.0, first=0, steps=1, every=None, form="direct", progress=None)
    out = advance(one, v, y, carried=True)
    n_v, n_y = (prod(shape) for shape in (plan.system.v_shape, plan.system.y_shape))
    return np.concatenate([out.slot.reshape(n_v, *plan.batch), out.y[-1].reshape(n_y, *plan.batch)])


def _matrix(plan: Plan, v: Array, y: Array, before: Whole, carried: bool) -> Outcome:
    given = plan.system.given_inputs()
    p, q = transition(plan), pulses(plan, given)
    q = q.reshape(q.shape[0] * q.shape[1], *q.shape[2:])
    slot = v if carried else _start(plan, v, y)
    n_v, n_y = v.size // max(1, prod(plan.batch)), y.size // max(1, prod(plan.batch))
    blocks = (*plan.system.v_shape, *plan.batch), (*plan.system.y_shape, *plan.batch)
    flat_v, flat_y = slot.reshape(n_v, *plan.batch), y.reshape(n_y, *plan.batch)

    if plan.backend == "numpy":
        linear = reference.linear_step(p, q, [i.signal() for i in given.values()], plan.method.nodes, plan.dt)

        def step(t: float, v: Array, y: Array) -> Blocks:
            s = linear(t, np.concatenate([v, y]))
            return s[:n_v], s[n_v:]

        flat_v, flat_y, kept, first_bad = _loop(plan, step, flat_v, flat_y, before, (1, 1))
    else:
        linear_map = {"n": n_v + n_y, "n_v": n_v, "p": p, "q": q, "inputs": [each.signal() for each in given.values()]}
        nodes = list(plan.method.nodes)
        spec = _core.ModelSpec("matrix", plan.method.name, flat(linear_map, plan.batch), matrix=(nodes, n_v))
        out = _rust(plan, spec, flat_v, flat_y, before, carried=True, carries=False)
        flat_v, kept, first_bad = out.slot, list(zip(out.v, out.y, strict=True)), out.first_bad
    shaped = [(a.reshape(blocks[0]), b.reshape(blocks[1])) for a, b in kept]
    return _finished(plan, flat_v.reshape(blocks[0]), shaped, first_bad)


def _power(plan: Plan, v: Array, y: Array, before: Whole, carried: bool) -> Outcome:
    """By powers of the transition matrix; the backend finds P and Q, the rest is the reference's."""
    from .reference import power  # only this form needs it
    from .reference.signal import Constant, Sine

    def wide(array: Array) -> Array:
        return np.broadcast_to(array, plan.batch).reshape(-1)

    given = plan.system.given_inputs()
    inputs = [
        Constant(wide(each.values[0]))
        if isinstance(each, Sampled)
        else Sine(wide(each.amplitude), wide(each.omega), wide(each.phase))
        for each in given.values()
    ]
    members, n_v = plan.members, prod(plan.system.v_shape)
    slot = v if carried else _start(plan, v, y)
    s = np.concatenate([slot.reshape(n_v, members), y.reshape(prod(plan.system.y_shape), members)])
    p, q = (a.reshape(*a.shape[: a.ndim - len(plan.batch)], members) for a in (transition(plan), pulses(plan, given)))

    drive = power.Drive([each for each in inputs if isinstance(each, Sine)], plan.dt)
    kept, saves = [], plan.saves.tolist()
    with np.errstate(all="ignore"):
        step = power.one_step(p, q, inputs, plan.method.nodes, drive)
        states = power.run(step, drive, s, before.reshape(-1), t0=plan.t0, first=plan.first, saves=saves)
        for i, s in enumerate(states, 1):
            kept.append((s[:n_v].reshape(v.shape), s[n_v:].reshape(y.shape)))
            if plan.progress is not None:
                plan.progress(i / len(saves))
    return _finished(plan, kept[-1][0], kept, before)


# ---- steps of chosen length


class Pacing(NamedTuple):
    """Where to be when, and how exactly. ``first``, ``relative`` and ``absolute`` broadcast over the batch.

    For the core they are rows, of one number for each member or one for all.
    """

    at: list[float]
    first: Array
    relative: Array
    absolute: Array
    budget: int


class PacedArrays(NamedTuple):
    """What a run with a tolerance begins with and what it fills, for the core.

    Attributes:
        v: rows of v, of one number for each member or one for all.
        y: rows of y, likewise.
        saved_v: velocities at the asked times, shape (times, *block, *batch); NaN from where a member stopped.
        saved_y: coordinates, likewise.
        reached: the time that each member reached, and the step that it would try next, shape (2, members).
        counts: accepted and rejected attempts and the status, shape (3, members).
    """

    v: Array
    y: Array
    saved_v: Array
    saved_y: Array
    reached: Array
    counts: Whole


class Adapted(NamedTuple):
    """States at the asked times, and for each member the time it reached, its next step, its attempts and its status."""

    v: Array
    y: Array
    t: Array
    h: Array
    accepted: Whole
    rejected: Whole
    status: Whole


def adapt(plan: Plan, pacing: Pacing, v: Array, y: Array) -> Adapted:
    """Make the run."""
    asked = ("first", "relative", "absolute")
    if plan.backend == "numpy":
        from .reference import adaptive  # only such runs need it

        pair: Any = plan.method.steps
        s = plan.system.scaled(1.0, plan.batch)
        wide: Any = {name: np.broadcast_to(getattr(pacing, name), plan.batch) for name in asked}
        timing: Any = {"t0": plan.t0, "at": pacing.at, "budget": pacing.budget, "order": plan.method.error_order}
        return Adapted(*adaptive.run(pair, s, v, y, plan.block_axes, **timing, **wide))
    kept = len(pacing.at)
    saved_v, saved_y = (np.empty((kept, *a.shape)) for a in (v, y))
    reached, counts = np.empty((2, plan.members)), np.empty((3, plan.members), dtype=np.int64)
    in_rows: Any = {name: rows(getattr(pacing, name), plan.batch) for name in asked}
    arrays = PacedArrays(rows(v, plan.batch), rows(y, plan.batch), saved_v, saved_y, reached, counts)
    _core.adapt(model(plan), plan, pacing._replace(**in_rows), arrays)
    t, h = (row.reshape(plan.batch) for row in reached)
    accepted, rejected, status = (row.reshape(plan.batch) for row in counts)
    return Adapted(saved_v, saved_y, t, h, accepted, rejected, status)
