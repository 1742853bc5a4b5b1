"""Work-precision charts: orders, stability marks, costs, files and the picture."""

import csv
import dataclasses
import functools
import itertools
import json
import math
import sys

import numpy as np
import pytest
import stepwell as sw
from stepwell.charts import data, known, measure, peers, style
from stepwell.errors import ArgumentError, DTypeError, UnknownNameError, UnsupportedError

#: The scenes with a solution that a fixed step does well; the others have their own test of orders.
HARD = ("figure_eight", "kepler", "pythagorean", "arenstorf")
SCENES = [scene for scene in sw.scenes.scenes() if scene.exact is not None and scene.name not in HARD]
CHAOTIC = [scene for scene in sw.scenes.scenes() if scene.exact is None]
METHODS = sw.methods()

#: The function hides the module of its name.
LADDER = sys.modules["stepwell.charts.work_precision"]

#: Below this, rounding is part of an error: it is some 1e-13 on these scenes, so a hundredth.
ROUNDING = 1e-11


@pytest.fixture(scope="module")
def charts():
    """These scenes by every method: what `stepwell chart` draws, but for the finest rungs of the ladder and with hasty times."""
    with pytest.MonkeyPatch.context() as patched:
        hasty(patched)
        patched.setattr(LADDER, "SMALLEST", 1 / 30)
        return {scene.name: sw.charts.work_precision(scene) for scene in SCENES}


@pytest.fixture(scope="module")
def whole():
    """These scenes, when they are asked for, on the whole ladder."""

    @functools.cache
    def chart(name):
        with pytest.MonkeyPatch.context() as patched:
            hasty(patched)
            return sw.charts.work_precision(name, tolerances=[])

    return chart


def hasty(patched):
    """Times of steps are not what is looked at."""
    patched.setattr(measure, "REPEATS", 2)
    patched.setattr(measure, "TIMED_SECONDS", 1e-4)


@pytest.fixture(scope="module")
def small():
    return sw.charts.work_precision("forced_oscillator", ["verlet", "false_euler", "rk4"], [4, 40, 400])


def read(path):
    with path.open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


def slope(curve):
    """The order that the errors show over the last factor of √10 of the step above rounding.

    An error in energy of an orbit grows into one in angle, maybe of the next order: A·hᵖ + B·hᵖ⁺¹ shows p plus the share of
    the second term, which falls as h. By Merson's method on the clover leaf it is 0.46 where the error is 4e-7 and 0.12 where it
    is 1e-10, so the window is at the smallest errors, and narrow.
    """
    last = [point for point in curve.points if point.state_error > ROUNDING][-1]
    first = min(curve.points, key=lambda point: abs(math.log(point.dt / (math.sqrt(10) * last.dt))))
    return math.log(first.state_error / last.state_error) / math.log(first.dt / last.dt)


# ---- orders


#: A linear scene and one that is not; test_orders.py looks at every method on more of either.
SHOWN = ("clover", "oscillator")


@pytest.mark.parametrize("method", METHODS, ids=lambda m: m.name)
@pytest.mark.parametrize(
    "scene", [pytest.param(s, marks=() if s.name in SHOWN else pytest.mark.long) for s in SCENES], ids=lambda s: s.name
)
def test_the_error_falls_with_the_order_that_is_declared(whole, scene, method):
    chart = whole(scene.name)
    if method.name in chart.refused:
        assert method.needs_acceleration
        return
    curve = next(curve for curve in chart.curves if curve.method is method)
    if (scene.name, method.name) == ("pendulum", "fehlberg"):
        return  # of two signs of error, which cancel in this window; test_orders.py looks closer
    if method.order > 5 and not scene.system.linear:
        return  # sixteen digits do not show it; test_orders.py takes fifty
    assert slope(curve) == pytest.approx(method.order, abs=0.1 if scene.system.linear else 0.25)


