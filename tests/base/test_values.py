"""Public objects are what they hold: equal by value, and the same after a copy or a pickle."""

from __future__ import annotations

import copy
import pickle
import warnings
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.base.immutable import ValueEquality, same
from stepwell.views import charts
from support.cases import SYSTEMS
from support.for_each import for_each

FREE = sw.Oscillator(omega=2.0)
BODIES = sw.NBody([3.0, 4.0, 5.0], force="newton", softening=0.1)
STATE: dict[str, Any] = {"v": 0.0, "y": np.array([[1.0, 3.0], [-2.0, -1.0], [1.0, -1.0]]), "dt": 0.01}


def quiet(make: Callable[[], Any]) -> Any:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return make()


def diverged() -> sw.Run:
    y = np.stack([STATE["y"], np.zeros((3, 2))], axis=-1)  # the second member's bodies meet
    return quiet(
        lambda: sw.integrate(BODIES.__class__([3.0, 4.0, 5.0]), "verlet", **STATE | {"y": y}, steps=5, every=2, record="energy")
    )


@cache
def point() -> charts.WorkPrecision:
    return charts.work_precision("oscillator", ["false_euler"], [100])


def passage(t: Any, v: Any, y: Any) -> Any:
    return y


def exactly(scene: sw.Scene, times: Any, setting: float) -> charts.Solved:
    """A peer that knows the solution."""
    assert scene.exact is not None
    return charts.Solved(*scene.exact(times), 1, 1e-3)


def beside(*peers: Any) -> charts.WorkPrecision:
    """A chart of some peers alone: the one method is refused."""
    return charts.work_precision("forced_oscillator", ["verlet"], [4], tolerances=[], peers=peers)


