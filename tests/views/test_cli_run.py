"""``stepwell run``: what it takes, and its verdict in words."""

from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.errors import ArgumentError
from stepwell.views import charts
from stepwell.views.cli.settings import scene_with
from stepwell.views.cli.verdict import growth_of, tenfold, verdict
from support import commands


def report(capsys: Any, *words: str) -> Any:
    return commands.listed(capsys, "run", *words)


def test_a_tolerance_makes_the_run_of_integrate(capsys: Any) -> None:
    scene = sw.scenes.kepler()
    at = np.linspace(0.0, scene.horizon, 101)
    run = sw.integrate(scene.system, "merson", v=scene.v, y=scene.y, tolerance=1e-6, at=at)
    printed = report(capsys, "kepler", "--method", "merson", "--tolerance", "1e-6")
    assert printed["last_y"] == run.y[-1].tolist()
    assert (printed["steps"], printed["rejected_steps"]) == (run.paces.accepted, run.paces.rejected)
    assert printed["function_evaluations"] == run.paces.evaluations
    assert printed["largest_state_error"] == scene.state_error(run).max()
    for option in ("--steps", "--every"):
        said = commands.complaint(capsys, "run", "kepler", "--method", "merson", "--tolerance", "1e-6", option, "5")
        assert said.startswith(f"stepwell: {option}: works with fixed steps only")


def test_without_a_method_the_advised_one_is_taken(capsys: Any) -> None:
    scene = sw.scenes.clover()
    printed = report(capsys, "clover")
    best = sw.advise(scene, scene.dt, methods=[printed["method"]], cost="evaluations", budget=1e9).best
    assert (printed["method"], printed["dt"]) == ("leapfrog", best.dt)
    assert printed["largest_state_error"] == pytest.approx(best.error, rel=0.05)
    assert printed["advised"].startswith("the cheapest of leapfrog, ")
    assert report(capsys, "clover") == printed, "again the same"
    given = report(capsys, "clover", "--dt", "0.1")
    assert given["dt"] == 0.1
    stiff = report(capsys, "rober")
    assert sw.method(stiff["method"]).is_implicit
    assert "dt" not in stiff, "adaptive steps"
    to = report(capsys, "oscillator", "--tolerance", "1e-4")
    assert "rejected_steps" in to
    assert sw.method(to["method"]).error_order is not None