@pytest.mark.parametrize(
    ("scene", "steps", "methods"),
    [
        ("figure_eight", (10_000, 100_000), ("false_euler", "standard_heun", "semi_false_heun", "leapfrog")),
        ("figure_eight", (3000, 6000), ("rk4",)),
        ("kepler", (300_000, 600_000), ("standard_heun", "semi_false_heun", "leapfrog")),
        ("kepler", (60_000, 120_000), ("rk4",)),
        pytest.param("pythagorean", (1_000_000, 2_000_000), ("rk4",), marks=pytest.mark.long),
    ],
)
def test_the_error_falls_with_the_order_on_hard_scenes_too(scene, steps, methods):
    """Or faster, up to the next order: a drift in energy is of that order, but its effect grows with the time squared."""
    for curve in sw.charts.work_precision(scene, methods, steps).curves:
        coarse, fine = (point.state_error for point in curve.points)
        order = math.log(coarse / fine) / math.log(steps[1] / steps[0])
        assert -0.25 < order - curve.method.order < 1, curve.method


@pytest.mark.parametrize("scene", CHAOTIC, ids=lambda s: s.name)
def test_what_is_chaotic_is_charted_as_far_as_it_is_known(scene):
    """Against a run to 1e-14 that one to 1e-13 agrees with to 1e-8; of ten times that and more, errors fall with the order."""
    steps = [1000, 2000] if scene.name == "plummer" else [10_000, 20_000]
    chart = sw.charts.work_precision(scene, ["rk4"], steps, tolerances=[1e-6])
    cut = scene.name != "plummer"  # whose stars are known over all of it
    assert (chart.cut, chart.floor, chart.scene.control) == (cut, pytest.approx(1e-7), None)
    assert (0 < chart.scene.horizon < scene.horizon) == cut
    coarse, fine = (point.state_error for point in chart.curves[0].points)
    assert coarse > chart.floor
    # To ± 0.7: in a chaotic motion the errors of higher orders grow too.
    assert math.log2(coarse / max(fine, chart.floor)) > 3.3 or fine < chart.floor
    assert all(row["error"] >= chart.floor for row in chart.front())
    assert ("as far as the true motion is known" in " ".join(text.get_text() for text in chart.plot().texts)) == cut


def test_the_true_motion_between_its_nodes_is_that_of_a_run():
    """Asked at times of its own, within a hundredth of the least error that is drawn."""
    scene, floor = known.chartable(sw.scenes.energy_control())
    times = np.linspace(0.0, scene.horizon, 7)[1:] - 0.0123
    run = sw.integrate(scene.system, "dop853", v=scene.v, y=scene.y, tolerance=1e-14, at=times)
    for found, wanted in zip(scene.exact(times), (run.v, run.y), strict=True):
        assert np.abs(found - wanted).max() < 0.1 * floor * np.abs(wanted).max()


def test_no_ladder_is_so_long_that_it_takes_minutes(monkeypatch):
    monkeypatch.setattr(LADDER, "MAX_STEPS", 5000)
    chart = sw.charts.work_precision("pythagorean", ["leapfrog"])
    assert chart.curves[0].points[-1].steps == 5000


def test_a_wrong_exact_solution_is_seen():
    """There is no slope if the system is not the one that was solved: here its frequency is a thousandth off."""
    scene = dataclasses.replace(sw.scenes.oscillator(), exact=sw.scenes.oscillator(omega=1.001).exact)
    chart = sw.charts.work_precision(scene, ["rk4"], [1000, 3162, 10_000])
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
    for point in curve.points:
        # PEFRL holds again in a window beyond its limit, where the z-plane says so.
        again = sw.analyse(sw.Oscillator(), method, dt=point.dt).radius <= 1.0 + 1e-9
        assert point.unstable == (point.dt > curve.largest_stable_step and not again), point.dt


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
                # With a tolerance the core counts; to the rounding of two quotients.
                assert point.cost == pytest.approx(curve.method.evaluations / point.dt, rel=1e-15)


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

    def integrate(system, method, *, v, y, dt, steps, threads, fused):
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


