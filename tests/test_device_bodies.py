"""Many bodies on a device of OpenCL have the bits of the core: every sum over pairs has the order of the specification."""

from __future__ import annotations

import re
import warnings
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell import _core
from stepwell.device import blocks, bodies
from stepwell.errors import UnsupportedError
from support import recorded
from support.devices import needs_device

pytestmark = needs_device

#: Explicit methods whose steps are operations on blocks.
METHODS = [each["name"] for each in _core.catalogue() if not blocks.unwritten(each["name"])]


def state(n: int, dim: int, *batch: int) -> Any:
    v, y = np.random.default_rng(n).normal(size=(2, n, dim, *batch))
    return {"v": v, "y": y}


def masses(n: int, *batch: int) -> Any:
    return np.random.default_rng(n + 1).uniform(0.5, 2.0, (n, *batch)) / n


def same(system: Any, method: Any, **options: Any) -> Any:
    """The run on the device, held against that of the core."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        got = sw.integrate(system, method, device="opencl", **options)
        core = sw.integrate(system, method, device="cpu", **options)
    for name in ("t", "v", "y", "first_bad_step", "carry"):
        one, other = getattr(got, name), getattr(core, name)
        assert (one is None) == (other is None), name
        if one is not None:
            np.testing.assert_array_equal(one, other, err_msg=name)
    for name, values in core.recorded.items():
        np.testing.assert_array_equal(got.recorded[name], values, err_msg=name)
    return got


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


@pytest.mark.parametrize("n", [64, 65, 100, 257, 1000])
@pytest.mark.parametrize("force", ["newton", "logarithmic", "printed"])
def test_numbers_of_bodies(n: int, force: Any, calls: list[str]) -> None:
    """Even and odd ones, with one slab of distances and with three, in the plane and in space."""
    same(sw.NBody(masses(n), force=force, softening=0.01), "leapfrog", dt=0.01, steps=4, every=3, **state(n, 2 + n % 2))
    assert "pairs" in calls


#: Of the recorded runs those of many bodies that are made here: those without a control.
RECORDED = [
    name
    for name in recorded.written()
    if re.search(r"\d+ bodies in .*large", name) and not re.search("nacozy|scaling|limited|, 100 bodies in 3-D, printed", name)
]


@pytest.mark.parametrize("name", RECORDED)
def test_recorded_runs(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("STEPWELL_DEVICE", "opencl")
    assert recorded.hashes(recorded.made(recorded.runs()[name])) == recorded.written()[name], name


@pytest.mark.parametrize("method", METHODS)
def test_methods(method: str) -> None:
    same(sw.NBody(masses(70), force="newton"), method, dt=0.01, steps=7, every=2, **state(70, 2))


def test_methods_are_all_explicit_ones() -> None:
    assert len(METHODS) >= 14
    assert {"false_euler", "rk4", "standard_heun", "leapfrog", "verlet", "pefrl"} <= set(METHODS)
    assert not {"trapezoidal", "taylor", "wisdom_holman"} & set(METHODS)


def test_a_method_that_keeps_blocks() -> None:
    @sw.method(start=lambda s, t, h, v, y: (s.dv(t, v, y), s.dy(t, v, y)))
    def two_steps(s: Any, t: Any, h: Any, v: Any, y: Any, before_v: Any, before_y: Any) -> Any:
        dv, dy = s.dv(t, v, y), s.dy(t, v, y)
        return v + 1.5 * dv - 0.5 * before_v, y + 1.5 * dy - 0.5 * before_y, dv, dy

    same(sw.NBody(masses(66), softening=0.1), two_steps, dt=0.01, steps=7, every=3, **state(66, 2))


def test_batches_each_with_its_numbers() -> None:
    strength = np.array([[1.0], [2.0]])
    system = sw.NBody(masses(80, 2, 3), force="newton", G=strength, softening=0.1 * strength)
    same(system, "rk4", dt=-0.01, steps=4, every=2, record=["energy", "closest"], **state(80, 3, 2, 3))


def test_quantities_are_those_of_the_core() -> None:
    for method in ("leapfrog", "pefrl"):
        for force in ("newton", "logarithmic"):
            record = ["energy", "momentum", "angular_momentum", "closest"]
            same(sw.NBody(masses(90), force=force), method, dt=0.01, steps=5, every=2, record=record, **state(90, 2))


def test_a_force_is_added() -> None:
    push = np.random.default_rng(1).normal(size=(70, 2, 3))
    for method in ("leapfrog", "standard_heun"):
        same(sw.NBody(masses(70)), method, dt=0.01, steps=5, force=push, record=["energy"], **state(70, 2))


@pytest.mark.parametrize("method", ["leapfrog", "rk4", "verlet"])
def test_runs_go_on(method: str) -> None:
    system, start = sw.NBody(masses(70), softening=0.1), state(70, 3)
    whole = same(system, method, dt=0.01, steps=9, **start)
    first = sw.integrate(system, method, dt=0.01, steps=4, device="opencl", **start)
    rest = sw.integrate(system, method, dt=0.01, steps=5, resume=first, device="opencl")
    np.testing.assert_array_equal(rest.v[-1], whole.v[-1])
    np.testing.assert_array_equal(rest.y[-1], whole.y[-1])


@pytest.mark.parametrize("massive", [0, 1, 40, 150, 300])
def test_bodies_without_mass(massive: int, calls: list[str]) -> None:
    rng = np.random.default_rng(massive)
    some = np.zeros(400)
    some[rng.permutation(400)[:massive]] = rng.uniform(0.5, 2.0, massive)
    for force in ("newton", "logarithmic"):
        same(sw.NBody(some, force=force, softening=0.1), "rk4", dt=0.001, steps=3, every=2, **state(400, 3))
    assert "pulled" in calls


@pytest.mark.parametrize("every", [None, 3, 1])
@pytest.mark.parametrize("method", ["leapfrog", "verlet", "rk4", "false_euler"])
def test_the_first_bad_step(method: str, every: Any) -> None:
    """Two bodies are in one place at step 4 of the first member and at step 8 of the second."""
    start = state(70, 2)
    v, y = np.zeros((70, 2, 3)), np.stack([start["y"]] * 3, axis=-1)
    y[1] = y[0] + np.array([0.5, 0.0])[:, np.newaxis]
    v[0, 0] = [1.0, 0.5, 0.0]
    got = same(sw.NBody(np.full(70, 1e-30), force="newton"), method, dt=0.125, steps=20, every=every, v=v, y=y)
    late = int(method == "false_euler")
    np.testing.assert_array_equal(got.first_bad_step, [4 + late, 8 + late, -1])


@pytest.mark.parametrize("pairs", [1, 1000, 30_000])
def test_launches_are_cut_anywhere(pairs: int, calls: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bodies, "FIRST_LAUNCH", pairs)
    monkeypatch.setattr(bodies, "MOST_PAIRS", pairs)
    some = masses(550)
    some[::10] = 0.0
    n = 550 if pairs > 1 else 70
    same(sw.NBody(some[:n], softening=0.1), "rk4", dt=0.01, steps=2, progress=True, **state(n, 2))
    assert calls.count("pairs") > 8


def test_a_step_that_begins_where_the_last_ended_asks_once(calls: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    """As the core does."""
    monkeypatch.setattr(bodies, "LAUNCH", 1e6)  # however busy the machine is, no launch is cut

    @sw.method
    def velocity_verlet(s: Any, t: Any, h: Any, v: Any, y: Any) -> Any:
        half = v + 0.5 * s.dv(t, v, y)
        moved = y + s.dy(t, half, y)
        return half + 0.5 * s.dv(t + h, half, moved), moved

    same(sw.NBody(masses(70)), velocity_verlet, dt=0.01, steps=10, every=3, **state(70, 2))
    assert calls.count("pairs") == 11


@pytest.mark.parametrize(
    ("options", "what"),
    [
        ({"fused": True}, "fused=True"),
        ({"control": sw.EnergyControl(0.5)}, "control="),
    ],
)
def test_what_is_not_there_is_refused(options: Any, what: str) -> None:
    with pytest.raises(UnsupportedError, match=f"device: runs of many bodies have {what} on device='cpu' only"):
        sw.integrate(sw.NBody(masses(64)), "standard_euler", dt=0.01, steps=2, device="opencl", **options, **state(64, 2))


def test_surfaces_are_refused() -> None:
    system = sw.NBody(masses(100), floor=sw.Floor(normal=[0.0, 1.0], offset=-9.0))
    with pytest.raises(UnsupportedError, match="surfaces on device='cpu' only"):
        sw.integrate(system, "leapfrog", dt=0.01, steps=2, device="opencl", **state(100, 2))
