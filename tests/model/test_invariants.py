"""Invariants of own systems: recorded, kept by a control or a projection, their gradients derived."""

from __future__ import annotations

import copy
import pickle
from functools import partial
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.errors import ArgumentError, UnknownNameError, UnsupportedError
from support import own_systems as own
from support.calls import a_step, assert_raises
from support.for_each import for_each
from support.graphs import assert_traced_alike

START: dict[str, Any] = {"v": np.array([0.0, 0.5]), "y": np.array([1.0, -2.0]), "dt": 0.05, "steps": 40, "every": 5}
QUATERNION = {"v": np.array([1.0, 0.1, 0.2]), "y": np.array([1.0, 0.0, 0.0, 0.0]), "dt": 0.05, "steps": 40, "every": 5}


def test_an_invariant_is_recorded() -> None:
    run = sw.integrate(own.pendulum(omega=1.3), "rk4", **START, record="energy")
    expected = 0.5 * run.v**2 + 1.3**2 * (1.0 - np.cos(run.y))
    # Four operations and a cosine of numbers up to 4, each right to half a unit or one in the last place.
    np.testing.assert_allclose(run.recorded["energy"], expected, rtol=0, atol=8 * 4 * 2**-53)
    np.testing.assert_array_equal(run.energy, run.recorded["energy"])
    norm = sw.integrate(own.top(), "rk4", **QUATERNION, record="norm").recorded["norm"]
    assert norm.shape == (9,)
    np.testing.assert_allclose(norm, 1.0, rtol=1e-6)


@for_each("method", ["standard_euler", "standard_heun", "rk4", "false_euler", "dop853", "taylor"])
@for_each("control", [sw.Control("energy", 2.0), sw.Control("energy", 2.0, "printed"), sw.Projection("energy")])
def test_the_core_and_the_reference_are_one_graph_under_control(method: str, control: Any) -> None:
    system = own.pendulum(omega=np.array([0.8, 1.3])).for_state_shapes(START["v"], START["y"])
    assert_traced_alike(system.controlled(control, START["v"], START["y"], 0.05), method)


@for_each("form", ["printed", "limited"])
@for_each("batch", [(), (3,)])
def test_a_series_has_the_functions_of_the_invariant_that_is_kept(form: Any, batch: tuple[int, ...]) -> None:
    """The rates have none of them, so their series come from the invariant alone: a wrong one would show in order 2."""

    @sw.system
    def orbit(t: Any, v: Any, y: Any) -> Any:
        square = y[0] * y[0] + y[1] * y[1]
        return np.array([-y[0], -y[1]]) / (square * np.sqrt(square))

    @orbit.invariant
    def of_energy(v: Any, y: Any) -> Any:
        energy = 0.5 * (v[0] * v[0] + v[1] * v[1]) - 1.0 / np.hypot(y[0], y[1])
        return np.exp(energy) + np.sin(energy)

    control = sw.Control("of_energy", np.linspace(0.5, 1.0, *batch or (1,)).reshape(batch), form, target=0.2)
    start = {"v": [0.0, 1.1], "y": [1.0, 0.0], "control": control}
    start = {name: np.reshape(each, (2, *len(batch) * [1])) if name in "vy" else each for name, each in start.items()}
    series = sw.integrate(orbit(), "taylor", **start, dt=0.02, steps=100, every=25)
    # Both methods have errors far below rounding at this step, and 100 steps round some hundred times each.
    np.testing.assert_allclose(series.y, sw.integrate(orbit(), "dop853", **start, dt=0.02, steps=100, every=25).y, rtol=1e-13)
    if form == "printed":
        sw.integrate(orbit(), "taylor", **start, tolerance=1e-9, at=[0.5, 2.0])


def test_a_control_keeps_what_the_method_loses() -> None:
    """Standard Euler's energy grows by (1 + h²ω²) a step near the middle; the control takes it away as exp(−gain·t)."""
    controls = (None, sw.Control("energy", 10.0), sw.Projection("energy"))
    free, controlled, onto = (
        sw.integrate(own.pendulum(), "standard_euler", **START | {"steps": 400}, control=each, record="energy").recorded["energy"]
        for each in controls
    )
    start = free[0]
    assert (np.abs(free[-1] - start) > 0.3 * start).all()
    # In balance a step's growth, below h²·ω²·E·(1 + …) ≤ 2·h²·E, is a step's decay, h·gain/(1 + h·gain) of what is left.
    assert (np.abs(controlled[-1] - start) < 2 * 0.05**2 * start * (1 + 0.05 * 10) / (0.05 * 10) * 1.5).all()
    # A projection is right to the square of what a step does.
    assert (np.abs(onto[-1] - start) < (2 * 0.05**2) * start).all()
    assert (np.abs(onto[-1] - start) < np.abs(controlled[-1] - start)).all()


