"""The chart of energy and state against the gain: its numbers are those of single runs, what diverges is told, and it draws."""

import dataclasses
import itertools
import math
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.errors import ArgumentError, DTypeError, ShapeError, UnknownNameError
from stepwell.views.charts import ControlSweep, control_picture
from support import ROOT, charted
from support.commands import complaint, listed, printed
from support.refusals import refused

from benches import control_study

GAINS = (1e-3, 1e-1, 10.0)
EIGHT = sw.scenes.figure_eight()
ROD: dict[str, Any] = {"scene": "conical_pendulum"}
KINDS = ("none", "limited", "printed", "scaling", "nacozy")


@pytest.fixture(scope="module")
def chart() -> ControlSweep:
    methods = ["standard_euler", "leapfrog", "rk4"]
    return sw.charts.control(EIGHT, methods, horizon=EIGHT.period, evaluations=800, relative=GAINS)


def test_all_methods_ask_for_rates_equally_often_and_what_cannot_be_controlled_is_told(chart: ControlSweep) -> None:
    assert {(line.method.name, line.steps) for line in chart.lines} == {("standard_euler", 800), ("leapfrog", 800), ("rk4", 200)}
    assert all(line.dt * line.steps == pytest.approx(EIGHT.period, rel=1e-15) for line in chart.lines)
    assert chart.line("leapfrog", "none").state_error < 0.1
    assert set(chart.refused) == {("leapfrog", kind) for kind in KINDS[1:]}
    assert "leapfrog carries v_half in place of v" in chart.refused["leapfrog", "limited"]
    refused(UnknownNameError, "kind: there is no 'limited'", chart.line, "leapfrog", "limited")


def test_numbers_are_those_of_single_runs(chart: ControlSweep) -> None:
    """The start is the exact end after one period; lengths are of all bodies together, at their largest on the orbit."""
    assert EIGHT.exact is not None
    for kind, (i, gain) in itertools.product(KINDS, enumerate(GAINS)):
        line = chart.line("rk4", kind)
        if i >= len(line.relative):
            continue
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
    rows, whole = charted.files_of(chart, tmp_path)
    # Two methods with two forms of three gains and three single runs, and one method with a single run.
    assert len(rows) == len(chart.rows()) == 2 * (2 * 3 + 3) + 1
    read = [float(row["state_error"]) for row in rows if (row["method"], row["kind"]) == ("rk4", "limited")]
    assert read == chart.line("rk4", "limited").state_error.tolist()
    assert (len(whole["rows"]), len(whole["refused"])) == (len(rows), 4)
    assert [row["kind"] for row in whole["summary"]] == [line.kind for line in chart.lines]
    figure = charted.drawn(chart, tmp_path)
    names = ["largest |E − E₀| / K₀", "error of the last state, relative"]
    assert [axes.get_ylabel() for axes in figure.axes[:2]] == names
    assert [axes.get_title(loc="left") for axes in figure.axes[2:]] == [f"{name}: before and after" for name in names]
    # The mark before is that of the run without control, and the mark after the median of the gains that did not diverge.
    marks = {
        (float(line.get_xdata()[0]), float(line.get_ydata()[0]))  # type: ignore[index]
        for line in figure.axes[2].lines
        if len(line.get_xdata()) == 1  # type: ignore[arg-type]
    }
    methods = list(dict.fromkeys(line.method.name for line in chart.lines))
    assert [text.get_text() for text in figure.axes[2].texts] == ["with control", "without"]
    for row, method in enumerate(methods):
        assert (float(chart.line(method, "none").energy_error[0]), float(row)) in marks
        if method != "leapfrog":
            errors = chart.line(method, "limited").energy_error
            assert (float(np.median(errors[np.isfinite(errors)])), float(row)) in marks


def test_the_title_says_what_control_changes() -> None:
    """Standard Euler drives the energy up without control (§5); a wrong title would count the gains that diverged as better."""
    chart = sw.charts.control(
        "energy_control", ["standard_euler", "false_euler"], horizon=1000.0, evaluations=100_000, relative=GAINS
    )
    factors = []
    for name in ("standard_euler", "false_euler"):
        errors = chart.line(name, "limited").energy_error
        factors.append(chart.line(name, "none").energy_error[0] / np.median(errors[np.isfinite(errors)]))
    assert min(factors) > control_picture.HELPS
    # Over 20 units of time it has not yet grown, and control is no help: a title that is always the same would be wrong there.
    short = sw.charts.control("energy_control", ["standard_euler"], horizon=20.0, evaluations=2000, relative=GAINS)
    assert "energy control does not help Standard Euler" in short.plot().texts[0].get_text()
    words = [f"{name} (÷{factor:.2g})" for name, factor in zip(("Standard Euler", "False Euler"), factors, strict=True)]
    order = words if factors[0] > factors[1] else words[::-1]
    assert chart.plot().texts[0].get_text() == f"{chart.title}: energy control helps {' and '.join(order)}"
    assert control_picture.finding(dataclasses.replace(chart, lines=())) == "energy and state under control"
    none = sw.charts.control(
        "energy_control", ["rk4"], ways=["scaling"], forms=[], horizon=20.0, evaluations=2000, relative=GAINS
    )
    assert none.plot().texts[0].get_text().endswith(": energy and state under control")


