"""Many bodies on a device of OpenCL have the bits of the core: every sum over pairs has the order of the specification."""

import itertools
import re
from collections import OrderedDict
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell import _core
from stepwell.device import blocks, bodies, device_of, opencl
from stepwell.errors import UnsupportedError
from support import families, recorded
from support.devices import assert_same, needs_device, of_recorded, same, velocity_verlet
from support.families import family
from support.own_methods import adams_bashforth_2

pytestmark = needs_device

#: Explicit methods whose steps are operations on blocks.
METHODS = [each["name"] for each in _core.catalogue() if not blocks.unwritten(each["name"])]


def state(n: int, dim: int, *batch: int) -> Any:
    v, y = np.random.default_rng(n).normal(size=(2, n, dim, *batch))
    return {"v": v, "y": y}


def masses(n: int, *batch: int) -> Any:
    return np.random.default_rng(n + 1).uniform(0.5, 2.0, (n, *batch)) / n


def massive(some: int, n: int) -> Any:
    """Masses of n bodies, of which these many have one."""
    rng, values = np.random.default_rng(some), np.zeros(n)
    values[rng.permutation(n)[:some]] = rng.uniform(0.5, 2.0, some)
    return values


def that_meet() -> dict[str, Any]:
    """Two bodies are in one place at step 4 of the first member and at step 8 of the second."""
    start = state(70, 2)
    v, y = np.zeros((70, 2, 3)), np.stack([start["y"]] * 3, axis=-1)
    y[1] = y[0] + np.array([0.5, 0.0])[:, np.newaxis]
    v[0, 0] = [1.0, 0.5, 0.0]
    return {"v": v, "y": y, "dt": 0.125, "steps": 20}


FORCES: list[Any] = ["newton", "logarithmic", "printed"]


