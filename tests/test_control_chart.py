"""The chart of energy and state against the gain: its numbers are those of single runs, what diverges is told, and it draws."""

from __future__ import annotations

import csv
import json
import math
import sys
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.charts import ControlSweep
from stepwell.errors import ArgumentError, DTypeError, ShapeError, UnknownNameError

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT))

from benches import control_study  # noqa: E402

GAINS = (1e-3, 1e-1, 10.0)
EIGHT = sw.scenes.figure_eight()
KINDS = ("none", "limited", "printed", "scaling", "nacozy")


@pytest.fixture(scope="module")
def chart() -> ControlSweep:
    methods = ["standard_euler", "leapfrog", "rk4"]
    return sw.charts.control(EIGHT, methods, horizon=EIGHT.period, evaluations=800, relative=GAINS)


def test_all_methods_ask_for_rates_equally_often(chart: ControlSweep) -> None:
    assert {(line.method.name, line.steps) for line in chart.lines} == {("standard_euler", 800), ("leapfrog", 800), ("rk4", 200)}
    assert all(line.dt * line.steps == pytest.approx(EIGHT.period, rel=1e-15) for line in chart.lines)


@pytest.mark.parametrize("kind", KINDS)
def test_numbers_are_those_of_single_runs(chart: ControlSweep, kind: str) -> None:
    """The start is the exact end after one period; lengths are of all bodies together, at their largest on the orbit."""
    line = chart.line("rk4", kind)
    assert EIGHT.exact is not None
    for i, gain in enumerate(line.relative):
        control: Any = None
        if kind in ("limited", "printed"):
            control = sw.EnergyControl(relative=gain, form=kind)
        elif kind != "none":
            control = sw.Projection(kind)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            run = sw.integrate(EIGHT.system, "rk4", v=EIGHT.v, y=EIGHT.y, dt=line.dt, steps=line.steps, every=1, control=control)
        if run.status:
            assert line.first_bad_step[i] == run.first_bad_step
            assert line.state_error[i] == line.energy_error[i] == line.largest[i] == math.inf
            continue
        blocks = zip((run.v[-1], run.y[-1]), (EIGHT.v, EIGHT.y), EIGHT.scales, strict=True)
        errors = [np.linalg.norm(block - true) / scale for block, true, scale in blocks]
        # The scales are those of other samples of the orbit, whose largest differ by far less than a ten-thousandth.
        assert line.state_error[i] == pytest.approx(max(errors), rel=1e-4, abs=1e-12)
        kinetic = 0.5 * (EIGHT.v**2).sum()
        assert line.energy_error[i] == pytest.approx(np.abs(run.energy - run.energy[0]).max() / kinetic, rel=1e-12, abs=1e-15)
        assert line.largest[i] == np.abs(run.y).max()
        assert line.first_bad_step[i] == -1


def test_what_cannot_be_controlled_is_told(chart: ControlSweep) -> None:
    assert chart.line("leapfrog", "none").state_error < 0.1
    assert set(chart.refused) == {("leapfrog", kind) for kind in KINDS[1:]}
    assert "energy control" in chart.refused["leapfrog", "limited"]
    with pytest.raises(UnknownNameError, match="kind: there is no 'limited'"):
        chart.line("leapfrog", "limited")


def test_projection_is_the_limit_of_a_strong_control_for_euler() -> None:
    """A control of infinite gain scales the velocities onto the energy before the step, a projection after it."""
    scene = sw.scenes.kepler(0.3)
    chart = sw.charts.control(scene, ["standard_euler"], evaluations=20_000, relative=[1e6], forms=["limited"])
    strong, scaled = (chart.line("standard_euler", kind).state_error[0] for kind in ("limited", "scaling"))
    # Both end within one push of each other, whose size is what one step adds to E, of the order h = 1e-3.
    assert strong == pytest.approx(scaled, rel=0.05)
    assert chart.line("standard_euler", "none").state_error[0] > 2 * scaled


def test_bodies_of_ones_own() -> None:
    """An NBody system with its start, and the exact end as two blocks."""
    bodies = sw.NBody([0.5, 0.5], force="newton")
    v, y = np.array([[0.0, -0.5], [0.0, 0.5]]), np.array([[-0.5, 0.0], [0.5, 0.0]])
    start: dict[str, Any] = {"v": v, "y": y, "horizon": 2 * math.pi, "evaluations": 400, "relative": 0.1}
    chart = sw.charts.control(bodies, ["rk4"], **start, exact=(v, y))
    assert chart.title == repr(chart.system)
    # RK4 with 100 steps a turn turns by Φ⁴/120 of the angle too little, 2π·(2π/100)⁴/120 = 8e-7, and loses energy of that order.
    assert chart.line("rk4", "none").state_error < 1e-5
    unknown = sw.charts.control(bodies, ["rk4"], **start)
    assert not unknown.exact
    assert np.isnan(unknown.line("rk4", "scaling").state_error).all()
    np.testing.assert_array_equal(unknown.line("rk4", "scaling").largest, chart.line("rk4", "scaling").largest)


