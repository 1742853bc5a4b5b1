"""Slots in, slots out: the same run by the Rust core or by the NumPy reference, in direct, matrix or power form.

A slot is the array that holds a block between steps: v for most methods, the carry for those that have one. Everything
above this file works with states, everything below with slots.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Iterable
from functools import partial
from itertools import count
from math import floor, prod
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from . import _checks, _core, _memory
from ._checks import Array, Shape
from .control import EnergyControl
from .methods import Method
from .reference import contact
from .reference import run as reference
from .reference.types import Blocks, Whole
from .systems import Sampled, System
from .systems.base import flat, rows

if TYPE_CHECKING:
    from .reference.adaptive import Pace

if hasattr(os, "register_at_fork"):
    #: Whether there was another thread when the process forked: what it was compiling or had locked stays so in the child.
    _others: list[bool] = []
    os.register_at_fork(
        before=lambda: _others.append(threading.active_count() > 1),
        after_in_parent=lambda: _others.clear(),
        after_in_child=lambda: _core.forget() if _others.pop() else None,
    )

Looped = tuple[Array, Array, Blocks, Whole]


class Watched(NamedTuple):
    """Quantities whose changes of sign the core notices while it makes steps: what it computes them by, and how many they are."""

    quantities: _core.Equations
    number: int


class Plan(NamedTuple):
    """What to run. ``choice`` is the number of the method's start, ``threads`` 0 for as many as pay; ``force`` is added to v̇.

    ``order`` is that of a series with adaptive steps; ``single`` is whether steps are computed in float32.
    """

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
    fused: bool = False
    force: Array | None = None
    watched: Watched | None = None
    order: int = 0
    single: bool = False

    @property
    def dtype(self) -> type[Any]:
        """Of the states."""
        return np.float32 if self.single else np.float64

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
    def kept(self) -> int:
        """How many states are kept."""
        return 1 if self.every is None else -(-self.steps // min(self.every, self.steps)) + 1

    def scaled(self) -> Any:
        """The NumPy reference of the system, scaled to the step, with the force."""
        return self.system.scaled(self.dt, self.batch, self.force)

    @property
    def by_tape(self) -> bool:
        """Whether the NumPy backend evaluates the tape of the reference, as for what is fused or of float32, and for a series."""
        return self.fused or self.single or self.method.has_series

    @property
    def members(self) -> int:
        """How many trajectories."""
        return prod(self.batch)

    @property
    def block_axes(self) -> tuple[int, int]:
        """How many axes a block of v and one of y have."""
        return len(self.system.v_shape), len(self.system.y_shape)


class Arrays(NamedTuple):
    """The arrays of a run for the core: those it starts from and those it fills.

    Attributes:
        v: rows of the v slot, with one number for each member or one for all.
        y: rows of y, likewise.
        carried: whether the v slot holds the carry of the method instead of velocities.
        saved_v: the saved velocities (in the matrix form: v slots), shape (saved, *block, *batch).
        saved_y: the saved coordinates.
        recorded: recorded quantities, shape (saved, numbers, *batch); None if there are none.
        tally: for each member the sum that a control or projection accumulates; None without one.
        carry: the last v slots; None if the method carries v.
        first_bad: for each member the first step that was not finite, −1 for none; read and written.
    """

    v: Array
    y: Array
    carried: bool
    saved_v: Array
    saved_y: Array
    recorded: Array | None
    tally: Array | None
    carry: Array | None
    first_bad: Whole


class Outcome(NamedTuple):
    """Saved states, last slots, each member's first step that was not finite, recorded quantities, and the sum of a control.

    ``diverged`` is False if it is known that no member has such a step. ``noticed`` has for each watched quantity its value at
    the start of the last step, and last how many changes of sign there were up to there; NaN where the core did not count.
    """

    v: Array
    y: Array
    slot: Array
    first_bad: Whole
    recorded: dict[str, Array] | None = None
    work: Array | None = None
    diverged: bool = True
    noticed: Array | None = None


def advance(plan: Plan, v: Array, y: Array, before: Whole | None = None, *, carried: bool = False) -> Outcome:
    """Make the run. ``v`` holds what the method carries if ``carried``; both have the shape of a block and a batch.

    ``before`` has the first bad steps of earlier runs, −1 for members that were finite so far.
    """
    if before is None:
        before = _memory.empty(plan.batch).view(np.int64)
        before.fill(-1)
    else:
        before = before.copy()
    if plan.form == "matrix":
        return _matrix(plan, v, y, before, carried)
    if plan.form == "power":
        return _power(plan, v, y, before, carried)
    if plan.backend == "numpy":
        return _numpy(plan, v, y, before, carried)
    return _rust(plan, model(plan), v, y, before, carried)


def _numpy(plan: Plan, v: Array, y: Array, before: Whole, carried: bool) -> Outcome:
    steps, s = plan.method.steps, plan.scaled()
    if plan.single:
        v, y = v.astype(plan.dtype), y.astype(plan.dtype)

    def plain(t: float, v: Array, y: Array) -> Blocks:
        made: Blocks = contact.step(steps, s, plan.choice, t, plan.dt, v, y)
        return made

    step = _evaluated_step(plan, s) if plan.by_tape else plain
    slot = v if carried else _start(plan, v, y)
    slot, y, kept, first_bad = _loop(plan, step, slot, y, before, plan.block_axes, _velocity(plan))
    out = _finished(plan, slot, kept, first_bad)
    with np.errstate(all="ignore"):
        recorded = {
            name: _stacked((s.record(name, *state) for state in zip(out.v, out.y, strict=True)), plan.kept)
            for name in plan.record
        }
    work = None if plan.system.control is None else np.broadcast_to(np.asarray(s.work), plan.batch).copy()
    return out._replace(recorded=recorded, work=_per_step(plan, work))


def _evaluated(plan: Plan, what: str, budget: int = 0) -> Callable[[list[Array], Any], Array]:
    """A method's "step" or "attempt", or how it goes from v to what it carries and back, by the tape of the reference.

    It is evaluated line by line, for all members at once: from the rows of a state, and the time, to the next ones.
    """
    from .reference import single  # only such runs need it
    from .reference.fused import Evaluated
    from .reference.traced import Tracer

    _core.check(model(plan))
    tape = _core.Tape(single=plan.single)
    tracer = Tracer(plan.system, tape, plan.force)
    match what:
        case "step":
            symbols = tracer.step(plan.method, plan.choice)
        case "attempt":
            symbols = tracer.attempt(plan.method, plan.order)
        case _:
            symbols = tracer.slot(plan.method, what, plan.choice)
    numbers = dict(enumerate(tracer.numbers))
    [(_, _, number_of_budget)], _ = tape.operations([tape.budget()])
    evaluated: Callable[..., list[Any]]
    if plan.single:
        evaluated = single.evaluated(tape, symbols, numbers, plan.fused)
    else:
        evaluated = Evaluated.traced(tape, symbols, numbers | {number_of_budget: budget}, tracer.tables, fuse=plan.fused)

    def made(state: list[Array], t: Any) -> Array:
        out = np.empty((len(symbols), *plan.batch), dtype=plan.dtype)
        for i, each in enumerate(evaluated(state, t, plan.dt)):
            out[i] = each
        return out

    return made


def _rows(plan: Plan, v: Array, y: Array) -> list[Array]:
    """The rows of a state."""
    return [*v.reshape(-1, *plan.batch), *y.reshape(-1, *plan.batch)]


def _blocks(v: Array, y: Array, made: Array) -> Blocks:
    """Blocks of the same shapes, from rows."""
    n_v, n_y = (a.size // max(1, made[0].size) for a in (v, y))
    return made[:n_v].reshape(v.shape), made[n_v : n_v + n_y].reshape(y.shape)


def _evaluated_step(plan: Plan, s: Any) -> reference.Step:
    """A step; what a control of ``s`` adds up is added up there."""
    made = _evaluated(plan, "step")

    def step(t: float, v: Array, y: Array) -> Blocks:
        if plan.system.control is None:
            return _blocks(v, y, made(_rows(plan, v, y), t))
        *_, s.work = out = made([*_rows(plan, v, y), np.asarray(s.work, dtype=plan.dtype)], t)
        return _blocks(v, y, out)

    return step


def _evaluated_slot(plan: Plan, which: str) -> reference.Velocity:
    """What a method carries from velocities, or back."""
    made = _evaluated(plan, which)
    return lambda t, v, y: _blocks(v, y, made(_rows(plan, v, y), t))[0]


def _per_step(plan: Plan, work: Array | None) -> Array | None:
    """What a control did, in units of energy, from h times the sum over all evaluations."""
    if work is None:
        return None
    return np.asarray(np.asarray(work, dtype=np.float64) / (pushes(plan.system.control, plan.method.evaluations) * plan.dt))


def pushes(control: Any, evaluations: int) -> int:
    """How many times a step with so many evaluations adds to what a control did."""
    return evaluations if isinstance(control, EnergyControl) and not control.between else 1


def _stacked(states: Iterable[Array], count: int) -> Array:
    """So many arrays of one shape as one, without a list of them."""
    stack = np.empty(0)
    for i, state in enumerate(states):
        if i == 0:
            stack = np.empty((count, *state.shape))
        stack[i] = state
    return stack


def _velocity(plan: Plan) -> reference.Velocity | None:
    """Makes velocities of what the method carries in their place at a time; None if it carries nothing else."""
    if plan.method.carry is None:
        return None
    if plan.by_tape:
        return _evaluated_slot(plan, "finish")
    return partial(plan.method.steps.finish, plan.scaled(), plan.choice)


def _loop(
    plan: Plan,
    step: reference.Step,
    v: Array,
    y: Array,
    before: Whole,
    block_axes: tuple[int, int],
    velocity: reference.Velocity | None,
) -> Looped:
    done, every = 0, max(1, plan.steps // 100)

    def told(t: float, v: Array, y: Array) -> Blocks:
        nonlocal done
        done += 1
        if plan.progress is not None and done % every == 0:
            plan.progress(done / plan.steps)
        return step(t, v, y)

    counts: Any = {"h": plan.dt, "t0": plan.t0, "first": plan.first, "steps": plan.steps, "saves": plan.saves}
    return reference.run(told, v, y, before, block_axes, velocity=velocity, **counts)


def _start(plan: Plan, v: Array, y: Array) -> Array:
    """What the method carries at the first step."""
    if plan.method.carry is None:
        return v
    t = plan.t0 + plan.first * plan.dt
    with np.errstate(all="ignore"):
        if plan.by_tape:
            return _evaluated_slot(plan, "start")(t, v, y)
        return np.asarray(plan.method.steps.start(plan.scaled(), plan.choice, t, v, y))


def _finished(plan: Plan, slot: Array, kept: Blocks, first_bad: Any) -> Outcome:
    """The states from the kept slots, which are the caller's to spend."""
    v, y = kept
    if velocity := _velocity(plan):
        if np.shares_memory(slot, v):
            slot = slot.copy()
        with np.errstate(all="ignore"):
            for i, step in enumerate(plan.saves):
                v[i] = velocity(plan.t0 + (plan.first + int(step)) * plan.dt, v[i], y[i])
    return Outcome(v, y, slot, np.asarray(first_bad, dtype=np.int64))


