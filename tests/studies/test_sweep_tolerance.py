"""Sweeps with a tolerance: the bits of ``integrate(tolerance=)`` on every engine and in every division, and what is refused."""

import re
import warnings
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.errors import ArgumentError
from stepwell.studies.sweeps import task
from support.families import family
from support.looped import looped
from support.refusals import refused
from support.sweeping import AXES, Pickling, duffing, ends, power, unlike

METHODS = ("merson", "fehlberg", "fehlberg_5", "dop853", "taylor")
GAMMA, Y0 = (values for _, values in AXES.values())
AT = np.linspace(0.0, 6.0, 25)
OUTCOMES = (
    *("last", "extremes", "mean", "crossing", "period", "evaluations", "history"),
    *(sw.sweeps.Extremes("energy"), sw.sweeps.Mean(power), ends),
)


def adaptive(**options: Any) -> Any:
    """A sweep of 45 members with every outcome that works with a tolerance."""
    arguments: dict[str, Any] = {"v": 0.0, "tolerance": 1e-8, "at": AT, "outcomes": OUTCOMES} | options
    axes, method = arguments.pop("axes", AXES), arguments.pop("method", "dop853")
    return sw.sweep(partial(duffing, delta=0.2), axes, method, **arguments)


def alike(method: str = "dop853", **options: Any) -> sw.Run:
    """The same members by ``integrate``."""
    arguments: dict[str, Any] = {"v": 0.0, "y": Y0, "tolerance": 1e-8, "at": AT} | options
    return sw.integrate(duffing(delta=0.2, gamma=GAMMA[:, None]), method, **arguments)


@looped("method", METHODS)
def test_members_are_those_of_integrate(method: str) -> None:
    dataset, run = adaptive(method=method, outcomes=["last", "history", "evaluations"], chunk=7, memory=20_000.0), alike(method)
    np.testing.assert_array_equal(dataset.y, np.moveaxis(run.y, 0, -1))
    np.testing.assert_array_equal(dataset.v, np.moveaxis(run.v, 0, -1))
    np.testing.assert_array_equal(dataset.y_last, run.y[-1])
    np.testing.assert_array_equal(dataset.v_last, run.v[-1])
    np.testing.assert_array_equal(dataset.t, AT)
    np.testing.assert_array_equal(dataset.evaluations, run.paces.evaluations)
    np.testing.assert_array_equal(dataset.accepted_steps, run.paces.accepted)
    np.testing.assert_array_equal(dataset.rejected_steps, run.paces.rejected)
    assert dataset.evaluations.dtype.kind == "i"
    assert len(np.unique(dataset.evaluations)) > 1  # members have steps of their own


@looped(
    "options",
    [
        {"tolerance": (1e-7, 1e-9)},
        {"dt": 0.01},
        {"fused": True},
        {"t0": -1.0},
        {"max_steps": 5000},
        {"control": sw.Projection("energy")},
        {"dtype": "float32", "tolerance": 1e-4},
    ],
)
def test_arguments_are_those_of_integrate(options: dict[str, Any]) -> None:
    dataset, run = adaptive(outcomes=["last", "evaluations"], chunk=10, memory=20_000.0, **options), alike(**options)
    np.testing.assert_array_equal(dataset.y_last, run.y[-1])
    np.testing.assert_array_equal(dataset.evaluations, run.paces.evaluations)


@looped("method", ["dop853", "taylor"])
def test_a_tolerance_as_an_axis(method: str) -> None:
    relative = np.array([1.1e-8, 1.2e-8, 1.5e-8]) if method == "taylor" else np.array([1e-4, 1e-8, 1e-12])
    axes = {"y": ("y0", Y0), "tolerance": ("tolerance", relative)}
    dataset = sw.sweep(
        partial(duffing, delta=0.2), axes, method, v=0.0, at=6.0, outcomes=["last", "evaluations"], chunk=4, threads=2
    )
    run = sw.integrate(duffing(delta=0.2), method, v=0.0, y=Y0[:, None], tolerance=relative, at=[6.0])
    np.testing.assert_array_equal(dataset.y_last, run.y[-1])
    np.testing.assert_array_equal(dataset.evaluations, run.paces.evaluations)
    np.testing.assert_array_equal(dataset.tolerance, relative)
    assert "tolerance" not in dataset.attrs


