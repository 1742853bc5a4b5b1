"""Work-precision charts: orders, stability marks, costs, files and the picture."""

import csv
import dataclasses
import json
import math
import sys

import numpy as np
import pytest
import stepwell as sw
from stepwell.charts import data, measure, style
from stepwell.errors import ArgumentError, DTypeError, UnknownNameError, UnsupportedError

#: The scenes with a solution that a fixed step does well; the others have their own test of orders.
HARD = ("figure_eight", "kepler", "pythagorean")
SCENES = [scene for scene in sw.scenes.scenes() if scene.exact is not None and scene.name not in HARD]
CHAOTIC = [scene for scene in sw.scenes.scenes() if scene.exact is None]
METHODS = sw.methods()

#: Below this, rounding is part of an error.
ROUNDING = 1e-10


@pytest.fixture(scope="module")
def charts():
    """These scenes by every method on the whole ladder: what `stepwell chart` draws."""
    return {scene.name: sw.charts.work_precision(scene) for scene in SCENES}


@pytest.fixture(scope="module")
def small():
    return sw.charts.work_precision("forced_oscillator", ["verlet", "false_euler", "rk4"], [4, 40, 400])


def read(path):
    with path.open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


def slope(curve):
    """The order that the errors show over the last factor of ten of the step."""
    last = [point for point in curve.points if point.state_error > ROUNDING][-1]
    first = min(curve.points, key=lambda point: abs(math.log(point.dt / (10 * last.dt))))
    return math.log(first.state_error / last.state_error) / math.log(first.dt / last.dt)


# ---- orders


@pytest.mark.parametrize("method", METHODS, ids=lambda m: m.name)
@pytest.mark.parametrize("scene", SCENES, ids=lambda s: s.name)
def test_the_error_falls_with_the_order_that_is_declared(charts, scene, method):
    chart = charts[scene.name]
    if method.name in chart.refused:
        assert method.needs_acceleration
        return
    curve = next(curve for curve in chart.curves if curve.method is method)
    # On an orbit an error in energy grows into one in angle, which shows the next order for long.
    assert slope(curve) == pytest.approx(method.order, abs=0.1 if scene.system.linear else 0.25)


@pytest.mark.parametrize(
    ("scene", "steps", "methods"),
    [
        ("figure_eight", (10_000, 100_000), ("false_euler", "standard_heun", "semi_false_heun", "leapfrog")),
        ("figure_eight", (3000, 6000), ("rk4",)),
        ("kepler", (300_000, 600_000), ("standard_heun", "semi_false_heun", "leapfrog")),
        ("kepler", (60_000, 120_000), ("rk4",)),
        ("pythagorean", (1_000_000, 2_000_000), ("rk4",)),
    ],
)
def test_the_error_falls_with_the_order_on_hard_scenes_too(scene, steps, methods):
    """Or faster, up to the next order: a drift in energy is of that order, but its effect grows with the time squared."""
    for curve in sw.charts.work_precision(scene, methods, steps).curves:
        coarse, fine = (point.state_error for point in curve.points)
        order = math.log(coarse / fine) / math.log(steps[1] / steps[0])
        assert -0.25 < order - curve.method.order < 1, curve.method


@pytest.mark.parametrize("scene", CHAOTIC, ids=lambda s: s.name)
def test_what_is_chaotic_has_no_chart(scene):
    with pytest.raises(ArgumentError, match=f"scene: {scene.name} has no exact solution, so there is no error to chart"):
        sw.charts.work_precision(scene)


def test_no_ladder_is_so_long_that_it_takes_minutes(monkeypatch):
    # The function hides the module of its name.
    monkeypatch.setattr(sys.modules["stepwell.charts.work_precision"], "MOST", 5000)
    chart = sw.charts.work_precision("pythagorean", ["leapfrog"])
    assert chart.curves[0].points[-1].steps == 5000


def test_a_wrong_exact_solution_is_seen():
    """There is no slope if the system is not the one that was solved: here its frequency is a thousandth off."""
    scene = dataclasses.replace(sw.scenes.oscillator(), exact=sw.scenes.oscillator(omega=1.001).exact)
    chart = sw.charts.work_precision(scene, ["rk4"], [1000, 10_000])
    assert slope(chart.curves[0]) == pytest.approx(0, abs=0.1)