def model(plan: Plan) -> _core.ModelSpec:
    """What to step, as the core takes it."""
    if plan.single:
        return _single_model(plan)
    given = plan.system.parameters(plan.batch, series=plan.method.has_series)
    if plan.force is not None:
        given.append(("added.force", rows(plan.force, plan.batch, len(plan.system.v_shape))))
    if plan.watched is not None:
        given.append(("watched()", plan.watched.quantities))
    if not plan.record and not plan.fused and not plan.order:
        return _core.ModelSpec(plan.system.kernel, plan.method.name, given)
    options: Any = {"record": list(plan.record), "fused": plan.fused, "order": plan.order}
    return _core.ModelSpec(plan.system.kernel, plan.method.name, given, **options)


def _single_model(plan: Plan) -> _core.ModelSpec:
    """The same for steps of float32."""
    given = plan.system.parameters(plan.batch, single=True)
    if plan.force is not None:
        given.append(("added.force", rows(np.asarray(plan.force, np.float64), plan.batch, len(plan.system.v_shape))))
    for name, value in given:
        if isinstance(value, np.ndarray):
            _checks.fits_single(name, value)
    return _core.ModelSpec(plan.system.kernel, plan.method.name, given, fused=plan.fused, single=True)


def _rust(
    plan: Plan, model: _core.ModelSpec, v: Array, y: Array, before: Whole, carried: bool, carries: bool | None = None
) -> Outcome:
    carries = plan.method.carry is not None if carries is None else carries
    kept = plan.kept
    empty = np.empty if kept * (v.size + y.size) < _memory.LEAST_LENT // 8 else _memory.empty
    if plan.single:
        saved_v, saved_y = (_memory.empty((kept, *a.shape), plan.dtype) for a in (v, y))
    else:
        saved_v, saved_y = empty((kept, *v.shape)), empty((kept, *y.shape))
    carry = np.empty(v.shape, plan.dtype) if carries else None
    recorded = None
    if plan.record:
        shapes = {name: plan.system.quantities[name] for name in plan.record}
        recorded = _memory.empty((kept, sum(map(prod, shapes.values())), *plan.batch))
    work = None if plan.system.control is None else np.empty(plan.batch, plan.dtype)
    tally, noticed = None if work is None else work.reshape(-1), None
    if plan.watched is not None:
        before_it = 0 if work is None else 1
        sums = np.full((before_it + plan.watched.number + 1, *plan.batch), np.nan)
        tally, noticed, work = sums.reshape(-1), sums[before_it:], None
    rows_v, rows_y = rows(v, plan.batch), rows(y, plan.batch)
    diverged = _core.run(
        model, plan, Arrays(rows_v, rows_y, carried, saved_v, saved_y, recorded, tally, carry, before.reshape(-1))
    )
    by_name: dict[str, Array] = {}
    if recorded is not None:
        for name, shape in shapes.items():
            mine, recorded = recorded[:, : prod(shape)], recorded[:, prod(shape) :]
            by_name[name] = mine.reshape(kept, *shape, *plan.batch)
    work = None if work is None else _per_step(plan, work)
    return Outcome(saved_v, saved_y, saved_v[-1] if carry is None else carry, before, by_name, work, diverged, noticed)


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


