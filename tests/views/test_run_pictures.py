"""Pictures and animations of runs: what is in them, and that nothing is cut off or covered."""

import dataclasses
import itertools
import math
import pickle
import sys
from pathlib import Path

import numpy as np
import pytest
import stepwell as sw
from stepwell.base.pictures import png
from stepwell.errors import ArgumentError, DTypeError, ShapeError, UnknownNameError, UnsupportedError
from stepwell.views.charts import orbits_picture, runs_animation, runs_picture, solids, solids_picture, style
from stepwell.views.charts.kinds import KINDS as ROWS
from stepwell.views.charts.kinds import kind_of
from stepwell.views.charts.runs import own_picture
from support.charted import files_of
from support.families import family
from support.looks import faults
from support.pictured import every_kind, every_kind_with_errors, figure_of, looked_at, picture_of, said
from support.refusals import refused


def test_a_picture_holds_the_errors_of_the_scene_as_far_as_they_are_known():
    scene = sw.scenes.kepler()
    run = scene.run("leapfrog", every=10)
    chart = sw.charts.run_picture("kepler", run)
    assert np.array_equal(chart.state_error, scene.state_error(run))
    assert np.array_equal(chart.energy_error, scene.energy_error(run))
    assert chart.energy_scale == "the largest kinetic energy of the exact solution"
    numbers = {"dt": 0.01, "steps": run.steps, "kept": len(run.t), "diverged_at_step": None}
    largest = {f"largest_{name}_error": getattr(scene, f"{name}_error")(run).max() for name in ("state", "energy")}
    assert chart.summary() == {"scene": "kepler", "method": "leapfrog"} | numbers | largest
    scene = dataclasses.replace(sw.scenes.clover(), until=3.0)
    chart = looked_at(scene)
    known = scene.state_error(chart.run)[chart.run.t <= 3.0]
    assert 0 < len(known) < len(chart.run.t)
    assert chart.summary()["largest_state_error"] == known.max()
    assert "not known after t = 3" in [text.get_text() for axes in chart.plot().axes for text in axes.texts]


def test_without_an_exact_solution_the_energy_is_compared_with_the_start():
    chart = looked_at(sw.scenes.energy_control(), "standard_euler", steps=300)
    assert chart.state_error is None
    assert chart.summary()["largest_state_error"] is None
    energy = chart.run.energy
    kinetic = 0.5 * (chart.scene.v**2).sum()
    np.testing.assert_allclose(chart.energy_error, np.abs(energy - energy[0]) / kinetic, rtol=1e-12)
    rest = dataclasses.replace(sw.scenes.pythagorean(), exact=None)
    chart = looked_at(rest, "leapfrog", steps=10)
    np.testing.assert_allclose(chart.energy_error, np.abs(chart.run.energy / (-769 / 60) - 1), rtol=0, atol=1e-12)
    assert chart.energy_scale == "the energy at the start"
    # A ball that falls from height 0: its energy is 0 at the start, and its kinetic energy the largest where it is lowest.
    ball = sw.Scene(sw.Particles(gravity=2.0, dim=1), v=[[0.0]], y=[[0.0]], dt=0.1, horizon=1.0)
    chart = looked_at(ball, "standard_euler")
    assert chart.energy_scale == "the largest kinetic energy of the run"
    kinetic = 0.5 * chart.run.v[:, 0, 0] ** 2
    np.testing.assert_allclose(chart.energy_error, np.abs(chart.run.energy) / kinetic.max(), rtol=1e-12)
    assert chart.energy_error.max() > 0.01


def test_files_hold_the_kept_states(tmp_path):
    chart = picture_of("crash")
    rows, whole = files_of(chart, tmp_path)
    assert list(rows[0]) == ["t", "v", "y", "energy", "state_error", "energy_error"] == list(chart.rows()[0])
    assert [float(row["y"]) for row in rows[:100]] == chart.run.y[:100].tolist()
    assert whole["summary"]["diverged_at_step"] == chart.run.first_bad_step
    assert whole["rows"][-1]["y"] is None
    assert "y[63, 2]" in files_of(picture_of("space"), tmp_path)[0][0]


