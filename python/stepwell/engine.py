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
from .systems.base import Parameters, rows
from .systems.inputs import add_inputs

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
    def controlled(self) -> bool:
        """Whether the system adds up what a control does."""
        return getattr(self.system, "control", None) is not None

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
    def block_axes(self) -> tuple[int, int]:
        """How many axes a block of v and one of y have."""
        return len(self.system.v_shape), len(self.system.y_shape)


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
    return _rust(plan, _model(plan), v, y, before, carried)


def _numpy(plan: Plan, v: Array, y: Array, before: Whole, carried: bool) -> Outcome:
    steps, s = plan.method.steps, plan.system.scaled(plan.dt, plan.batch)
    settle = getattr(s, "settle", None)  # only systems that are projected have it

    def step(t: float, v: Array, y: Array) -> Blocks:
        v, y = steps.step(s, t, plan.dt, v, y)
        return settle(v, y) if settle else (v, y)

    slot = v if carried else _start(plan, v, y)
    slot, y, kept, first_bad = _loop(plan, step, slot, y, before, plan.block_axes)
    out = _finished(plan, slot, kept, first_bad)
    with np.errstate(all="ignore"):
        states = list(zip(out.v, out.y, strict=True)) if plan.record else []
        recorded = {name: np.stack([s.record(name, *state) for state in states]) for name in plan.record}  # type: ignore[attr-defined]
    work = np.broadcast_to(np.asarray(s.work), plan.batch).copy() if plan.controlled else None  # type: ignore[attr-defined]
    return out._replace(recorded=recorded, work=_per_step(plan, work))


def _per_step(plan: Plan, work: Array | None) -> Array | None:
    """What a control did, in units of energy, from h times the sum over all evaluations."""
    if work is None:
        return None
    evaluations = plan.method.evaluations if isinstance(getattr(plan.system, "control", None), EnergyControl) else 1
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


def _model(plan: Plan) -> _core.ModelSpec:
    return model(plan.system.kernel, plan.system.parameters(plan.batch), plan.method, record=plan.record)


def model(
    kernel: str,
    p: Parameters,
    method: Method,
    matrix: tuple[list[float], int] | None = None,
    record: Iterable[str] = (),
) -> _core.ModelSpec:
    """What to step, as the core takes it."""
    tables = [(start, interval, values) for values, interval, start in p.tables]
    return _core.ModelSpec(kernel, p.options, p.sizes, p.rows, tables, method.name, matrix, list(record))


def _rust(
    plan: Plan, model: _core.ModelSpec, v: Array, y: Array, before: Whole, carried: bool, carries: bool | None = None
) -> Outcome:
    carries = plan.method.carry is not None if carries is None else carries
    kept = len(plan.saves)
    saved_v, saved_y = (np.empty((kept, *a.shape)) for a in (v, y))
    carry = np.empty(v.shape if carries else 0)
    shapes = {name: plan.system.quantities[name] for name in plan.record}
    recorded = np.empty((kept, sum(prod(shape) for shape in shapes.values()), *plan.batch))
    work = np.empty(plan.batch) if plan.controlled else None
    _core.run(
        model,
        t0=plan.t0,
        dt=plan.dt,
        start=plan.choice,
        first=plan.first,
        steps=plan.steps,
        every=plan.every,
        threads=plan.threads,
        carried=carried,
        v=_flat(plan, v),
        y=_flat(plan, y),
        saved_v=saved_v,
        saved_y=saved_y,
        recorded=recorded,
        tally=np.empty(0) if work is None else work.reshape(-1),
        carry=carry,
        first_bad=before.reshape(-1),
        progress=plan.progress,
    )
    by_name: dict[str, Array] = {}
    for name, shape in shapes.items():
        mine, recorded = recorded[:, : prod(shape)], recorded[:, prod(shape) :]
        by_name[name] = mine.reshape(kept, *shape, *plan.batch)
    return Outcome(saved_v, saved_y, carry if carries else saved_v[-1], before, by_name, _per_step(plan, work))