def matrix_model(plan: Plan, P: Array, Q: Array) -> Any:
    """A step by a transition matrix, P of shape (n, n, *batch), Q of shape (nodes·inputs, n, *batch), as the core takes it."""
    n_v, n_y = prod(plan.system.v_shape), prod(plan.system.y_shape)
    q = Q.reshape(prod(Q.shape[: Q.ndim - 1 - len(plan.batch)]), n_v + n_y, *plan.batch)
    inputs = [each.signal() for each in plan.system.given_inputs().values()]
    linear_map = {"n": n_v + n_y, "n_v": n_v, "p": P, "q": q, "inputs": inputs}
    return _core.ModelSpec("matrix", plan.method.name, flat(linear_map, plan.batch), matrix=(list(plan.method.nodes), n_v))


def _matrix(plan: Plan, v: Array, y: Array, before: Whole, carried: bool) -> Outcome:
    given = plan.system.given_inputs()
    p, q = transition(plan), pulses(plan, given)
    q = q.reshape(q.shape[0] * q.shape[1], *q.shape[2:])
    slot = v if carried else _start(plan, v, y)
    n_v, n_y = v.size // max(1, prod(plan.batch)), y.size // max(1, prod(plan.batch))
    blocks = (*plan.system.v_shape, *plan.batch), (*plan.system.y_shape, *plan.batch)
    flat_v, flat_y = slot.reshape(n_v, *plan.batch), y.reshape(n_y, *plan.batch)

    linear = reference.linear_step(p, q, [i.signal() for i in given.values()], plan.method.nodes, plan.dt)
    finish = _velocity(plan)

    def step(t: float, v: Array, y: Array) -> Blocks:
        s = linear(t, np.concatenate([v, y]))
        return s[:n_v], s[n_v:]

    def velocity(t: float, v: Array, y: Array) -> Array:
        return v if finish is None else np.reshape(finish(t, v.reshape(blocks[0]), y.reshape(blocks[1])), v.shape)

    def by_reference(plan: Plan, v: Array, y: Array, before: Whole) -> Looped:
        return _loop(plan, step, v, y, before, (1, 1), None if finish is None else velocity)

    if plan.backend == "numpy":
        flat_v, _, kept, first_bad = by_reference(plan, flat_v, flat_y, before)
    else:
        spec = matrix_model(plan, p, q)

        def by_core(plan: Plan, v: Array, y: Array, before: Whole) -> Outcome:
            return _rust(plan, spec, v, y, before.copy(), carried=True, carries=False)

        out = by_core(plan, flat_v, flat_y, before)
        first_bad = out.first_bad if finish is None else _seen(plan, by_core, by_reference, flat_v, flat_y, before, out)
        flat_v, kept = out.slot, (out.v, out.y)
    v, y = (a.reshape(len(a), *block) for a, block in zip(kept, blocks, strict=True))
    return _finished(plan, flat_v.reshape(blocks[0]), (v, y), first_bad)


