"""Taylor series of functions of two arguments, one of them a parameter: everything that reads such a step by the reference."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell import _core
from stepwell.reference.traced import Tracer
from stepwell.runs import engine
from support.graphs import assert_one_graph
from support.ways import assert_equal_ways

TAYLOR = sw.method("taylor")

#: Rates of y with a parameter p, which is a symbol on a tape and no series.
FUNCTIONS: dict[str, Callable[[Any, Any], Any]] = {
    "power": lambda y, p: y**p,
    "exponent": lambda y, p: p**y,
    "float_power": np.float_power,
    "hypot": np.hypot,
    "hypot of a parameter first": lambda y, p: np.hypot(p, y),
    "arctan2": np.arctan2,
    "arctan2 of a parameter first": lambda y, p: np.arctan2(p, y),
    "mod": np.mod,
    "remainder": np.remainder,
    "%": lambda y, p: y % p,
    "twice with different parameters": lambda y, p: np.hypot(y, p) - np.hypot(y, 2.0 * p),
    "twice with zeros of both signs": lambda y, p: np.arctan2(y, 0.0) - p * np.arctan2(y, -0.0),
}


def of(name: str) -> sw.System:
    @sw.system
    def own(t: Any, v: Any, y: Any, *, p: Any = 1.7) -> Any:
        return -FUNCTIONS[name](y, p)

    return own(p=[1.2, 1.7])


def test_core_and_reference_are_one_graph() -> None:
    for name in FUNCTIONS:
        system, tape = of(name).for_state_shapes(0.0, 0.0), _core.Tape()
        for what, traced in (("step", Tracer(system, tape).step), ("attempt", Tracer(system, tape).attempt)):
            model = engine.model(engine.Plan(system, TAYLOR, (), 0.1))
            assert_one_graph(tape, tape.trace(model, what), traced(TAYLOR))


def test_both_backends_have_the_same_bits() -> None:
    for name in FUNCTIONS:
        y = np.array([0.9, -0.4] if "arctan2" in name else [0.9, 0.4])
        run = assert_equal_ways(of(name), "taylor", ways=("by the reference",), v=np.zeros(2), y=y, dt=0.01, steps=20)
        assert np.isfinite(run.y).all(), name


@pytest.mark.parametrize("name", ["power", "hypot", "arctan2", "mod"])
def test_everything_that_reads_the_step(name: str) -> None:
    system = of(name)
    one = {"v": 0.0, "y": 0.9}
    assert np.isfinite(sw.lyapunov(system, "taylor", **one, dt=0.01, steps=20).exponents).all()
    assert sum(sw.explain(system, "taylor").computed.values()) > 0
    assert "_step" in sw.export(system, "taylor", "c", dt=0.01, member=1).source
    below = sw.Event(lambda t, v, y: y - 0.85, name="below")
    run = sw.integrate(system, "taylor", **one, dt=0.01, steps=80, events=[below])
    assert (run.events["below"].count >= 1).all()
    assert np.shape(sw.stability_limit(system, "taylor", **one)) == (2,)
