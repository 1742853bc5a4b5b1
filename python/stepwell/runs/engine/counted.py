"""The operations of a step, counted by kind."""

from __future__ import annotations

from math import prod
from typing import Any

from ... import _core
from ...reference.traced import Tracer
from .plan import Plan


def written(plan: Plan, attempts: bool = False) -> dict[str, int]:
    """Count the operations of a step as it is written down, by kind, for values that change between steps."""
    tape = _core.Tape(single=plan.single)
    return tape.written(traced(Tracer(plan.system, tape), plan, attempts))


def traced(tracer: Tracer, plan: Plan, attempts: bool) -> list[Any]:
    """The values of the next state, on the tape of the tracer."""
    if plan.form == "matrix":
        inputs = [each.signal() for each in plan.system.given_inputs().values()]
        n = prod(plan.system.v_shape) + prod(plan.system.y_shape)
        return tracer.matrix(plan.method.nodes, n, inputs, plan.method.carry is not None)
    return tracer.attempt(plan.method) if attempts else tracer.step(plan.method)