def test_what_is_a_run_of_the_scene_and_what_is_not():
    scene = sw.scenes.clover()
    chart = looked_at(scene, "standard_euler", control=sw.EnergyControl(1.0))
    assert "EnergyControl" in said(chart.plot())
    s, oscillator = sw.scenes.clover(), sw.scenes.oscillator()
    run = s.run("rk4", every=1)
    own = {"v": s.v, "dt": 0.1, "steps": 5, "every": 1}
    for scene, other, error, message in (
        ("clovr", run, UnknownNameError, "did you mean 'clover'"),
        (3, run, DTypeError, "scene: expected a Scene or its name, got int"),
        (s, 3, DTypeError, "run: expected what scene.run returns, got int"),
        (s, s.run("rk4"), ArgumentError, "run: expected two saved states or more, got 1; run with every="),
        ("plummer", run, ShapeError, r"run: expected one member with states of shape \(64, 3\)"),
        ("figure_eight", run, ArgumentError, "got another start or system"),
        (sw.scenes.oscillator(2.0), oscillator.run("rk4", every=1), ArgumentError, "another start or system"),
        (s, sw.integrate(s.system, "rk4", y=2 * s.y, **own), ArgumentError, "another start or system"),
        (s, sw.integrate(s.system, "rk4", y=np.repeat(s.y[..., None], 2, -1), **own), ShapeError, "run: expected one member"),
    ):
        refused(error, message, sw.charts.run_picture, scene, other)


@every_kind
def test_nothing_in_the_picture_is_cut_off_or_covered(kind):
    figure = figure_of(kind)
    assert (figure.get_size_inches() * figure.dpi).tolist() == [1600, 900]
    assert faults(figure) == []
    panels = [axes.get_tightbbox() for axes in figure.axes]
    assert not any(one.overlaps(other) for one, other in itertools.combinations(panels, 2))


@every_kind_with_errors
def test_energy_is_never_shown_alone(kind):
    """Below it the state error, or the words that there is none; and no panel without a curve."""
    chart, figure = picture_of(kind), figure_of(kind)
    panels = {axes.get_title(loc="left").split(" over")[0]: axes for axes in figure.axes}
    assert "energy error" in panels
    assert ("state error" in panels) is (chart.state_error is not None)
    assert ("No exact solution is known" in said(figure)) is (chart.state_error is None)
    for axes, error in ((panels["energy error"], chart.energy_error), (panels.get("state error"), chart.state_error)):
        if error is not None:
            shown = axes.lines[0].get_ydata()
            good = np.isfinite(error) & (error > 0)
            assert np.array_equal(shown[good], error[good])
            assert np.isnan(shown[~good]).all()
            assert axes.get_ylim()[1] > min(error[good].max(), 1e300)


def test_orbits_are_where_the_bodies_went():
    chart = picture_of("two")
    axes = figure_of("two").axes[0]
    assert axes.get_aspect() == 1.0
    paths = [line for line in axes.lines if len(line.get_xdata()) == len(chart.run.t)]
    assert [line.get_xydata().tolist() for line in paths] == [chart.run.y[:, i].tolist() for i in (0, 1)]
    single = [(line.get_xydata().tolist()[0], line.get_markerfacecolor()) for line in axes.lines if len(line.get_xdata()) == 1]
    for i, look in enumerate(orbits_picture.BODIES[:2]):
        assert (chart.run.y[0, i].tolist(), "white") in single
        assert (chart.run.y[-1, i].tolist(), look["color"]) in single
    exact = [line for line in axes.lines if line.get_linewidth() == orbits_picture.EXACT["linewidth"]]
    assert len(exact) == 2
    box = axes.get_xlim() + axes.get_ylim()
    assert np.abs(chart.run.y).max() < max(map(abs, box))
    assert [text.get_text() for text in axes.get_legend().get_texts()] == ["body 1", "body 2", "exact", "start", "end"]


def test_bodies_in_space_are_seen_from_two_sides_and_told_apart():
    chart = picture_of("space")
    above, side = figure_of("space").axes[:2]
    assert [(a.get_xlabel(), a.get_ylabel(), a.get_title(loc="left")) for a in (above, side)] == [
        ("x", "y", "seen along z"),
        ("x", "z", "seen along y"),
    ]
    assert np.ptp(above.get_xlim()) == pytest.approx(np.ptp(side.get_ylim()))
    for axes, plane in ((above, (0, 1)), (side, (0, 2))):
        assert np.array_equal(axes.lines[0].get_xydata(), chart.run.y[:, 0][:, plane])
    # One hue a body, of those that tests/views/test_looks.py tells apart in grey and without green cones, too.
    looks = orbits_picture.BODIES
    assert len({look["marker"] for look in looks}) == len({look["color"] for look in looks}) == len(looks)
    assert {look["color"] for look in looks} <= set(style.FAMILIES.values())


