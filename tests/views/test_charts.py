"""Work-precision charts: orders, stability marks, costs, tolerances and the front."""

import dataclasses
import itertools
import math

import numpy as np
import pytest
import stepwell as sw
from stepwell.errors import ArgumentError, UnknownNameError
from stepwell.runs import engine
from stepwell.studies.measuring import data, known, measure, peers, timing
from stepwell.views.charts import style
from support import stiff
from support.advised import scene_of
from support.charted import LADDER, METHODS, SCENES, _hasty_times, read, the_charts, the_small  # noqa: F401
from support.families import family
from support.looks import faults

#: Those without a formula; the stiff ones are compared with published values in test_stiff_scenes.py.
UNSOLVED = [scene for scene in sw.scenes.scenes() if scene.exact is None and scene.name not in stiff.SCENES]

#: Below this, rounding is part of an error: it is some 1e-13 on these scenes, so a hundredth.
ROUNDING = 1e-11


def slope(curve):
    """The order that the errors show over the last factor of √10 of the step above rounding."""
    # An error in energy of an orbit grows into one in angle, maybe of the next order: A·hᵖ + B·hᵖ⁺¹ shows p plus the share of
    # the second term, which falls as h. By Merson's method on the clover leaf it is 0.46 at an error of 4e-7, and 0.12 at
    # 1e-10, so the window is at the smallest errors, and narrow.
    last = [point for point in curve.points if point.state_error > ROUNDING][-1]
    first = min(curve.points, key=lambda point: abs(math.log(point.dt / (math.sqrt(10) * last.dt))))
    return math.log(first.state_error / last.state_error) / math.log(first.dt / last.dt)


#: Of these the errors do not show the order: they are of two signs, or the next power rules in this window.
NOT_SHOWN = {("pendulum", "fehlberg"), ("clover", "rodas4")}


# test_orders.py looks at every method on more scenes, to fifty digits, and test_stiff.py at the coefficients of rodas5p.
@pytest.mark.parametrize("name", family([scene.name for scene in SCENES], lambda name: name == "oscillator"))
def test_the_error_falls_with_the_order_that_is_declared(name):
    scene = sw.scenes.scene(name)
    chart = sw.charts.work_precision(name, tolerances=[])
    assert all(sw.method(refused).needs_acceleration for refused in chart.refused)
    for curve in chart.curves:
        method = curve.method
        if (
            (method.order > 5 and not scene.system.linear)
            or method.name in ("rodas5p", "vern9")
            or (name, method.name) in NOT_SHOWN
        ):
            continue
        # The error of vern7 is soon that of the next power, and that of vern9 roundings.
        most = 0.25 if not scene.system.linear else 0.12 if method.name == "vern7" else 0.1
        assert slope(curve) == pytest.approx(method.order, abs=most), method


@pytest.mark.parametrize(
    ("scene", "steps", "methods"),
    [
        ("figure_eight", (10_000, 100_000), ("false_euler", "leapfrog")),
        ("figure_eight", (3000, 6000), ("rk4",)),
        ("kepler", (60_000, 120_000), ("rk4",)),
        pytest.param("figure_eight", (10_000, 100_000), ("standard_heun", "semi_false_heun"), marks=pytest.mark.long),
        pytest.param("kepler", (300_000, 600_000), ("standard_heun", "semi_false_heun", "leapfrog"), marks=pytest.mark.long),
        pytest.param("pythagorean", (1_000_000, 2_000_000), ("rk4",), marks=pytest.mark.long),
    ],
)
def test_the_error_falls_with_the_order_on_hard_scenes_too(scene, steps, methods):
    """Or faster, up to the next order: a drift in energy is of that order, but its effect grows with the time squared."""
    for curve in sw.charts.work_precision(scene, methods, steps).curves:
        coarse, fine = (point.state_error for point in curve.points)
        order = math.log(coarse / fine) / math.log(steps[1] / steps[0])
        assert -0.25 < order - curve.method.order < 1, curve.method


#: By default one that is known over all of it, one that is not known to the end, and one of a body that turns.
OPEN = ("aircraft", "energy_control", "heavy_top")