#: As the core's ``HUGE``.
_HUGE = 2.0**960

#: Steps between two checks of whether a velocity may have overflowed.
_PIECE = 1024


def _seen(
    plan: Plan,
    by_core: Callable[[Plan, Array, Array, Whole], Outcome],
    by_reference: Callable[[Plan, Array, Array, Whole], Looped],
    v: Array,
    y: Array,
    before: Whole,
    out: Outcome,
) -> Whole:
    """The first bad steps of a run in matrix form, whose velocities the core does not know.

    Members that come near the end of the number range are stepped again by the reference, from the last check before that.
    """
    most = _HUGE * min(plan.dt, 1.0)

    def is_near(v: Array, y: Array) -> Any:
        return (before < 0) & ~((np.abs(v) < most).all(axis=-1 - before.ndim) & (np.abs(y) < most).all(axis=-1 - before.ndim))

    near = np.logical_or.reduce(is_near(out.v, out.y), axis=0) | (out.first_bad > before)
    if not near.any():
        return out.first_bad
    # Members whose carry is not finite need no further checks.
    last = plan.steps if (near & (out.first_bad < 0)).any() else int(out.first_bad.max()) - plan.first
    for done in range(0, last, _PIECE):
        piece = plan._replace(first=plan.first + done, steps=min(_PIECE, last - done), every=None, progress=None)
        ahead = by_core(piece, v, y, before)
        if is_near(ahead.v[-1], ahead.y[-1]).any():
            before = by_reference(piece, v, y, before)[3]
        v, y = ahead.slot, ahead.y[-1]
    return np.asarray(before)


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
    kept, saves = (np.empty((plan.kept, *v.shape)), np.empty((plan.kept, *y.shape))), plan.saves
    with np.errstate(all="ignore"):
        step = power.one_step(p, q, inputs, plan.method.nodes, drive)
        states = power.run(step, drive, s, before.reshape(-1), t0=plan.t0, first=plan.first, saves=map(int, saves))
        for i, s in enumerate(states):
            kept[0][i], kept[1][i] = s[:n_v].reshape(v.shape), s[n_v:].reshape(y.shape)
            if plan.progress is not None:
                plan.progress((i + 1) / len(saves))
    out = _finished(plan, kept[0][-1], kept, before)
    # Velocities are made of what is carried at saved states only, so a power cannot tell of those between.
    first_bad = out.first_bad.reshape(-1)
    for save, v in zip(plan.saves, out.v.reshape(plan.kept, n_v, members), strict=True):
        bad, k = ~np.isfinite(v).all(axis=0), plan.first + int(save)
        first_bad[bad & ((first_bad < 0) | (first_bad > k)) & (save > 0)] = k
    return out