def test_neither_a_long_run_nor_the_last_body_hides_the_others():
    chart = looked_at(sw.scenes.figure_eight(), "leapfrog", steps=3 * orbits_picture.LONG_CURVE)
    assert orbits_picture.crowded(chart, 2.4)
    lines = chart.plot().axes[0].lines
    paths = [line.get_zorder() for line in lines if len(line.get_xdata()) == len(chart.run.t)]
    exact = [line.get_zorder() for line in lines if line.get_linestyle() == "--"]
    assert min(exact) > max(paths)
    # The last one drawn would hide the others: each has its colour where it went in the last third of a period.
    chart = looked_at(sw.scenes.clover(), "rk4")
    axes = chart.plot().axes[0]
    arcs = [line for line in axes.lines if line.get_linewidth() == 3.0]
    assert [line.get_color() for line in arcs] == [look["color"] for look in orbits_picture.BODIES[:3]]
    assert [line.get_xydata()[-1].tolist() for line in arcs] == chart.run.y[-1].tolist()
    third = chart.scene.period / 3
    for line in arcs:
        assert len(line.get_xdata()) == pytest.approx(third / chart.run.dt, abs=1.0)
    assert not orbits_picture.one_curve(looked_at(sw.scenes.pythagorean(), "rk4", steps=10))
    assert not orbits_picture.one_curve(picture_of("two"))


def test_the_distance_from_the_centre_is_drawn_over_the_angle():
    """Kepler's ellipse: r = a·(1 − e²)/(1 + e·cos θ) of each body, half of the relative orbit; a turn a period."""
    chart = picture_of("two")
    axes = next(a for a in figure_of("two").axes if a.get_title(loc="left").startswith("distance from the centre"))
    for i, line in enumerate(line for line in axes.lines if line.get_zorder() == 3):
        np.testing.assert_allclose(line.get_ydata(), np.hypot(*chart.run.y[:, i].T), rtol=1e-15)
    grey = next(line for line in axes.lines if line.get_zorder() == 1)
    angle, r = 2 * np.pi * grey.get_xdata(), grey.get_ydata()
    e = 0.9
    nearest = angle[np.argmin(r)]
    # The least is found among 6001 points, 1e-3 of a turn apart where r is least; the ellipse is flat there.
    ellipse = 0.5 * (1 - e * e) / (1 + e * np.cos(angle - nearest))
    np.testing.assert_allclose(r, ellipse, rtol=0.05)
    assert not any(a.get_title(loc="left").startswith("distance") for a in figure_of("orbits").axes)


def test_what_leaves_the_picture_or_the_finite_numbers_is_said():
    assert "A body leaves the picture." in said(figure_of("gone"))
    assert "The curve leaves the picture." in said(figure_of("grown"))
    for kind in ("orbits", "two", "swing", "rows", "space"):
        assert "leaves" not in said(figure_of(kind))
    low, high = figure_of("grown").axes[0].get_ylim()
    assert -4 < low < -1 < 1 < high < 4
    figure, step = figure_of("crash"), int(picture_of("crash").run.first_bad_step)
    assert f"Diverged at step {step} (t = {step * 100:g})" in said(figure)
    assert " not finite " in [text.get_text() for text in figure.axes[-1].texts]
    for name, dt, steps in (("aircraft", 2.0, 900), ("dzhanibekov", 4.0, 300)):
        with pytest.warns(sw.DivergenceWarning):
            chart = looked_at(sw.scenes.scene(name), "standard_euler", dt, steps=steps)
        assert "Diverged at step" in said(chart.plot())


def test_swings_and_rows_are_the_states():
    chart = picture_of("swing")
    above, below = figure_of("swing").axes[:2]
    assert np.array_equal(above.lines[1].get_ydata(), chart.run.y)
    assert np.array_equal(below.lines[1].get_ydata(), chart.run.v)
    np.testing.assert_allclose(above.lines[0].get_ydata(), np.cos(above.lines[0].get_xdata()), rtol=0, atol=1e-14)
    chart = picture_of("rows")
    axes = figure_of("rows").axes[0]
    drawn = [line.get_ydata() for line in axes.lines if len(line.get_xdata()) == len(chart.run.t)]
    assert len(drawn) == 8
    for i, (line, tick) in enumerate(zip(drawn, axes.get_yticks(), strict=True)):
        np.testing.assert_allclose(line - tick, chart.run.y[:, i], rtol=0, atol=1e-12)
    axes = figure_of("many rows").axes[0]
    labels = [label.get_text() for label in axes.get_yticklabels()]
    assert (labels[0], labels[-1], len(labels)) == ("1", "100", runs_picture.MOST_ROWS)