@pytest.mark.parametrize("scene", family(UNSOLVED, lambda scene: scene.name in OPEN, lambda scene: scene.name))
def test_what_has_no_formula_is_charted_as_far_as_it_is_known(scene):
    """Against a run to 1e-14 that one to 1e-13 agrees with to 1e-8; of ten times that and more, errors fall with the order."""
    few = {"aircraft": 200, "gimbal_trap": 400, "heavy_top": 500}
    few |= {"energy_control": 160_000} | dict.fromkeys(("cloth", "jelly_cube", "plummer", "rope_bridge"), 1000)
    steps = few.get(scene.name, 10_000)
    chart = sw.charts.work_precision(scene, ["rk4"], [steps, 2 * steps], tolerances=[1e-6])
    cut = scene.name in ("energy_control", "triple_pendulum")  # the others are known over all of it
    assert (chart.cut, chart.floor, chart.scene.control) == (cut, pytest.approx(1e-7), None)
    assert (0 < chart.scene.horizon < scene.horizon) == cut
    coarse, fine = (point.state_error for point in chart.curves[0].points)
    assert coarse > chart.floor
    # To ± 0.7: in a chaotic motion the errors of higher orders grow too.
    assert math.log2(coarse / max(fine, chart.floor)) > 3.3 or fine < chart.floor
    assert all(row["error"] >= chart.floor for row in chart.front())
    assert ("as far as the true motion is known" in " ".join(text.get_text() for text in chart.plot().texts)) == cut


def test_no_ladder_is_so_long_that_it_takes_minutes_or_so_short_that_no_step_is_stable(monkeypatch):
    monkeypatch.setattr(LADDER, "MAX_STEPS", 5000)
    assert LADDER._ladder(sw.scenes.pythagorean())[-1] == 5000
    # Else there would be no curve of them: a cloth has 3072 numbers.
    scene = sw.scenes.cloth()
    longest = scene.system.safe_step("false_euler")
    ladder = LADDER._ladder(scene)
    assert sum(scene.horizon / n < longest for n in ladder) > 10
    assert max(ladder) == 10 * round(scene.horizon / scene.dt)


def test_a_wrong_exact_solution_is_seen_and_one_between_nodes_is_right():
    """There is no slope if the system is not the one that was solved: here its frequency is a thousandth off."""
    scene = dataclasses.replace(sw.scenes.oscillator(), exact=sw.scenes.oscillator(omega=1.001).exact)
    chart = sw.charts.work_precision(scene, ["rk4"], [1000, 3162, 10_000])
    assert slope(chart.curves[0]) == pytest.approx(0, abs=0.1)
    # Asked at times of its own, within a hundredth of the least error that is drawn.
    scene, floor = known.chartable(sw.scenes.energy_control())
    times = np.linspace(0.0, scene.horizon, 7)[1:] - 0.0123
    run = sw.integrate(scene.system, "dop853", v=scene.v, y=scene.y, tolerance=1e-14, at=times)
    for exact, wanted in zip(scene.exact(times), (run.v, run.y), strict=True):
        assert np.abs(exact - wanted).max() < 0.1 * floor * np.abs(wanted).max()


def test_instability_is_marked_beyond_the_limit_and_not_below(charts):
    """2 % beyond, most methods grow by 8 % a step and more, 29-fold over the 43 steps; 2 % below, none grows."""
    scene = sw.scenes.oscillator()
    for curve in charts["oscillator"].curves:
        method = curve.method
        if curve.by == "tolerance" or not 0.0 < method.limit < math.inf:
            continue
        beyond = 1.02 * method.limit
        if float(sw.analyse(scene.system, method, dt=beyond).radius) ** scene.steps_for(beyond) < 20.0:
            continue  # as of dopri5, which grows so slowly that the scene does not show it
        for share, unstable in ((0.98, False), (1.02, True)):
            dt = share * method.limit
            assert measure.assess(scene, method, dt, scene.steps_for(dt)).unstable is unstable, method
        assert 0.98 * method.limit < curve.largest_stable_step < 1.02 * method.limit, method
        # PEFRL holds again in a window beyond its limit, where the z-plane says so.
        stable = sw.analyse(sw.Oscillator(), method, dt=[point.dt for point in curve.points]).radius <= 1.0 + 1e-9
        for point, again in zip(curve.points, stable, strict=True):
            assert point.unstable == (point.dt > curve.largest_stable_step and not again), (method, point.dt)