# ---- adaptive steps

#: How many numbers say where a member stands: those of a ``Pace``.
PACE_NUMBERS = 20
#: Places among them; the counts are of accepted, rejected and extra steps.
TIME, STEP, TARGET, HELD, RELATIVE, ABSOLUTE, COUNTS, WORK = 0, 1, 2, 4, 5, 6, slice(15, 18), 19


class Pacing(NamedTuple):
    """When the state is asked for, ascending, the most attempts of a member, and whether members have yet to begin."""

    at: Array
    budget: int
    begins: bool = False


class AdaptiveArrays(NamedTuple):
    """What a run with a tolerance begins with and what it fills, for the core.

    Attributes:
        v: rows of v, of one number for each member or one for all.
        y: rows of y, likewise.
        paces: where members stand at the start, shape (numbers of a ``Pace``, members), or (…, 1) where that is the same for all.
        saved_v: velocities at the asked times, shape (times, *block, *batch); NaN from where a member stopped.
        saved_y: coordinates, likewise.
        last_state: the state where members stand at the end, shape (numbers of v and y, members).
        last_paces: where they stand, as ``paces``.
        status: how they ended, shape (members,).
        trail: None; or times and steps to try next, shape (2, times, members), where attempts are made one by one until the asked
            time, and what is kept is where members stand before the first and after each.
    """

    v: Array
    y: Array
    paces: Array
    saved_v: Array
    saved_y: Array
    last_state: Array
    last_paces: Array
    status: Whole
    trail: Array | None = None


