"""Advice may choose float32 where it is accurate enough and costs less; beside it stand cost and error in float64."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.scenes import Scene
from stepwell.studies.advice import Row
from stepwell.studies.advice.costs import Times, single_name
from stepwell.studies.advice.motion import motion_of
from stepwell.studies.advice.trials import Trials
from stepwell.views import cli
from support.advised import _times_are_measured_once, scene_of, unmeasured  # noqa: F401

METHODS = ["leapfrog", "rk4", "pefrl", "dop853"]

#: A point that nothing moves otherwise: v̇ = 0, ẏ = v.
FREE = sw.LinearSystem([[0.0, 0.0], [1.0, 0.0]])


def error_of(advice: sw.advice.Advice, row: Row, dtype: str) -> float:
    """The largest error of a row's steps, made again step by step and compared at their own times."""
    run = advice.scene.run(row.method, row.dt, steps=row.steps, every=1, dtype=dtype)
    return float(scene_of(advice.scene.name).state_error(run).max())


def prices(single: float, noise: float = 0.05) -> Any:
    """Measured times of a step, where one of float32 takes that share of one of float64."""

    def times(scene: Scene, methods: Any, singles: Any) -> Times:
        measured = Times({m.name: float(m.evaluations) for m in methods})
        measured.update({single_name(m): single * m.evaluations for m in singles})
        measured.noise = noise
        return measured

    return times


@pytest.mark.usefixtures("unmeasured")
@pytest.mark.parametrize(
    ("name", "tolerance", "frame"), [("oscillator", 1e-3, None), ("clover", 1e-2, 0.3), ("pendulum", 1e-4, 0.1)]
)
def test_the_advice_in_float32_is_true(name: str, tolerance: float, frame: float | None) -> None:
    """The pendulum is compared with a table of its motion, whose error is far below that of float32."""
    advice = sw.advise(name, frame, tolerance, methods=METHODS, dtype="float32")
    assert advice.ranked
    for row in advice.ranked:
        assert row.dtype == "float32"
        assert row.tolerance is None
        assert row.name == f"{row.method.name}, float32"
        run = advice.run(row)
        assert run.dtype == "float32"
        assert error_of(advice, row, "float32") == pytest.approx(row.error, rel=1e-3, abs=1e-9)
        assert error_of(advice, row, "float64") == pytest.approx(row.float64_error, rel=1e-3, abs=1e-9)
        assert row.error <= tolerance
        # The states of both differ, so the errors are not the same number.
        assert row.error != row.float64_error


@pytest.mark.mutant
@pytest.mark.usefixtures("unmeasured")
def test_float64_in_the_place_of_float32_would_be_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    """A deliberately wrong search, whose runs in float32 are made in float64: its errors are not those of its rows."""
    init = Trials.__init__
    monkeypatch.setattr(Trials, "__init__", lambda self, *arguments: init(self, *arguments[:3]))
    advice = sw.advise("oscillator", None, 1e-5, methods=["rk4"], dtype="float32")
    assert advice.ranked
    assert all(error_of(advice, row, "float32") != pytest.approx(row.error, rel=1e-3, abs=1e-9) for row in advice.ranked)
    assert all(row.error == row.float64_error for row in advice.ranked)


@pytest.mark.parametrize("name", ["oscillator", pytest.param("figure_eight", marks=pytest.mark.long)])
def test_float32_is_not_advised_where_its_rounding_is_more_than_what_is_wanted(name: str) -> None:
    """Half a unit in the last place of float32 is 6e-8 of a number, so no run of these is right to 1e-9."""
    advice = sw.advise(name, None, 1e-9, methods=METHODS, dtype="both")
    assert advice.best is not None
    assert {row.dtype for row in advice.ranked} == {"float64"}
    assert {each.method for each in advice.rejected if each.dtype == "float32"} == set(METHODS)
    rounding = [each for each in advice.rejected if "most of it rounding: in float64 it is" in each.reason]
    assert rounding
    assert {each.dtype for each in rounding} == {"float32"}
    alone = sw.advise(name, None, 1e-9, methods=METHODS, dtype="float32")
    assert alone.best is None
    assert alone.shortfall is not None
    assert alone.shortfall.dtype == "float32"
    assert alone.shortfall.least_error > 2.0**-26
    assert " in float32 with " in str(alone)


def test_the_search_ends_where_shorter_steps_only_round_more() -> None:
    """Without that it would go on to millions of steps; here the last run has at most four times the steps of the best."""
    free = sw.advise("oscillator", None, 1e-8, methods=["rk4"], dtype="float32")
    assert free.shortfall is not None
    last = next(each for each in free.rejected if each.method == "rk4")
    assert int(last.reason.split(" with ")[1].split(" steps")[0]) <= 4 * (free.shortfall.substeps or 0)
    assert free.runs < 40