def test_an_aircraft_is_drawn_by_its_angles_and_its_axes():
    chart = picture_of("attitude")
    assert (chart.kind, chart.energy_error, chart.state_error) == ("attitude", None, None)
    figure = figure_of("attitude")
    roll, pitch, yaw, *_, rates = figure.axes
    for i, axes in enumerate((roll, pitch, yaw)):
        np.testing.assert_array_equal(axes.lines[0].get_xydata(), np.stack([chart.run.t, chart.run.y[:, i]], axis=1))
    np.testing.assert_array_equal(roll.lines[1].get_ydata(), chart.run.system.commanded("roll", chart.run.t))
    assert set(pitch.lines[1].get_ydata()) == {-10.0}
    assert sorted(text.get_text() for text in roll.texts) == ["commanded", "φ"]
    np.testing.assert_array_equal([line.get_ydata() for line in rates.lines], chart.run.v.T)
    # Level at t = 0: seen from behind, to the right and above, the nose is farther away and so higher, the right wing nearer.
    level = dict(zip(solids.AIRCRAFT, figure.axes[3].patches, strict=True))
    assert level["fuselage"].get_xy()[0, 1] > level["fin"].get_xy()[0, 1]
    assert level["right wing"].get_zorder() > level["left wing"].get_zorder()
    # Where it banks to the right, the right wing is down.
    at = solids_picture.attitudes(chart, solids_picture.AIRCRAFT_ATTITUDES)
    banked = next(i for i, frame in enumerate(at) if chart.run.y[frame, 0] > 20.0)
    parts = dict(zip(solids.AIRCRAFT, figure.axes[3 + banked].patches, strict=True))
    turned = chart.run.system.rotation(chart.run.y[at[banked]])
    tip = turned @ solids.AIRCRAFT["right wing"][0][1]
    assert tip[2] < -0.3
    screen = solids.viewed()
    np.testing.assert_allclose(parts["right wing"].get_xy()[1], [tip @ screen.right, tip @ screen.up], rtol=0, atol=1e-15)


def test_angles_that_jump_are_broken_off_and_a_box_has_the_moments_of_the_body():
    line = figure_of("trapped").axes[0].lines[0]
    assert np.isnan(line.get_ydata()).sum() >= 1
    assert (np.abs(np.diff(line.get_ydata())[~np.isnan(np.diff(line.get_ydata()))]) <= 180.0).all()
    known, run = line.get_ydata()[~np.isnan(line.get_ydata())], picture_of("trapped").run
    np.testing.assert_array_equal(known, run.system.angles(run.y, axis=1)[:, 0])
    for inertia in ([2.0, 3.0, 4.0], [1.0, 1.0, 1.6], [5.0, 4.0, 2.0]):
        a, b, c = solids.half_sides(np.array(inertia))
        moments = np.array([b * b + c * c, c * c + a * a, a * a + b * b])  # of a box: m/3 of these
        np.testing.assert_allclose(moments / moments[0], np.array(inertia) / inertia[0], rtol=1e-14)
        for axis in range(3):
            faces = solids.box(np.array([a, b, c]), axis)
            assert {fill for _, fill in faces.values()} == {solids.FRONT, solids.BACK, *solids.SIDES}
            for name, (corners, _) in faces.items():
                i = int(name[1]) - 1
                assert {corner[i] for corner in corners} == {(a, b, c)[i] * (1.0 if name[0] == "+" else -1.0)}


def turned_up(chart):
    """Axis and tip, from Rodrigues' formula: the momentum at the start is turned to the third axis, everything else with it."""
    matrices = np.moveaxis(sw.quaternion.matrix(chart.run.y.T), -1, 0)
    momentum = matrices[0] @ (chart.run.system.inertia * chart.run.v[0])
    x, y, z = momentum / np.linalg.norm(momentum)
    across, sine = np.array([y, -x, 0.0]), math.hypot(x, y)
    n = across / sine
    cross = np.array([[0.0, -n[2], n[1]], [n[2], 0.0, -n[0]], [-n[1], n[0], 0.0]])
    return (np.eye(3) + sine * cross + (1.0 - z) * cross @ cross) @ matrices