def test_standard_euler_falls_off_where_its_growth_reaches_two(charts):
    """It is never stable: its radius grows by √(1 + Φ²) a step, so to 2, an error of 1, where Φ·T/2 = ln 2."""
    curve = charts["oscillator"].curves[0]
    assert (curve.method.name, curve.method.limit) == ("standard_euler", 0.0)
    assert curve.largest_stable_step == pytest.approx(2 * math.log(2) / sw.scenes.oscillator().horizon, rel=0.01)


def test_what_is_stable_and_what_is_not():
    """Verlet just below its limit has a wrong angle and an amplitude of about √(2/(2 − Φ)), but keeps it."""
    scene = sw.scenes.oscillator()
    point = measure.assess(scene, sw.method("verlet"), 1.95, scene.steps_for(1.95))
    assert point.state_error > 1
    assert not point.unstable
    assert not point.usable
    scene = sw.scenes.oscillator()
    point = measure.assess(scene, sw.method("standard_euler"), 100.0, 500)
    assert point.unstable
    assert point.state_error == point.energy_error == math.inf
    oscillator = sw.scenes.oscillator()
    stable = sw.charts.work_precision(oscillator, ["rk4"], [100, 200]).curves[0]
    unstable = sw.charts.work_precision(oscillator, ["rk4"], [10, 20]).curves[0]
    assert (stable.largest_stable_step, unstable.largest_stable_step) == (math.inf, 0.0)
    assert unstable.usable == ()
    assert unstable.cheapest(1.0) == math.inf


def test_costs_are_counted_and_the_summary_is_what_the_points_say(charts):
    for chart in charts.values():
        for curve in chart.curves:
            for point in curve.points:
                assert point.dt == chart.scene.horizon / point.steps
                # With a tolerance the core counts; to the rounding of two quotients.
                method = curve.method
                evaluations = engine.evaluations(method, chart.scene.system, paced=curve.by != "step")
                assert point.cost == pytest.approx(evaluations / point.dt, rel=1e-15)
    for chart in charts.values():
        for row, curve in zip(chart.summary(), chart.curves, strict=True):
            assert row["least_error"] == min((p.state_error for p in curve.dependable()), default=math.inf)
            for error in data.TARGETS:
                cost = row[f"cost_at_error_{error:g}"]
                better = [p.cost for p in curve.dependable() if p.state_error <= error]
                assert cost == (min(better) if better else math.inf)


def test_the_cheapest_cost_is_that_of_the_largest_step_and_rejected_ones_count():
    point = data.Point(steps=1, dt=1.0, cost=1.0, state_error=0.5, energy_error=0.0, unstable=False)
    wrong = dataclasses.replace(point, cost=0.1, state_error=0.01, unstable=True)
    better = dataclasses.replace(point, cost=2.0, state_error=0.05)
    best = dataclasses.replace(point, cost=4.0, state_error=0.05)
    curve = data.Curve(METHODS[0], (wrong, point, better, best), 1.0, data.Timing(1.0, 1.0, 1.0))
    assert [curve.cheapest(error) for error in (0.5, 0.1, 0.01)] == [1.0, 2.0, math.inf]
    scene = sw.scenes.kepler()
    times = np.linspace(0.0, scene.horizon, measure.SAVED_TIMES + 1)[1:]
    run = sw.integrate(scene.system, "merson", v=scene.v, y=scene.y, tolerance=1e-6, at=times, dt=scene.dt)
    point = measure.assess_tolerance(scene, sw.method("merson"), 1e-6)
    assert int(run.paces.rejected) > 0
    assert point.steps == int(run.paces.accepted) + int(run.paces.rejected) + measure.EXTRA_STEPS
    assert point.cost == 5 * point.steps / scene.horizon
    assert point.end_error == scene.state_error(run)[-1]


def test_a_step_is_timed_per_member(monkeypatch):
    """With a clock that counts steps times members in place of the machine's, every step takes one nanosecond."""
    clock = 0.0

    def integrate(system, method, *, v, y, dt, steps, threads, fused, dtype):
        nonlocal clock
        assert threads == 1
        assert v.shape == y.shape == (3, 2, timing.CHARTS.members)
        clock += 1e-9 * steps * timing.CHARTS.members

    monkeypatch.setattr(timing, "quietly", integrate)
    monkeypatch.setattr(timing.time, "perf_counter", lambda: clock)
    times = timing.step_times(sw.scenes.clover(), METHODS[:2])
    assert list(times) == [m.name for m in METHODS[:2]]
    for each in times.values():
        assert (each.median, each.low, each.high) == pytest.approx((1.0, 1.0, 1.0), rel=1e-6)


