"""Sweeps whose members are stepped by a device: the bits of the CPU."""

from __future__ import annotations

import itertools
import warnings
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.errors import ArgumentError, UnsupportedError
from stepwell.studies.sweeps import ensemble
from support.devices import NAMES, assert_alike, needs_device
from support.families import family
from support.sweeping import driven, swinging

pytest.importorskip("xarray")

pytestmark = needs_device


AXES = {"mu": ("mu", np.linspace(0.5, 4.0, 5)), "y": ("y0", np.linspace(-2.0, 2.0, 13))}


def largest(run: sw.Run) -> Any:
    """The largest coordinate of each member."""
    return run.y.max(axis=0)


CASES: dict[str, dict[str, Any]] = {
    "last": {"steps": 90},
    "after a transient": {"steps": 90, "transient": 40},
    "no transient of any length": {"steps": 1, "transient": 1},
    "reduced": {"steps": 90, "outcomes": ["last", "extremes", "mean"]},
    "reduced at intervals": {"steps": 90, "transient": 11, "outcomes": ["last", "extremes", "mean"], "observe": 7},
    "of functions": {"steps": 30, "outcomes": [sw.sweeps.Extremes("y"), sw.sweeps.Mean(lambda t, v, y: v * y, name="power")]},
    "passages": {"steps": 600, "dt": 0.05, "outcomes": ["period", "crossing", "extremes"]},
    "history": {"steps": 90, "every": 20, "outcomes": ["history", "mean"], "observe": 8},
    "a function": {"steps": 90, "every": 9, "outcomes": largest},
    "exponents": {"steps": 40, "outcomes": ["lyapunov", "last"]},
    "float32": {"steps": 90, "transient": 10, "dtype": "float32", "outcomes": ["last", "extremes", "mean"]},
    "a force": {"steps": 90, "force": 0.1, "fused": True, "outcomes": ["mean", "extremes"]},
    "events": {"steps": 90, "events": sw.Event(lambda t, v, y: y, name="ground"), "outcomes": "extremes"},
    "stopped": {"steps": 90, "events": sw.Event(lambda t, v, y: y - 1.0, name="ground", terminal=True)},
}


#: What states come back in, by the one method; by the other what of a carry goes on: over a transient, an interval, an event.
#: What is reduced on the device is in ``test_device_reductions.py``.
BY_RK4 = ("last", "no transient of any length", "of functions", "history", "a function", "exponents", "float32", "events")
BY_LEAPFROG = ("after a transient", "reduced at intervals", "stopped")


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize(
    ("method", "case"),
    family(
        itertools.product(("rk4", "leapfrog"), CASES),
        lambda method, case: case in (BY_RK4 if method == "rk4" else BY_LEAPFROG),
    ),
)
def test_a_device_has_the_bits_of_the_cpu(name: str, case: str, method: str) -> None:
    options = {"dt": 0.02, "v": 0.3, "outcomes": None} | CASES[case]
    if method == "leapfrog" and options["outcomes"] == ["lyapunov", "last"]:
        options["outcomes"] = "last"  # a method with a carry has no exponents
    system = swinging if method == "leapfrog" else driven
    assert_alike(sw.sweep(system, AXES, method, **options), sw.sweep(system, AXES, method, device=name, **options))


@pytest.mark.parametrize("name", NAMES)
def test_in_chunks_and_pieces_and_threads(name: str) -> None:
    options: dict[str, Any] = {"v": 0.3, "dt": 0.02, "steps": 70, "outcomes": ["mean", "extremes", "period"]}
    whole = sw.sweep(driven, AXES, "rk4", **options)
    for more in ({"chunk": 7}, {"memory": 1e5}, {"chunk": 9, "threads": 3}):
        assert_alike(whole, sw.sweep(driven, AXES, "rk4", device=name, **more, **options))


@pytest.mark.parametrize("name", NAMES)
def test_steps_of_each_member(name: str) -> None:
    axes = {"omega": ("run", [1.0, 2.0, 4.0]), "dt": ("run", [0.01, 0.02, 0.04])}
    options: dict[str, Any] = {"v": 0.0, "y": 1.0, "steps": 50, "outcomes": ["last", "extremes"]}
    assert_alike(sw.sweep(sw.Oscillator, axes, "rk4", **options), sw.sweep(sw.Oscillator, axes, "rk4", device=name, **options))


@pytest.mark.parametrize("name", NAMES)
def test_members_that_diverge(name: str) -> None:
    @sw.system(order=1)
    def explodes(t: Any, y: Any, *, rate: float = 1.0) -> Any:
        return rate * y * y

    axes = {"rate": ("rate", [0.1, 3.0, 0.2, 9.0])}
    options: dict[str, Any] = {"y": 1.0, "dt": 0.1, "steps": 200, "transient": 3, "outcomes": ["extremes", "mean", "last"]}
    results, said = [], []
    for device in ("cpu", name):
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            results.append(sw.sweep(explodes, axes, "rk4", device=device, **options))
        said.append([str(each.message) for each in caught])
    assert_alike(*results)
    assert said[0] == said[1]
    assert "diverged" in said[0][0]


@pytest.mark.parametrize("name", NAMES)
def test_the_variable_names_the_device(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[Any] = []
    before = ensemble._compute

    def watched(task: Any, *rest: Any) -> None:
        seen.append(task.options.get("device"))
        before(task, *rest)

    monkeypatch.setattr(ensemble, "_compute", watched)
    monkeypatch.setenv("STEPWELL_DEVICE", name)
    sw.sweep(driven, AXES, "rk4", v=0.0, dt=0.02, steps=5)
    sw.sweep(driven, AXES, "rk4", v=0.0, dt=0.02, steps=5, device="cpu")
    assert seen == [name, "cpu"]


@pytest.mark.parametrize("name", NAMES)
def test_a_store_goes_on_with_another_device(name: str, tmp_path: Any) -> None:
    pytest.importorskip("zarr")
    options: dict[str, Any] = {"v": 0.0, "dt": 0.02, "steps": 20, "store": tmp_path / "results.zarr", "chunk": 10}
    one = sw.sweep(driven, AXES, "rk4", **options)
    other = sw.sweep(driven, AXES, "rk4", device=name, **options)
    assert one.attrs["bits"] == other.attrs["bits"]


def test_a_wrong_device() -> None:
    with pytest.raises(ArgumentError, match="device: expected 'cpu', 'opencl'"):
        sw.sweep(driven, AXES, "rk4", v=0.0, dt=0.02, steps=20, device="gpu")
    with pytest.raises(UnsupportedError, match="device: there is no opencl:99"):
        sw.sweep(driven, AXES, "rk4", v=0.0, dt=0.02, steps=20, device="opencl:99")


@pytest.mark.parametrize("more", [{"dt": 0.1, "steps": 5}, {"tolerance": 1e-3, "at": [1.0]}])
def test_what_is_too_long_is_refused_before_any_work(more: dict[str, Any], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ensemble, "_compute", lambda *_: pytest.fail("work"))

    def chains(k: Any) -> sw.System:
        return sw.Springs([(i, i + 1) for i in range(6000)], stiffness=k, rest=1.0, dim=3)

    start = {"v": 0.0, "y": np.arange(18003.0).reshape(6001, 3, 1)}
    with pytest.raises(UnsupportedError, match="too long for a kernel, which has at most 100000"):
        sw.sweep(chains, {"k": ("k", [1.0, 2.0])}, "dop853", device=NAMES[0], **start, **more)