def test_a_rigid_body_is_drawn_by_the_path_of_its_axis_and_as_a_box():
    chart = picture_of("body")
    assert (chart.kind, solids.main_axis(chart)) == ("body", 1)
    # Two ways to the same turn: some thirty roundings of numbers up to 1, 2⁻⁵³ each, are below 1e-14.
    figure = figure_of("body")
    ball, *small, omega, _, _ = figure.axes
    assert len(small) == solids_picture.BODY_ATTITUDES
    screen, matrices = solids.viewed(elevation=solids.BODY_ELEVATION), turned_up(chart)
    tips = matrices[:, :, 1]
    drawn = [line for line in ball.lines if len(line.get_xdata()) == len(chart.run.t) and line.get_color() == "#000000"]
    seen = np.stack([tips @ screen.right, tips @ screen.up], axis=-1)
    fore, behind = (np.ma.masked_invalid(line.get_xydata()) for line in drawn)
    assert not (np.ma.getmaskarray(fore) & np.ma.getmaskarray(behind)).any()  # in front or behind, and nowhere left out
    for line in (fore, behind):
        assert 10 < line[:, 0].count() < len(seen)
        assert np.abs(line - seen).max() < 1e-14
    assert (~np.ma.getmaskarray(fore)[:, 0])[tips @ screen.near >= 0.0].all()
    np.testing.assert_array_equal([line.get_ydata() for line in omega.lines[3:]], chart.run.v.T)
    np.testing.assert_array_equal([line.get_ydata() for line in omega.lines[:3]], chart.exact[1].T)
    # The dark face of the box is where the axis points: up at the start, down after it has turned over.
    half = solids.half_sides(chart.run.system.inertia)
    heights = []
    for axes, frame in zip(small, solids_picture.attitudes(chart, solids_picture.BODY_ATTITUDES), strict=True):
        names = solids.box(half, 1)
        dark = dict(zip(names, axes.patches, strict=True))["+2"]
        middle = half[1] * matrices[frame, :, 1]
        assert np.abs(dark.get_xy()[:4].mean(axis=0) - [middle @ screen.right, middle @ screen.up]).max() < 1e-14
        heights.append(matrices[frame, 2, 1])
    assert heights[0] > 0.99
    assert min(heights) < -0.9


def test_the_path_of_a_top_has_the_vertical_up():
    chart = picture_of("top")
    np.testing.assert_array_equal(solids.upright(chart), np.eye(3))
    assert "up is the third axis of space" in said(figure_of("top"))
    assert "up is the angular momentum" in said(figure_of("body"))
    # A centre of mass on the other side of the axis hangs, and so does the disc.
    for centre, side in (([0.0, 0.0, 1.0], 1.0), ([0.0, 0.0, -1.0], -1.0)):
        top = sw.Scene(
            sw.RigidBody([1.0, 1.0, 0.5], weight=4.0, centre=centre), v=[0.3, 0.0, 0.0], y=[1.0, 0.0, 0.0, 0.0], horizon=1.0
        )
        disc = looked_at(top, "rk4").plot().axes[1].patches[0].get_xy()
        assert np.sign(disc[:, 1].mean()) == side
    upside_down = sw.Scene(sw.RigidBody([1.0, 1.0, 0.5]), v=[0.0, 0.0, -1.0], y=[1.0, 0.0, 0.0, 0.0], horizon=3.0)
    turned = solids.upright(looked_at(upside_down, "rk4"))
    assert (turned @ [0.0, 0.0, -1.0]).tolist() == [0.0, 0.0, 1.0]
    assert np.linalg.det(turned) == 1.0


def test_the_energy_of_a_body_is_judged_as_far_as_it_is_constant():
    start = {"v": [0.1, 1.0, 0.1], "y": [1.0, 0.0, 0.0, 0.0], "horizon": 3.0}
    free = looked_at(sw.Scene(sw.RigidBody([1.0, 2.0, 2.5], damping=0.0), **start), "rk4")
    assert free.energy_error.max() < 1e-6
    for options in ({"damping": 0.1}, {"torque": [0.1, None, None]}, {"space_torque": [None, 0.1, None]}):
        chart = looked_at(sw.Scene(sw.RigidBody([1.0, 2.0, 2.5], **options), **start), "rk4")
        assert chart.energy_error is None
    assert chart.plot().axes[-1].get_title(loc="left") == "energy over time; forces take or give it"