@pytest.fixture
def calls(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The kernels that were started."""
    started: list[str] = []
    call = bodies._Run.call

    def noted(self: Any, name: str, size: int, *arguments: Any) -> None:
        started.append(name)
        call(self, name, size, *arguments)

    monkeypatch.setattr(bodies._Run, "call", noted)
    return started


def test_numbers_of_bodies_with_and_without_mass(calls: list[str]) -> None:
    """Even and odd ones, with one slab of distances and with three, in the plane and in space."""
    for n, force in zip((64, 65, 100, 257, 1000), FORCES * 2, strict=False):
        same(sw.NBody(masses(n), force=force, softening=0.01), "leapfrog", dt=0.01, steps=4, every=3, **state(n, 2 + n % 2))
    assert "pairs" in calls
    record = ["closest", "energy", "angular_momentum", "momentum"]
    for i, some in enumerate((0, 1, 40, 150, 300)):
        system = sw.NBody(massive(some, 400), force=FORCES[i % 2], softening=0.1)
        same(system, "rk4", dt=0.001, steps=3, every=2, **state(400, 3))
        system = sw.NBody(massive(some, 300), softening=0.1)
        same(system, ("leapfrog", "verlet")[i % 2], dt=0.01, steps=3, every=2, record=record, **state(300, 3, 2))
    assert "pulled" in calls


#: Of the recorded runs those of many bodies.
RECORDED = [name for name in recorded.written() if re.search(r"\d+ bodies in .*large", name)]


#: A batch, controls, what is recorded and a lone member; methods, forces and numbers of bodies are in the tests below.
@pytest.mark.parametrize("name", family(RECORDED, lambda name: RECORDED.index(name) % 4 == 2))
def test_recorded_runs(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    of_recorded(name, monkeypatch)


def test_methods_are_all_explicit_ones() -> None:
    assert len(METHODS) >= 14
    assert {"false_euler", "rk4", "standard_heun", "leapfrog", "verlet", "pefrl"} <= set(METHODS)
    assert not {"trapezoidal", "taylor", "wisdom_holman"} & set(METHODS)
    for method in METHODS:
        same(sw.NBody(masses(70), force="newton"), method, dt=0.01, steps=7, every=2, **state(70, 2))


def test_another_method_or_control_is_compiled_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """And not the forces with it, which take as long."""
    machine = device_of("opencl")
    assert machine is not None
    monkeypatch.setattr(machine, "_programs", OrderedDict())
    built: list[str] = []
    build = opencl.Machine._built

    def noted(self: Any, program: Any, options: list[str]) -> Any:
        built.append(program._source)
        return build(self, program, options)

    monkeypatch.setattr(opencl.Machine, "_built", noted)
    of_control = sw.Projection(), sw.EnergyControl(0.5)
    for method, control, texts in (
        ("false_euler", None, 2), ("standard_euler", None, 1), ("standard_euler", of_control[0], 2), ("rk4", of_control[1], 2),
    ):  # fmt: skip
        built.clear()
        sw.integrate(sw.NBody(masses(64)), method, dt=0.01, steps=1, control=control, device="opencl", **state(64, 2))
        assert len(built) == texts
        assert sum("__kernel void pairs(" in text for text in built) == (method == "false_euler")


def test_own_methods() -> None:
    @sw.method(start=lambda s, t, h, v, y: (s.dv(t, v, y), s.dy(t, v, y)))
    def two_steps(s: Any, t: Any, h: Any, v: Any, y: Any, before_v: Any, before_y: Any) -> Any:
        dv, dy = s.dv(t, v, y), s.dy(t, v, y)
        return v + 1.5 * dv - 0.5 * before_v, y + 1.5 * dy - 0.5 * before_y, dv, dy

    same(sw.NBody(masses(66), softening=0.1), two_steps, dt=0.01, steps=7, every=3, **state(66, 2))

    @sw.method
    def twice(s: Any, t: Any, h: Any, v: Any, y: Any) -> Any:
        one = v + s.dv(t, v, y)
        other = v + s.dv(t, one, y)
        late = v + s.dv(t + h, v, y)
        return (one + other + late) / 3.0, y + s.dy(t, one, y)

    same(sw.NBody(masses(70)), twice, dt=0.01, steps=3, control=sw.EnergyControl(3.0, target=0.0), **state(70, 2))


def test_batches_quantities_and_forces_are_those_of_the_core() -> None:
    strength = np.array([[1.0], [2.0]])
    system = sw.NBody(masses(80, 2, 3), force="newton", G=strength, softening=0.1 * strength)
    same(system, "rk4", dt=-0.01, steps=4, every=2, record=["energy", "closest"], **state(80, 3, 2, 3))
    record, push = ["energy", "momentum", "angular_momentum", "closest"], np.random.default_rng(1).normal(size=(90, 2, 3))
    for method, force in itertools.product(("leapfrog", "pefrl"), FORCES[:2]):
        ask = {"record": record, "force": push} if force == "newton" else {"record": record}
        same(sw.NBody(masses(90), force=force), method, dt=0.01, steps=5, every=2, **ask, **state(90, 2, *push.shape[2:]))
    # A NaN is never the nearest, nor is a body to itself.
    start = state(70, 2, 2)
    start["y"][3, 0, 1] = 1e200
    start["y"][5] = start["y"][9]
    for method in ("leapfrog", "rk4"):
        record = ["closest", "energy"]
        same(sw.NBody(masses(70), force="newton"), method, dt=0.01, steps=3, every=1, record=record, **start)


def test_runs_go_on(calls: list[str]) -> None:
    system, start = sw.NBody(masses(70), softening=0.1), state(70, 3)
    cases = [(method, None) for method in ("leapfrog", "verlet")]
    cases += [(("rk4", adams_bashforth_2)[i % 2], control) for i, control in enumerate(CONTROLS)]
    for method, control in cases:
        whole = same(system, method, dt=0.01, steps=9, control=control, **start)
        first = sw.integrate(system, method, dt=0.01, steps=4, device="opencl", control=control, **start)
        rest = sw.integrate(system, method, dt=0.01, steps=5, resume=first, device="opencl")
        assert_same(rest, sw.integrate(system, method, dt=0.01, steps=5, resume=first), "v", "y", "work")
        np.testing.assert_array_equal(rest.v[-1], whole.v[-1])
        np.testing.assert_array_equal(rest.y[-1], whole.y[-1])


def test_the_first_bad_step() -> None:
    """Under a control what is added is counted once, though the steps are made again to find which was bad."""
    for method, every in zip(("leapfrog", "verlet", "rk4", "false_euler"), (None, 3, 1, 3), strict=True):
        got = same(sw.NBody(np.full(70, 1e-30), force="newton"), method, every=every, **that_meet())
        late = int(method == "false_euler")
        np.testing.assert_array_equal(got.first_bad_step, [4 + late, 8 + late, -1])
    some = np.stack([np.full(70, 1e-30), np.full(70, 1e-30), masses(70)], axis=-1)
    system = sw.NBody(some, force="newton", softening=np.array([0.0, 0.0, 0.1]))
    for control, every in itertools.product(EACH_CONTROL, (None, 3)):
        got = same(system, "standard_heun", every=every, control=control, **that_meet())
        assert np.isfinite(got.work[2])
        assert got.work[2] != 0.0
        np.testing.assert_array_equal(np.asarray(got.first_bad_step) > 0, [True, True, False])


@pytest.mark.parametrize("pairs", [1, 1000, 30_000])
def test_launches_are_cut_anywhere(pairs: int, calls: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bodies, "FIRST_LAUNCH", pairs)
    monkeypatch.setattr(bodies, "MOST_PAIRS", pairs)
    some = masses(550)
    some[::10] = 0.0
    n = 550 if pairs > 1 else 70
    for control in (None, sw.EnergyControl(0.5), sw.Projection("nacozy")):
        options = {"progress": True} if control is None else {"control": control}
        same(sw.NBody(some[:n], softening=0.1), "rk4", dt=0.01, steps=2, **options, **state(n, 2))
        assert control or calls.count("pairs") > 8


def test_a_step_that_begins_where_the_last_ended_asks_once(calls: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    """As the core does; and it keeps its energy."""
    monkeypatch.setattr(bodies, "LAUNCH", 1e6)  # however busy the machine is, no launch is cut
    same(sw.NBody(masses(70)), velocity_verlet, dt=0.01, steps=10, every=3, **state(70, 2))
    assert calls.count("pairs") == 11
    push = np.random.default_rng(1).normal(size=(70, 2))
    for control, force in itertools.product(EACH_CONTROL, (None, push)):
        same(sw.NBody(masses(70)), velocity_verlet, dt=0.01, steps=6, every=4, control=control, force=force, **state(70, 2))


#: Methods in whose stages v and y belong to one time, those where a control comes between steps, and one that keeps blocks.
CONTROLLED = ["standard_euler", "false_euler", "standard_heun", "rk4", "pefrl", "dop853", adams_bashforth_2]
CONTROLS = [
    sw.EnergyControl(3.0), sw.EnergyControl(2.0, "printed"), sw.EnergyControl(relative=0.1, target=-1.0),
    sw.Projection("scaling"), sw.Projection("nacozy"), sw.Projection("nacozy", target=0.5),
]  # fmt: skip


EACH_CONTROL = [sw.EnergyControl(0.5), sw.Projection("scaling"), sw.Projection("nacozy")]


def test_controls(calls: list[str]) -> None:
    """Each with methods of several kinds, and each method with several."""
    system = sw.NBody(masses(64), force="newton", softening=0.05)
    for (i, method), (j, control) in itertools.product(enumerate(CONTROLLED), enumerate(CONTROLS)):
        if not families.LONG and (i + j) % 3:
            continue
        got = same(system, method, dt=0.05, steps=5, every=2, control=control, record=["energy"], **state(64, 2))
        assert got.work is not None
        assert np.all(got.work != 0.0)
    assert "pairs_and_wells" in calls


def test_controls_of_numbers_of_bodies_and_of_batches() -> None:
    """One slab of distances and several, opposite bodies and none, in the plane and in space; with mass and without."""
    for n, force in zip((64, 65, 100, 500), (*FORCES, "newton"), strict=True):
        for control in EACH_CONTROL:
            same(sw.NBody(masses(n), force=force), "rk4", dt=0.02, steps=2, control=control, **state(n, 2 + n // 65 % 2))
    for force in FORCES:
        same(sw.NBody(masses(513), force=force), "pefrl", dt=0.02, steps=2, control=sw.EnergyControl(0.5), **state(513, 3))
    for some, control in itertools.product((0, 1, 7, 40, 150), CONTROLS):
        if some == 0 and getattr(control, "relative", None) is not None:
            continue  # there is no kinetic energy to relate a gain to
        system = sw.NBody(massive(some, 300), softening=0.1)
        same(system, "standard_heun", dt=0.01, steps=3, every=2, control=control, **state(300, 2))
    strength = np.array([[1.0], [2.0]])
    system = sw.NBody(masses(70, 2, 3), force="newton", G=strength, softening=0.1 * strength)
    push = np.random.default_rng(1).normal(size=(70, 3, 2, 3))
    for control in (
        sw.EnergyControl(np.array([0.1, 0.2, 0.4])), sw.Projection("scaling", target=np.array([[1.0], [0.7]])),
        sw.Projection("nacozy"),
    ):  # fmt: skip
        for method in ("rk4", "pefrl"):
            for force in (None, push):
                same(system, method, dt=0.01, steps=4, every=3, force=force, control=control, **state(70, 3, 2, 3))


@pytest.mark.parametrize("record", [["energy"], ["closest"], ["energy", "closest"], ["momentum", "energy"]])
def test_quantities_of_pairs_are_found_on_the_device(record: list[str], calls: list[str], monkeypatch: Any) -> None:
    """The core has no pass over pairs to make, and the next step begins with the forces that were found with the energy."""
    monkeypatch.setattr(bodies, "LAUNCH", 1e6)
    run, asked = _core.run, []
    monkeypatch.setattr(_core, "run", lambda model, plan, arrays: asked.append(plan.device) or run(model, plan, arrays))
    start = state(70, 2)
    sw.integrate(sw.NBody(masses(70)), "leapfrog", dt=0.01, steps=4, every=1, record=record, device="opencl", **start)
    assert len(asked) == 5 * ("momentum" in record)
    evaluations = calls.count("pairs") + calls.count("pairs_and_wells")
    assert evaluations == 5
    assert calls.count("nearest") == 5 * ("closest" in record)
    monkeypatch.setattr(_core, "run", run)
    push = np.random.default_rng(1).normal(size=(70, 2))
    for control in (None, sw.EnergyControl(0.5), sw.Projection("nacozy")):
        method = "leapfrog" if control is None else "rk4"
        same(sw.NBody(masses(70)), method, dt=0.01, steps=4, every=1, record=record, force=push, control=control, **start)


@pytest.mark.parametrize(
    ("members", "then"),
    family(
        itertools.product((1, 3, 100), (None, lambda t, v, y: (0.5 * v, y))), lambda members, then: members == 3 or then is None
    ),
)
def test_events_of_many_bodies(members: int, then: Any) -> None:
    """Members that go on from an event are made by the core one by one: a hundred take seconds."""
    event = sw.Event(lambda t, v, y: y[0, 0] - 0.25, name="passes", then=then)
    system = sw.NBody(masses(64), softening=0.1)
    options = {"dt": 0.05, "steps": 20, "every": 20, "events": event} | state(64, 2, members)
    got, core = (sw.integrate(system, "leapfrog", device=device, **options) for device in ("opencl", "cpu"))
    assert_same(got, core, "v", "y", "first_bad_step")
    assert_same(got.events["passes"], core.events["passes"], "t", "v", "y", "member")
    assert members == 1 or len(got.events["passes"].t)


def test_velocities_of_a_carry_are_computed_once(calls: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    """For the check of what diverged and for the state that is saved, from forces with which the next step begins."""
    monkeypatch.setattr(bodies, "LAUNCH", 1e6)
    monkeypatch.setattr(bodies, "FIRST_LAUNCH", 1 << 30)
    for every, saved in ((None, 1), (2, 4)):
        calls.clear()
        same(sw.NBody(masses(70)), "verlet", dt=0.01, steps=6, every=every, **state(70, 2))
        assert (calls.count("finish_last"), calls.count("pairs")) == (saved, 7)


def test_projections_back_in_time_and_surfaces_that_are_refused() -> None:
    """Energies times h are below zero there."""
    for control in EACH_CONTROL[1:]:
        got = same(sw.NBody(masses(70)), "standard_euler", dt=-0.05, steps=6, control=control, **state(70, 2))
        assert np.all(got.work != 0.0)
    system = sw.NBody(masses(100), floor=sw.Floor(normal=[0.0, 1.0], offset=-9.0))
    with pytest.raises(UnsupportedError, match="surfaces on device='cpu' only"):
        sw.integrate(system, "leapfrog", dt=0.01, steps=2, device="opencl", **state(100, 2))
