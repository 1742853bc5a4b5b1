"""The exact step of linear systems: equal bits by core and reference, the true solution for every input, and what is refused."""

from __future__ import annotations

import copy
import pickle
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.errors import ArgumentError, UnsupportedError
from support.for_each import for_each
from support.ways import assert_equal_ways


def driven(x: Any, *, batch: bool = False) -> sw.LinearSystem:
    """Two damped oscillators that touch, with two inputs, and the velocities among the coordinates."""
    A = np.array([[0.0, 1.0, 0.0, 0.0], [-4.0, -0.3, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0], [1.0, 0.0, -9.0, -0.2]])
    whole = A[..., np.newaxis] * np.array([0.5, 1.0, 1.5]) if batch else A
    B = np.array([[0.0, 0.0], [1.0, 0.5], [0.0, 0.0], [0.0, 1.0]])
    return sw.LinearSystem(whole, B, x=[x, -0.7], velocities=[1, 3])


DT = 0.25

INPUTS: dict[str, Any] = {
    "constant": 0.4,
    "sinusoid": sw.Sinusoid(1.0, 3.0, 0.4),
    "sinusoids of each member": sw.Sinusoid(np.array([1.0, 0.5, 2.0]), np.array([0.0, 3.0, 40.0]), 0.4),
    "held": sw.Sampled([0.0, 1.0, -0.5, 2.0], 2 * DT, start=DT),
    "held, of each member": sw.Sampled(np.arange(12.0).reshape(4, 3), DT),
    "lines": sw.Sampled([0.0, 1.0, -0.5, 2.0, 0.3], DT, start=-DT, interpolation="linear"),
    "none": None,
}


@for_each("name", INPUTS)
def test_every_input_goes_every_way(name: str) -> None:
    """Those that begin with steps, as the method needs them."""
    start = {"v": np.array([[0.3], [-0.2]]) * np.ones(3), "y": np.array([[1.0], [0.5]]) * np.ones(3)}
    ways = ("by the reference", "in pieces", "in a world", "alone")
    for options in ({}, {"dtype": "float32", "fused": True}):
        system = driven(INPUTS[name], batch=True)
        assert_equal_ways(system, "exact", **start, **options, dt=DT, steps=30, every=7, t0=DT, ways=ways)


@for_each("name", INPUTS)
def test_it_is_the_solution(name: str) -> None:
    """Beside DOP853 to 1e-13, whose own error is some 1e-12 over these 8 units of time."""
    system, start = driven(INPUTS[name], batch="each" in name), {"v": [0.3, -0.2], "y": [1.0, 0.5]}
    run = sw.integrate(system, "exact", **start, dt=DT, steps=32, every=8)
    true = sw.integrate(system, "dop853", **start, tolerance=1e-13, at=run.t, max_step=DT)
    assert run.v == pytest.approx(true.v, abs=2e-11)
    assert run.y == pytest.approx(true.y, abs=2e-11)


def test_a_step_may_be_as_long_as_it_likes() -> None:
    """One of 100 and a thousand of 0.1 end at the same state: the method has no order, and no limit."""
    system = sw.Oscillator(2.0, 0.01, x=sw.Sinusoid(1.0, 1.7))
    one = sw.integrate(system, "exact", v=0.0, y=1.0, dt=100.0, steps=1)
    many = sw.integrate(system, "exact", v=0.0, y=1.0, dt=0.1, steps=1000)
    assert one.y[-1] == pytest.approx(many.y[-1], abs=1e-12)
    undamped = sw.integrate(sw.Oscillator(1.0), "exact", v=0.0, y=1.0, dt=0.5, steps=100_000)
    assert float(np.hypot(undamped.v[-1], undamped.y[-1])) == pytest.approx(1.0, abs=1e-11)  # 1e5 steps of 1e-16


@for_each("name", ["sinusoid", "held", "lines", "constant"])
def test_it_goes_back_in_time(name: str) -> None:
    system = driven(INPUTS[name])
    there = sw.integrate(system, "exact", v=[0.3, -0.2], y=[1.0, 0.5], dt=DT, steps=8)
    back = sw.integrate(system, "exact", v=there.v[-1], y=there.y[-1], dt=-DT, steps=8, t0=8 * DT)
    assert back.y[-1] == pytest.approx([1.0, 0.5], abs=1e-12)
    assert back.v[-1] == pytest.approx([0.3, -0.2], abs=1e-12)


def test_the_matrix_has_the_same_bits() -> None:
    system, options = sw.Oscillator([1.0, 2.0], 0.1, x=sw.Sinusoid(1.0, 1.7), a=0.3), {"v": 0.2, "y": 1.0, "dt": 0.3, "steps": 50}
    direct = sw.integrate(system, "exact", **options)
    assert np.array_equal(sw.integrate(system, "exact", **options, form="matrix").y, direct.y)
    each = sw.integrate(system, "exact", **options, t0=np.array([0.0, 1.0]))
    assert np.array_equal(each.y[..., 0], direct.y[..., 0])
    assert np.array_equal(each.y[..., 1], sw.integrate(system, "exact", **options, t0=1.0).y[..., 1])


def test_a_world_is_reset_and_has_no_parameters() -> None:
    y = np.ones(2)
    world = sw.World(sw.Oscillator(np.array([1.0, 2.0]), 0.1), "exact", v=np.full(2, 0.2), y=y, dt=0.3)
    world.step(20)
    for again in (pickle.loads(pickle.dumps(world)), copy.deepcopy(world)):
        assert np.array_equal(again.y, y)
    world.reset(0, v=0.2, y=1.0)
    assert y[0] == 1.0
    for call in (lambda: world.set(damping=0.2), lambda: world.parameters, lambda: world.reset(0, omega=2.0)):
        with pytest.raises(UnsupportedError, match="parameters: exact steps by matrices that were computed from them"):
            call()