# ---- errors of the end, of the phase


def test_the_phase_error_of_false_euler_is_that_of_its_angle():
    """It turns by Ψ = 2·asin(Φ/2) a step: y = cos((k + ½)Ψ)/cos(½Ψ), v = −sin(kΨ)/cos(½Ψ) after k steps from (0, 1)."""
    scene = sw.scenes.oscillator()
    for steps in (400, 1000, 3000):
        phi = scene.horizon / steps
        psi = 2 * math.asin(phi / 2)
        v, y = -math.sin(steps * psi) / math.cos(psi / 2), math.cos((steps + 0.5) * psi) / math.cos(psi / 2)
        point = measure.assess(scene, sw.method("false_euler"), phi, steps)
        assert point.phase_error == pytest.approx(math.atan2(-v, y) / (2 * math.pi), abs=1e-11)
        # The angle that Ψ/Φ − 1 gives; the ellipse, whose axes are 1 ± ½Φ, adds that share of it.
        assert point.phase_error == pytest.approx(steps * (psi - phi) / (2 * math.pi), rel=phi)
        assert point.end_error <= point.state_error


@pytest.mark.parametrize("name", ["oscillator", "clover", "kepler", "figure_eight"])
@pytest.mark.parametrize("share", [-0.3, -1e-3, 1e-7, 0.02, 0.4])
def test_a_motion_that_is_ahead_is_seen_to_be_ahead(name, share):
    scene = sw.scenes.scene(name)
    if name == "clover" and abs(share) > 0.3:
        return
    v, y = scene.exact(np.array([scene.horizon + share * scene.period]))
    # Times of some 20 periods are rounded to 1e-15 of a period, and next to a periapsis places by more.
    assert measure.phase_error(scene, v[0], y[0], scene.horizon) == pytest.approx(share, abs=1e-10)


def test_a_scene_without_a_period_has_no_phase_error(small):
    assert {point.phase_error for curve in small.curves for point in curve.points} == {None}
    with pytest.raises(ArgumentError, match="no exact solution that repeats itself"):
        measure.phase_error(small.scene, small.scene.v, small.scene.y, 0.0)


# ---- tolerances


def test_the_error_falls_with_the_tolerance(charts):
    """In proportion to it by fifth order, or by its 4/5th power by fourth, as in ``test_adaptive.py``; over the whole range,
    since errors of one sign and the other cancel here and there.
    """
    for name in ("oscillator", "clover"):
        paced = [curve for curve in charts[name].curves if curve.by == "tolerance"]
        assert [c.name for c in paced] == [f"{m.name}, tolerance" for m in METHODS if m.error_order is not None]
        for curve in paced:
            assert [p.tolerance for p in curve.points] == list(peers.TOLERANCES)
            seen = [(p.tolerance, p.state_error) for p in curve.points if 1e-11 < p.tolerance < 2e-3]
            slope_seen = np.polyfit(*np.log10(seen).T, 1)[0]
            assert 0.7 < slope_seen < 1.15, curve.name
            assert all(a.cost <= b.cost for a, b in itertools.pairwise(curve.points))


def test_rejected_steps_are_counted():
    scene = sw.scenes.kepler()
    times = np.linspace(0.0, scene.horizon, measure.SAVED_TIMES + 1)[1:]
    run = sw.integrate(scene.system, "merson", v=scene.v, y=scene.y, tolerance=1e-6, at=times, dt=scene.dt)
    point = measure.assess_tolerance(scene, sw.method("merson"), 1e-6)
    assert int(run.paces.rejected) > 0
    assert point.steps == int(run.paces.accepted) + int(run.paces.rejected) + measure.EXTRA_STEPS
    assert point.cost == 5 * point.steps / scene.horizon
    assert point.end_error == scene.state_error(run)[-1]


# ---- the front


