"""What tests of graphs share."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
import stepwell as sw
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


def model(system: sw.System, method: sw.Method, *, single: bool = False) -> Any:
    return engine.model(engine.Plan(system, method, system.batch, 0.1, single=single))


def methods(system: sw.System) -> Iterator[sw.Method]:
    large = int(np.prod(system.v_shape)) > MANY
    for method in METHODS[:4] if large else few_implicit(METHODS, 3, "graph", str(system)):
        if fits(system, method):
            yield method