def test_reductions_see_the_states_at_the_times() -> None:
    dataset, run = adaptive(chunk=7, memory=40_000.0), alike()
    for name, values in {"v": run.v, "y": run.y, "energy": run.quantity("energy")}.items():
        np.testing.assert_array_equal(dataset[f"{name}_min"], values.min(axis=0))
        np.testing.assert_array_equal(dataset[f"{name}_max"], values.max(axis=0))
    for name, values in {"y": run.y, "power": run.v * run.y}.items():
        lengths = np.diff(AT)[:, None, None]
        mean = (lengths / 2 * (values[1:] + values[:-1])).sum(axis=0) / (AT[-1] - AT[0])
        # As many additions as times, of numbers of that size, on both sides.
        np.testing.assert_allclose(dataset[f"{name}_mean"], mean, atol=2 * AT.size * 2**-53 * abs(values).max())
    np.testing.assert_array_equal(dataset.twice, 2.0 * run.y[-1])


def test_unequal_times_crossings_and_periods() -> None:
    """The mean of cos over [0, 2π/3]: each interval errs by its length cubed, times the largest |cos|, over 12."""
    at = np.concatenate([np.linspace(0.0, 1.0, 101), np.linspace(1.0, 2.0 * np.pi / 3.0, 301)[1:]])
    dataset = sw.sweep(sw.Oscillator, {"omega": [1.0, 1.0]}, "dop853", v=0.0, y=1.0, tolerance=1e-12, at=at, outcomes="mean")
    end = 2.0 * np.pi / 3.0
    bound = (np.diff(at) ** 3 / 12.0).sum() / end
    off = abs(dataset.y_mean.values - np.sin(end) / end)
    assert (off < bound + 1e-11).all()
    # As if all intervals were as long as the first: far outside.
    weights = np.full(at.size, 0.01)
    assert abs((weights * np.cos(at)).sum() / end - np.sin(end) / end) > 100 * bound
    # By a cubic through both states and their rates: (interval·ω)⁴/384 over the speed; the states err by far less.
    omega, h = np.array([1.0, 1.3, 1.7]), 0.1
    at = h * np.arange(300)
    dataset = sw.sweep(
        sw.Oscillator, {"omega": omega}, "dop853", v=0.0, y=1.0, tolerance=1e-12, at=at, outcomes=["crossing", "period"], chunk=2
    )
    bound = 1.1 * (omega * h) ** 4 / 384 / omega + 1e-9
    assert (abs(dataset.y_crossing.values - 1.5 * np.pi / omega) < bound).all()
    n = dataset.y_passages.values - 1
    assert (abs(dataset.y_period.values - 2 * np.pi / omega) < 2 * bound / n).all()


@pytest.fixture(scope="module")
def whole() -> Any:
    return adaptive()


def in_pieces(monkeypatch: pytest.MonkeyPatch, times: int) -> None:
    """As if memory sufficed for so many states at once."""
    monkeypatch.setattr(task.Task, "states_at_once", lambda *_: times)


