"""What advice predicts, what it refuses, and what it tells."""

import json
import math
import warnings
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.errors import ArgumentError, DivergenceWarning, DTypeError
from stepwell.scenes import Scene
from stepwell.studies.advice import Row
from stepwell.studies.advice.costs import Times, single_name
from stepwell.studies.advice.motion import motion_of
from stepwell.studies.advice.predict import Rates
from stepwell.studies.advice.trials import Trials
from support.advised import _times_are_measured_once, brute_of, scene_of, unmeasured  # noqa: F401
from support.commands import complaint, listed, printed
from support.families import family
from support.looped import assert_refused, looped
from support.truths import CLOSED_FORMS


def error_of(scene: Scene, method: str, dt: float, steps: int) -> float:
    """The largest state error of a run."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DivergenceWarning)
        warnings.simplefilter("ignore", sw.AccuracyWarning)
        return float(scene.state_error(scene.run(method, dt, steps=steps, every=1)).max())


@pytest.mark.usefixtures("unmeasured")
@pytest.mark.parametrize("name", family(["oscillator", "chain"], lambda name: name == "oscillator"))
def test_modes_predict_the_error(name: str) -> None:
    """A free linear system does what its modes say; some hundred roundings of each of a few thousand steps may differ."""
    advice = sw.advise(name, frame=None, tolerance=1e-3, cost="evaluations")
    for row in (row for row in advice.ranked if row.tolerance is None):
        assert row.predicted_by == "modes"
        assert row.predicted == pytest.approx(row.error, rel=0.01)


@pytest.mark.usefixtures("unmeasured")
def test_errors_of_frequency_and_damping_and_methods_that_are_refused() -> None:
    methods = ["false_euler", "semi_false_heun"]
    advice = sw.advise("oscillator", frame=0.1, tolerance=0.9, methods=methods, cost="evaluations")
    rows = {row.method.name: row for row in advice.ranked}
    # Φ²/24 + 3Φ⁴/640 and no damping; −Φ²/12 + 7Φ⁴/160 and r₁² = 1 − Φ⁴/4, so ln r₁/dt = −Φ⁴/8/dt.
    assert rows["false_euler"].frequency_error == pytest.approx(0.1**2 / 24 + 3 * 0.1**4 / 640, rel=1e-4)
    assert rows["false_euler"].damping_error == pytest.approx(0.0, abs=1e-12)
    assert rows["semi_false_heun"].frequency_error == pytest.approx(-(0.1**2) / 12 + 7 * 0.1**4 / 160, rel=1e-3)
    assert rows["semi_false_heun"].damping_error == pytest.approx(0.1**4 / 8 / 0.1, rel=1e-3)
    advice = sw.advise("forced_oscillator", frame=0.1, tolerance=1e-1)
    refused = {each.method: each.reason for each in advice.rejected if each.kind == "refused"}
    assert set(refused) == {m.name for m in sw.methods() if m.needs_acceleration}
    assert "damping" in refused["verlet"]
    only = sw.advise("forced_oscillator", tolerance=1e-1, methods=["verlet"])
    assert only.best is None
    assert "Nothing fits" in str(only)


def test_no_prediction_where_it_makes_no_sense() -> None:
    rates = Rates(np.array([0.0, 1.0]), np.array([[-1.0 + 2.0j, 5.0], [-3.0, 0.1]]))
    assert rates.fastest == (-3.0, 1.0)
    assert Rates(np.array([0.0]), np.array([[1.0 + 0.0j]])).fastest is None
    advice = sw.advise("forced_oscillator", frame=1 / 60, tolerance=0.1, methods=["rk4"])
    assert (advice.best.predicted, advice.best.predicted_by, advice.best.frequency_error) == (None, None, None)


@pytest.mark.usefixtures("unmeasured")
@pytest.mark.parametrize("name", family(["oscillator", "chain"], lambda name: name == "oscillator"))
def test_the_margin_is_to_the_limit_of_the_system(name: str) -> None:
    """Runs on both sides of that limit are in ``test_truth.py`` and ``test_stability_limit.py``."""
    scene = sw.scenes.scene(name)
    advice = sw.advise(scene, frame=None, tolerance=1e-1, cost="evaluations")
    rows = [row for row in advice.ranked if row.tolerance is None]
    assert {row.limit_by for row in rows} == {"linear"}
    limited = [row for row in rows if row.limit and math.isfinite(row.limit)]
    for row in limited:
        assert (row.limit, row.margin) == (float(sw.stability_limit(scene.system, row.method)), row.limit / row.dt)
    assert len(limited) >= 3


@pytest.mark.usefixtures("unmeasured")
def test_the_observed_limit_is_where_runs_begin_to_grow() -> None:
    advice = sw.advise("clover", frame=None, tolerance=1e-2, cost="evaluations")
    scene = sw.scenes.clover()
    for row in [row for row in advice.ranked if row.tolerance is None][:3]:
        assert row.limit_by == "frozen"
        assert row.dt <= row.observed_limit
        assert row.margin == row.observed_limit / row.dt
        if math.isfinite(row.observed_limit):
            inside = round(scene.horizon / row.observed_limit)
            assert error_of(scene, row.method.name, scene.horizon / inside, inside) < math.inf


def test_nothing_fits_a_budget() -> None:
    advice = sw.advise("oscillator", frame=0.5, tolerance=1e-3, budget=1e-15)
    assert advice.best is None
    assert advice.ranked == ()
    gap = advice.shortfall
    assert (gap.method, gap.substeps, gap.least_error) == (None, None, math.inf)
    assert 1e-12 < gap.needed_budget < 1e-3
    assert {each.kind for each in advice.rejected} <= {"budget", "dominated", "inaccurate", "unstable"}
    text = str(advice)
    assert "Nothing fits." in text
    assert "does not suffice for one step" in text
    assert "The tolerance needs a budget of" in text
    # What is needed is enough, with some room for a measurement that does not repeat.
    assert sw.advise("oscillator", frame=0.5, tolerance=1e-3, budget=10 * gap.needed_budget).best is not None


@pytest.mark.usefixtures("unmeasured")
def test_nothing_meets_the_tolerance() -> None:
    """Rounding alone is worse than 1e-17; the least error that is told was reached."""
    advice = sw.advise("oscillator", frame=0.5, tolerance=1e-17, methods=["rk4", "pefrl"])
    gap = advice.shortfall
    assert advice.best is None
    assert gap.needed_budget is None
    assert gap.method in ("rk4", "pefrl")
    scene = sw.scenes.oscillator()
    steps = math.ceil(scene.horizon / 0.5 - 1e-9) * gap.substeps
    assert error_of(scene, gap.method, 0.5 / gap.substeps, steps) <= 2 * gap.least_error < 1e-9
    assert "Nothing that was tried meets the tolerance" in str(advice)


@pytest.mark.usefixtures("unmeasured")
@pytest.mark.parametrize("budget", family([1e-7, 7e-8], lambda budget: budget == 1e-7))
def test_the_least_error_is_that_of_a_whole_run(budget: float) -> None:
    """A run that ends far out shows little there of how late it is where it is fast: half a per cent of its largest error."""
    scene = replace(sw.scenes.kepler(0.9), horizon=5.0 * math.pi)
    options = {"frame": None, "methods": ["fehlberg_5", "merson"], "cost": "evaluations"}
    advice = sw.advise(scene, tolerance=1e-9, budget=budget, **options)
    gap = advice.shortfall
    assert gap.tolerance is not None
    at = np.linspace(0.0, scene.horizon, 3001)[1:]
    run = sw.integrate(scene.system, gap.method, v=scene.v, y=scene.y, tolerance=gap.tolerance, at=at)
    assert scene.state_error(run)[-1] < 0.1 * gap.least_error
    # Errors are measured at 2000 times evenly spaced on the path and more around the worst: more densely than here.
    assert scene.state_error(run).max() <= 1.01 * gap.least_error


@pytest.mark.usefixtures("unmeasured")
def test_a_choice_whose_neighbours_fail_says_so() -> None:
    """Where errors dip, the row says from where on they stay below the tolerance; all that were tried there do."""
    advice = sw.advise("pendulum", frame=None, tolerance=0.03, cost="evaluations", methods=list(CLOSED_FORMS))
    scene = scene_of("pendulum")
    assert not advice.best.is_robust
    assert "Errors are not even here" in str(advice)
    for row in advice.ranked:
        if row.tolerance is not None:
            assert row.robust is None or row.robust <= row.tolerance
        elif row.is_robust:
            assert brute_of("pendulum").error(row.method.name, scene.horizon / (row.steps + 1), row.steps + 1) <= 0.03
        elif row.robust is not None:
            assert row.robust > row.steps


def test_what_is_wrong_is_said() -> None:
    assert_refused(
        (lambda wrong=wrong: sw.advise(**{"scene": "clover"} | wrong), error, message)
        for wrong, error, message in (
            ({"scene": 3}, DTypeError, "scene: expected a Scene or its name, got int"),
            ({"scene": "cloverr"}, ArgumentError, "did you mean 'clover'?"),
            ({"frame": 0.0}, ArgumentError, "frame: expected numbers above zero in units of time"),
            ({"frame": "1/60"}, DTypeError, "frame: expected real numbers in units of time"),
            ({"tolerance": -1.0}, ArgumentError, "tolerance: expected numbers above zero"),
            ({"tolerance": math.nan}, ArgumentError, "tolerance: expected finite numbers"),
            ({"budget": 0}, ArgumentError, "budget: expected numbers above zero in seconds"),
            ({"methods": "rk4"}, DTypeError, "methods: expected a list of names, got 'rk4'"),
            ({"methods": []}, ArgumentError, "methods: expected at least one, got none"),
            ({"methods": ["rk44"]}, ArgumentError, "did you mean 'rk4'?"),
            ({"cost": "energy"}, ArgumentError, "Known: time, evaluations"),
            ({"dtype": "float16"}, sw.errors.UnknownNameError, "dtype: there is no 'float16'"),
        )
    )


@pytest.mark.usefixtures("unmeasured")
def test_the_text_fits_a_screen(tmp_path: Any) -> None:
    for name in ("oscillator", "clover"):
        advice = sw.advise(name, frame=None, tolerance=1e-2, cost="evaluations")
        lines = str(advice).splitlines()
        assert len(lines) <= 26
        assert lines[0].startswith(advice.scene.title)
        assert lines[1].startswith(f"Use {advice.best.method.name} with {advice.best.steps} steps")
        assert advice.best.method.name in repr(advice)
    advice.to_json(tmp_path / "a.json")
    assert json.loads((tmp_path / "a.json").read_text(encoding="utf-8")) == json.loads(advice.to_json())
    assert json.loads(advice.to_json())["best"]["method"] == advice.best.method.name


@pytest.mark.usefixtures("unmeasured")
def test_the_command_says_what_advise_says(capsys: Any, tmp_path: Any) -> None:
    words = ("advise", "clover", "--frame", "3/10", "--tolerance", "0.01", "--cost", "evaluations")
    report, direct = listed(capsys, *words), json.loads(sw.advise("clover", 0.3, 0.01, cost="evaluations").to_json())
    for key in ("scene", "horizon", "frame", "tolerance", "cost", "rejected"):
        assert report[key] == direct[key]
    keys = ["method", "substeps", "dt", "error", "predicted", "limit", "observed_limit", "margin", "robust"]
    keys += ["evaluations_per_frame"]
    assert [[row[k] for k in keys] for row in report["ranked"]] == [[row[k] for k in keys] for row in direct["ranked"]]
    out = printed(capsys, *words, "-o", str(tmp_path / "a.json"))
    assert f"Use {report['best']['method']} with {report['best']['substeps']} step" in out
    assert "written:" in out
    assert (tmp_path / "a.json").exists()
    for row in report["ranked"]:
        assert row["method"] in out


@looped(
    "words, message",
    [
        (["advise", "cloverr"], "did you mean 'clover'?"),
        (["advise", "clover", "--frame", "x"], "--frame: expected a time such as 0.02 or 1/60, or any, got 'x'"),
        (["advise", "clover", "--frame", "1/0"], "--frame: expected a time"),
        (["advise", "oscillator", "--frame", "1e-12", "-o", "a.json"], "frame: expected at most 1000000 frames in the horizon"),
        (["advise", "clover", "--tolerance", "0"], "tolerance: expected numbers above zero"),
        (["advise", "clover", "--methods", "rk44"], "did you mean 'rk4'?"),
        (["advise", "clover", "-o", "a.txt"], "-o: expected a file ending in .json"),
    ],
)
def test_the_command_says_what_is_wrong(capsys: Any, words: list[str], message: str) -> None:
    assert message in complaint(capsys, *words)


# ---- float32, where it is accurate enough and costs less
FEW = ["leapfrog", "rk4", "pefrl", "dop853"]

#: A point that nothing moves otherwise: v̇ = 0, ẏ = v.
FREE = sw.LinearSystem([[0.0, 0.0], [1.0, 0.0]])


def error_in(advice: sw.advice.Advice, row: Row, dtype: str) -> float:
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
    advice = sw.advise(name, frame, tolerance, methods=FEW, dtype="float32")
    assert advice.ranked
    for row in advice.ranked:
        assert row.dtype == "float32"
        assert row.tolerance is None
        assert row.name == f"{row.method.name}, float32"
        run = advice.run(row)
        assert run.dtype == "float32"
        assert error_in(advice, row, "float32") == pytest.approx(row.error, rel=1e-3, abs=1e-9)
        assert error_in(advice, row, "float64") == pytest.approx(row.float64_error, rel=1e-3, abs=1e-9)
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
    assert all(error_in(advice, row, "float32") != pytest.approx(row.error, rel=1e-3, abs=1e-9) for row in advice.ranked)
    assert all(row.error == row.float64_error for row in advice.ranked)


@pytest.mark.parametrize("name", family(["oscillator", "figure_eight"], lambda name: name == "oscillator"))
def test_float32_is_not_advised_where_its_rounding_is_more_than_what_is_wanted(name: str) -> None:
    """Half a unit in the last place of float32 is 6e-8 of a number, so no run of these is right to 1e-9."""
    advice = sw.advise(name, None, 1e-9, methods=FEW, dtype="both")
    assert advice.best is not None
    assert {row.dtype for row in advice.ranked} == {"float64"}
    assert {each.method for each in advice.rejected if each.dtype == "float32"} == set(FEW)
    rounding = [each for each in advice.rejected if "most of it rounding: in float64 it is" in each.reason]
    assert rounding
    assert {each.dtype for each in rounding} == {"float32"}
    alone = sw.advise(name, None, 1e-9, methods=FEW, dtype="float32")
    assert alone.best is None
    assert alone.shortfall.dtype == "float32"
    assert alone.shortfall.least_error > 2.0**-26
    assert " in float32 with " in str(alone)


def test_the_search_ends_where_shorter_steps_only_round_more_and_nothing_fits(capsys: Any) -> None:
    """Without that it would go on to millions of steps; here the last run has at most four times the steps of the best."""
    free = sw.advise("oscillator", None, 1e-8, methods=["rk4"], dtype="float32")
    last = next(each for each in free.rejected if each.method == "rk4")
    assert int(last.reason.split(" with ")[1].split(" steps")[0]) <= 4 * (free.shortfall.substeps or 0)
    assert free.runs < 40
    words = ("advise", "oscillator", "--budget", "1e-15", "--methods")
    assert "Nothing fits." in printed(capsys, *words, "rk4, leapfrog")
    assert listed(capsys, *words, "rk4")["best"] is None


def test_float32_is_chosen_where_it_costs_less(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("stepwell.advice.step_times", prices(0.5))
    options: dict[str, Any] = {"frame": 0.1, "tolerance": 0.1, "methods": ["leapfrog", "rk4"], "fixed": True}
    advice = sw.advise("oscillator", **options, dtype="both")
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
    """Their last state is not compared with an earlier one, which would be wrong by what the step was rounded by."""
    # A point moves at a speed of 1, so y = t. Both steps add a number of float32 to itself or to 0, so nothing else is rounded.
    known = Scene(FREE, v=[1.0], y=[0.0], until=0.6, exact=lambda t: (np.ones((len(t), 1)), t[:, np.newaxis]))
    forever = Scene(FREE, v=[1.0], y=[0.0], horizon=0.6, exact=known.exact)
    run = known.run("false_euler", 0.3, steps=2, every=1, dtype="float32")
    assert run.t[-1] > 0.6
    assert np.array_equal(run.y[:, 0], run.t)
    assert np.array_equal(forever.state_error(run), np.zeros(3))
    for scene in (known, forever):
        trials = Trials(motion_of(scene, None, 1e-4, single=True), 1e-4, np.inf, "float32")
        assert trials.confirm(sw.method("false_euler"), 0.3, 2).error == 0.0


@pytest.mark.usefixtures("unmeasured")
def test_the_command_tries_both(capsys: Any) -> None:
    words = ["advise", "clover", "--frame", "0.3", "--tolerance", "0.01", "--cost", "evaluations", "--float32"]
    report = listed(capsys, *words)
    assert report["dtype"] == "both"
    assert {row["dtype"] for row in report["ranked"]} == {"float64", "float32"}
    assert all((row["float64_error"] is None) == (row["dtype"] == "float64") for row in report["ranked"])
    assert "rk4, float32" in printed(capsys, *words)