def test_the_error_of_an_invariant_decays_as_it_is_said() -> None:
    """A ring of the norm alone, kept: the state goes radially, and the norm's error by exp(−gain·t)."""
    y = np.array([1.2, 0.0, 0.0, 0.0])
    control = sw.Control("norm", 3.0, "printed", target=1.0)
    run = sw.integrate(own.top(), "rk4", v=np.zeros(3), y=y, dt=0.01, steps=100, every=1, control=control, record="norm")
    error = run.recorded["norm"] - 1.0
    # |q|² − 1 decays with the rate 3 exactly; RK4's own error is (0.03)⁵/120 a step.
    np.testing.assert_allclose(error, error[0] * np.exp(-3.0 * run.t), rtol=100 * 0.03**5)


def test_a_limited_control_never_overshoots() -> None:
    start = {"v": np.zeros(3), "y": np.array([1.2, 0.0, 0.0, 0.0]), "dt": 0.1}
    for gain in (10.0, 1e3, 1e6):
        control = sw.Control("norm", gain, target=1.0)
        run = sw.integrate(own.top(), "standard_euler", **start, steps=60, every=1, control=control, record="norm")
        error = run.recorded["norm"] - 1.0
        assert (np.diff(np.abs(error)) <= 2**-52).all()
    with pytest.warns(sw.ControlWarning, match=r"gain: h·gain = 100"):
        sw.integrate(own.top(), "standard_euler", **start, steps=1, control=sw.Control("norm", 1e3, "printed"))


def test_where_the_gradient_is_zero_nothing_is_pushed() -> None:
    run = sw.integrate(own.pendulum(), "rk4", v=0.0, y=0.0, dt=0.1, steps=3, control=sw.Control("energy", 1.0, target=1.0))
    assert run.v[-1] == run.y[-1] == 0.0


def test_what_resumes_a_run_has_its_control() -> None:
    """A world, too; runs that go on are in test_ways.py."""
    system, control = own.pendulum(), sw.Control("energy", 2.0)
    whole = sw.integrate(system, "rk4", **START, control=control)
    world = sw.World(system, "rk4", v=START["v"].copy(), y=START["y"].copy(), dt=0.05, control=control)
    world.step(20)
    resumed = sw.World(system, "rk4", dt=0.05, resume=world)
    resumed.step(20)
    np.testing.assert_array_equal(resumed.y, whole.y[-1])
    assert pickle.loads(pickle.dumps(whole.system)) == copy.deepcopy(whole.system) == whole.system


def test_batches_of_gains_and_targets() -> None:
    control = sw.Control("energy", np.array([0.0, 5.0]), target=np.array([1.0, 2.0]))
    run = sw.integrate(own.pendulum(), "rk4", **START | {"steps": 200}, control=control, record="energy")
    free = sw.integrate(own.pendulum(), "rk4", **START | {"steps": 200}, record="energy")
    np.testing.assert_allclose(run.recorded["energy"][:, 0], free.recorded["energy"][:, 0], rtol=1e-9)
    np.testing.assert_allclose(run.recorded["energy"][-1, 1], 2.0, rtol=1e-6)


def test_what_cannot_be() -> None:
    @sw.system
    def plain(t: Any, v: Any, y: Any, *, k: Any = 1.0) -> Any:
        return -k * y

    def declared(name: str, arguments: str) -> Any:
        namespace: dict[str, Any] = {}
        exec(f"def {name}({arguments}):\n    return [y, y]", namespace)
        return plain.invariant(namespace[name])

    gain = sw.Control("energy", 1.0)
    declared("vector", "v, y")
    run = partial(a_step, own.pendulum)
    assert_raises(
        (lambda: run(control=sw.Control("enrgy", 1.0)), UnknownNameError, "control: there is no 'enrgy'; did you mean 'energy'"),
        (lambda: run(control=sw.EnergyControl(1.0)), UnsupportedError, r"EnergyControl .* use Control\('energy', gain\)"),
        (lambda: run(control=sw.Projection()), UnsupportedError, r"Projection\('scaling'\) .* use Projection\('energy'\)"),
        (lambda: run("verlet", control=gain), UnsupportedError, "verlet needs"),
        (lambda: a_step(sw.NBody(), y=np.eye(3, 2), control=gain), UnsupportedError, "is for an invariant of an own system"),
        (lambda: a_step(own.duffing, record="energy"), UnsupportedError, "energy: duffing.* declare one: @duffing.invariant"),
        (lambda: declared("wrong", "v, y, *, m"), ArgumentError, r"plain: wrong: expected .* whose .* got 'm'. Known: k"),
        (lambda: declared("short", "y"), ArgumentError, r"plain: short: expected a function \(v, y, \*, …\)"),
        (lambda: a_step(plain, record="vector"), ArgumentError, r"plain: vector: expected one number .* of shape \(2,\)"),
    )