def test_float32_is_chosen_where_it_costs_less(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("stepwell.advice.step_times", prices(0.5))
    options: dict[str, Any] = {"frame": 0.1, "tolerance": 0.1, "methods": ["leapfrog", "rk4"], "fixed": True}
    advice = sw.advise("oscillator", **options, dtype="both")
    assert advice.best is not None
    assert (advice.best.name, advice.best.ns_per_step, advice.best.float64_ns_per_step) == ("leapfrog, float32", 0.5, 1.0)
    wide = next(row for row in advice.ranked if row.name == "leapfrog")
    assert advice.best.seconds_per_frame == pytest.approx(0.5 * (wide.seconds_per_frame or 0.0))
    sentence = f"In float64 these steps have an error of {advice.best.float64_error:.2g}, and a step takes 2 times as long."
    assert sentence in str(advice)
    assert "Use leapfrog in float32 with 1 step a frame" in str(advice)
    assert repr(advice).startswith("<advice for oscillator: leapfrog, float32, dt = 0.1")
    # By default it is not even tried.
    assert {row.dtype for row in sw.advise("oscillator", **options).ranked} == {"float64"}


def test_of_equal_costs_float64_comes_first(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where both take the same time, and by evaluations always; also where rounding makes the error of an oscillator smaller."""
    monkeypatch.setattr("stepwell.advice.step_times", prices(1.0))
    for cost in ("time", "evaluations"):
        advice = sw.advise("pendulum", 0.1, 1e-4, methods=["pefrl", "dop853"], fixed=True, dtype="both", cost=cost)  # type: ignore[arg-type]
        names = [row.name for row in advice.ranked]
        assert names.index("dop853") < names.index("dop853, float32")
        assert "Of float32 the best is " in str(advice)
        lucky = sw.advise("oscillator", 0.1, 1e-3, methods=["rk4"], fixed=True, dtype="both", cost=cost)  # type: ignore[arg-type]
        assert [row.name for row in lucky.ranked] == ["rk4", "rk4, float32"]
        assert lucky.ranked[1].error < 0.99 * lucky.ranked[0].error


def test_what_float32_does_not_go_with_is_refused_in_words() -> None:
    def turning(t: Any) -> Any:
        return -np.sin(t), np.cos(t)

    # A drive of no strength, whose angle is far beyond what float32 can tell: the motion is the free one.
    far = Scene(sw.Oscillator(1.0, a=sw.Sinusoid(0.0, 1e6)), v=0.0, y=1.0, horizon=10.0, exact=turning)
    large = Scene(sw.Oscillator(1.0), v=0.0, y=1e39, horizon=10.0, exact=lambda t: (-1e39 * np.sin(t), 1e39 * np.cos(t)))
    for scene, message in (
        (far, "in float32 a sinusoid's angle may grow to"),
        (large, "y: expected numbers up to 3.4e38, the largest of float32"),
    ):
        advice = sw.advise(scene, None, 1e-2, methods=["rk4"], cost="evaluations", dtype="both")
        assert [row.name for row in advice.ranked if row.by == "step"] == ["rk4"]
        (refused,) = (each for each in advice.rejected if each.kind == "refused")
        assert refused.name == "rk4, float32"
        assert message in refused.reason


def test_steps_that_round_up_end_after_what_is_known() -> None:
    """Their last state is not compared with an earlier one, which would be wrong by what the step was rounded by.

    A point moves at a speed of 1, so y = t. Both steps add a number of float32 to itself or to 0, so nothing else is rounded.
    """
    known = Scene(FREE, v=[1.0], y=[0.0], until=0.6, exact=lambda t: (np.ones((len(t), 1)), t[:, np.newaxis]))
    forever = Scene(FREE, v=[1.0], y=[0.0], horizon=0.6, exact=known.exact)
    run = known.run("false_euler", 0.3, steps=2, every=1, dtype="float32")
    assert run.t[-1] > 0.6
    assert np.array_equal(run.y[:, 0], run.t)
    assert np.array_equal(forever.state_error(run), np.zeros(3))
    for scene in (known, forever):
        trials = Trials(motion_of(scene, None, 1e-4, single=True), 1e-4, np.inf, "float32")
        assert trials.confirm(sw.method("false_euler"), 0.3, 2).error == 0.0


def test_what_is_wrong_is_said() -> None:
    with pytest.raises(sw.errors.UnknownNameError, match="dtype: there is no 'float16'"):
        sw.advise("oscillator", dtype="float16")  # type: ignore[arg-type]


@pytest.mark.usefixtures("unmeasured")
def test_the_command_tries_both(capsys: Any) -> None:
    words = ["advise", "clover", "--frame", "0.3", "--tolerance", "0.01", "--cost", "evaluations", "--float32"]
    assert cli.main([*words, "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["dtype"] == "both"
    assert {row["dtype"] for row in report["ranked"]} == {"float64", "float32"}
    assert all((row["float64_error"] is None) == (row["dtype"] == "float64") for row in report["ranked"])
    assert cli.main(words) == 0
    assert "rk4, float32" in capsys.readouterr().out
