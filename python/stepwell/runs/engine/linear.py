"""Linear systems: a step by the transition matrix (Appendix B)."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from itertools import count
from math import floor, prod
from typing import Any

import numpy as np

from ... import _core
from ...base import checks
from ...base.arrays import Array, Blocks, Whole
from ...model.parameters import aligned, flat
from ...reference import run as reference
from . import exact
from .direct import Looped, advance_direct, finished, looped, run_by_core, to_slot, to_velocity
from .plan import BEGINS, Outcome, Plan

#: Numbers in memory at a time for each element of the matrix: unit vectors, their states after a step, the core's copies of them.
NUMBERS_OF_AN_ELEMENT = 8

#: This many numbers of states, and of matrices if members have their own, are stepped at once: an operation on them takes a
#: millisecond.
NUMBERS_AT_ONCE = 1 << 20


def transition(plan: Plan) -> Array:
    """P of shape (n, n, *batch), from one step of each unit vector of the slots (v slot first).

    Each vector of a member needs a copy of the member's parameters, so only some vectors are stepped at once. For steps in
    float32 P is a parameter: computed in float64, then rounded.
    """
    n_v, n_y = (prod(shape) for shape in (plan.system.v_shape, plan.system.y_shape))
    n = n_v + n_y
    if plan.method.is_exact:
        whole = exact.transition(plan.system, plan.dt)
        whole = np.array(np.broadcast_to(aligned(whole, 2, plan.batch), (n, n, *plan.batch)))
        return _rounded(plan, "the transition matrix", whole)
    free = plan._replace(system=plan.system.without_inputs(), single=False)
    at_once = max(1, NUMBERS_AT_ONCE // (n * n * prod(plan.batch))) if plan.system.batch else n
    matrix: Array = np.empty((n, n, *plan.batch))
    for k in range(0, n, at_once):
        along = np.eye(n)[:, k : k + at_once].reshape(n, -1, *(1,) * len(plan.batch))
        batch = (along.shape[1], *plan.batch)
        unit = np.broadcast_to(along, (n, *batch))
        v, y = unit[:n_v].reshape(*plan.system.v_shape, *batch), unit[n_v:].reshape(*plan.system.y_shape, *batch)
        matrix[:, k : k + at_once] = one_step(free._replace(batch=batch), v, y)
    return _rounded(plan, "the transition matrix", matrix)


def _rounded(plan: Plan, name: str, matrix: Array) -> Array:
    """A matrix rounded to the precision of the steps."""
    if not plan.single:
        return matrix
    checks.fits_single(name, matrix)
    return matrix.astype(np.float32).astype(np.float64)


def pulses(plan: Plan, inputs: Iterable[str]) -> Array:
    """Q of shape (nodes, inputs, n, *batch), from one step from rest with a unit pulse of one input at one node."""
    if plan.method.is_exact:
        return _rounded(plan, "what inputs add in a step", exact.pulses(plan))
    grid = _grid(plan.method.nodes)
    n = prod(plan.system.v_shape) + prod(plan.system.y_shape)
    inputs = list(inputs)
    q = np.zeros((len(plan.method.nodes), len(inputs), n, *plan.batch))
    for i, node in enumerate(plan.method.nodes):
        pulse, part = np.zeros(grid + 1), abs(plan.dt) / grid
        # In a step back in time the last part comes first, and a node is at the end of its part.
        back = plan.dt < 0.0
        pulse[grid - _bin(node, grid) if back else _bin(node, grid)] = 1.0
        start = -(grid + _LATE) * part if back else 0.0
        for j, name in enumerate(inputs):
            q[i, j] = one_step(plan._replace(system=plan.system.with_pulse(name, pulse, part, start), single=False))
    return _rounded(plan, "what inputs add in a step", q)


#: A node is in the first 0.9 of its part, so that this share of a part is after all of them.
_LATE = 0.95


def _bin(node: float, grid: int) -> int:
    """The part of a step that contains a node, if the step has ``grid`` parts."""
    return floor(node * grid + 1e-6)


def _grid(nodes: Iterable[float]) -> int:
    """The least number of parts of a step for each node to be in a part of its own, and not near its end."""
    nodes = list(nodes)
    return next(
        n for n in count(1) if len({_bin(c, n) for c in nodes}) == len(nodes) and all(c * n - _bin(c, n) < 0.9 for c in nodes)
    )


def one_step(plan: Plan, v: Array | None = None, y: Array | None = None) -> Array:
    """The slots after one step at t = 0 from ``v`` and ``y``, zero if None, as rows: those of v, then those of y."""
    if v is None or y is None:
        v, y = (np.zeros((*shape, *plan.batch)) for shape in (plan.system.v_shape, plan.system.y_shape))
    one = plan._replace(t0=0.0, first=0, steps=1, every=None, form="direct", progress=None)
    out = advance_direct(one, v, y, carried=True)
    n_v, n_y = (prod(shape) for shape in (plan.system.v_shape, plan.system.y_shape))
    return np.concatenate([out.slot.reshape(n_v, *plan.batch), out.y[-1].reshape(n_y, *plan.batch)])


def matrix_model(plan: Plan, P: Array, Q: Array) -> Any:
    """A step by a transition matrix, P of shape (n, n, *batch), Q of shape (nodes·inputs, n, *batch), as the core takes it."""
    n_v, n_y = prod(plan.system.v_shape), prod(plan.system.y_shape)
    q = Q.reshape(prod(Q.shape[: Q.ndim - 1 - len(plan.batch)]), n_v + n_y, *plan.batch)
    inputs = [each.signal() for each in exact.inputs_of(plan)]
    carries = int(plan.method.carry is not None)
    linear_map: dict[str, Any] = {"n": n_v + n_y, "n_v": n_v, "carries": carries, "p": P, "q": q, "inputs": inputs}
    if isinstance(plan.t0, np.ndarray) and inputs:
        linear_map[BEGINS] = plan.t0
    parameters = flat(linear_map, plan.batch)
    nodes = list(exact.nodes_of(plan))
    return _core.ModelSpec("matrix", plan.method.key, parameters, matrix=(nodes, n_v), fused=plan.fused, single=plan.single)


def _matrix_step(plan: Plan, P: Array, Q: Array) -> Callable[[float, Array], Array]:
    """A step by a transition matrix by the reference, from a time and the rows of a state to the next rows."""
    inputs, carries = [each.signal() for each in exact.inputs_of(plan)], plan.method.carry is not None
    nodes = exact.nodes_of(plan)
    if not plan.single:
        return reference.linear_step(P, Q, inputs, nodes, plan.dt, carries, fused=plan.fused)
    from ...reference.tape import single  # only such runs need it
    from ...reference.traced import Tracer

    tape = _core.Tape(single=True)
    tracer = Tracer(plan.system, tape)
    symbols = tracer.matrix(nodes, len(P), inputs, carries)
    numbers = [*P.reshape(-1, *plan.batch), *Q.reshape(-1, *plan.batch), *tracer.numbers]
    lines = single.Steps(tape, symbols, dict(enumerate(numbers)), False, tracer.tables, tracer.times)
    if plan.fused:
        lines.fuse_products_of(len(numbers) - len(tracer.numbers))
    return lambda t, s: np.stack(np.broadcast_arrays(*lines(list(s), t, plan.dt)))


def exact_model(plan: Plan) -> Any:
    """The exact step of a plan, as the core takes it."""
    p, q = transition(plan), pulses(plan, plan.system.given_inputs())
    return matrix_model(plan, p, q.reshape(q.shape[0] * q.shape[1], *q.shape[2:]))


def by_matrix(plan: Plan, v: Array, y: Array, before: Whole, carried: bool) -> Outcome:
    """The run by the transition matrix, step by step."""
    n = prod(plan.system.v_shape) + prod(plan.system.y_shape)
    numbers = float(NUMBERS_OF_AN_ELEMENT) * n * n
    checks.fits(f"the transition matrices of {n} × {n} numbers", numbers, plan.batch, "use form='direct'")
    inputs = plan.system.given_inputs()
    p, q = transition(plan), pulses(plan, inputs)
    q = q.reshape(q.shape[0] * q.shape[1], *q.shape[2:])
    slot = v if carried else to_slot(plan, v, y)
    n_v, n_y = v.size // max(1, prod(plan.batch)), y.size // max(1, prod(plan.batch))
    blocks = (*plan.system.v_shape, *plan.batch), (*plan.system.y_shape, *plan.batch)
    flat_v, flat_y = slot.reshape(n_v, *plan.batch), y.reshape(n_y, *plan.batch)
    linear = _matrix_step(plan, p, q)
    finish = to_velocity(plan)

    def step(t: float, v: Array, y: Array) -> Blocks:
        s = linear(t, np.concatenate([v, y]))
        return s[:n_v], s[n_v:]

    def velocity(t: float, v: Array, y: Array) -> Array:
        return v if finish is None else np.reshape(finish(t, v.reshape(blocks[0]), y.reshape(blocks[1])), v.shape)

    def by_reference(plan: Plan, v: Array, y: Array, before: Whole) -> Looped:
        return looped(plan, step, v, y, before, (1, 1), None if finish is None else velocity)

    if plan.backend == "numpy":
        flat_v, flat_y = flat_v.astype(plan.dtype, copy=False), flat_y.astype(plan.dtype, copy=False)
        flat_v, _, saved, first_bad = by_reference(plan, flat_v, flat_y, before)
    else:
        spec = matrix_model(plan, p, q)

        def by_core(plan: Plan, v: Array, y: Array, before: Whole) -> Outcome:
            v, y = (block.astype(np.float64, copy=False) for block in (v, y))
            return run_by_core(plan, spec, v, y, before.copy(), carried=True, carries=False)

        out = by_core(plan, flat_v, flat_y, before)
        first_bad = out.first_bad if finish is None else _seen(plan, by_core, by_reference, flat_v, flat_y, before, out)
        flat_v, saved = out.slot, (out.v, out.y)
    v, y = (a.reshape(len(a), *block) for a, block in zip(saved, blocks, strict=True))
    return finished(plan, flat_v.reshape(blocks[0]), (v, y), first_bad)


#: As the core's ``HUGE``, and that of float32.
_HUGE, _HUGE_SINGLE = 2.0**960, 2.0**64

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
    """The first bad steps of a run in matrix form, whose velocities the core does not compute.

    Members that come near the end of the number range are stepped again by the reference, from the last check before that.
    """
    most = (_HUGE_SINGLE if plan.single else _HUGE) * min(abs(plan.dt), 1.0)

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
            before = by_reference(piece, v.astype(plan.dtype, copy=False), y.astype(plan.dtype, copy=False), before)[3]
        v, y = ahead.slot, ahead.y[-1]
    return np.asarray(before)