def test_the_analysis_has_the_truth() -> None:
    """e^(λ·dt) at every step: no damping, no frequency that is off, and no limit."""
    dt = np.array([0.1, 1.0, 1.5])
    step = sw.analyse(sw.Oscillator(2.0, 0.1), "exact", dt=dt)
    rate = 2.0 * (-0.1 + 1j * np.sqrt(0.99))
    assert step.eigenvalues[0] == pytest.approx(np.exp(rate * dt), rel=1e-14)
    assert step.frequency_ratio == pytest.approx(1.0, rel=1e-14)
    free = sw.analyse(sw.Oscillator(2.0), "exact", dt=0.5)
    assert (free.kind, free.q) == ("harmonic", pytest.approx(1.0, abs=1e-15))
    one = sw.analyse(driven(None), "exact", dt=0.3)
    near = sw.analyse(driven(None), "dop853", dt=0.3)
    assert np.abs(one.P - near.P).max() < 1e-6  # ten times its own error
    assert np.abs(one.Q - near.Q).max() < 1e-6
    held = sw.discretise(sw.Oscillator(2.0, 0.1), 0.1, sw.method("exact"))
    assert np.array_equal(held.P, sw.analyse(sw.Oscillator(2.0, 0.1), "exact", dt=0.1).P)


def test_the_limit_is_that_of_the_system() -> None:
    assert sw.stability_limit(sw.Oscillator([1.0, 5.0], 0.1), "exact").tolist() == [np.inf, np.inf]
    assert sw.stability_limit(sw.Oscillator(1.0), "exact") == np.inf
    assert sw.stability_limit(sw.LinearSystem([[0.1]]), "exact") == 0.0


def test_other_ways_to_run_it(tmp_path: Path) -> None:
    run = sw.integrate(sw.Oscillator(damping=0.1), "exact", v=0.0, y=1.0, dt=0.3, steps=5)
    run.save(tmp_path / "run.npz")
    assert sw.load(tmp_path / "run.npz").method is sw.method("exact")
    assert copy.deepcopy(sw.method("exact")) is sw.method("exact")
    scene = sw.scenes.oscillator()
    assert float(np.max(scene.state_error(scene.run("exact", 0.1)))) < 1e-11


OSCILLATOR = sw.Oscillator(1.0)
START: dict[str, Any] = {"v": 0.0, "y": 1.0, "dt": 0.1, "steps": 3}

#: What options a run with the method refuses, of the oscillator or of another system, and why.
REFUSED: list[tuple[dict[str, Any], str]] = [
    ({"system": sw.Pendulum()}, "method: exact steps linear systems"),
    ({"system": sw.Oscillator(friction=0.1)}, "method: exact steps linear systems"),
    ({"system": sw.Oscillator(x=sw.Sampled([0.0, 1.0], 0.25))}, "x: with exact a sample begins with a step"),
    ({"system": sw.Oscillator(a=sw.Sampled([0.0, 1.0], 0.05))}, "a: with exact a sample begins with a step"),
    ({"system": sw.Oscillator(x=sw.Sampled([0.0, 1.0, 4.0], 0.1, interpolation="cubic"))},
     "x: exact knows the solution for inputs that are constant, sinusoidal, held or on straight lines"),
    ({"force": 1.0}, "force: does not go with exact"),
    ({"control": sw.EnergyControl(1.0)}, "control: does not go with exact"),
    ({"events": lambda t, v, y: y}, "events: does not go with exact"),
    ({"dt": None, "steps": None, "tolerance": 1e-6, "at": [1.0]}, "tolerance: exact does not estimate"),
]  # fmt: skip
#: What reads the operations of a step, which this method has not.
READING: list[Any] = [
    *(partial(read, OSCILLATOR, "exact") for read in (sw.explain, partial(sw.lyapunov, v=0.0, y=1.0, dt=0.1, steps=10))),
    partial(sw.export, OSCILLATOR, "exact", "c"),
    partial(sw.charts.work_precision, "oscillator", ["exact"]),
    *(partial(read, ["exact"]) for read in (sw.charts.stability, sw.criteria)),
    partial(sw.charts.stability_map, "exact"),
    *(partial(read, "exact") for read in (sw.stability.function, sw.stability.operations, sw.stability.series)),
]


def test_what_is_refused() -> None:
    y = np.ones(1)
    late = sw.Oscillator(x=sw.Sampled([0.0, 1.0], 0.1, start=0.03))
    for call, message in (
        *((partial(sw.integrate, **{"system": OSCILLATOR, "method": "exact"} | START | more), why) for more, why in REFUSED),
        (partial(sw.World, late, "exact", v=0.0 * y, y=y, dt=0.1), "x: with exact a sample begins with a step"),
        *((read, "method: exact makes no operations") for read in READING),
    ):
        with pytest.raises((UnsupportedError, ArgumentError)) as caught:
            call()
        assert str(caught.value).startswith(message), call


def test_it_is_not_among_the_methods_of_all_systems() -> None:
    assert "exact" not in [each.name for each in sw.methods()]
    assert sw.method("exact").order == np.inf
    assert "matrix exponential" in str(sw.method("exact").__doc__)