def test_a_tried_step_is_timed_per_member(monkeypatch):
    """With a clock that counts attempts times members, every attempt takes one nanosecond, of a batch and of one member."""
    clock, tolerances = 0.0, set()

    def integrate(system, method, *, v, y, **options):
        nonlocal clock
        run = sw.integrate(system, method, v=v, y=y, **options)
        clock += 1e-9 * run.paces.evaluations.sum() / method.attempt_evaluations
        tolerances.add((v.shape[2:], options["tolerance"]))
        return run

    monkeypatch.setattr(timing, "quietly", integrate)
    monkeypatch.setattr(timing.time, "perf_counter", lambda: clock)
    monkeypatch.setattr(timing, "CHARTS", timing.CHARTS._replace(seconds=1e-6))
    scene = dataclasses.replace(sw.scenes.clover(), horizon=0.5)
    for members, fused in itertools.product((3, 0), (False, True)):
        times = timing.tried_times(scene, [sw.method("merson"), sw.method("dop853")], members, fused)
        assert [each.median for each in times.values()] == pytest.approx([1.0, 1.0])
    assert tolerances == {((3,), timing.BATCH_TOLERANCE), ((), timing.BATCH_TOLERANCE), ((), timing.SINGLE_TOLERANCE)}


def test_repeats_end_when_they_take_too_long(monkeypatch):
    """A clock on which a step of the one takes a second, and one of the other a millisecond."""
    clock, effort = 0.0, timing.Effort(members=4, numbers=64, fewest=1, seconds=0.01, repeats=5, slow=2.5)

    def timed(seconds):
        def steps(n):
            nonlocal clock
            clock += seconds * n
            return seconds * n, n

        return steps

    monkeypatch.setattr(timing.time, "perf_counter", lambda: clock)
    repeats = timing.in_turns({"slow": timed(1.0), "quick": timed(0.001)}, effort, members=1)
    assert [len(each) for each in repeats.values()] == [3, 3]
    assert {round(x) for x in repeats["slow"]} == {10**9}
    assert {round(x) for x in repeats["quick"]} == {10**6}


def test_everything_but_the_time_is_repeatable_and_progress_is_told(small):
    shares = []
    again = sw.charts.work_precision(small.scene, ["verlet", "false_euler", "rk4"], [400, 4, 40, 4], progress=shares.append)

    def counted(chart):
        return [{k: v for k, v in row.items() if not k.startswith("measured_")} for row in chart.rows()]

    assert counted(again) == counted(small)
    assert any(k.startswith("measured_") for k in small.rows()[0])
    assert shares == sorted(shares)
    assert len(shares) > 4
    assert shares[-1] == 1.0


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


def test_a_motion_that_is_ahead_is_seen_to_be_ahead_if_it_has_a_period(small):
    for name, share in itertools.product(("oscillator", "clover", "kepler", "figure_eight"), (-0.3, -1e-3, 1e-7, 0.02, 0.4)):
        scene = scene_of(name)
        if name == "clover" and abs(share) > 0.3:
            continue
        v, y = scene.exact(np.array([scene.horizon + share * scene.period]))
        # Times of some 20 periods are rounded to 1e-15 of a period, and next to a periapsis places by more.
        ahead = measure.phase_error(scene, v[0], y[0], scene.horizon)
        assert ahead == pytest.approx(share, abs=1e-10), (name, share)
    assert {point.phase_error for curve in small.curves for point in curve.points} == {None}
    with pytest.raises(ArgumentError, match="no exact solution that repeats itself"):
        measure.phase_error(small.scene, small.scene.v, small.scene.y, 0.0)