#: How to make one of each, and others of the class that differ in one thing.
MAKERS: dict[str, list[Callable[[], Any]]] = {
    "NBody": [
        lambda: BODIES,
        lambda: quiet(lambda: sw.integrate(BODIES, "rk4", **STATE, steps=1, control=sw.Projection())).system,
        lambda: quiet(lambda: sw.integrate(BODIES, "rk4", **STATE, steps=1, control=sw.EnergyControl(0.1))).system,
    ],
    "any system": [lambda make=make: make(np.random.default_rng(1), 2) for make in SYSTEMS.values()],
    "Floor": [
        sw.Floor,
        lambda: sw.Floor(restitution=0.5),
        lambda: sw.Floor(friction=0.1),
        lambda: sw.Floor(normal=(1.0, 1.0)),
        lambda: sw.Floor(offset=1.0),
        lambda: sw.Floor(way="spring", omega=1.0),
    ],
    "Sphere": [
        lambda: sw.Sphere((0.0, 0.0), 1.0),
        lambda: sw.Sphere((0.0, 1.0), 1.0),
        lambda: sw.Sphere((0.0, 0.0), 1.0, inside=True),
    ],
    "Sinusoid": [lambda: sw.Sinusoid(1.0, 2.0), lambda: sw.Sinusoid(1.0, 2.0, 0.5)],
    "Sampled": [lambda: sw.Sampled([1.0], 0.1), lambda: sw.Sampled([1.0], 0.2), lambda: sw.Sampled([2.0], 0.1)],
    "LengthControl": [lambda: sw.LengthControl(0.5), lambda: sw.LengthControl([0.1, 0.5])],
    "NormControl": [lambda: sw.NormControl(0.5), lambda: sw.NormControl([0.1, 0.5])],
    "EnergyControl": [
        lambda: sw.EnergyControl(0.1),
        lambda: sw.EnergyControl(relative=0.1),
        lambda: sw.EnergyControl(0.1, "printed"),
        lambda: sw.EnergyControl(0.1, target=1.0),
    ],
    "Control": [lambda: sw.Control("energy", 0.1), lambda: sw.Control("norm", [0.1, 0.2], "printed", target=1.0)],
    "Projection": [
        sw.Projection,
        lambda: sw.Projection("norm"),
        lambda: sw.Projection("nacozy"),
        lambda: sw.Projection(target=[1.0, 2.0]),
    ],
    "Event": [
        lambda: sw.Event(passage),
        lambda: sw.Event(quiet),
        lambda: sw.Event(passage, direction=1),
        lambda: sw.Event(passage, terminal=True),
        lambda: sw.Event(passage, most=10),
        lambda: sw.Event(passage, name="zero"),
    ],
    "Occurrences": [
        lambda: sw.integrate(FREE, "rk4", v=0.0, y=1.0, dt=0.1, steps=30, events=passage).events["passage"],
        lambda: sw.integrate(FREE, "rk4", v=0.0, y=1.0, dt=0.1, steps=40, events=passage).events["passage"],
        lambda: sw.integrate(FREE, "rk4", v=0.0, y=[1.0, 2.0], dt=0.1, steps=30, events=passage).events["passage"],
    ],
    "Run": [
        lambda: sw.integrate(FREE, "rk4", v=0.0, y=1.0, dt=0.1, steps=30, events=passage),
        lambda: sw.integrate(FREE, "rk4", v=0.0, y=1.0, dt=0.1, steps=3),
        lambda: sw.integrate(FREE, "rk4", v=0.0, y=1.0, dt=0.1, steps=3, every=1),
        lambda: sw.integrate(FREE, "rk4", v=0.0, y=1.0, dt=0.1, steps=3, force=0.0),
        lambda: sw.integrate(FREE, "merson", v=0.0, y=[1.0, 2.0], tolerance=1e-3, at=[1.0]),
        lambda: sw.integrate(FREE, "merson", v=0.0, y=[1.0, 2.0], tolerance=1e-4, at=[1.0]),
        diverged,
    ],
    "Device": [
        lambda: sw.Device("opencl:0", "a GPU", "a driver", 1 << 30, 64),
        lambda: sw.Device("opencl:0", "a GPU", "a driver", 1 << 30, 64, float32="it rounds otherwise"),
    ],
    "Paces": [
        lambda: sw.integrate(FREE, "merson", v=0.0, y=[1.0, 2.0], tolerance=1e-3, at=[1.0]).paces,
        lambda: sw.integrate(FREE, "merson", v=0.0, y=[1.0, 2.0], tolerance=1e-4, at=[1.0]).paces,
    ],
    "DiscreteSystem": [
        lambda: sw.discretise(sw.Oscillator(), 0.1),
        lambda: sw.discretise(sw.Oscillator(), 0.2),
        lambda: sw.discretise(sw.Oscillator(), 0.1, "rk4"),
    ],
    "AdaptiveState": [
        lambda: sw.integrate(FREE, "merson", v=0.0, y=[1.0, 2.0], tolerance=1e-3, at=[1.0]).controller_state,
        lambda: sw.integrate(FREE, "merson", v=0.0, y=[1.0, 2.0], tolerance=1e-4, at=[1.0]).controller_state,
    ],
    "Mode": [lambda: sw.stability_limit(FREE, "false_euler").mode, lambda: sw.stability_limit(FREE, "rk4").mode],
    "At": [lambda: sw.criteria(["rk4"])[0].at[0], lambda: sw.criteria(["false_euler"])[0].at[0]],
    "Explanation": [
        lambda: sw.explain(FREE, "rk4"),
        lambda: sw.explain(FREE, "verlet"),
        lambda: sw.explain(FREE, "rk4", members=9),
        lambda: sw.explain(FREE, "rk4", fused=True),
        lambda: sw.explain(FREE, "merson", attempt=True),
        lambda: sw.explain(sw.Chain(1000), "rk4"),
    ],
    "Explorer": [
        lambda: sw.explore("oscillator", methods=["rk4"]),
        lambda: sw.explore("oscillator", methods=["verlet"]),
        lambda: sw.explore(["oscillator", "pendulum"], methods=["rk4"]),
    ],
    "ExportedStep": [
        lambda: sw.export(FREE, "rk4", "c"),
        lambda: sw.export(FREE, "rk4", "rust"),
        lambda: sw.export(FREE, "verlet", "c"),
        lambda: sw.export(FREE, "rk4", "c", name="another"),
        lambda: sw.export(FREE, "rk4", "c", fused=True),
    ],
    "Method": [lambda: sw.method("rk4"), lambda: sw.method("verlet")],
    "Scene": [lambda: sw.Scene(sw.Oscillator(), v=0.0, y=1.0, until=9.0), lambda: sw.scenes.kepler(), lambda: sw.scenes.clover()],
    "Status": [lambda: sw.Status.OK, lambda: sw.Status.UNDERFLOW],
    "WorkPrecision's curve": [lambda: point().curves[0]],
    "Peer": [
        lambda: charts.Peer("known", exactly),
        lambda: charts.Peer("known", exactly, (0.1,)),
        lambda: charts.Peer("known", exactly, (0.1,), by="step"),
        lambda: charts.Peer("known", exactly, (0.1,), order=2),
        lambda: charts.Peer("SciPy", charts.peers.ByScipy("RK45")),
        lambda: charts.Peer("SciPy", charts.peers.ByScipy("DOP853")),
        lambda: charts.Peer("REBOUND", charts.peers.ByRebound("bs")),
        lambda: charts.Peer("heyoka", charts.peers.ByHeyoka()),
    ],
    "Figures": [lambda: charts.figures(["rk4"]), lambda: charts.figures(["rk4"], phi=0.4), lambda: charts.figures(["verlet"])],
    "Bode": [
        lambda: charts.bode(sw.Oscillator(damping=0.1), ["rk4"], dt=0.1),
        lambda: charts.bode(sw.Oscillator(damping=0.1), ["rk4"], dt=0.1, x="hold"),
    ],
    "MethodResponse": [
        lambda: charts.bode(sw.Oscillator(damping=0.1), ["rk4"], dt=0.1).curves[0],
        lambda: charts.bode(sw.Oscillator(damping=0.1), ["merson"], dt=0.1).curves[0],
    ],
    "Stability": [lambda: charts.stability(["rk4"]), lambda: charts.stability(["verlet"])],
    "StabilityMap": [lambda: charts.stability_map("rk4"), lambda: charts.stability_map("merson")],
    "NormSweep": [lambda: charts.norm(["rk4"], gains=[0.1]), lambda: charts.norm(["rk4"], gains=[0.2])],
    "Settled": [lambda: charts.norm(["rk4"], gains=[0.1]).lines[0], lambda: charts.norm(["rk4"], gains=[0.2]).lines[0]],
    "Powers": [lambda: charts.powers("rk4")],  # with measured times
    "VerletFriction": [charts.verlet_friction, lambda: charts.verlet_friction(0.05)],
    "Solved": [
        lambda: charts.Solved(np.ones(2), np.ones(2), None, 0.1),
        lambda: charts.Solved(np.ones(2), np.ones(3), None, 0.1),
    ],
}