def test_what_diverged_is_drawn_above_the_frame_and_summed_up() -> None:
    """Printed with h·C·K = 10 multiplies ΔE by −19 in a step."""
    chart = sw.charts.control("energy_control", ["standard_euler"], horizon=20.0, evaluations=2000, relative=GAINS)
    line = chart.line("standard_euler", "printed")
    assert line.diverged.tolist() == [False, False, True]
    summary = next(row for row in chart.summary() if row["kind"] == "printed")
    assert (summary["diverged"], summary["diverged_from"]) == (1, 10.0)
    figure = chart.plot()
    for axes in figure.axes[:2]:
        above = [
            each for each in axes.lines if np.size(each.get_ydata()) and np.max(each.get_ydata()) > 1 and not each.get_clip_on()
        ]
        assert [each.get_xdata().tolist() for each in above] == [[10.0]]  # type: ignore[union-attr]
    assert figure.axes[1].get_ylabel() == "largest coordinate"


def test_bad_arguments_are_named() -> None:
    for arguments, error, message in (
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
        # With rods.
        (ROD | {"forms": ["limited"]}, ArgumentError, "forms: there is no 'limited'"),
        (ROD | {"ways": ["scaling"]}, ArgumentError, "ways: there is no 'scaling'"),
        (ROD | {"evaluations": []}, ArgumentError, "evaluations: expected one number or several, got none"),
        (ROD | {"evaluations": [100, 0]}, ArgumentError, "evaluations: expected 1 or more"),
        (ROD | {"evaluations": "many"}, ArgumentError, "evaluations: expected a whole number"),
        ({"scene": sw.Pendulum3D()}, ArgumentError, "v: expected it beside a Pendulum3D system"),
    ):
        refused(error, message, sw.charts.control, **({"scene": EIGHT} | arguments))


def test_the_report_is_current_and_what_it_concludes_is_true() -> None:
    """One table of it, which every change of a method, of a control or of a projection would move."""
    report = (ROOT / "benches" / "CONTROL.md").read_text(encoding="utf-8")
    assert control_study.orders() in report
    # Projection makes RK4 better, and Heun under control is better than Heun projected, by at least so much.
    options: dict[str, Any] = {"horizon": 21.0 * math.pi, "evaluations": 21_000, "relative": [1.0], "forms": ["limited"]}
    for e, rk4, heun in ((0.0, 1.5, 7.0), (0.3, 1.5, 7.0), (0.6, 3.0, 60.0)):
        chart = sw.charts.control(sw.scenes.kepler(e), ["standard_heun", "rk4"], **options)
        free, scaled = (chart.line("rk4", kind) for kind in ("none", "scaling"))
        assert free.state_error > rk4 * scaled.state_error
        assert free.energy_error > 1e3 * scaled.energy_error
        limited, scaled = (chart.line("standard_heun", kind) for kind in ("limited", "scaling"))
        assert scaled.state_error > heun * limited.state_error
        assert scaled.energy_error < 1e-9 * limited.energy_error
    scene = sw.scenes.kepler()
    moments = []
    for control in (None, sw.Projection()):
        run = scene.run("false_euler", dt=1e-3, every=100, control=control)
        r, u = run.y[:, 1] - run.y[:, 0], run.v[:, 1] - run.v[:, 0]
        moments.append(np.ptp(r[:, 0] * u[:, 1] - r[:, 1] * u[:, 0]))
    # Kicks go along r and drifts along v, so r × v is kept to rounding, 20 000 times 1e-16 of 0.44.
    assert moments[0] < 1e-11
    assert moments[1] > 1e-3


C = (0.05, 0.5, 3.0)


@pytest.fixture(scope="module")
def cone() -> ControlSweep:
    return sw.charts.control("conical_pendulum", ["false_euler", "rk4", "pefrl"], relative=C, evaluations=[2400, 600])


def test_numbers_of_rods_are_those_of_single_runs(cone: ControlSweep) -> None:
    scene = sw.scenes.conical_pendulum()
    assert cone.evaluations == (600, 2400)
    ways = (("false_euler", 600), ("rk4", 2400))
    for (method, evaluations), kind in itertools.product(ways, ("none", "control", "length")):
        line = cone.line(method, kind, evaluations)
        assert line.steps == 600
        assert line.dt == scene.horizon / 600
        for i, gain in enumerate(line.relative):
            control: Any = {"none": None, "length": sw.Projection("length")}.get(kind)
            if kind == "control":
                control = sw.LengthControl(gain)
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                run = scene.run(method, line.dt, every=1, control=control, record="length_error")
            if run.status:
                assert line.first_bad_step[i] == run.first_bad_step
                assert line.state_error[i] == line.length_error[i] == math.inf
                continue
            assert line.state_error[i] == pytest.approx(scene.state_error(run)[-1], rel=1e-12, abs=1e-15)
            assert line.length_error[i] == run.recorded["length_error"].max()
            kinetic = 0.5 * (scene.v**2).sum()
            assert line.energy_error[i] == pytest.approx(np.abs(run.energy - run.energy[0]).max() / kinetic, rel=1e-9)