class Adapted(NamedTuple):
    """Saved states, and of each member at the end the state, the numbers of its ``Pace`` and the status.

    ``evaluations`` is how many function evaluations an attempt takes.
    """

    v: Array
    y: Array
    last_v: Array
    last_y: Array
    paces: Array
    status: Whole
    evaluations: int


def paces(plan: Plan, first: Array | None, relative: Array, absolute: Array | None) -> Array:
    """Where members stand before they begin, shape (numbers of a ``Pace``, *batch), or (numbers,) if it is the same for all.

    Without ``absolute`` the relative error is one of the longest that a block has been.
    """
    from .reference import adaptive  # only such runs need it

    given: list[Any] = [0.0 if each is None else each.item() if each.size == 1 else each for each in (first, relative, absolute)]
    step, *tolerance = given
    waiting = adaptive.waiting(plan.t0, step, (*tolerance, float(absolute is None)), plan.system.samples)
    if all(type(each) is float for each in given):
        return np.array(waiting)
    numbers = np.empty((PACE_NUMBERS, *plan.batch))
    for row, number in zip(numbers, waiting, strict=True):
        row[...] = number
    return numbers


def begun(plan: Plan, paces: Array, v: Array, y: Array) -> Pace:
    """Where members stand at the start, by the reference; of them it is known where they stand before."""
    from .reference import adaptive

    system, pace = plan.system.alone(1.0, plan.batch), pace_of(paces, plan.batch)
    return adaptive.begin(system, pace, v, y, plan.block_axes, series=plan.method.has_series)


def pace_of(numbers: Array, batch: Shape) -> Pace:
    """Where the members of a batch stand, from the numbers of each, or those of all."""
    from .reference import adaptive

    return adaptive.Pace(*numbers if numbers.shape[1:] == batch else (np.broadcast_to(row, batch) for row in numbers))


def evaluations(method: Method, system: System, *, order: int = 0, paced: bool = False) -> int:
    """Function evaluations of a step, or of an attempt at an adaptive one by a series of that order.

    Of a series: operations of all coefficients of the rates over those of one evaluation, rounded up. All operations count alike.

    Raises:
        UnsupportedError: if the series of the system is too long.
    """
    if method.has_series:
        batch = system.batch if system.control is None else np.broadcast_shapes(system.batch, system.control.batch)
        plan = Plan(system, method, batch, 1.0, order=order)
        return _core.series_evaluations(model(plan), attempts=paced)
    return method.attempt_evaluations if paced else method.evaluations


