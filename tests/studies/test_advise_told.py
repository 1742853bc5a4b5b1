"""What advice predicts, what it refuses, and what it tells."""

from __future__ import annotations

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
from stepwell.views import cli
from support.advised import _times_are_measured_once, brute_of, scene_of, unmeasured  # noqa: F401
from support.truths import CLOSED_FORMS


def error_of(scene: Scene, method: str, dt: float, steps: int) -> float:
    """The largest state error of a run."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DivergenceWarning)
        warnings.simplefilter("ignore", sw.AccuracyWarning)
        return float(scene.state_error(scene.run(method, dt, steps=steps, every=1)).max())


# ---- prediction and margin


@pytest.mark.usefixtures("unmeasured")
@pytest.mark.parametrize("name", ["oscillator", "chain"])
def test_modes_predict_the_error(name: str) -> None:
    """A free linear system does what its modes say; some hundred roundings of each of a few thousand steps may differ."""
    advice = sw.advise(name, frame=None, tolerance=1e-3, cost="evaluations")
    for row in (row for row in advice.ranked if row.tolerance is None):
        assert row.predicted_by == "modes"
        assert row.predicted == pytest.approx(row.error, rel=0.01)


@pytest.mark.usefixtures("unmeasured")
def test_frequency_and_damping_errors_are_those_of_the_series() -> None:
    methods = ["false_euler", "semi_false_heun"]
    advice = sw.advise("oscillator", frame=0.1, tolerance=0.9, methods=methods, cost="evaluations")
    rows = {row.method.name: row for row in advice.ranked}
    # Φ²/24 + 3Φ⁴/640 and no damping; −Φ²/12 + 7Φ⁴/160 and r₁² = 1 − Φ⁴/4, so ln r₁/dt = −Φ⁴/8/dt.
    assert rows["false_euler"].frequency_error == pytest.approx(0.1**2 / 24 + 3 * 0.1**4 / 640, rel=1e-4)
    assert rows["false_euler"].damping_error == pytest.approx(0.0, abs=1e-12)
    assert rows["semi_false_heun"].frequency_error == pytest.approx(-(0.1**2) / 12 + 7 * 0.1**4 / 160, rel=1e-3)
    assert rows["semi_false_heun"].damping_error == pytest.approx(0.1**4 / 8 / 0.1, rel=1e-3)


def test_no_prediction_where_it_makes_no_sense() -> None:
    advice = sw.advise("forced_oscillator", frame=1 / 60, tolerance=0.1, methods=["rk4"])
    assert advice.best is not None
    assert (advice.best.predicted, advice.best.predicted_by, advice.best.frequency_error) == (None, None, None)


@pytest.mark.usefixtures("unmeasured")
@pytest.mark.parametrize("name", ["oscillator", "chain"])
def test_the_margin_is_where_it_blows_up(name: str) -> None:
    """A run a thousandth inside the limit is bounded, one a thousandth outside grows."""
    scene = sw.scenes.scene(name)
    advice = sw.advise(scene, frame=None, tolerance=1e-1, cost="evaluations")
    tried = 0
    for row in (row for row in advice.ranked if row.tolerance is None):
        assert row.limit_by == "linear"
        if not row.limit or not math.isfinite(row.limit):
            continue
        assert row.margin == row.limit / row.dt
        assert row.limit == float(sw.stability_limit(scene.system, row.method))
        sizes = []
        for share in (0.999, 1.001):
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", DivergenceWarning)
                warnings.simplefilter("ignore", sw.AccuracyWarning)
                run = scene.run(row.method, share * row.limit, steps=20_000, every=20)
            sizes.append(float(scene.amplitude(run).max()))
        # Near the limit the axes of the ellipse are in the ratio √((2+Φ)/(2−Φ)) < 45; outside e⁷ and more.
        assert sizes[0] < 50
        assert not sizes[1] < 1e3
        tried += 1
    assert tried >= 3


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


# ---- nothing fits, and what is refused


def test_nothing_fits_a_budget() -> None:
    advice = sw.advise("oscillator", frame=0.5, tolerance=1e-3, budget=1e-15)
    assert advice.best is None
    assert advice.ranked == ()
    gap = advice.shortfall
    assert gap is not None
    assert (gap.method, gap.substeps, gap.least_error) == (None, None, math.inf)
    assert gap.needed_budget is not None
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
    assert gap is not None
    assert gap.needed_budget is None
    assert gap.method in ("rk4", "pefrl")
    assert gap.substeps is not None
    scene = sw.scenes.oscillator()
    steps = math.ceil(scene.horizon / 0.5 - 1e-9) * gap.substeps
    assert error_of(scene, gap.method, 0.5 / gap.substeps, steps) <= 2 * gap.least_error < 1e-9
    assert "Nothing that was tried meets the tolerance" in str(advice)


@pytest.mark.usefixtures("unmeasured")
@pytest.mark.parametrize("budget", [1e-7, 7e-8])
def test_the_least_error_is_that_of_a_whole_run(budget: float) -> None:
    """A run that ends far out shows little there of how late it is where it is fast: half a per cent of its largest error."""
    scene = replace(sw.scenes.kepler(0.9), horizon=5.0 * math.pi)
    options = {"frame": None, "methods": ["fehlberg_5", "merson"], "cost": "evaluations"}
    advice = sw.advise(scene, tolerance=1e-9, budget=budget, **options)
    gap = advice.shortfall
    assert gap is not None
    assert gap.tolerance is not None
    at = np.linspace(0.0, scene.horizon, 3001)[1:]
    run = sw.integrate(scene.system, gap.method, v=scene.v, y=scene.y, tolerance=gap.tolerance, at=at)
    assert scene.state_error(run)[-1] < 0.1 * gap.least_error
    # Errors are measured at 2000 times evenly spaced on the path and more around the worst: more densely than here.
    assert scene.state_error(run).max() <= 1.01 * gap.least_error


@pytest.mark.usefixtures("unmeasured")
def test_methods_that_the_system_refuses_are_named() -> None:
    advice = sw.advise("forced_oscillator", frame=0.1, tolerance=1e-1)
    refused = {each.method: each.reason for each in advice.rejected if each.kind == "refused"}
    assert set(refused) == {m.name for m in sw.methods() if m.needs_acceleration}
    assert "damping" in refused["verlet"]
    only = sw.advise("forced_oscillator", tolerance=1e-1, methods=["verlet"])
    assert only.best is None
    assert "Nothing fits" in str(only)


@pytest.mark.usefixtures("unmeasured")
def test_a_choice_whose_neighbours_fail_says_so() -> None:
    """Where errors dip, the row says from where on they stay below the tolerance; all that were tried there do."""
    advice = sw.advise("pendulum", frame=None, tolerance=0.03, cost="evaluations", methods=list(CLOSED_FORMS))
    scene = scene_of("pendulum")
    assert advice.best is not None
    assert not advice.best.is_robust
    assert "Errors are not even here" in str(advice)
    for row in advice.ranked:
        if row.tolerance is not None:
            assert row.robust is None or row.robust <= row.tolerance
        elif row.is_robust:
            assert brute_of("pendulum").error(row.method.name, scene.horizon / (row.steps + 1), row.steps + 1) <= 0.03
        elif row.robust is not None:
            assert row.robust > row.steps


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ({"scene": 3}, DTypeError, "scene: expected a Scene or its name, got int"),
        ({"scene": "cloverr"}, ArgumentError, "did you mean 'clover'?"),
        ({"frame": 0.0}, ArgumentError, "frame: expected numbers above zero in units of time"),
        ({"frame": "1/60"}, DTypeError, "frame: expected real numbers in units of time"),
        ({"tolerance": -1.0}, ArgumentError, "tolerance: expected numbers above zero"),
        ({"tolerance": math.nan}, ArgumentError, "tolerance: expected finite numbers"),
        ({"budget": 0}, ArgumentError, "budget: expected numbers above zero in seconds"),
        ({"methods": "rk4"}, DTypeError, "methods: expected a list of names, got 'rk4'"),
        ({"methods": []}, ArgumentError, "methods: expected at least one, got none"),
        ({"methods": ["rk5"]}, ArgumentError, "did you mean 'rk4'?"),
        ({"cost": "energy"}, ArgumentError, "Known: time, evaluations"),
    ],
)
def test_what_is_wrong_is_said(arguments: dict[str, Any], error: type[Exception], message: str) -> None:
    with pytest.raises(error) as raised:
        sw.advise(**({"scene": "clover"} | arguments))
    assert message in str(raised.value)


# ---- telling


@pytest.mark.usefixtures("unmeasured")
def test_the_text_fits_a_screen(tmp_path: Any) -> None:
    for name in ("oscillator", "clover"):
        advice = sw.advise(name, frame=None, tolerance=1e-2, cost="evaluations")
        lines = str(advice).splitlines()
        assert len(lines) <= 26
        assert lines[0].startswith(advice.scene.title)
        assert advice.best is not None
        assert lines[1].startswith(f"Use {advice.best.method.name} with {advice.best.steps} steps")
        assert advice.best.method.name in repr(advice)
    advice.to_json(tmp_path / "a.json")
    assert json.loads((tmp_path / "a.json").read_text(encoding="utf-8")) == json.loads(advice.to_json())
    assert json.loads(advice.to_json())["best"]["method"] == advice.best.method.name


def run_command(capsys: Any, *words: str) -> tuple[int, str, str]:
    code = cli.main(list(words))
    return code, *capsys.readouterr()


@pytest.mark.usefixtures("unmeasured")
def test_the_command_says_what_advise_says(capsys: Any, tmp_path: Any) -> None:
    words = ("advise", "clover", "--frame", "3/10", "--tolerance", "0.01", "--cost", "evaluations")
    code, out, err = run_command(capsys, *words, "--json")
    assert (code, err) == (0, "")
    report, direct = json.loads(out), json.loads(sw.advise("clover", 0.3, 0.01, cost="evaluations").to_json())
    for key in ("scene", "horizon", "frame", "tolerance", "cost"):
        assert report[key] == direct[key]
    keys = (
        "method",
        "substeps",
        "dt",
        "error",
        "predicted",
        "evaluations_per_frame",
        "limit",
        "observed_limit",
        "margin",
        "robust",
    )
    assert [[row[k] for k in keys] for row in report["ranked"]] == [[row[k] for k in keys] for row in direct["ranked"]]
    assert report["rejected"] == direct["rejected"]
    code, out, err = run_command(capsys, *words, "-o", str(tmp_path / "a.json"))
    assert (code, err) == (0, "")
    assert f"Use {report['best']['method']} with {report['best']['substeps']} step" in out
    assert "written:" in out
    assert (tmp_path / "a.json").exists()
    for row in report["ranked"]:
        assert row["method"] in out


def test_the_command_says_when_nothing_fits(capsys: Any) -> None:
    code, out, err = run_command(capsys, "advise", "oscillator", "--budget", "1e-15", "--methods", "rk4, leapfrog")
    assert (code, err) == (0, "")
    assert "Nothing fits." in out
    code, out, _ = run_command(capsys, "advise", "oscillator", "--budget", "1e-15", "--methods", "rk4", "--json")
    assert code == 0
    assert json.loads(out)["best"] is None


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["advise", "cloverr"], "did you mean 'clover'?"),
        (["advise", "clover", "--frame", "x"], "--frame: expected a time such as 0.02 or 1/60, or any, got 'x'"),
        (["advise", "clover", "--frame", "1/0"], "--frame: expected a time"),
        (["advise", "oscillator", "--frame", "1e-12", "-o", "a.json"], "frame: expected at most 1000000 frames in the horizon"),
        (["advise", "clover", "--tolerance", "0"], "tolerance: expected numbers above zero"),
        (["advise", "clover", "--methods", "rk5"], "did you mean 'rk4'?"),
        (["advise", "clover", "-o", "a.txt"], "-o: expected a file ending in .json"),
    ],
)
def test_the_command_says_what_is_wrong(capsys: Any, words: list[str], message: str) -> None:
    code, out, err = run_command(capsys, *words)
    assert (code, out) == (2, "")
    assert message in err
