"""Steps by the tape of the reference, line by line, for all members at once: what is fused, of float32, or a series."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ... import _core
from ...base.arrays import Array, Blocks
from ...reference import run as reference
from .plan import Plan, model


def evaluated(plan: Plan, what: str, budget: int = 0) -> Callable[[list[Array], Any], Array]:
    """A method's "step" or "attempt", or how it goes from v to what it carries and back, by the tape of the reference.

    It is evaluated line by line, for all members at once: from the rows of a state, and the time, to the next ones.
    """
    from ...reference.tape import single  # only such runs need it
    from ...reference.tape.fused import Evaluated
    from ...reference.traced import Tracer

    _core.check(model(plan.of_core()))
    tape = _core.Tape(single=plan.single)
    tracer = Tracer(plan.system, tape, plan.force)
    match what:
        case "step":
            symbols = tracer.step(plan.method, plan.choice)
        case "attempt":
            symbols = tracer.attempt(plan.method, plan.order, plan.acceptance, backward=plan.backward)
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


def rows_of(plan: Plan, v: Array, y: Array) -> list[Array]:
    """The rows of a state."""
    return [*v.reshape(-1, *plan.batch), *y.reshape(-1, *plan.batch)]


def blocks_of(v: Array, y: Array, made: Array) -> Blocks:
    """Blocks of the same shapes, from rows."""
    n_v, n_y = (a.size // max(1, made[0].size) for a in (v, y))
    return made[:n_v].reshape(v.shape), made[n_v : n_v + n_y].reshape(y.shape)


def evaluated_step(plan: Plan, s: Any) -> reference.Step:
    """A step; what a control of ``s`` adds up is added up there."""
    made = evaluated(plan, "step")

    def step(t: float, v: Array, y: Array) -> Blocks:
        if plan.system.control is None:
            return blocks_of(v, y, made(rows_of(plan, v, y), t))
        *_, s.work = out = made([*rows_of(plan, v, y), np.asarray(s.work, dtype=plan.dtype)], t)
        return blocks_of(v, y, out)

    return step


def evaluated_slot(plan: Plan, which: str) -> reference.Velocity:
    """What a method carries from velocities, or back."""
    made = evaluated(plan, which)
    return lambda t, v, y: blocks_of(v, y, made(rows_of(plan, v, y), t))[0]
