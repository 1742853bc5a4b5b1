"""Work-precision charts: peers, the panel, what is refused, files and the picture; of all scenes in test_charts.py."""

import itertools
import math
import sys
from dataclasses import replace

import numpy as np
import pytest
import stepwell as sw
from stepwell.base import tables
from stepwell.errors import ArgumentError, DTypeError, UnknownNameError, UnsupportedError
from stepwell.studies.measuring import data, measure, peers, timing
from stepwell.views.charts import style
from support.charted import METHODS, _hasty_times, drawn, files_of, read, the_small  # noqa: F401
from support.refusals import refused


def perfect(scene, times, tolerance):
    """A peer that knows the solution and misses it by the tolerance."""
    v, y = scene.exact(times)
    return peers.Solved(v, y + tolerance, round(-100 * math.log10(tolerance)), 1e-3)


def test_a_peer_is_on_the_same_axes(tmp_path):
    def cannot(scene, times, setting):
        raise UnsupportedError("it has no springs")

    coarse = peers.Peer("in steps", perfect, (0.01, 0.1), by="step")
    chart = sw.charts.work_precision("oscillator", ["rk4"], [100, 200], tolerances=[], peers=[perfect, coarse, cannot])
    assert [curve.name for curve in chart.curves] == ["rk4", "perfect", "in steps"]
    assert chart.refused == {"cannot": "it has no springs"}
    curve = chart.curves[1]
    assert [point.tolerance for point in curve.points] == list(peers.TOLERANCES)
    for point in curve.points:
        assert point.state_error == pytest.approx(point.tolerance, rel=1e-3)
        assert point.cost == round(-100 * math.log10(point.tolerance)) / chart.scene.horizon
    assert curve.time(0, "single").median == pytest.approx(1e6 / chart.scene.horizon)
    assert [point.dt for point in chart.curves[2].points] == [0.1, 0.01]
    assert {row["method"] for row in chart.front()} >= {"perfect"}
    drawn(chart, tmp_path, time="single", error="end_error")
    files_of(chart, tmp_path)


def test_a_peer_that_is_not_installed_says_so(monkeypatch):
    for module, make in (("scipy.integrate", peers.scipy), ("heyoka", peers.heyoka), ("rebound", peers.rebound)):
        monkeypatch.setitem(sys.modules, module, None)
        name = module.split(".")[0]
        refused(UnsupportedError, f"peers: {name} is not installed; pip install {name}", make)


@pytest.mark.parametrize(
    ("package", "make", "scene"),
    [
        ("scipy", lambda: peers.scipy("DOP853", (1e-4, 1e-10)), "oscillator"),
        ("rebound", lambda: peers.rebound("bs", (1e-4, 1e-10)), "figure_eight"),
        pytest.param("scipy", lambda: peers.scipy("RK45", (1e-4, 1e-10)), "figure_eight", marks=pytest.mark.long),
        ("heyoka", lambda: peers.heyoka((1e-4, 1e-10)), "chain"),
        pytest.param("heyoka", lambda: peers.heyoka((1e-4, 1e-10)), "figure_eight", marks=pytest.mark.long),
        pytest.param("rebound", lambda: peers.rebound("leapfrog", (0.1, 0.001)), "figure_eight", marks=pytest.mark.long),
    ],
)
def test_a_real_peer_solves_the_scene(package, make, scene):
    pytest.importorskip(package)
    curve = sw.charts.work_precision(scene, ["rk4"], [400], tolerances=[], peers=[make()]).curves[-1]
    coarse, fine = curve.points
    assert fine.state_error < min(1e-3, 0.1 * coarse.state_error)
    assert fine.cost >= coarse.cost > 0


