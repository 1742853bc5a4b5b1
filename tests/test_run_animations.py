"""Animations of runs as files of frames: what is in them, and that nothing is cut off or covered."""

import math
from itertools import pairwise

import numpy as np
import pytest
import stepwell as sw
from PIL import Image
from stepwell.errors import ArgumentError, UnsupportedError
from stepwell.views.charts import runs_animation
from support.pictured import every_kind, looked_at, said, the_pictures  # noqa: F401


@every_kind
def test_an_animation_shows_the_states(pictures, kind, tmp_path):
    chart = pictures[kind]
    chart.animate(tmp_path / "run.gif", seconds=0.4, fps=10)
    frames = []
    with Image.open(tmp_path / "run.gif") as animation:
        assert (animation.size, animation.n_frames, animation.info["duration"]) == ((1000, 562), 4, 100)
        for i in range(4):
            animation.seek(i)
            frames.append(np.asarray(animation.convert("L"), dtype=int))
    for one, other in pairwise(frames):
        assert (np.abs(one - other) > 60).sum() > 30  # the bodies moved, and the clock went on


@every_kind
def test_nothing_in_an_animation_is_cut_off_or_covered(pictures, kind):
    figure, show = runs_animation.stage(pictures[kind])
    show(int(np.flatnonzero(pictures[kind].finite)[-1]))
    page = figure.bbox
    boxes = [axes.get_tightbbox() for axes in figure.axes]
    boxes += [text.get_window_extent() for text in figure.texts if text.get_text()]
    for i, box in enumerate(boxes):
        assert page.x0 <= box.x0 < box.x1 <= page.x1
        assert page.y0 <= box.y0 < box.y1 <= page.y1
        assert not any(box.overlaps(other) for other in boxes[:i])


def test_a_frame_is_the_state_of_its_time(pictures):
    chart = pictures["orbits"]
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

    chart = pictures["rows"]
    figure, show = runs_animation.stage(chart)
    show(33)
    exact, mark = figure.axes[0].lines[1:3]
    assert np.array_equal(mark.get_ydata(), chart.run.y[33])
    assert np.array_equal(exact.get_ydata(), chart.scene.exact(chart.run.t[33:34])[1][0])

    chart = pictures["swing"]
    figure, show = runs_animation.stage(chart)
    show(33)
    show(20)
    grown = next(line for line in figure.axes[0].lines if line.get_zorder() == 3)
    assert np.array_equal(grown.get_ydata(), chart.run.y[:21])


def test_no_frame_is_made_up(tmp_path):
    """Six states are six frames, and the animation is as long as was asked."""
    chart = looked_at(sw.scenes.clover(), every=20)
    chart.animate(tmp_path / "run.gif", seconds=3, fps=25)
    with Image.open(tmp_path / "run.gif") as animation:
        assert (animation.n_frames, animation.info["duration"]) == (6, 500)


def test_without_ffmpeg_an_mp4_is_refused_by_name(monkeypatch, tmp_path):
    from matplotlib import animation

    monkeypatch.setattr(animation.FFMpegWriter, "isAvailable", classmethod(lambda cls: False))
    chart = looked_at(sw.scenes.clover())
    with pytest.raises(UnsupportedError, match=r"an \.mp4 needs the program ffmpeg, which is not found"):
        chart.animate(tmp_path / "run.mp4")
    assert list(tmp_path.iterdir()) == []


def test_with_ffmpeg_an_mp4_is_written(tmp_path):
    from matplotlib import animation

    if not animation.FFMpegWriter.isAvailable():
        pytest.skip("there is no ffmpeg here")
    looked_at(sw.scenes.clover(), every=50).animate(tmp_path / "run.mp4", seconds=1, fps=2)
    assert (tmp_path / "run.mp4").read_bytes()[4:8] == b"ftyp"


@pytest.mark.parametrize(
    ("path", "options", "message"),
    [
        ("run.avi", {}, r"path: expected an ending of an animation, one of \.gif, \.mp4, \.html, got"),
        ("run.gif", {"seconds": 0}, "seconds: expected numbers above zero"),
        ("run.gif", {"fps": math.inf}, "fps"),
        ("run.gif", {"seconds": 1e6, "fps": 1e3}, "expected 20000 or fewer"),
    ],
)
def test_an_animation_that_cannot_be_is_refused(path, options, message, tmp_path):
    chart = looked_at(sw.scenes.clover())
    with pytest.raises(ArgumentError, match=message):
        chart.animate(tmp_path / path, **options)
    with pytest.raises(ArgumentError, match="expected an ending of a picture"):
        chart.plot(tmp_path / "run.gif2")
    assert list(tmp_path.iterdir()) == []