@for_each("name, i, make", [(name, i, make) for name, makers in MAKERS.items() for i, make in enumerate(makers)])
def test_a_copy_is_the_same(name: str, i: int, make: Callable[[], Any]) -> None:
    one = make()
    for other in (
        copy.copy(one),
        copy.deepcopy(one),
        *(pickle.loads(pickle.dumps(one, k)) for k in (2, pickle.HIGHEST_PROTOCOL)),
    ):
        assert type(other) is type(one)
        assert other == one
        assert (other != one) is False  # a named tuple has both apart
        assert hash(other) == hash(one)
        assert repr(other) == repr(one)
    assert one != 1
    assert one != "one"


@for_each("name", [name for name, makers in MAKERS.items() if len(makers) > 1])
def test_others_are_not(name: str) -> None:
    ones, twos = ([make() for make in MAKERS[name]] for _ in range(2))
    for i, a in enumerate(ones):
        for k, b in enumerate(twos):
            assert (a == b) is (i == k), (i, k)


def test_every_public_class_is_here() -> None:
    """Exceptions are Python's own, a world and a prepared run are no values; advice and stability are elsewhere."""
    public = {name for module in (sw, charts) for name in module.__all__ if isinstance(getattr(module, name), type)}
    elsewhere = {name for name in public if issubclass(getattr(sw, name, int), (Exception, Warning))}
    elsewhere |= {"World", "PreparedRun", "System"}
    parts = {"Curve", "Held", "Locus", "Observation", "Panel", "Peer", "Point", "Samples", "Timing", "WorkPrecision"}
    parts |= {"ControlSweep"}
    elsewhere |= {name for name in public if issubclass(getattr(sw, name, int), sw.System)}  # each is among the cases
    assert public - elsewhere - parts - {"RunPicture"} <= set(MAKERS)
    for name in parts | {"RunPicture"}:
        assert issubclass(getattr(charts, name), ValueEquality)