def attempts(method: Method, system: Any, block_axes: tuple[int, int], order: int = 0) -> Any:
    """An attempt at an adaptive step by the reference: a function of a pace, a budget, v and y."""
    from .reference import adaptive, series_pace

    steps: Any = method.steps
    if method.has_series:
        return partial(series_pace.attempt, order or steps.ORDER, system, block_axes)
    assert method.error_order is not None
    return partial(adaptive.attempt, steps, system, method.error_order, block_axes)


def _evaluated_attempt(plan: Plan, budget: int) -> Any:
    """An attempt at an adaptive step."""
    made = _evaluated(plan, "attempt", budget)

    def attempt(pace: Pace, budget: int, v: Array, y: Array) -> tuple[Pace, Array, Array]:
        out = made([*_rows(plan, v, y), *np.broadcast_arrays(*pace)], None)
        return (pace_of(out[-len(pace) :], plan.batch), *_blocks(v, y, out))

    return attempt


def attempt_by_numpy(plan: Plan, budget: int) -> Any:
    """The same, by the tape if it has to be."""
    from .reference import adaptive

    if plan.by_tape:
        return _evaluated_attempt(plan, budget)
    system = adaptive.Attempted(plan.system.alone(1.0, plan.batch), plan.system.control)
    return attempts(plan.method, system, plan.block_axes, plan.order)


def adapt(plan: Plan, pacing: Pacing, paces: Array, v: Array, y: Array) -> Adapted:
    """Go on from where members stand, of whom ``paces`` has the numbers of each or those of all."""
    if plan.backend == "numpy":
        return _adapt_by_numpy(plan, pacing, paces, v, y)
    times, n_v, members = len(pacing.at), prod(plan.system.v_shape), plan.members
    saved_v, saved_y = np.empty((times, *v.shape)), np.empty((times, *y.shape))
    last = np.empty((n_v + prod(plan.system.y_shape), members))
    last_paces, status = np.empty((PACE_NUMBERS, members)), np.empty(plan.batch, dtype=np.int64)
    before = paces.reshape(PACE_NUMBERS, paces.size // PACE_NUMBERS)
    rows_v, rows_y = rows(v, plan.batch), rows(y, plan.batch)
    arrays = AdaptiveArrays(rows_v, rows_y, before, saved_v, saved_y, last, last_paces, status.reshape(-1))
    spec = model(plan)
    if not _core.adapt(spec, plan, pacing, arrays):  # an attempt is not one tape: the reference finds the start
        before = np.array(begun(plan, paces, v, y)).reshape(PACE_NUMBERS, members)
        _core.adapt(spec, plan, pacing._replace(begins=False), arrays._replace(paces=before))
    series = plan.method.has_series
    each = _core.series_evaluations(spec, attempts=True) if series else plan.method.attempt_evaluations
    last_v, last_y = last[:n_v].reshape(v.shape), last[n_v:].reshape(y.shape)
    return Adapted(saved_v, saved_y, last_v, last_y, last_paces.reshape(PACE_NUMBERS, *plan.batch), status, each)


def _adapt_by_numpy(plan: Plan, pacing: Pacing, paces: Array, v: Array, y: Array) -> Adapted:
    """The same by the reference."""
    from .reference import adaptive

    pace = begun(plan, paces, v, y) if pacing.begins else pace_of(paces, plan.batch)
    attempt = attempt_by_numpy(plan, pacing.budget)
    out = adaptive.run(attempt, v, y, pace, at=pacing.at.tolist(), budget=pacing.budget)
    each = evaluations(plan.method, plan.system, order=plan.order, paced=True)
    return Adapted(out.v, out.y, out.last_v, out.last_y, np.array(np.broadcast_arrays(*out.pace)), out.status, each)