def _flat(plan: Plan, array: Array) -> Array:
    """A block as rows for the core."""
    return rows(array.reshape((prod(array.shape[: array.ndim - len(plan.batch)]), *plan.batch)), plan.batch)


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
        maps = [rows(a.reshape((a.shape[0] * a.shape[1], *plan.batch)), plan.batch) for a in (p, q)]
        parameters = Parameters(sizes=[n_v + n_y], rows=maps)
        add_inputs(parameters, given.values(), plan.batch)
        spec = model("matrix", parameters, plan.method, (list(plan.method.nodes), n_v))
        out = _rust(plan, spec, flat_v, flat_y, before, carried=True, carries=False)
        flat_v, kept, first_bad = out.slot, list(zip(out.v, out.y, strict=True)), out.first_bad
    shaped = [(a.reshape(blocks[0]), b.reshape(blocks[1])) for a, b in kept]
    return _finished(plan, flat_v.reshape(blocks[0]), shaped, first_bad)


def _power(plan: Plan, v: Array, y: Array, before: Whole, carried: bool) -> Outcome:
    """By powers of the transition matrix; the backend finds P and Q, the rest is the reference's."""
    from .reference import power  # only this form needs it
    from .reference.signal import Held, Sine

    def flat(array: Array) -> Array:
        return np.broadcast_to(array, plan.batch).reshape(-1)

    given = plan.system.given_inputs()
    inputs: list[Held | Sine] = [
        Held(flat(each.values[0])[np.newaxis], 1.0, 0.0)
        if isinstance(each, Sampled)
        else Sine(flat(each.amplitude), flat(each.omega), flat(each.phase))
        for each in given.values()
    ]
    members, n_v = prod(plan.batch), prod(plan.system.v_shape)
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
    """Where to be when, and how exactly. ``first``, ``relative`` and ``absolute`` broadcast over the batch."""

    at: list[float]
    first: Array
    relative: Array
    absolute: Array
    budget: int


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
    if plan.backend == "numpy":
        from .reference import adaptive, tableau  # only such runs need it

        pairs, s = plan.method.steps, plan.system.scaled(1.0, plan.batch)
        steps: Any = pairs

        coarse = getattr(steps, "COARSE", None)

        def attempt(s: Any, t: Any, h: Any, v: Array, y: Array) -> tuple[Blocks, Blocks, Blocks | None]:
            increments = steps.stages(s, t, h, v, y)
            corrected = None if coarse is None else tableau.combined(coarse, increments)
            return tableau.plus(v, y, steps.WEIGHTS, increments), tableau.combined(steps.ERROR, increments), corrected

        wide: Any = {name: np.broadcast_to(getattr(pacing, name), plan.batch) for name in ("first", "relative", "absolute")}
        timing: Any = {"t0": plan.t0, "at": pacing.at, "budget": pacing.budget, "order": plan.method.error_order}
        whole = adaptive.run(attempt, s, v, y, plan.block_axes, **timing, **wide)
        return Adapted(*whole)
    kept, members = len(pacing.at), prod(plan.batch)
    saved_v, saved_y = (np.empty((kept, *a.shape)) for a in (v, y))
    reached, counts = np.empty((2, members)), np.empty((3, members), dtype=np.int64)
    _core.adapt(
        _model(plan),
        t0=plan.t0,
        at=pacing.at,
        first=rows(pacing.first[np.newaxis], plan.batch),
        relative=rows(pacing.relative[np.newaxis], plan.batch),
        absolute=rows(pacing.absolute[np.newaxis], plan.batch),
        budget=pacing.budget,
        threads=plan.threads,
        v=_flat(plan, v),
        y=_flat(plan, y),
        saved_v=saved_v,
        saved_y=saved_y,
        reached=reached,
        counts=counts,
        progress=plan.progress,
    )
    t, h = (row.reshape(plan.batch) for row in reached)
    accepted, rejected, status = (row.reshape(plan.batch) for row in counts)
    return Adapted(saved_v, saved_y, t, h, accepted, rejected, status)