def test_where_no_method_can_be_advised_the_usual_one_runs(capsys: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(*arguments: Any, **options: Any) -> Any:
        raise ArgumentError("scene: its true motion is not known; more")

    monkeypatch.setattr("stepwell.views.cli.advised.advise", refused)
    printed = report(capsys, "oscillator")
    assert (printed["method"], printed["advised"]) == ("rk4", "no: scene: its true motion is not known; rk4 is usual")
    printed = report(capsys, "oscillator", "--tolerance", "1e-4")
    assert printed["advised"] == "no: dop853 is usual with a tolerance; --method NAME takes another"


def test_set_changes_the_scene_the_system_and_the_start(capsys: Any) -> None:
    printed = report(capsys, "oscillator", "--method", "rk4", "--set", "omega=3")
    scene = sw.scenes.oscillator(3.0)
    run = scene.run("rk4", every=1)
    assert printed["last_y"] == run.y[-1]
    assert printed["largest_state_error"] == scene.state_error(run).max()
    assert scene_with("kepler:e=0.5", []).v.tolist() == scene_with("kepler", ["e=0.5"]).v.tolist()
    printed = report(capsys, "oscillator", "--method", "rk4", "--set", "damping=0.1", "--set", "y=2", "--steps", "40")
    scene = sw.scenes.oscillator()
    run = sw.integrate(sw.Oscillator(1.0, 0.1), "rk4", v=0.0, y=2.0, dt=scene.dt, steps=40)
    assert printed["last_y"] == run.y[-1]
    assert "largest_state_error" not in printed, "the exact solution is that of another system"
    moved = scene_with("kepler", ["y=1,0,-1,0"])
    assert moved.y.tolist() == [[1.0, 0.0], [-1.0, 0.0]]
    assert moved.exact is None


#: Wrong settings, and what is said of them.
SETTINGS = [
    ("omega", "--set: expected NAME=VALUE, such as omega=3, got 'omega'"),
    ("=3", "--set: expected NAME=VALUE"),
    ("omgea=3", "--set: oscillator has no 'omgea'; known: omega, "),
    ("omega=-1", "omega: expected 1e-100 to 1e+100 rad per unit of time"),
    ("omega=x", "omega: expected"),
    ("y=1,2", "--set: expected y as one number, or as numbers of shape (), got '1,2'"),
    ("y=x", "--set: expected y as one number"),
    ("damping=nan", "--set: expected finite numbers"),
]


def test_form_and_start_are_those_of_integrate_and_wrong_settings_are_one_line(capsys: Any) -> None:
    for setting, message in SETTINGS:
        said = commands.complaint(capsys, "run", "oscillator", "--method", "rk4", "--set", setting)
        assert message in said
        assert said.count("\n") == 1, setting
    scene = sw.scenes.oscillator()
    printed = report(capsys, "oscillator", "--method", "rk4", "--form", "matrix", "--steps", "50")
    assert printed["last_y"] == scene.run("rk4", steps=50, every=1, form="matrix").y[-1]
    printed = report(capsys, "oscillator", "--method", "verlet", "--start", "first_order", "--steps", "50")
    assert printed["last_y"] == scene.run("verlet", steps=50, start="first_order").y[-1]
    assert printed["last_y"] != scene.run("verlet", steps=50).y[-1]


VERDICTS = [
    (("oscillator", "--method", "false_euler", "--dt", "3", "--steps", "24"), "grew by 10²⁰: unstable"),
    (("oscillator", "--method", "standard_euler"), "grew by 10⁴: unstable"),
    (("oscillator", "--method", "rk4"), "bounded; the state error is at most 0.0"),
    (("oscillator", "--method", "false_euler", "--dt", "1.9"), "bounded, but wrong: the state error is up to "),
    (("plummer", "--method", "leapfrog", "--steps", "3"), "finite to the end; the error is unknown"),
    (("oscillator", "--method", "false_euler", "--dt", "30", "--steps", "400"), "diverged at step "),
]


@pytest.mark.filterwarnings("ignore")
def test_the_verdict_is_in_words(capsys: Any) -> None:
    for words, beginning in VERDICTS:
        code, out, _ = commands.run_command(capsys, "run", *words)
        assert code == 0
        (said,) = [line.partition("verdict")[2].strip() for line in out.splitlines() if line.startswith("verdict")]
        assert said.startswith(beginning), words
        assert "None" not in out


def test_growth_is_against_the_true_motion() -> None:
    """By False Euler at Φ = 3 the eigenvalues are −(7 ± √45)/2, so y grows by 6.854 a step."""
    scene = sw.scenes.oscillator()
    run = scene.run("false_euler", 3.0, steps=24, every=1)
    picture = charts.run_picture(scene, run)
    growth, known = growth_of(picture)
    assert known
    radius = (7.0 + 45.0**0.5) / 2.0
    # After n steps y = c·radiusⁿ, but for what the other eigenvalue, 1/radius, adds: of the size of radius⁻²ⁿ.
    assert growth == pytest.approx(abs(run.y[1:]).max(), rel=0.2)
    assert abs(run.y[-1] / run.y[-2]) == pytest.approx(radius, rel=1e-12)
    assert verdict(picture) == f"grew by {tenfold(growth)}: unstable"
    assert (tenfold(1.2e20), tenfold(387.0), tenfold(9.9e19)) == ("10²⁰", "a factor of 387", "10²⁰")


def test_a_tolerance_that_stops_says_so_and_many_numbers_do_not_fill_the_screen(capsys: Any) -> None:
    scene = sw.scenes.kepler()
    at = np.linspace(0.0, scene.horizon, 11)
    with pytest.warns(sw.ToleranceWarning):
        run = sw.integrate(scene.system, "merson", v=scene.v, y=scene.y, tolerance=1e-8, at=at, max_steps=30)
    assert "reached the largest number of steps allowed" in verdict(charts.run_picture(scene, run))
    _, out, _ = commands.run_command(capsys, "run", "plummer", "--method", "leapfrog", "--steps", "3")
    assert max(map(len, out.splitlines())) < 120
    assert "last y                64 × 3 numbers; -o FILE writes them" in out