# ---- stability


@pytest.mark.parametrize("method", [m for m in METHODS if m.limit], ids=lambda m: m.name)
def test_instability_is_marked_beyond_the_limit_and_not_below(charts, method):
    """2 % beyond, the slowest method grows by 8 % a step, 29-fold over the 43 steps; 2 % below, none grows."""
    scene = sw.scenes.oscillator()
    for share, unstable in ((0.98, False), (1.02, True)):
        dt = share * method.limit
        assert measure.assess(scene, method, dt, scene.steps_for(dt)).unstable is unstable
    curve = next(curve for curve in charts["oscillator"].curves if curve.method is method)
    assert 0.98 * method.limit < curve.largest_stable_step < 1.02 * method.limit
    assert all(point.unstable == (point.dt > curve.largest_stable_step) for point in curve.points)


def test_standard_euler_falls_off_where_its_growth_reaches_two(charts):
    """It is never stable: its radius grows by √(1 + Φ²) a step, so to 2, an error of 1, where Φ·T/2 = ln 2."""
    curve = charts["oscillator"].curves[0]
    assert (curve.method.name, curve.method.limit) == ("standard_euler", 0.0)
    assert curve.largest_stable_step == pytest.approx(2 * math.log(2) / sw.scenes.oscillator().horizon, rel=0.01)


def test_what_is_wrong_but_bounded_is_not_unstable():
    """Verlet just below its limit has a wrong angle and an amplitude of about √(2/(2 − Φ)), but keeps it."""
    scene = sw.scenes.oscillator()
    point = measure.assess(scene, sw.method("verlet"), 1.95, scene.steps_for(1.95))
    assert point.state_error > 1
    assert not point.unstable
    assert not point.usable


def test_a_run_that_leaves_the_finite_numbers_is_unstable():
    scene = sw.scenes.oscillator()
    point = measure.assess(scene, sw.method("standard_euler"), 100.0, 500)
    assert point.unstable
    assert point.state_error == point.energy_error == math.inf


def test_a_ladder_that_is_stable_or_unstable_throughout_says_so():
    oscillator = sw.scenes.oscillator()
    stable = sw.charts.work_precision(oscillator, ["rk4"], [100, 200]).curves[0]
    unstable = sw.charts.work_precision(oscillator, ["rk4"], [10, 20]).curves[0]
    assert (stable.largest_stable_step, unstable.largest_stable_step) == (math.inf, 0.0)
    assert unstable.usable == ()
    assert unstable.cheapest(1.0) == math.inf


# ---- costs


def test_cost_is_counted_from_the_record(charts):
    for chart in charts.values():
        for curve in chart.curves:
            for point in curve.points:
                assert point.dt == chart.scene.horizon / point.steps
                assert point.cost == curve.method.evaluations / point.dt


def test_the_cheapest_cost_is_that_of_the_largest_step_that_will_do():
    point = data.Point(steps=1, dt=1.0, cost=1.0, state_error=0.5, energy_error=0.0, unstable=False)
    wrong = dataclasses.replace(point, cost=0.1, state_error=0.01, unstable=True)
    better = dataclasses.replace(point, cost=2.0, state_error=0.05)
    best = dataclasses.replace(point, cost=4.0, state_error=0.05)
    curve = data.Curve(METHODS[0], (wrong, point, better, best), 1.0, data.Timing(1.0, 1.0, 1.0))
    assert [curve.cheapest(error) for error in (0.5, 0.1, 0.01)] == [1.0, 2.0, math.inf]


def test_a_step_is_timed_per_member(monkeypatch):
    """With a clock that counts steps times members in place of the machine's, every step takes one nanosecond."""
    clock = 0.0

    def integrate(system, method, *, v, y, dt, steps, threads):
        nonlocal clock
        assert threads == 1
        assert v.shape == y.shape == (3, 2, measure.MEMBERS)
        clock += 1e-9 * steps * measure.MEMBERS

    monkeypatch.setattr(measure, "integrate", integrate)
    monkeypatch.setattr(measure.time, "perf_counter", lambda: clock)
    times = measure.step_times(sw.scenes.clover(), METHODS[:2])
    assert list(times) == [m.name for m in METHODS[:2]]
    for timing in times.values():
        assert (timing.median, timing.low, timing.high) == pytest.approx((1.0, 1.0, 1.0), rel=1e-6)