@pytest.mark.parametrize("error", data.ERRORS)
@pytest.mark.parametrize("cost", data.COSTS)
def test_the_front_is_a_front(charts, error, cost):
    """Nothing is cheaper and as right as a row of it, and what is not in it has a row that is as cheap and as right."""
    for chart in charts.values():
        front = chart.front(error, cost)
        ends = [(row["cost"], row["error"]) for row in front]
        assert ends == sorted(ends)
        assert all(a[0] < b[0] and a[1] > b[1] for a, b in itertools.pairwise(ends))
        for curve in chart.curves:
            for spent, point in zip(curve.costs(cost), curve.points, strict=True):
                if point.usable and math.isfinite(point.error(error)):
                    assert any(c <= spent and e <= point.error(error) for c, e in ends)
        assert bool(front) == (error != "phase_error" or chart.scene.period is not None)


def test_the_front_is_in_the_table_and_the_best_is_of_it(charts):
    chart = charts["clover"]
    assert [row["error"] for row in chart.front()] == sorted(
        (row["state_error"] for row in chart.rows() if row["front"] is True), reverse=True
    )
    best = chart.best(1e-4)
    assert best["cost"] == min(curve.cheapest(1e-4) for curve in chart.curves)
    assert chart.best(0.0) is None
    with pytest.raises(UnknownNameError, match="did you mean 'batch'"):
        chart.front(cost="bach")


# ---- peers


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
    chart.plot(tmp_path / "peers.png", time="single", error="end_error")
    chart.to_csv(tmp_path / "peers.csv")
    chart.to_json(tmp_path / "peers.json")


def test_a_peer_that_is_not_installed_says_so(monkeypatch):
    for module, make in (("scipy.integrate", peers.scipy), ("heyoka", peers.heyoka), ("rebound", peers.rebound)):
        monkeypatch.setitem(sys.modules, module, None)
        name = module.split(".")[0]
        with pytest.raises(UnsupportedError, match=f"peers: {name} is not installed; pip install {name}"):
            make()


@pytest.mark.parametrize(
    ("package", "make", "scene"),
    [
        ("scipy", lambda: peers.scipy("DOP853", (1e-4, 1e-10)), "oscillator"),
        ("scipy", lambda: peers.scipy("RK45", (1e-4, 1e-10)), "figure_eight"),
        ("heyoka", lambda: peers.heyoka((1e-4, 1e-10)), "chain"),
        ("heyoka", lambda: peers.heyoka((1e-4, 1e-10)), "figure_eight"),
        ("rebound", lambda: peers.rebound("bs", (1e-4, 1e-10)), "figure_eight"),
        ("rebound", lambda: peers.rebound("leapfrog", (0.1, 0.001)), "figure_eight"),
    ],
)
def test_a_real_peer_solves_the_scene(package, make, scene):
    pytest.importorskip(package)
    curve = sw.charts.work_precision(scene, ["rk4"], [400], tolerances=[], peers=[make()]).curves[-1]
    coarse, fine = curve.points
    assert fine.state_error < min(1e-3, 0.1 * coarse.state_error)
    assert fine.cost >= coarse.cost > 0


# ---- the panel


def test_a_panel_is_its_charts(tmp_path):
    panel = sw.charts.panel(["oscillator", "clover", "chain", "kepler"], methods=["rk4", "merson"], steps=[400, 4000])
    assert [chart.scene.name for chart in panel.charts] == ["oscillator", "clover", "chain", "kepler"]
    figure = panel.plot(tmp_path / "panel.png")
    assert [axes.get_title(loc="left").strip() for axes in figure.axes] == [chart.scene.title for chart in panel.charts]
    assert [text.get_text() for text in figure.legends[0].get_texts()] == [
        "Runge-Kutta 4",
        "RK-Merson",
        "RK-Merson, tolerance",
        "the cheapest of all for its error",
    ]
    legend = figure.legends[0].get_window_extent()
    assert not any(axes.get_tightbbox().overlaps(legend) for axes in figure.axes)
    panel.to_csv(tmp_path / "panel.csv")
    assert len(read(tmp_path / "panel.csv")) == len(panel.rows()) == sum(len(chart.rows()) for chart in panel.charts)
    panel.to_json(tmp_path / "panel.json")
    whole = json.loads((tmp_path / "panel.json").read_text(encoding="utf-8"))
    assert [len(each["front"]) for each in whole] == [len(chart.front()) for chart in panel.charts]
    with pytest.raises(ArgumentError, match="scenes: expected at least one, got none"):
        sw.charts.panel([])
    with pytest.raises(DTypeError, match="scenes: expected a list of scenes"):
        sw.charts.panel("clover")