def test_the_energy_error_is_never_alone(tmp_path):
    """Beside the curves of the energy error are those of the state error, in a picture of one scene and in a panel."""
    panel = sw.charts.panel(["clover", "oscillator"], methods=["false_euler", "rk4"], steps=[100, 400, 1600], tolerances=[])
    for shown, charts in ((panel, panel.charts), (panel.charts[0], panel.charts[:1])):
        figure = shown.plot(tmp_path / "energy.png", error="energy_error")
        for chart, kind in itertools.product(charts, ("energy_error", "state_error")):
            for curve in chart.curves:
                wanted = [point.error(kind) if point.usable else math.nan for point in curve.points]
                drawn = [line for axes in figure.axes for line in axes.lines if list(line.get_xdata()) == curve.costs()]
                assert any(np.array_equal(line.get_ydata(), wanted, equal_nan=True) for line in drawn), (kind, curve.name)
        words = [*(text.get_text() for text in figure.texts), *(axes.get_ylabel() for axes in figure.axes)]
        for kind in ("energy", "state"):
            assert f"largest {kind} error of the run, relative" in " ".join(words).replace("\n", " ")


def test_a_panel_is_its_charts(tmp_path):
    names = ["oscillator", "clover", "chain", "kepler"]
    panel = sw.charts.panel(names, methods=["rk4", "merson"], steps=[400, 4000], tolerances=[1e-3, 1e-6])
    assert [chart.scene.name for chart in panel.charts] == names
    figure = panel.plot(tmp_path / "panel.png")
    assert [axes.get_title(loc="left").strip() for axes in figure.axes] == [chart.scene.title for chart in panel.charts]
    assert not figure.legends
    for axes, chart in zip(figure.axes, panel.charts, strict=True):
        named = {text.get_text().replace("\n", ", ") for text in axes.texts}
        leading = {row["method"] for row in chart.front()}
        assert named >= {curve.title for curve in chart.curves if curve.name in leading}
    rows, whole = files_of(panel, tmp_path)
    assert len(rows) == len(panel.rows()) == sum(len(chart.rows()) for chart in panel.charts)
    assert [len(each["front"]) for each in whole] == [len(chart.front()) for chart in panel.charts]
    refused(ArgumentError, "scenes: expected at least one, got none", sw.charts.panel, [])
    refused(DTypeError, "scenes: expected a list of scenes", sw.charts.panel, "clover")


def test_implicit_methods_are_left_out_where_they_would_take_most_of_an_hour(monkeypatch):
    """Of 23 bodies in space, 138 numbers, all are; of 21, 126 numbers, or if they are named, none is. No step is made."""
    point = data.Point(steps=4, dt=1.0, cost=1.0, state_error=0.5, energy_error=0.0, unstable=False)
    monkeypatch.setattr(measure, "assess", lambda *_: point)
    monkeypatch.setattr(measure, "largest_stable_step", lambda *_: math.inf)
    monkeypatch.setattr(
        timing, "step_times", lambda scene, able, *_: {method.name: data.Timing(1.0, 1.0, 1.0) for method in able}
    )
    implicit = {each.name for each in sw.methods() if each.is_implicit}

    def left_out(bodies: int, methods: list[str] | None) -> dict[str, str]:
        scene = sw.scenes.plummer(bodies)
        return sw.charts.work_precision(replace(scene, horizon=4 * scene.dt), methods, [4], tolerances=[]).refused

    many = left_out(23, None)
    assert set(many) & implicit == implicit
    assert many["rodas5p"] == "each step solves equations in 138 unknowns: name rodas5p in methods= to chart it"
    assert not set(left_out(21, None)) & implicit
    assert left_out(23, ["rodas5p"]) == {}


def test_a_refused_method_is_named_with_the_reason(small, tmp_path):
    assert [curve.name for curve in small.curves] == ["false_euler", "rk4"]
    assert list(small.refused) == ["verlet"]
    assert "has damping" in small.refused["verlet"]
    small.to_csv(tmp_path / "chart.csv")
    refused = [row for row in read(tmp_path / "chart.csv") if row["refused"]]
    assert [(row["method"], row["refused"], row["cost"]) for row in refused] == [("verlet", small.refused["verlet"], "")]
    said = " ".join(text.get_text() for text in small.plot().texts).replace("\n", " ")
    assert "Not applicable: Verlet (needs forces that do not depend on the velocity; here: damping)." in said
    # One that only refuses can still be drawn and written.
    chart = sw.charts.work_precision("forced_oscillator", ["verlet"], [100])
    assert (chart.curves, chart.summary()) == ((), [])
    chart.plot(tmp_path / "chart.png")
    chart.to_csv(tmp_path / "chart.csv")
    assert "verlet" in (tmp_path / "chart.csv").read_text(encoding="utf-8")


