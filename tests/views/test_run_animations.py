"""Animations of runs as files of frames: what is in them, and that nothing is cut off or covered."""

import math
import time
from itertools import pairwise

import numpy as np
import pytest
import stepwell as sw
from matplotlib import animation
from PIL import Image
from stepwell.errors import ArgumentError, UnsupportedError
from stepwell.views.charts import frames, runs_animation
from stepwell.views.charts.run_panels import view_of
from support.looks import faults
from support.pictured import every_kind, looked_at, picture_of
from support.refusals import refused


@every_kind
def test_an_animation_shows_the_states(kind, tmp_path):
    chart = picture_of(kind)
    chart.animate(tmp_path / "run.gif", seconds=0.4, fps=10)
    drawn = []
    with Image.open(tmp_path / "run.gif") as moving:
        assert (moving.size, moving.n_frames, moving.info["duration"]) == ((1000, 562), 4, 100)
        for i in range(4):
            moving.seek(i)
            drawn.append(np.asarray(moving.convert("L"), dtype=int))
    for one, other in pairwise(drawn):
        assert (np.abs(one - other) > 60).sum() > 30  # the bodies moved, and the clock went on


@every_kind
def test_nothing_in_an_animation_is_cut_off_or_covered(kind):
    figure, show = runs_animation.stage(picture_of(kind))
    show(int(np.flatnonzero(picture_of(kind).finite)[-1]))
    for artist in figure.findobj():
        artist.set_animated(False)
    assert [fault for fault in faults(figure) if "pixels" not in fault] == []  # its letters may be smaller than a page's


def test_a_frame_is_the_state_of_its_time():
    chart = picture_of("orbits")
    figure, show = runs_animation.stage(chart)
    show(70)
    assert f"t = {chart.run.t[70]:6.3f}" in [text.get_text() for text in figure.texts]
    marks = [line.get_xydata().tolist() for line in figure.axes[0].lines if len(line.get_xdata()) == 1]
    assert marks == [[chart.run.y[70, i].tolist()] for i in range(3)]
    trails = [line.get_xydata() for line in figure.axes[0].lines if 1 < len(line.get_xdata()) <= 71]
    for i, trail in enumerate(trails):
        assert np.array_equal(trail, chart.run.y[71 - len(trail) : 71, i])
        assert len(trail) == pytest.approx(0.3 * chart.scene.period / chart.run.dt, abs=2)
    assert len(trails) == 3

    chart = picture_of("rows")
    figure, show = runs_animation.stage(chart)
    show(33)
    exact, mark = figure.axes[0].lines[1:3]
    assert np.array_equal(mark.get_ydata(), chart.run.y[33])
    assert np.array_equal(exact.get_ydata(), chart.scene.exact(chart.run.t[33:34])[1][0])

    chart = picture_of("swing")
    figure, show = runs_animation.stage(chart)
    show(33)
    show(20)
    grown = next(line for line in figure.axes[0].lines if line.get_zorder() == 3)
    assert np.array_equal(grown.get_ydata(), chart.run.y[:21])


def test_no_frame_and_no_error_is_made_up(tmp_path):
    """Six states are six frames, and the animation is as long as was asked."""
    chart = looked_at(sw.scenes.clover(), every=20)
    chart.animate(tmp_path / "run.gif", seconds=3, fps=25)
    with Image.open(tmp_path / "run.gif") as moving:
        assert (moving.n_frames, moving.info["duration"]) == (6, 500)
    for kind, panels in (("orbits", 2), ("space", 1)):
        figure, _ = runs_animation.stage(picture_of(kind))
        assert len(figure.axes) == 1 + panels
        assert not any("no exact solution" in text.get_text() for axes in figure.axes for text in axes.texts)


def test_rods_and_springs_are_drawn_in_the_view_of_the_page():
    for name in ("double_pendulum", "jelly_cube"):
        scene = sw.scenes.scene(name)
        chart = looked_at(scene, "rk4", steps=40)
        figure, show = runs_animation.stage(chart)
        show(30)
        (drawn,) = [line for line in figure.axes[0].lines if np.isnan(line.get_xdata()).any()]
        pairs = drawn.get_xydata().reshape(-1, 3, 2)[:, :2]
        places = view_of(chart).places[30]
        if name == "double_pendulum":
            assert pairs.tolist() == [places.tolist(), [[0.0, 0.0], places[0].tolist()]]
        else:
            np.testing.assert_array_equal(pairs, places[scene.system.pairs])


def test_what_moves_is_all_that_differs_from_a_whole_drawing():
    """The frames that are drawn over one ground are those of a figure that is drawn anew."""
    chart = picture_of("orbits")
    figure, show = runs_animation.stage(chart)
    drawn = frames.Frames(figure, show, [20, 70])
    drawn.frame(20)
    over = drawn.frame(70)
    figure, show = runs_animation.stage(chart)
    for artist in figure.findobj():
        artist.set_animated(False)
    show(70)
    figure.canvas.draw()
    whole = np.array(figure.canvas.buffer_rgba())[..., :3]
    assert (np.abs(over.astype(int) - whole.astype(int)) > 60).any(axis=2).mean() < 2e-3  # where the order of lines differs


@pytest.mark.parametrize("name", ["double_pendulum", pytest.param("cloth", marks=pytest.mark.long)])
def test_a_gif_is_quick_and_small_and_says_how_far_it_is(name, tmp_path):
    scene = sw.scenes.scene(name)
    chart = looked_at(scene, "leapfrog" if name == "cloth" else "rk4")
    shares = []
    begun = time.process_time()
    chart.animate(tmp_path / "run.gif", progress=shares.append)
    assert time.process_time() - begun < 20.0  # of 200 frames, on a busy machine
    assert shares == sorted(shares)
    assert shares[-1] == 1.0
    assert (tmp_path / "run.gif").stat().st_size <= 1_500_000
    with Image.open(tmp_path / "run.gif") as moving:
        assert moving.n_frames == len(shares)
        assert moving.n_frames * moving.info["duration"] == pytest.approx(10_000, rel=0.05)


def test_an_animation_that_cannot_be_is_refused(monkeypatch, tmp_path):
    chart = looked_at(sw.scenes.clover())
    for path, options, message in (
        ("run.avi", {}, r"path: expected an ending of an animation, one of \.html, \.gif, \.mp4, got"),
        ("run.gif", {"seconds": 0}, "seconds: expected numbers above zero"),
        ("run.gif", {"fps": math.inf}, "fps"),
        ("run.gif", {"seconds": 1e6, "fps": 1e3}, "expected 20000 or fewer"),
    ):
        refused(ArgumentError, message, chart.animate, tmp_path / path, **options)
    refused(ArgumentError, "expected an ending of a picture", chart.plot, tmp_path / "run.gif2")
    monkeypatch.setattr(animation.FFMpegWriter, "isAvailable", classmethod(lambda cls: False))
    refused(UnsupportedError, r"an \.mp4 needs the program ffmpeg, which is not found", chart.animate, tmp_path / "run.mp4")
    assert list(tmp_path.iterdir()) == []