def test_an_invariant_may_take_the_time_before_the_state() -> None:
    """As rates do; but no quantity that depends on it is constant."""
    first = sw.system(order=1)(lambda t, y, *, k=2.0: np.array([-k * y[1], y[0]]))
    second = sw.system(lambda t, v, y, *, k=2.0: -k * y)

    def of_first(t: Any, y: Any, *, k: Any) -> Any:
        return 0.5 * y[0] ** 2 + 0.5 * k * y[1] ** 2

    def of_second(t: Any, v: Any, y: Any, k: Any) -> Any:
        return 0.5 * v**2 + 0.5 * k * y**2

    systems: list[tuple[Any, Any, dict[str, Any]]] = [
        (first, of_first, {"y": np.ones(2)}),
        (second, of_second, {"v": 0.0, "y": 1.0}),
    ]
    for system, function, start in systems:
        name = function.__name__
        system.invariant(function)
        options: dict[str, Any] = {**start, "dt": 0.1, "steps": 5, "record": name}
        run, onto = (sw.integrate(system(k=3.0), "rk4", **options, control=each) for each in (None, sw.Projection(name)))
        states = [run.y[-1]] if system is first else [run.v[-1], run.y[-1]]
        assert run.recorded[name][-1] == pytest.approx(function(0.0, *states, k=3.0), rel=1e-15)
        # One correction of an error of 1e-6, squared.
        assert onto.recorded[name][-1] == pytest.approx(function(0.0, *start.values(), k=3.0), rel=1e-9)
    driven = sw.system(lambda t, v, y: np.cos(t) - y)

    @driven.invariant
    def moving(t: Any, v: Any, y: Any) -> Any:
        return v - np.sin(t)

    with pytest.raises(ArgumentError, match=r"moving: .* one that depends on the time t"):
        sw.integrate(driven, "rk4", v=0.0, y=1.0, dt=0.1, steps=1, record="moving")


def test_a_parameter_that_changes_makes_no_invariant() -> None:
    """It can be run all the same."""
    sw.integrate(own.pendulum(omega=own.turning), "rk4", v=0.0, y=1.0, dt=0.1, steps=3)
    with pytest.raises(ArgumentError, match=r"pendulum: energy: .* got omega, which changes with the time"):
        sw.integrate(own.pendulum(omega=lambda t: 1.0 + 0.1 * np.sin(t)), "rk4", v=0.0, y=1.0, dt=0.1, steps=1, record="energy")


def test_adaptive_steps_of_a_system_under_control() -> None:
    """A system that a run has put under control keeps it: they used to step bodies as if there were none."""
    y = np.array([[0.0, 1.0], [1.0, 0.0], [2.0, 2.0]])
    bodies = sw.integrate(sw.NBody(), "rk4", v=0.0, y=y, dt=0.01, steps=1, control=sw.EnergyControl(0.1)).system
    pairs: list[tuple[sw.System, sw.System, Any, Any]] = [(bodies, sw.NBody(), y, bodies.keeper)]
    for control in (sw.Control("energy", 1.0), sw.Projection("energy")):
        mine = sw.integrate(own.pendulum(), "rk4", v=0.0, y=1.0, dt=0.1, steps=1, control=control).system
        pairs.append((mine, own.pendulum(), 1.0, mine.keeper))
    for controlled, free, start, control in pairs:
        ask: dict[str, Any] = {"v": 0.0, "y": start, "tolerance": 1e-3, "at": [0.5]}
        run, alone = (sw.integrate(system, "dop853", **ask) for system in (controlled, free))
        anew = sw.integrate(free, "dop853", **ask, control=control)
        np.testing.assert_array_equal(run.y, anew.y)
        assert run.system.keeper is not None
        assert not np.array_equal(run.y, alone.y)