def test_what_cannot_be_charted_is_said(small, tmp_path):
    for arguments, error, message in (
        (("clovr",), UnknownNameError, "did you mean 'clover'"),
        ((3,), DTypeError, "scene: expected a Scene or its name, got int"),
        (("clover", ["rk44"]), UnknownNameError, "did you mean 'rk4'"),
        (("clover", "rk4"), DTypeError, "methods: expected a list of names, got 'rk4'"),
        (("clover", []), ArgumentError, "methods: expected at least one, got none"),
        (("clover", None, []), ArgumentError, "steps: expected at least one, got none"),
        (("clover", None, [3]), ArgumentError, "steps: expected 4 or more"),
        (("clover", None, [4.5]), DTypeError, "steps: expected a whole number"),
    ):
        refused(error, message, sw.charts.work_precision, *arguments)
    refused(ArgumentError, "tolerances: expected", sw.charts.work_precision, "clover", tolerances=[0.0])
    refused(UnknownNameError, "fused: there is no 'all'", sw.charts.work_precision, "oscillator", fused="all")
    refused(ArgumentError, "expected an ending of a picture", small.plot, tmp_path / "chart.docx")


def test_the_measured_columns_are_those_of_the_counted_step_and_the_json_is_whole(small, tmp_path):
    for curve in small.curves:
        rows = [row for row in small.rows() if row["method"] == curve.name]
        for row, point in zip(rows, curve.points, strict=True):
            assert row["measured_ns_per_time_median"] == curve.step_time.median / point.dt
            assert row["measured_ns_per_time_single_median"] == curve.single_time.median / point.dt
            assert row["measured_ns_per_time_low"] <= row["measured_ns_per_time_median"] <= row["measured_ns_per_time_high"]

    _, whole = files_of(small, tmp_path)
    assert (whole["scene"]["name"], whole["refused"]) == ("forced_oscillator", small.refused)
    effort = {"members": timing.CHARTS.members, "threads": 1, "repeats": timing.CHARTS.repeats}
    assert whole["measured_on"] == effort | {"isa": sw.isa()}
    assert [row["state_error"] for row in whole["rows"][:3]] == [p.state_error for p in small.curves[0].points]
    assert [row["method"] for row in whole["summary"]] == ["false_euler", "rk4"]
    assert tables.finite({"a": [math.inf, 1.0], "b": math.nan}) == {"a": [None, 1.0], "b": None}


def test_methods_are_told_apart_without_colour():
    looks = [style.look(method) for method in METHODS]
    assert len({look["marker"] for look in looks}) == len(METHODS)
    assert {look["color"] for look in looks} == set(style.FAMILIES.values())
    orders = {method.order for method in METHODS if method.order in {1, 2, 3, 4, 5, 8}}  # others are drawn solid
    assert len({str(look["linestyle"]) for look in looks}) == len(orders)


def test_without_matplotlib_the_numbers_are_still_there(small, monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    refused(UnsupportedError, r"pip install 'stepwell\[chart\]'", small.plot)
    small.to_csv(tmp_path / "chart.csv")


def test_both_arithmetics_are_charted():
    chart = sw.charts.work_precision("oscillator", ["false_euler", "rk4"], [50, 100, 500, 2000], tolerances=(), fused="both")
    assert [curve.name for curve in chart.curves] == ["false_euler", "rk4", "false_euler, fused", "rk4, fused"]
    plain, fused = (chart.curves[i].points for i in (1, 3))
    # The method's error is the same; rounding is not.
    assert [p.state_error for p in plain] != [p.state_error for p in fused]
    np.testing.assert_allclose([p.state_error for p in plain], [p.state_error for p in fused], rtol=1e-3)
    assert {row["method"] for row in chart.rows()} == {curve.name for curve in chart.curves}
    chart.plot()