# ---- what is refused


def test_a_refused_method_is_named_with_the_reason(small, tmp_path):
    assert [curve.name for curve in small.curves] == ["false_euler", "rk4"]
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
        (("clover", "rk4"), DTypeError, "methods: expected a list of names, got 'rk4'"),
        (("clover", []), ArgumentError, "methods: expected at least one, got none"),
        (("clover", None, []), ArgumentError, "steps: expected at least one, got none"),
        (("clover", None, [3]), ArgumentError, "steps: expected 4 or more"),
        (("clover", None, [4.5]), DTypeError, "steps: expected a whole number"),
        (("clover", None, None, [0.0]), ArgumentError, "tolerances: expected"),
    ],
)
def test_what_cannot_be_charted_is_said(arguments, error, message):
    with pytest.raises(error, match=message):
        sw.charts.work_precision(*arguments[:3], **({"tolerances": arguments[3]} if len(arguments) > 3 else {}))


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
                if value is None or found[key] == "":
                    assert found[key] == ("" if value is None else value)
                    continue
                kind = bool if isinstance(value, bool) else type(value)
                assert {"True": True, "False": False}[found[key]] is value if kind is bool else kind(found[key]) == value


def test_the_measured_columns_are_those_of_the_counted_step(small):
    for curve in small.curves:
        rows = [row for row in small.rows() if row["method"] == curve.name]
        for row, point in zip(rows, curve.points, strict=True):
            assert row["measured_ns_per_time_median"] == curve.step_time.median / point.dt
            assert row["measured_ns_per_time_single_median"] == curve.single_time.median / point.dt
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
            assert row["least_error"] == min((p.state_error for p in curve.usable), default=math.inf)
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
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert labels.pop() == "the cheapest of all for its error"
    assert [label.split(", order")[0] for label in labels] == [curve.title for curve in chart.curves]
    for row, curve in enumerate(chart.curves):
        line = curves.lines[row]
        shown = [(x, y) for x, y in line.get_xydata().tolist() if math.isfinite(y)]
        assert shown == [(p.cost, p.state_error) for p in curve.points if p.usable]
        of_row = [mark for mark in marks.lines if len(mark.get_ydata()) and set(mark.get_ydata()) == {row}]
        crosses = [x for mark in of_row if mark.get_marker() == "x" for x in mark.get_xdata()]
        assert crosses == [p.cost for p in curve.points if p.unstable]
        if curve.by == "tolerance":
            continue
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


def test_both_arithmetics_are_charted():
    chart = sw.charts.work_precision("oscillator", ["false_euler", "rk4"], [50, 100, 500, 2000], tolerances=(), fused="both")
    assert [curve.name for curve in chart.curves] == ["false_euler", "rk4", "false_euler, fused", "rk4, fused"]
    plain, fused = (chart.curves[i].points for i in (1, 3))
    # The method's error is the same; rounding is not.
    assert [p.state_error for p in plain] != [p.state_error for p in fused]
    np.testing.assert_allclose([p.state_error for p in plain], [p.state_error for p in fused], rtol=1e-3)
    assert {row["method"] for row in chart.rows()} == {curve.name for curve in chart.curves}
    chart.plot()
    with pytest.raises(sw.errors.UnknownNameError, match="fused: there is no 'all'"):
        sw.charts.work_precision("oscillator", fused="all")