def test_every_division_of_members_and_of_time_gives_the_same_bits(whole: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    with ThreadPoolExecutor(3) as pool:
        divisions: list[dict[str, Any]] = [{"chunk": 1}, {"chunk": 2, "threads": 3}, {"memory": 60_000.0, "chunk": 11}]
        for division in (*divisions, {"engine": pool, "chunk": 4}, {"engine": Pickling(), "chunk": 10}):
            dataset = adaptive(**division)
            assert unlike(whole, dataset) == [], division
            assert whole.attrs == dataset.attrs, division
    for times in (1, 2, 7, 24):
        in_pieces(monkeypatch, times)
        assert unlike(whole, adaptive(chunk=20)) == [], times


@pytest.mark.parametrize("method", METHODS)
def test_every_method_goes_on(method: str, monkeypatch: pytest.MonkeyPatch) -> None:
    before = adaptive(method=method)
    in_pieces(monkeypatch, 3)
    assert unlike(before, adaptive(method=method)) == []


def test_little_memory_is_more_pieces() -> None:
    """Of 45 members, whose states at 25 times take 18 kB, some at once."""
    some = task.Task(duffing, "dop853", {}, 0, 0, 1, None, (sw.sweeps.Last(),), 150_000.0, AT)
    system = duffing()
    members = some.most_members(system)
    assert 45 < members < 1000
    assert 2 <= some.states_at_once(system, members) < AT.size < some.states_at_once(system, 5)


@pytest.mark.mutant
def test_pieces_that_begin_anew_would_be_noticed(whole: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """A piece that goes on from the last saved state, and not from where the members are, has other steps."""

    def anew(arguments: dict[str, Any], run: sw.Run) -> dict[str, Any]:
        return arguments | {"v": run.v[-1], "y": run.y[-1], "t0": float(run.t[-1])}

    in_pieces(monkeypatch, 4)
    monkeypatch.setattr(task, "_going_on", anew)
    assert "y_last" in unlike(whole, adaptive())


@pytest.mark.parametrize("ending", family(["zarr", "nc"], lambda ending: ending == "zarr"))
def test_a_store_goes_on_and_refuses_another_tolerance(whole: Any, ending: str, tmp_path: Path) -> None:
    path = tmp_path / f"a.{ending}"
    for _ in range(2):
        with adaptive(store=path, chunk=10) as dataset:
            assert unlike(whole, dataset) == []
            assert (dataset.attrs["tolerance"], dataset.attrs["end"]) == (1e-8, 6.0)
    for other in ({"tolerance": 1e-9}, {"tolerance": (1e-8, 1e-12)}, {"at": AT[1:]}, {"max_steps": 77}):
        refused(ArgumentError, "store: ", adaptive, store=path, chunk=10, **other)
    with adaptive(store=tmp_path / f"b.{ending}", tolerance=(1e-8, 1e-12)) as dataset:
        assert dataset.attrs["tolerance"] == "(1e-08, 1e-12)"


@sw.system(order=1)
def explosion(t: Any, y: Any, *, rate: Any = 1.0) -> Any:
    """ẏ = rate·y²: from y = 1 it is 1/(1 − rate·t), and ends at t = 1/rate."""
    return rate * y * y


def test_what_stops_leaves_the_others_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    rate = np.array([0.1, 0.8, 0.2, 2.0, 0.3])
    at = np.linspace(0.0, 3.0, 31)
    arguments: dict[str, Any] = {"y": 1.0, "tolerance": 1e-9, "at": at}
    with pytest.warns(sw.ToleranceWarning):
        run = sw.integrate(explosion(rate=rate), "dop853", **arguments)
    message = r"2 of 5 members stopped before t = 3, the first of them at rate = 0.8: (the step that|no step)"
    results = []
    outcomes = ["last", "history", "extremes", "evaluations"]
    for options, times in (({}, 31), ({"chunk": 2}, 31), ({"chunk": 3}, 4)):
        in_pieces(monkeypatch, times)
        with pytest.warns(sw.ToleranceWarning, match=message) as caught:
            dataset = sw.sweep(explosion, {"rate": rate}, "dop853", outcomes=outcomes, **arguments, **options)
        assert (len(caught), caught[0].filename) == (1, __file__)
        np.testing.assert_array_equal(dataset.y, run.y.T)
        np.testing.assert_array_equal(dataset.status, run.status)
        np.testing.assert_array_equal(dataset.first_bad_step, run.first_bad_step)
        results.append(dataset)
    assert (results[0].status.values > 0).tolist() == [False, True, False, True, False]
    assert all(unlike(results[0], each) == [] for each in results[1:])
    assert np.isnan(results[0].y_max[1])
    # By the closed form; a step errs by 1e-9 of y, and an error of y grows as y².
    np.testing.assert_allclose(results[0].y_last[[0, 2, 4]], 1.0 / (1.0 - 3.0 * rate[[0, 2, 4]]), rtol=1e-6)


def test_a_budget_is_that_of_the_whole_run_and_lost_motion_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    """However many pieces there are."""
    arguments: dict[str, Any] = {"v": 0.0, "y": 1.0, "tolerance": 1e-9, "at": np.linspace(0.0, 40.0, 41), "max_steps": 200}
    omega = np.array([0.5, 1.0, 20.0])
    with pytest.warns(sw.ToleranceWarning):
        run = sw.integrate(sw.Oscillator(omega), "dop853", **arguments)
    for times in (41, 3):
        in_pieces(monkeypatch, times)
        with pytest.warns(
            sw.ToleranceWarning, match="1 of 3 members stopped before t = 40, that at omega = 20: out of max_steps"
        ):
            dataset = sw.sweep(sw.Oscillator, {"omega": omega}, "dop853", outcomes=["history", "last"], **arguments)
        np.testing.assert_array_equal(dataset.status, run.status)
        np.testing.assert_array_equal(dataset.y, run.y.T)
    assert run.status[-1] == sw.Status.BUDGET
    arguments: dict[str, Any] = {"v": 0.0, "tolerance": (1e-9, 1e-3), "at": [1.0]}
    with pytest.warns(sw.ToleranceWarning, match=r"tolerance: for 1 of 2 members the absolute part lets a step err"):
        sw.sweep(sw.Oscillator(), {"y": [1.0, 1e-3]}, "dop853", **arguments)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        sw.sweep(sw.Oscillator(), {"y": [1.0, 2.0]}, "dop853", **arguments)


GOOD: dict[str, Any] = {"system": sw.Oscillator, "axes": {"omega": [1.0, 2.0]}, "method": "dop853", "v": 0.0, "y": 1.0}
GOOD |= {"tolerance": 1e-9, "at": [1.0, 2.0]}
REFUSED: dict[str, tuple[dict[str, Any], str]] = {
    "steps": ({"steps": 10}, "steps: works with fixed steps only, and tolerance= or at= was given"),
    "a transient": ({"transient": 0}, "transient: works with fixed steps only"),
    "an interval": ({"every": 2, "outcomes": "history"}, "every: works with fixed steps only"),
    "an interval of reductions": ({"observe": 2}, "observe: works with fixed steps only"),
    "a start": ({"start": "first_order"}, "start: works with fixed steps only"),
    "steps as an axis": ({"axes": {"dt": [0.1, 0.2]}}, "axes: dt: with a tolerance, dt is the step to try first"),
    "no times": ({"at": None}, "at: tolerance= needs the times at which to save states, too, such as at="),
    "times alone": ({"tolerance": None}, "tolerance: at= needs the error that a step may have, too, such as tolerance=1e-6"),
    "an axis without times": ({"tolerance": None, "at": None, "axes": {"tolerance": [1e-6, 1e-9]}}, "at: tolerance= needs"),
    "a list": ({"tolerance": [1e-6, 1e-9]}, "tolerance: expected a number, or a pair (relative, absolute), the same for all"),
    "three": ({"tolerance": (1e-6, 1e-9, 1.0)}, "tolerance: expected a number, or a pair (relative, absolute), the same for all"),
    "an array": ({"tolerance": np.array([1e-6, 1e-9])}, "if it varies, it is an axis"),
    "none tolerated": ({"tolerance": 0.0}, "tolerance: expected"),
    "a tolerance that is none": ({"tolerance": "small"}, "tolerance: expected real numbers"),
    "twice": ({"axes": {"tolerance": [1e-6, 1e-9]}}, "tolerance: given twice, as an argument and in axes"),
    "a pair for each": (
        {"tolerance": None, "axes": {"tolerance": ("run", [[1e-6, 1e-9], [1e-6, 1e-9]])}},
        "axes: tolerance: expected one number for each member, got shape (2, 2)",
    ),
    "a tolerance below zero": ({"tolerance": None, "axes": {"tolerance": [1e-6, -1.0]}}, "axes: tolerance: expected"),
    "times that fall": ({"at": [2.0, 1.0]}, "at: expected times that ascend"),
    "times as a table": ({"at": [[1.0, 2.0]]}, "at: expected times along one axis"),
    "no step budget": ({"max_steps": 0}, "max_steps: expected 1 or more"),
    "one time for an extreme": (
        {"at": 1.0, "outcomes": "extremes"},
        "at: expected two or more times, since with a tolerance Ext",
    ),
    "one time for a mean": ({"at": [1.0], "outcomes": ["last", "mean"]}, "since with a tolerance Mean sees the states at these"),
    "too few intervals": ({"outcomes": sw.sweeps.Exponents(transient=999)}, "transient: expected fewer intervals than at has"),
    "a method without an estimate": ({"method": "rk4"}, "tolerance: rk4 does not estimate its error"),
    "a series of two orders": (
        {"method": "taylor", "tolerance": None, "axes": {"tolerance": [1e-6, 1e-12]}},
        "tolerance: expected tolerances of one order for all members",
    ),
    "evaluations of fixed steps": (
        {"tolerance": None, "at": None, "dt": 0.1, "steps": 10, "outcomes": "evaluations"},
        "outcomes: Evaluations: with fixed steps every member has the same number",
    ),
    "a budget of fixed steps": ({"tolerance": None, "at": None, "dt": 0.1, "steps": 9, "max_steps": 9}, "max_steps: works with"),
    "nothing of either": ({"tolerance": None, "at": None, "dt": 0.1}, "steps: expected with fixed steps; or give tolerance="),
}


@looped("what", REFUSED)
def test_what_is_refused(what: str) -> None:
    wrong, message = REFUSED[what]
    refused((sw.StepwellError, TypeError), re.escape(message), sw.sweep, **(GOOD | wrong))


def test_lyapunov_exponents_are_those_of_lyapunov() -> None:
    """Each member to its own tolerance."""
    omega, tolerance, at = np.array([1.0, 2.0, 3.0]), np.array([1e-6, 1e-10]), np.linspace(1.0, 12.0, 12)
    axes, outcomes = {"omega": omega, "tolerance": tolerance}, sw.sweeps.Exponents("all", transient=4)
    dataset = sw.sweep(sw.Pendulum, axes, "dop853", v=0.0, y=1.0, at=at, outcomes=outcomes)
    for i, k in np.ndindex(3, 2):
        truth = sw.lyapunov(
            sw.Pendulum(omega[i]), "dop853", v=0.0, y=1.0, tolerance=tolerance[k], at=at, transient=4, exponents="all"
        )
        np.testing.assert_array_equal(dataset.lyapunov[i, k], truth.exponents)