def test_the_document_s_question_is_answered(cone: ControlSweep) -> None:
    """§12 supposes that control is better than resetting. For False Euler it is, at every gain below its limit; not for RK4."""
    assert cone.better == {"false_euler": (True, True), "rk4": (False, False)}
    assert cone.answer == (
        "Rods under control, or reset after every step: control is better for False Euler; resetting is better for Runge-Kutta 4"
    )
    for evaluations in cone.evaluations:
        controlled, reset = (cone.line("false_euler", kind, evaluations) for kind in ("control", "length"))
        assert (controlled.state_error[:2] < reset.state_error).all()
        assert controlled.diverged.tolist() == [False, False, True]
        assert reset.length_error < 1e-15
    assert set(cone.refused) == {("pefrl", kind) for kind in ("none", "control", "length")}
    refused(ArgumentError, r"evaluations: expected one of \[600, 2400\], got 7", cone.line, "rk4", "control", 7)


def test_the_answer_is_that_of_most_gains() -> None:
    """Exchanged results give the exchanged answer, and a mixture says that it depends."""
    chart = sw.charts.control("conical_pendulum", ["false_euler"], relative=[0.3, 0.5], evaluations=[600, 1200])
    lines = list(chart.lines)
    where = {(line.kind, line.steps): i for i, line in enumerate(lines)}
    i, j = where["control", 600], where["length", 600]
    swapped = dataclasses.replace(lines[j], state_error=lines[j].state_error * 1e-9)
    lines[j] = swapped
    mixed = dataclasses.replace(chart, lines=tuple(lines))
    assert mixed.better == {"false_euler": (False, True)}
    assert mixed.answer.endswith("for False Euler it depends on the step")
    assert i != j


def test_rods_from_rest_are_measured_against_a_tight_run() -> None:
    """At rest there is no kinetic energy: the largest of the true motion is the scale. Without one there is no state error."""
    chart = sw.charts.control("double_pendulum", ["rk4"], horizon=3.0, evaluations=600, relative=[0.5])
    assert chart.exact
    assert chart.line("rk4", "length").state_error < 1e-3
    assert chart.line("rk4", "length").energy_error < 1e-3
    pendulum: dict[str, Any] = {"v": [0.0, 0.5, 0.0], "y": [1.0, 0.0, 0.0], "horizon": 5.0, "evaluations": 500, "relative": [0.5]}
    unknown = sw.charts.control(sw.Pendulum3D(), ["rk4"], **pendulum)
    assert np.isnan(unknown.line("rk4", "control").state_error).all()
    assert (unknown.better, unknown.answer) == ({}, "")
    assert unknown.plot().axes[0].get_ylabel() == "largest |E − E₀|, relative"


def test_files_and_the_picture_of_rods(cone: ControlSweep, tmp_path: Path) -> None:
    rows, whole = charted.files_of(cone, tmp_path)
    # Two methods with two steps: three gains, and two single runs.
    assert len(rows) == 2 * 2 * (3 + 2)
    read = [float(row["length_error"]) for row in rows if (row["method"], row["kind"]) == ("rk4", "control")]
    assert read == [*cone.line("rk4", "control", 600).length_error, *cone.line("rk4", "control", 2400).length_error]
    assert (whole["answer"], whole["evaluations"]) == (cone.answer, [600, 2400])
    assert whole["better"] == {"false_euler": [True, True], "rk4": [False, False]}
    figure = charted.drawn(cone, tmp_path)
    assert cone.answer in " ".join(text.get_text() for text in figure.texts)
    above, below = figure.axes[0], figure.axes[2]
    assert (above.get_ylabel(), below.get_ylabel()) == ("error of the last state, relative", "largest error of a length")
    # Resetting is a level line above, and is not drawn below; what diverged is above the frame.
    level = [line for line in above.lines if np.ptp(np.asarray(line.get_ydata(), dtype=float)) == 0 and line.get_clip_on()]
    assert [float(np.asarray(line.get_ydata())[0]) for line in level] == [
        cone.line(name, "length", 600).state_error[0] for name in ("false_euler", "rk4")
    ]
    lost = [line for line in above.lines if not line.get_clip_on()]
    assert [np.asarray(line.get_xdata()).tolist() for line in lost] == [[3.0], [3.0]]


def test_the_command_line_makes_the_chart(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["control", "conical_pendulum", "-o", str(tmp_path), "--methods", "false_euler,rk4", "--gains", "0.1,0.5"]
    report = listed(capsys, *words, "--evaluations", "600")
    assert report["answer"].endswith("control is better for False Euler; resetting is better for Runge-Kutta 4")
    assert all(Path(file).stat().st_size > 100 for file in report["files"])
    assert [row["kind"] for row in report["summary"]] == ["none", "control", "length"] * 2
    assert "control is better for False Euler" in printed(capsys, *words, "--evaluations", "300")
    said = complaint(capsys, "control", "conical_pendulum", "--gains", "0.1;2", "-o", str(tmp_path))
    assert "--gains: expected numbers with commas between them" in said