def test_a_method_is_one_of_its_kind() -> None:
    for method in sw.methods():
        assert pickle.loads(pickle.dumps(method)) is copy.deepcopy(method) is copy.copy(method) is method


def test_collisions_after_a_pickle() -> None:
    run = diverged()
    assert run.collisions
    assert pickle.loads(pickle.dumps(run)).collisions == run.collisions


def test_a_chart_of_a_scene_without_a_formula_can_be_pickled() -> None:
    # Its reference solution is an interpolation, which only this kind of chart holds.
    chart = charts.work_precision("energy_control", ["false_euler"], [400])
    for again in (pickle.loads(pickle.dumps(chart)), copy.deepcopy(chart)):
        assert again == chart
        t = np.linspace(0.0, 0.9 * chart.scene.horizon, 7)
        for block, other in zip(chart.scene.exact(t), again.scene.exact(t), strict=True):
            np.testing.assert_array_equal(block, other)


def test_a_run_under_a_bar_can_be_pickled() -> None:
    """The bar is gone by then, and what finds collisions must not hold it."""
    pytest.importorskip("rich")
    run = sw.integrate(BODIES, "rk4", **STATE, steps=5, progress=True)
    assert pickle.loads(pickle.dumps(run)) == run


def test_a_chart_with_peers_goes_through_a_pickle() -> None:
    """Its peers are functions and objects that are found again by name, and solve as before."""
    chart = beside(exactly, charts.Peer("in steps", exactly, (0.1,), by="step"))
    again = pickle.loads(pickle.dumps(chart))
    assert again == chart
    assert [curve.method.name for curve in again.curves] == ["exactly", "in steps"]
    assert again.curves[0].method.solve is exactly


def test_a_chart_with_a_peer_that_has_no_name_says_why_it_does_not() -> None:
    chart = beside(lambda scene, times, setting: exactly(scene, times, setting))
    assert copy.deepcopy(chart) == chart
    with pytest.raises(pickle.PicklingError, match="peer '<lambda>': pickle finds a function again by its name in a module"):
        pickle.dumps(chart)


def test_a_peer_of_scipy_goes_through_a_pickle() -> None:
    pytest.importorskip("scipy")
    one = charts.peers.scipy("RK45", (1e-4,))
    two = pickle.loads(pickle.dumps(one))
    assert two == one
    scene = sw.scenes.oscillator()
    a, b = (each.solve(scene, np.array([1.0, scene.horizon]), 1e-4) for each in (one, two))
    assert np.array_equal(a.y, b.y)
    assert a.evaluations == b.evaluations


@for_each(
    ("a", "b", "equal"),
    [
        (np.array([1.0, np.nan]), np.array([1.0, np.nan]), True),
        (np.array([1.0]), np.array([1]), False),
        (np.array([1.0]), 1.0, False),
        (np.ones((2, 1)), np.ones(2), False),
        (np.nan, float("nan"), True),
        ({"a": (1, [np.nan])}, {"a": (1, [float("nan")])}, True),
        ({"a": 1}, {"b": 1}, False),
        ([1], (1,), False),
        ((1, 2), (1,), False),
        (np.array(["a"]), np.array(["a"]), True),
    ],
)
def test_same(a: Any, b: Any, equal: bool) -> None:
    assert same(a, b) is same(b, a) is equal