def test_a_frame_is_the_attitude_of_its_time():
    chart = picture_of("body")
    figure, show = runs_animation.stage(chart)
    show(90)
    show(60)
    screen, matrices = solids.viewed(elevation=solids.BODY_ELEVATION), turned_up(chart)
    tip = matrices[60, :, 1]
    rod = next(line for line in figure.axes[0].lines if len(line.get_xdata()) == 2 and line.get_color() == "black")
    assert np.abs(rod.get_xydata()[1] - solids.REACH * np.array([tip @ screen.right, tip @ screen.up])).max() < 1e-14
    trail = next(line for line in figure.axes[0].lines if line.get_color() == "#7a7a7a")
    assert np.abs(trail.get_xydata()[-1] - rod.get_xydata()[1]).max() < 1e-14


def test_pictures_can_be_drawings_and_a_notebook_shows_them_without_pyplot(tmp_path, monkeypatch):
    """IPython asks an object for ``_repr_png_``; what it knows of matplotlib's figures it learns from pyplot."""
    run = sw.integrate(sw.Pendulum(), "rk4", v=0.0, y=2.0, dt=0.1, steps=30, every=1)
    for ending, start in (("svg", b"<?xml"), ("pdf", b"%PDF-"), ("png", b"\x89PNG")):
        figure = run.plot(tmp_path / f"run.{ending}")
        assert (tmp_path / f"run.{ending}").read_bytes().startswith(start)
    assert figure._repr_png_() == png(figure) == (tmp_path / "run.png").read_bytes()
    assert pickle.loads(pickle.dumps(figure))._repr_png_().startswith(b"\x89PNG")
    chart = looked_at(sw.scenes.clover())
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    for draw in (chart.plot, lambda: chart.animate(tmp_path / "run.gif")):
        refused(UnsupportedError, r"pip install 'stepwell\[chart\]'", draw)
    chart.to_csv(tmp_path / "run.csv")


@pytest.mark.parametrize(
    ("scene", "adaptive"),
    family(
        itertools.product(("oscillator", "clover", "dzhanibekov", "aircraft"), (False, True)),
        lambda scene, adaptive: adaptive == (scene in ("oscillator", "aircraft")),
    ),
)
def test_a_run_back_in_time_is_drawn(scene: str, adaptive: bool, tmp_path: Path) -> None:
    """The time goes on to the right as the run went, to ever smaller numbers; and trails end where the body is."""
    own = sw.scenes.scene(scene)
    start = {"v": own.v, "y": own.y}
    if adaptive:
        run = sw.integrate(own.system, "dop853", **start, tolerance=1e-8, at=-own.dt * np.arange(1.0, 16.0))
    else:
        run = sw.integrate(own.system, "rk4", **start, dt=-own.dt, steps=15, every=1)
    picture = own_picture(run)
    assert (np.diff(picture.elapsed) > 0.0).all()
    figure = run.plot(tmp_path / "back.png")
    over_time = [axes for axes in figure.axes if axes.get_xlabel() == "time"]
    assert over_time
    for axes in over_time:
        left, right = axes.get_xlim()
        assert left > right
    run.animate(tmp_path / "back.html")
    run.animate(tmp_path / "back.gif", seconds=0.5, fps=4.0)


def test_every_system_has_a_row_that_says_how_it_is_drawn() -> None:
    """Of a class without one, that of the class from which it is derived."""
    assert kind_of(sw.scenes.double_pendulum().system).links(sw.scenes.double_pendulum().system) == [(0, 1)]
    assert [point.joined for point in kind_of(sw.Pendulum3D()).fixed_points(sw.Pendulum3D())] == [(0,)]
    heavy_and_light = kind_of(sw.RestrictedThreeBody()).fixed_points(sw.RestrictedThreeBody(mu=0.3))
    assert [point.name for point in heavy_and_light] == ["heavy body", "light body"]
    assert kind_of(sw.Chain(3)).owner == "mass"
    assert kind_of(sw.Oscillator()) is ROWS[sw.System]
    y = np.array([[0.0], [1.0]])
    on_a_line = sw.integrate(sw.Particles([1.0, 1.0]), "rk4", v=0.0 * y, y=y, dt=0.01, steps=3, every=1)
    assert own_picture(on_a_line).kind == "rows"
