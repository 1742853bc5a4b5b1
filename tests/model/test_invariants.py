"""Invariants of own systems: recorded, kept by a control or a projection, their gradients derived."""

from __future__ import annotations

import copy
import pickle
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell import _core
from stepwell.errors import ArgumentError, UnknownNameError, UnsupportedError
from stepwell.reference.traced import Tracer
from stepwell.runs import engine
from support import own_systems as own
from support.for_each import for_each
from support.graphs import assert_one_graph

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
    system = own.pendulum(omega=np.array([0.8, 1.3]))
    controlled = system.for_state_shapes(START["v"], START["y"]).controlled(control, START["v"], START["y"], 0.05)
    plan = engine.Plan(controlled, sw.method(method), controlled.batch, 0.05)
    tape = _core.Tape()
    assert_one_graph(tape, tape.trace(engine.model(plan), "step"), Tracer(controlled, tape).step(sw.method(method)))


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
    system, control = own.pendulum(), sw.Control("energy", 2.0)
    whole = sw.integrate(system, "rk4", **START, control=control)
    half = sw.integrate(system, "rk4", **START | {"steps": 20}, control=control)
    for each in (system, half.system):
        again = sw.integrate(each, "rk4", resume=half, steps=20)
        np.testing.assert_array_equal(again.y[-1], whole.y[-1])
        assert again.system.uncontrolled == half.system.uncontrolled
    world = sw.World(system, "rk4", v=START["v"].copy(), y=START["y"].copy(), dt=0.05, control=control)
    world.step(20)
    resumed = sw.World(system, "rk4", dt=0.05, resume=world)
    resumed.step(20)
    np.testing.assert_array_equal(resumed.y, whole.y[-1])
    for each in (pickle.loads(pickle.dumps(whole.system)), copy.deepcopy(whole.system)):
        assert each == whole.system
    projected = sw.integrate(system, "rk4", **START, control=sw.Projection("energy"))
    assert projected.work is not None
    sw.integrate(projected.system, "rk4", resume=projected, steps=5)


def test_batches_of_gains_and_targets() -> None:
    control = sw.Control("energy", np.array([0.0, 5.0]), target=np.array([1.0, 2.0]))
    run = sw.integrate(own.pendulum(), "rk4", **START | {"steps": 200}, control=control, record="energy")
    free = sw.integrate(own.pendulum(), "rk4", **START | {"steps": 200}, record="energy")
    np.testing.assert_allclose(run.recorded["energy"][:, 0], free.recorded["energy"][:, 0], rtol=1e-9)
    np.testing.assert_allclose(run.recorded["energy"][-1, 1], 2.0, rtol=1e-6)


def test_what_cannot_be() -> None:
    arguments: dict[str, Any] = {"v": 0.0, "y": 1.0, "dt": 0.1, "steps": 1}
    with pytest.raises(UnknownNameError, match=r"control: there is no 'enrgy'; did you mean 'energy'"):
        sw.integrate(own.pendulum(), "rk4", **arguments, control=sw.Control("enrgy", 1.0))
    with pytest.raises(UnsupportedError, match=r"EnergyControl .* use Control\('energy', gain\)"):
        sw.integrate(own.pendulum(), "rk4", **arguments, control=sw.EnergyControl(1.0))
    with pytest.raises(UnsupportedError, match=r"Projection\('scaling'\) .* use Projection\('energy'\)"):
        sw.integrate(own.pendulum(), "rk4", **arguments, control=sw.Projection())
    with pytest.raises(UnsupportedError, match=r"is for an invariant of an own system"):
        sw.integrate(sw.NBody(), "rk4", **arguments | {"y": np.eye(3, 2)}, control=sw.Control("energy", 1.0))
    with pytest.raises(UnsupportedError, match=r"energy: duffing.* declare one: @duffing.invariant"):
        sw.integrate(own.duffing(), "rk4", **arguments, record="energy")
    with pytest.raises(UnsupportedError, match=r"verlet needs"):
        sw.integrate(own.pendulum(), "verlet", **arguments, control=sw.Control("energy", 1.0))

    @sw.system
    def plain(t: Any, v: Any, y: Any, *, k: Any = 1.0) -> Any:
        return -k * y

    with pytest.raises(ArgumentError, match=r"plain: wrong: expected .* \(t, v, y, \*, …\) whose .* got 'm'. Known: k"):

        @plain.invariant
        def wrong(v: Any, y: Any, *, m: Any) -> Any:
            return m * v

    with pytest.raises(ArgumentError, match=r"plain: short: expected a function \(v, y, \*, …\)"):

        @plain.invariant
        def short(y: Any) -> Any:
            return y

    @plain.invariant
    def vector(v: Any, y: Any) -> Any:
        return np.array([v, y])

    with pytest.raises(ArgumentError, match=r"plain: vector: expected one number of a state, got an array of shape \(2,\)"):
        sw.integrate(plain(), "rk4", **arguments, record="vector")


def test_an_invariant_may_take_the_time_before_the_state() -> None:
    """As rates do; but no quantity that depends on it is constant."""
    for order in (1, 2):
        rates: Any = (lambda t, y, *, k=2.0: np.array([-k * y[1], y[0]])) if order == 1 else (lambda t, v, y, *, k=2.0: -k * y)
        kind = sw.system(order=order)(rates)
        if order == 1:

            @kind.invariant
            def energy(t: Any, y: Any, *, k: Any) -> Any:
                return 0.5 * y[0] ** 2 + 0.5 * k * y[1] ** 2

            @kind.invariant
            def plain(y: Any, k: Any) -> Any:
                return 0.5 * y[0] ** 2 + 0.5 * k * y[1] ** 2
        else:

            @kind.invariant
            def energy(t: Any, v: Any, y: Any, k: Any) -> Any:
                return 0.5 * v**2 + 0.5 * k * y**2

            @kind.invariant
            def plain(v: Any, y: Any, *, k: Any) -> Any:
                return 0.5 * v**2 + 0.5 * k * y**2

        start: dict[str, Any] = {"y": np.ones(2)} if order == 1 else {"v": 0.0, "y": 1.0}
        run = sw.integrate(kind(k=3.0), "rk4", **start, dt=0.1, steps=5, every=1, record=["energy", "plain"])
        np.testing.assert_array_equal(run.recorded["energy"], run.recorded["plain"])
        projected = sw.integrate(kind(k=3.0), "rk4", **start, dt=0.1, steps=5, control=sw.Projection("energy"))
        assert projected.energy[-1] == pytest.approx(run.energy[0], rel=1e-9)  # one correction of an error of 1e-6, squared
        assert sw.integrate(kind(k=3.0), "rk4", **start, dt=0.1, steps=5, record="energy")

    @sw.system
    def driven(t: Any, v: Any, y: Any) -> Any:
        return np.cos(t) - y

    @driven.invariant
    def moving(t: Any, v: Any, y: Any) -> Any:
        return v - np.sin(t)

    with pytest.raises(ArgumentError, match=r"driven: moving: .* one that depends on the time t"):
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
        run, anew, alone = (
            sw.integrate(controlled, "dop853", **ask),
            sw.integrate(free, "dop853", **ask, control=control),
            sw.integrate(free, "dop853", **ask),
        )
        np.testing.assert_array_equal(run.y, anew.y)
        assert run.system.keeper is not None
        assert not np.array_equal(run.y, alone.y)