def test_everything_but_the_time_is_repeatable(small):
    again = sw.charts.work_precision(small.scene, ["verlet", "false_euler", "rk4"], [400, 4, 40, 4])

    def counted(chart):
        return [{k: v for k, v in row.items() if not k.startswith("measured_")} for row in chart.rows()]

    assert counted(again) == counted(small)
    assert any(k.startswith("measured_") for k in small.rows()[0])


def test_progress_is_told():
    told = []
    sw.charts.work_precision("oscillator", ["rk4", "verlet"], [100], progress=told.append)
    assert told == [0.5, 1.0]


# ---- what is refused


def test_a_refused_method_is_named_with_the_reason(small, tmp_path):
    assert [curve.method.name for curve in small.curves] == ["false_euler", "rk4"]
    assert list(small.refused) == ["verlet"]
    assert "has damping" in small.refused["verlet"]
    small.to_csv(tmp_path / "chart.csv")
    rows = read(tmp_path / "chart.csv")
    assert [(row["method"], row["refused"], row["cost"]) for row in rows if row["refused"]] == [
        ("verlet", small.refused["verlet"], "")
    ]
    assert "Verlet is refused" in " ".join(text.get_text() for text in small.plot().texts).replace("\n", " ")


def test_a_scene_that_only_refuses_can_still_be_drawn_and_written(tmp_path):
    chart = sw.charts.work_precision("forced_oscillator", ["verlet"], [100])
    assert (chart.curves, chart.summary()) == ((), [])
    chart.plot(tmp_path / "chart.png")
    chart.to_csv(tmp_path / "chart.csv")
    assert "verlet" in (tmp_path / "chart.csv").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        (("clovr",), UnknownNameError, "did you mean 'clover'"),
        ((3,), DTypeError, "scene: expected a Scene or its name, got int"),
        (("clover", ["rk5"]), UnknownNameError, "did you mean 'rk4'"),
        (("clover", "rk4"), DTypeError, "methods: expected a list of names, got the text 'rk4'"),
        (("clover", []), ArgumentError, "methods: expected at least one, got none"),
        (("clover", None, []), ArgumentError, "steps: expected at least one, got none"),
        (("clover", None, [3]), ArgumentError, "steps: expected 4 or more"),
        (("clover", None, [4.5]), DTypeError, "steps: expected a whole number"),
        ((dataclasses.replace(SCENES[0], exact=None),), ArgumentError, "no exact solution"),
    ],
)
def test_what_cannot_be_charted_is_said(arguments, error, message):
    with pytest.raises(error, match=message):
        sw.charts.work_precision(*arguments)


# ---- files


def test_the_csv_reads_back_as_the_same_numbers(charts, tmp_path):
    for name, chart in charts.items():
        chart.to_csv(tmp_path / f"{name}.csv")
        found_rows = read(tmp_path / f"{name}.csv")
        rows = chart.rows()
        assert len(found_rows) == len(rows) == sum(len(c.points) for c in chart.curves) + len(chart.refused)
        for found, wanted in zip(found_rows, rows, strict=True):
            assert list(found) == list(wanted)
            for key, value in wanted.items():
                kind = bool if isinstance(value, bool) else type(value)
                assert {"True": True, "False": False}[found[key]] is value if kind is bool else kind(found[key]) == value


def test_the_measured_columns_are_those_of_the_counted_step(small):
    for curve in small.curves:
        rows = [row for row in small.rows() if row["method"] == curve.method.name]
        for row, point in zip(rows, curve.points, strict=True):
            assert row["measured_ns_per_time_median"] == curve.step_time.median / point.dt
            assert row["measured_ns_per_time_low"] <= row["measured_ns_per_time_median"] <= row["measured_ns_per_time_high"]