def test_the_error_falls_with_the_tolerance(charts):
    """In proportion to it by fifth order, by its 4/5th power by fourth, by 2/3 by second, as in ``test_adaptive.py``; over the
    whole range, since errors of one sign and the other cancel here and there.
    """
    for name in ("oscillator", "clover"):
        paced = [curve for curve in charts[name].curves if curve.by == "tolerance"]
        named = [f"{m.name}, tolerance" for m in METHODS if m.error_order is not None and not m.has_series]
        assert [c.name for c in paced] == named
        for curve in paced:
            assert [p.tolerance for p in curve.points] == list(peers.TOLERANCES)
            seen = [(p.tolerance, p.state_error) for p in curve.points if 1e-11 < p.tolerance < 2e-3]
            slope_seen = np.polyfit(*np.log10(seen).T, 1)[0]
            # Errors of rodas4 with the loosest tolerances are of both signs; those of rodas5p next to zero, where little is
            # tolerated, cancel with the tightest ones: 1.19.
            least, most = {"rosenbrock23": (0.6, 1.15), "rodas4": (0.7, 1.25), "dopri5": (0.7, 1.35), "vern7": (0.7, 1.25)}.get(
                curve.method.name, (0.7, 1.2)
            )
            assert least < slope_seen < most, curve.name
            # Of the loosest tolerance a fifth of the steps is rejected, which costs more than a tighter one.
            costs = [p.cost for p in curve.points if p.tolerance < 5e-3]  # one more rejected step of dop853 is a ninth
            assert all(a <= 1.12 * b for a, b in itertools.pairwise(costs)), curve.name


def test_the_front_is_a_front(charts):
    """Nothing is cheaper and as right as a row of it, and what is not in it has a row that is as cheap and as right."""
    for chart, error, cost in itertools.product(charts.values(), data.ERRORS, data.COSTS):
        front = chart.front(error, cost)
        ends = [(row["cost"], row["error"]) for row in front]
        assert ends == sorted(ends)
        assert all(a[0] < b[0] and a[1] > b[1] for a, b in itertools.pairwise(ends))
        for curve in chart.curves:
            dependable = curve.dependable(error, chart.floor)
            for spent, point in zip(curve.costs(cost), curve.points, strict=True):
                if point in dependable and math.isfinite(point.error(error)):
                    assert any(c <= spent and e <= point.error(error) for c, e in ends), (error, cost, curve.name)
        assert bool(front) == (error != "phase_error" or chart.scene.period is not None)


def test_a_step_that_is_right_by_luck_is_not_on_the_front(charts):
    """One of a curve's errors is a thousandth of what it was, as if that step met an impact just right."""
    chart = charts["clover"]
    curve = max(chart.curves, key=lambda each: len(each.usable))
    place = next(i for i, point in enumerate(curve.points) if point.usable) + 2
    lucky = dataclasses.replace(curve.points[place], state_error=1e-3 * curve.points[place].state_error)
    points = (*curve.points[:place], lucky, *curve.points[place + 1 :])
    curve = dataclasses.replace(curve, points=points)
    assert lucky.usable
    assert lucky not in curve.dependable()
    changed = dataclasses.replace(chart, curves=(curve,))
    assert lucky.state_error not in [row["error"] for row in changed.front()]
    assert curve.cheapest(lucky.state_error) > lucky.cost
    # An unstable window a little below: the same.
    window = dataclasses.replace(curve.points[place + 2], unstable=True)
    curve = dataclasses.replace(curve, points=(*points[: place + 2], window, *points[place + 3 :]))
    assert curve.points[place + 1] not in curve.dependable()
    # Rounding errors that grow with the number of steps are no luck: 3 rungs are twice as many.
    grown = [dataclasses.replace(lucky, state_error=1e-12 * 10 ** (i / LADDER.RUNGS_PER_DECADE)) for i in range(6)]
    assert dataclasses.replace(curve, points=tuple(grown)).dependable() == tuple(grown)


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


# ---- files and pictures of these charts, which take time to make


def test_every_point_is_in_the_picture(charts):
    """Below 1 as a point of a curve, or above it as a mark; each unstable method's own marker where it falls off."""
    chart = charts["oscillator"]
    figure = chart.plot()
    assert faults(figure) == []
    curves, marks = figure.axes[0], figure.axes[2]
    words = " ".join(text.get_text() for text in (*curves.texts, *figure.texts)).replace("\n", ", ")
    cheapest = {row["method"] for row in chart.front()}
    # beside its curve, or among those for which there is no room
    assert all(curve.title in words for curve in chart.curves if curve.name in cheapest)
    assert marks.get_position().height == pytest.approx(0.1 * (marks.get_position().height + curves.get_position().height))
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
        if curve.method.is_implicit:
            assert not own  # it is stable at every step
            continue
        assert curve.method.evaluations / curve.largest_stable_step in own
