"""The computations beside the steps of a run, as lines: start and finish of a method with a carry, and recorded quantities."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np

from ... import _core
from ...reference.traced import Tracer
from ...runs.engine import Plan
from .formula import Formula, Notation
from .listing import Leaf, Section, Writer
from .naming import indexed, kept, parameters


def lines_beside(plan: Plan, choice: int, record: Sequence[str]) -> tuple[Section, ...]:
    """The sections of a method's start and finish, where it begins with more than its state, and of the recorded quantities."""
    sections = []
    if plan.method.begins:
        for which in ("start", "finish") if plan.method.carry is not None else ("start",):
            sections.append(_lines(plan, which, partial(Tracer.slot, method=plan.method, which=which, choice=choice)))
    for name in record:
        sections.append(_lines(plan, f"record {name}", partial(Tracer.record, names=[name])))
    return tuple(sections)


def _lines(plan: Plan, when: str, traced: Callable[[Tracer], list[Any]]) -> Section:
    """The section of a computation that is not split."""
    tape = _core.Tape(single=plan.single)
    tracer = Tracer(plan.stepped, tape)
    symbols = traced(tracer)
    numbers, tables = parameters(plan._replace(form="direct"))
    system, carry = plan.system, plan.method.carry or "v"
    is_end = when in ("start", "finish")
    reads = carry if when == "finish" else "v"
    makes = {"start": carry, "finish": "v"}.get(when, when.removeprefix("record "))
    blocks = [(reads, system.v_shape), ("y", system.y_shape)]
    of_state = [indexed(name, index) for name, shape in blocks for index in np.ndindex(shape)]
    if when == "start" and plan.method.kept:
        results = [indexed(name, index) for name, shape in kept(plan) for index in np.ndindex(shape)]
        wanted = symbols[len(symbols) - len(results) :]
    else:
        results = [indexed(makes, index) for index in np.ndindex(system.v_shape if is_end else system.quantities[makes])]
        wanted = symbols[: len(results)]
    # Recorded quantities are computed without fused multiply-adds.
    on, wanted = tape.fused(wanted) if plan.fuses and is_end else (tape, wanted)
    params = [tape.param(i) for i in range(len(numbers))]

    def leaf(name: str, i: int) -> Leaf:
        match name:
            case "state":
                return Leaf(Formula(of_state[i]), tape.state(i), 4)
            case "parameter":
                return Leaf(Formula(numbers[i]), params[i], 1)
            case "step":
                return Leaf(Formula("h"), tape.step(), 1)
            case _:
                return Leaf(Formula("t"), tape.time(), 3)

    omegas = {(tape.step() * symbol).id: "Φ" for each, symbol in zip(numbers, params, strict=True) if each == "omega"}
    return Writer(tape, omegas, Notation(plan.single), tables=tables).section(when, on.operations(wanted), leaf, 4, "a", results)[
        0
    ]