def test_files_and_pictures(chart: ControlSweep, tmp_path: Path) -> None:
    chart.to_csv(tmp_path / "c.csv")
    with (tmp_path / "c.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    # Two methods with two forms of three gains and three single runs, and one method with a single run.
    assert len(rows) == len(chart.rows()) == 2 * (2 * 3 + 3) + 1
    read = [float(row["state_error"]) for row in rows if (row["method"], row["kind"]) == ("rk4", "limited")]
    assert read == chart.line("rk4", "limited").state_error.tolist()
    chart.to_json(tmp_path / "c.json")
    whole = json.loads((tmp_path / "c.json").read_text(encoding="utf-8"))
    assert len(whole["rows"]) == len(rows)
    assert len(whole["refused"]) == 4
    assert [row["kind"] for row in whole["summary"]] == [line.kind for line in chart.lines]
    figure = chart.plot(tmp_path / "c.png")
    assert (tmp_path / "c.png").stat().st_size > 10_000
    assert [axes.get_ylabel() for axes in figure.axes] == ["largest |E − E₀| / K₀", "error of the last state, relative"]


def test_what_diverged_is_drawn_above_the_frame_and_summed_up() -> None:
    """Printed with h·C·K = 10 multiplies ΔE by −19 in a step."""
    chart = sw.charts.control("energy_control", ["standard_euler"], horizon=20.0, evaluations=2000, relative=GAINS)
    line = chart.line("standard_euler", "printed")
    assert line.diverged.tolist() == [False, False, True]
    told = next(row for row in chart.summary() if row["kind"] == "printed")
    assert (told["diverged"], told["diverged_from"]) == (1, 10.0)
    figure = chart.plot()
    for axes in figure.axes:
        above = [
            each for each in axes.lines if np.size(each.get_ydata()) and np.max(each.get_ydata()) > 1 and not each.get_clip_on()
        ]
        assert [each.get_xdata().tolist() for each in above] == [[10.0]]  # type: ignore[union-attr]
    assert figure.axes[1].get_ylabel() == "largest coordinate"


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ({"scene": "oscillator"}, DTypeError, "scene: expected a scene of bodies"),
        ({"scene": "figure_seven"}, UnknownNameError, "scene: there is no 'figure_seven'"),
        ({"scene": sw.NBody()}, ArgumentError, "v: expected it beside an NBody system"),
        ({"methods": "rk4"}, DTypeError, "methods: expected a list of names"),
        ({"methods": []}, ArgumentError, "methods: expected at least one"),
        ({"relative": [0.1, 0.0]}, ArgumentError, "relative: expected numbers above zero"),
        ({"relative": []}, ShapeError, "relative: expected gains of shape"),
        ({"forms": ["tight"]}, UnknownNameError, "forms: there is no 'tight'"),
        ({"ways": ["nacosy"]}, UnknownNameError, "ways: there is no 'nacosy'; did you mean 'nacozy'"),
        ({"horizon": -1.0}, ArgumentError, "horizon"),
        ({"evaluations": 0}, ArgumentError, "evaluations: expected 1 or more"),
        ({"v": 0.0}, ArgumentError, "v: a start at rest has no kinetic energy"),
        ({"y": np.ones((3, 2, 4))}, ShapeError, "scene: expected one start"),
    ],
)
def test_bad_arguments_are_named(arguments: dict[str, Any], error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        sw.charts.control(**({"scene": "figure_eight"} | arguments))


# ---- the study


def test_the_report_is_current() -> None:
    """One table of it, which every change of a method, of a control or of a projection would move."""
    report = (ROOT / "benches" / "CONTROL.md").read_text(encoding="utf-8")
    assert control_study.orders() in report


@pytest.mark.parametrize(("e", "rk4", "heun"), [(0.0, 1.5, 7.0), (0.3, 1.5, 7.0), (0.6, 3.0, 60.0)])
def test_what_the_report_concludes(e: float, rk4: float, heun: float) -> None:
    """Projection makes RK4 better, and Heun under control is better than Heun projected, by at least so much."""
    options: dict[str, Any] = {"horizon": 21.0 * math.pi, "evaluations": 21_000, "relative": [1.0], "forms": ["limited"]}
    chart = sw.charts.control(sw.scenes.kepler(e), ["standard_heun", "rk4"], **options)
    assert chart.line("rk4", "none").state_error > rk4 * chart.line("rk4", "scaling").state_error
    assert chart.line("rk4", "none").energy_error > 1e3 * chart.line("rk4", "scaling").energy_error
    assert chart.line("standard_heun", "scaling").state_error > heun * chart.line("standard_heun", "limited").state_error
    assert chart.line("standard_heun", "scaling").energy_error < 1e-9 * chart.line("standard_heun", "limited").energy_error


def test_false_euler_keeps_what_scaling_breaks() -> None:
    scene = sw.scenes.kepler()
    moments = []
    for control in (None, sw.Projection()):
        run = scene.run("false_euler", dt=1e-3, every=100, control=control)
        r, u = run.y[:, 1] - run.y[:, 0], run.v[:, 1] - run.v[:, 0]
        moments.append(np.ptp(r[:, 0] * u[:, 1] - r[:, 1] * u[:, 0]))
    # Kicks go along r and drifts along v, so r × v is kept to rounding, 20 000 times 1e-16 of 0.44.
    assert moments[0] < 1e-11
    assert moments[1] > 1e-3
