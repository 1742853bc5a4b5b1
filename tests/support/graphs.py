"""What tests of graphs share."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell import _core
from stepwell.reference.traced import Tracer
from stepwell.runs import engine

from support.cases import few_implicit, fits
from support.tracing import METHODS

#: Bodies whose graphs are compared with one method of each kind alone: they have tens of thousands of operations.
MANY = 100


def assert_one_graph(tape: Any, core: list[Any], reference: list[Any]) -> None:
    """Or show where both begin to differ."""
    assert len(core) == len(reference)
    for i, (ours, theirs) in enumerate(zip(core, reference, strict=True)):
        if ours.id != theirs.id:
            a, b = (tape.listing(each).splitlines() for each in (ours, theirs))
            line = next(n for n, pair in enumerate(zip([*a, "end"], [*b, "end"], strict=False)) if pair[0] != pair[1])
            pytest.fail(f"number {i} of the state: the core has  {a[line:][:1]}  where the reference has  {b[line:][:1]}")


def assert_traced_alike(system: sw.System, method: sw.Method | str, *whats: str, **of_plan: Any) -> None:
    """Of what is named, by default the step: the core and the reference have one graph."""
    method = sw.method(method) if isinstance(method, str) else method
    assert_plan_is_traced_alike(engine.Plan(system, method, system.batch, 0.1, **of_plan), *whats or ("step",))


def assert_plan_is_traced_alike(plan: engine.Plan, *whats: str) -> None:
    for what in whats:
        tape = _core.Tape()
        tracer, (which, *choice) = Tracer(plan.system, tape, plan.force), what.split()
        if choice:
            reference = tracer.slot(plan.method, which, int(choice[0]))
        else:
            reference = getattr(tracer, which)(plan.method, **{"backward": True} if plan.backward else {})
        assert_one_graph(tape, tape.trace(engine.model(plan), what), reference)


def model(system: sw.System, method: sw.Method, *, single: bool = False) -> Any:
    return engine.model(engine.Plan(system, method, system.batch, 0.1, single=single))


def methods(system: sw.System) -> Iterator[sw.Method]:
    large = int(np.prod(system.v_shape)) > MANY
    for method in METHODS[:4] if large else few_implicit(METHODS, 3, "graph", str(system)):
        if fits(system, method):
            yield method
