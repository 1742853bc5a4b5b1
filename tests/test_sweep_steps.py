"""Sweeps whose members have steps of their own, and names that clash in a sweep."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.errors import ArgumentError
from stepwell.studies.sweeps import outcomes

STEPS = [0.1, 0.05, 0.025]


@pytest.mark.parametrize(
    ("system", "v", "y"),
    [
        (sw.Oscillator(), 0.0, 1.0),
        (sw.NBody(), 0.0, np.arange(6.0).reshape(3, 2) ** 2),
        (sw.NBody(), np.ones((3, 2)), np.arange(6.0).reshape(3, 2) ** 2),
        (sw.Pendulum3D(), 0.1, [1.0, 0.0, 0.0]),
        (sw.RigidBody([1.0, 2.0, 3.0]), 1.0, [1.0, 0.0, 0.0, 0.0]),
    ],
)
def test_the_step_alone_is_varied(system: sw.System, v: Any, y: Any) -> None:
    for axes in ({"dt": STEPS}, {"dt": ("run", STEPS)}, {"dt": (("a", "b"), np.array([STEPS, STEPS[::-1]]))}):
        dataset = sw.sweep(system, axes, "rk4", v=v, y=y, steps=10, outcomes=["last", "extremes", "mean"])
        for i, dt in enumerate(STEPS):
            run = sw.integrate(system, "rk4", v=v, y=y, dt=dt, steps=10)
            for name, block in (("v_last", run.v[-1]), ("y_last", run.y[-1])):
                values = dataset[name].values
                np.testing.assert_array_equal(values[0, i] if len(dataset["status"].dims) == 2 else values[i], block)


def test_systems_made_of_parameters_and_the_step_alone() -> None:
    dataset = sw.sweep(sw.Oscillator, {"dt": STEPS}, "rk4", v=0.0, y=1.0, steps=10, every=2)
    assert dataset["y"].dims == ("dt", "saved")
    assert dataset["status"].shape == (3,)


def test_means_are_summed_state_after_state_whatever_the_pieces(monkeypatch: pytest.MonkeyPatch) -> None:
    """And many states in one go: state by state took 50 times as long as the run of a member with a step of its own."""
    omega = np.linspace(0.5, 2.0, 3)
    axes = {"omega": ("run", omega), "dt": ("run", 0.1 / omega)}
    calls: list[int] = []
    whole = outcomes._Mean._add

    def counted(self: Any, t: Any, all_of: Any) -> None:
        calls.append(len(t))
        whole(self, t, all_of)

    monkeypatch.setattr(outcomes._Mean, "_add", counted)
    dataset = sw.sweep(sw.Oscillator, axes, "rk4", v=0.0, y=1.0, steps=2000, outcomes="mean")
    assert len(calls) <= 6  # one for each member, and one for each of two that are tried
    monkeypatch.setattr(outcomes, "NUMBERS_AT_ONCE", 7)
    np.testing.assert_array_equal(
        sw.sweep(sw.Oscillator, axes, "rk4", v=0.0, y=1.0, steps=2000, outcomes="mean").y_mean, dataset.y_mean
    )
    for i, each in enumerate(omega):
        run = sw.integrate(sw.Oscillator(each), "rk4", v=0.0, y=1.0, dt=0.1 / each, steps=2000, every=1)
        total = 0.0
        for k in range(2000):
            total += 0.5 * (run.t[k + 1] - run.t[k]) * (run.y[k] + run.y[k + 1])
        assert dataset.y_mean.values[i] == total / (run.t[-1] - run.t[0])


def test_a_dimension_that_two_arguments_have_in_common_has_a_name_of_its_own() -> None:
    axes = {"omega": ("omega", [1.0, 2.0]), "dt": ("omega", [0.1, 0.05])}
    with pytest.raises(ArgumentError, match=r"two coordinates would .* such as \{'omega': \(\"run\", values\), …\}"):
        sw.sweep(sw.Oscillator, axes, "rk4", v=0.0, y=1.0, steps=10)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"outcomes": ["mean", sw.sweeps.Mean("y", name="y")]}, "two results 'y_mean'"),
        ({"outcomes": ["last", "last"]}, "two results"),
        ({"axes": {"omega": ("status", [1.0, 2.0])}}, "'status' is the name of a result"),
        ({"axes": {"omega": ("y_mean", [1.0, 2.0])}, "outcomes": "mean"}, "'y_mean' is the name of a result"),
    ],
)
def test_names_that_clash_are_refused_before_any_chunk(options: Any, message: str, monkeypatch: pytest.MonkeyPatch) -> None:
    from stepwell.studies.sweeps import engines

    def never(*_: Any) -> Any:
        raise AssertionError("a chunk was computed")

    monkeypatch.setattr(engines, "run", never)
    axes = options.pop("axes", {"omega": [1.0, 2.0]})
    with pytest.raises(ArgumentError, match=message):
        sw.sweep(sw.Oscillator, axes, "rk4", v=0.0, y=1.0, dt=0.1, steps=10, **options)
