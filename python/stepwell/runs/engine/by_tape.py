"""Steps by the tape of the reference, line by line, for all members at once: fused steps, float32 and series."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import prod
from typing import TYPE_CHECKING, Any

import numpy as np

from ... import _core
from ...base.arrays import Array, Blocks
from ...reference import run as reference
from ...reference.signal import Held
from .plan import Plan, model

if TYPE_CHECKING:
    from ...reference import adaptive
    from ...reference.tape.single import Steps
    from ...reference.traced import Tracer

#: Parameters by their numbers on a tape, and sampled inputs, of some members.
Some = tuple[Mapping[int, Any], Sequence[Any]]


def traced(plan: Plan, what: str) -> tuple[Tracer, Any, list[Any]]:
    """Trace a method's "step", "attempt", "extension", the "tried" part of an attempt, or "start" or "finish" of the carry.

    Returns the tracer, the tape, and the symbols of the next state.
    """
    from ...reference.traced import Tracer  # only such runs need it

    _core.check(model(plan.of_core()))
    tape = _core.Tape(single=plan.single)
    tracer = Tracer(plan.stepped, tape, plan.force)
    match what:
        case "step":
            symbols = tracer.step(plan.method, plan.choice)
        case "attempt":
            symbols = tracer.attempt(plan.method, plan.order, plan.acceptance, backward=plan.backward)
        case "extension":
            symbols = tracer.extension(plan.method, plan.acceptance, backward=plan.backward)
        case "tried":
            symbols = tracer.tried(plan.method, backward=plan.backward)
        case _:
            symbols = tracer.slot(plan.method, what, plan.choice)
    return tracer, tape, symbols


def steps_of_single(plan: Plan, what: str) -> Steps:
    """``traced`` in float32, to be evaluated for all members at once."""
    from ...reference.tape.single import Steps

    tracer, tape, symbols = traced(plan, what)
    return Steps(tape, symbols, dict(enumerate(tracer.numbers)), plan.fuses, tracer.tables, tracer.times)


def evaluated(plan: Plan, what: str, budget: int = 0) -> Callable[[list[Array], Any], Array]:
    """A function from the rows of a state and the time to the next rows, line by line for all members at once."""
    from ...reference.tape.evaluate import Evaluation

    steps: Callable[..., list[Any]]
    if plan.single:
        steps = steps_of_single(plan, what)
    else:
        tracer, tape, symbols = traced(plan, what)
        numbers, [(_, _, number_of_budget)] = dict(enumerate(tracer.numbers)), tape.operations([tape.budget()])[0]
        steps = Evaluation(tape, symbols, numbers | {number_of_budget: budget}, tracer.tables, fuse=plan.fuses)

    def next_rows(state: list[Array], t: Any) -> Array:
        rows = steps(state, t, plan.dt)
        out = np.empty((len(rows), *plan.batch), dtype=plan.dtype)
        for i, row in enumerate(rows):
            out[i] = row
        return out

    return next_rows


def some_of(steps: Steps, index: Any) -> Some:
    """The parameters and samples of these members, along one axis."""

    def some(numbers: Any) -> Any:
        return numbers[..., index] if numbers.ndim and numbers.shape[-1] > 1 else numbers

    tables = [
        Held(some(table.values) if table.values.ndim > 1 else table.values, table.interval, table.start) for table in steps.tables
    ]
    return {i: some(numbers) for i, numbers in steps.numbers.items()}, tables


def tried(plan: Plan, steps: Steps, t: Any, step: Any, v: Array, y: Array, some: Some | None = None) -> adaptive.Tried:
    """The part of an attempt in float32 before its decision, as float64; with the parameters of ``some`` members if given."""
    from ...reference import adaptive

    numbers, tables = (None, steps.tables) if some is None else some
    sign = -1.0 if plan.backward else 1.0
    # No step crosses the time of a sample, so the sample at its middle is that of the whole step.
    samples = [table.sample(sign * (t + 0.5 * step)) for table in tables]
    n_v, n_y, batch = prod(plan.system.v_shape), prod(plan.system.y_shape), v.shape[len(plan.system.v_shape) :]
    n = n_v + n_y
    rows = steps([*v.reshape(n_v, *batch), *y.reshape(n_y, *batch), t, step, *samples], 0.0, 1.0, numbers, tables)[
        n + 2 + len(tables) :
    ]
    wide = np.empty((len(rows), *batch))
    for i, row in enumerate(rows):
        wide[i] = row
    pairs = [(wide[i : i + n_v].reshape(v.shape), wide[i + n_v : i + n].reshape(y.shape)) for i in range(0, len(rows) - 1, n)]
    return adaptive.Tried(*pairs[0], pairs[1:-1], pairs[-1], wide[-1])


def tried_attempt(plan: Plan) -> Any:
    """An attempt at an adaptive step in float32, decided in float64."""
    from ...reference import adaptive

    steps, order = steps_of_single(plan, "tried"), plan.method.error_order
    small = adaptive.small_of(plan.system.mass_matrix, adaptive.SINGLE_ROUNDING)
    assert order is not None

    def attempt(pace: adaptive.Pace, budget: int, v: Array, y: Array) -> tuple[adaptive.Pace, Array, Array]:
        outlook = pace.outlook(budget)
        trial = tried(plan, steps, pace.t, outlook.step, v, y)
        return adaptive.judged(
            pace, outlook, order, plan.block_axes, plan.acceptance, v, y, trial, small=small, rounding=adaptive.SINGLE_ROUNDING
        )

    return attempt


def rows_of(plan: Plan, v: Array, y: Array) -> list[Array]:
    """The rows of a state."""
    return [*v.reshape(-1, *plan.batch), *y.reshape(-1, *plan.batch)]


def blocks_of(v: Array, y: Array, rows: Array) -> Blocks:
    """Blocks from rows, in the shapes of v and y."""
    n_v, n_y = (a.size // max(1, rows[0].size) for a in (v, y))
    return rows[:n_v].reshape(v.shape), rows[n_v : n_v + n_y].reshape(y.shape)


def evaluated_step(plan: Plan, s: Any) -> Callable[[float, Array, Array, list[Array]], list[Array]]:
    """A step, with what the method keeps behind v and y, which adds the work of a control to ``s.work``."""
    next_rows = evaluated(plan, "step")

    def step(t: float, v: Array, y: Array, kept: list[Array]) -> list[Array]:
        rows = [*rows_of(plan, v, y), *(row for block in kept for row in block.reshape(-1, *plan.batch))]
        if plan.system.control is None:
            out = next_rows(rows, t)
        else:
            *_, s.work = out = next_rows([*rows, np.asarray(s.work, dtype=plan.dtype)], t)
        blocks, ends = [v, y, *kept], np.cumsum([len(each.reshape(-1, *plan.batch)) for each in (v, y, *kept)])
        return [
            out[end - len(each.reshape(-1, *plan.batch)) : end].reshape(each.shape)
            for each, end in zip(blocks, ends, strict=True)
        ]

    return step


def evaluated_slot(plan: Plan, which: str) -> reference.Velocity:
    """A function from velocities to what a method carries, or back."""
    next_rows = evaluated(plan, which)
    return lambda t, v, y: blocks_of(v, y, next_rows(rows_of(plan, v, y), t))[0]