def test_the_json_is_strict_and_whole(small, tmp_path):
    def refuse(constant):
        raise AssertionError(constant)

    small.to_json(tmp_path / "chart.json")
    whole = json.loads((tmp_path / "chart.json").read_text(encoding="utf-8"), parse_constant=refuse)
    assert whole["scene"]["name"] == "forced_oscillator"
    assert whole["refused"] == small.refused
    assert whole["measured_on"] == {"members": 4096, "threads": 1, "repeats": measure.REPEATS, "isa": sw.isa()}
    assert [row["state_error"] for row in whole["rows"][:3]] == [p.state_error for p in small.curves[0].points]
    assert [row["method"] for row in whole["summary"]] == ["false_euler", "rk4"]
    assert data.finite({"a": [math.inf, 1.0], "b": math.nan}) == {"a": [None, 1.0], "b": None}


def test_the_summary_is_what_the_points_say(charts):
    for chart in charts.values():
        for row, curve in zip(chart.summary(), chart.curves, strict=True):
            assert row["least_error"] == min(p.state_error for p in curve.usable)
            for error in data.TARGETS:
                cost = row[f"cost_at_error_{error:g}"]
                better = [p.cost for p in curve.points if not p.unstable and p.state_error <= error]
                assert cost == (min(better) if better else math.inf)


# ---- the picture


def test_methods_are_told_apart_without_colour():
    looks = [style.look(method) for method in METHODS]
    assert len({look["marker"] for look in looks}) == len({look["color"] for look in looks}) == len(METHODS)
    assert len({str(look["linestyle"]) for look in looks}) == len({method.order for method in METHODS})


@pytest.mark.parametrize("scene", SCENES, ids=lambda s: s.name)
def test_nothing_in_the_picture_is_cut_off_or_covered(charts, scene, tmp_path):
    chart = charts[scene.name]
    figure = chart.plot(tmp_path / "chart.png")
    width, height = np.frombuffer((tmp_path / "chart.png").read_bytes()[16:24], ">u4")
    assert (width, height) == (1600, 900)

    page = figure.bbox
    panels = [axes.get_tightbbox() for axes in figure.axes]
    texts = [text for text in figure.texts if text.get_text()]
    beside = [figure.legends[0].get_window_extent(), *(text.get_window_extent() for text in texts)]
    for box in (*panels, *beside):
        assert page.x0 <= box.x0 < box.x1 <= page.x1
        assert page.y0 <= box.y0 < box.y1 <= page.y1
    for i, box in enumerate(beside):
        assert not any(box.overlaps(other) for other in (*panels, *beside[:i]))


def test_every_point_is_in_the_picture(charts):
    """Below 1 as a point of a curve, or above it as a mark; each unstable method's own marker where it falls off."""
    chart = charts["oscillator"]
    figure = chart.plot()
    curves, marks = figure.axes[0], figure.axes[2]
    assert [text.get_text().splitlines()[0].split(" (")[0] for text in figure.legends[0].get_texts()] == [
        curve.method.title for curve in chart.curves
    ]
    for row, curve in enumerate(chart.curves):
        line = curves.lines[row]
        shown = [(x, y) for x, y in line.get_xydata().tolist() if math.isfinite(y)]
        assert shown == [(p.cost, p.state_error) for p in curve.points if p.usable]
        of_row = [mark for mark in marks.lines if len(mark.get_ydata()) and set(mark.get_ydata()) == {row}]
        crosses = [x for mark in of_row if mark.get_marker() == "x" for x in mark.get_xdata()]
        assert crosses == [p.cost for p in curve.points if p.unstable]
        own = [mark.get_xdata()[0] for mark in of_row if mark.get_marker() == style.look(curve.method)["marker"]]
        assert curve.method.evaluations / curve.largest_stable_step in own


def test_an_unknown_kind_of_picture_is_refused(small, tmp_path):
    with pytest.raises(ArgumentError, match="expected an ending of a picture"):
        small.plot(tmp_path / "chart.docx")


def test_without_matplotlib_the_numbers_are_still_there(small, monkeypatch, tmp_path):
    monkeypatch.setitem(__import__("sys").modules, "matplotlib.figure", None)
    with pytest.raises(UnsupportedError, match=r"pip install 'stepwell\[chart\]'"):
        small.plot()
    small.to_csv(tmp_path / "chart.csv")
