"""The animation of a run: bodies with trails, growing curves, a swinging chain; the errors so far beside it, and the time."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...base import checks
from ...base.pictures import new_figure
from ...errors import ArgumentError, UnsupportedError
from . import attitude_picture, body_picture
from .orbits_picture import BODIES, EXACT, body, exact, fixed, left_picture, square, view
from .runs import RunPicture
from .runs_finding import steps_of
from .runs_picture import curves, errors, greyed
from .style import FONT, GREY

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

ENDINGS = (".gif", ".mp4", ".html")

#: More frames than this are a mistake, and no animation.
MOST_FRAMES = 20_000

#: Dots per inch, for an animation of about 1000 pixels' width.
DPI = 62.5

#: A trail is as long as this share of the run, or of the period if there is one.
TRAIL = 0.1
TRAIL_OF_PERIOD = 0.3

Show = Callable[[int], None]


def need(path: str | Path, seconds: float, fps: float) -> tuple[float, float]:
    """Raise if no such animation can be written, before any work is done; or return its seconds and frames a second.

    Raises:
        ArgumentError: if the ending is not that of an animation, or its length cannot be.
        UnsupportedError: naming what is missing.
    """
    seconds = checks.number("seconds", seconds, positive=True, unit="seconds")
    fps = checks.number("fps", fps, positive=True, unit="frames a second")
    if seconds * fps > MOST_FRAMES:
        raise ArgumentError(f"seconds, fps: {seconds * fps:.3g} frames, expected {MOST_FRAMES} or fewer")
    ending = checks.file("path", path).suffix.lower()
    if ending not in ENDINGS:
        raise ArgumentError(f"path: expected an ending of an animation, one of {', '.join(ENDINGS)}, got {str(path)!r}")
    if ending == ".html":
        return seconds, fps
    new_figure(1.0, 1.0)  # raises if matplotlib is missing
    from matplotlib.animation import FFMpegWriter

    if ending == ".mp4" and not FFMpegWriter.isAvailable():
        raise UnsupportedError("animate: an .mp4 needs the program ffmpeg, which is not found; .gif and .html do not")
    return seconds, fps


def write(chart: RunPicture, path: str | Path, seconds: float, fps: float) -> None:
    """Draw every frame and write the animation."""
    from matplotlib import animation, rc_context

    good = np.flatnonzero(chart.finite)
    count = max(2, min(len(good), round(seconds * fps)))
    frames = good[np.round(np.linspace(0, len(good) - 1, count)).astype(int)]
    rate: Any = count / seconds
    ending = Path(path).suffix.lower()
    writer: Any
    writer = animation.PillowWriter(fps=rate) if ending == ".gif" else animation.FFMpegWriter(fps=rate)
    with rc_context(FONT):
        figure, show = stage(chart)
        with writer.saving(figure, str(path), DPI):
            for frame in frames.tolist():
                show(frame)
                writer.grab_frame(facecolor="white")


def stage(chart: RunPicture) -> tuple[Figure, Show]:
    """The figure, and what shows a saved state on it."""
    figure = new_figure(16.0, 9.0)
    figure.text(0.012, 0.95, chart.title, size=22, weight="bold")
    run = chart.run
    figure.text(0.012, 0.91, steps_of(run), size=15, color=GREY)
    now = figure.text(0.978, 0.945, "", size=20, ha="right", family="monospace")
    if chart.kind == "attitude":
        show_left, shown = (
            attitude_picture.animated(figure, chart),
            attitude_picture.angle_panels(figure, chart, (0.56, 0.1, 0.36, 0.76)),
        )
    elif chart.kind == "body":
        show_left, shown = body_picture.animated(figure, chart)
    else:
        show_left = {"orbits": _orbits, "swing": _swing, "rows": _rows}[chart.kind](figure, chart)
        shown = _errors(figure, chart, {"orbits": 0.56, "swing": 0.66, "rows": 0.66}[chart.kind])
    cursors = [axes.axvline(float(run.t[0]), color="black", linewidth=2.0) for axes in shown]
    digits = max(0, min(6, 2 - int(np.floor(np.log10(max(float(chart.elapsed[-1]) / 100.0, 1e-300))))))
    width = len(f"{run.t[-1]:.{digits}f}")

    def show(frame: int) -> None:
        t = float(run.t[frame])
        now.set_text(f"t = {t:{width}.{digits}f}")
        for cursor in cursors:
            cursor.set_xdata([t, t])
        show_left(frame)

    return figure, show


def _errors(figure: Figure, chart: RunPicture, left: float) -> list[Axes]:
    """The errors over the run, in grey; the panels of those that are known."""
    energy = figure.add_axes((left, 0.53, 0.978 - left, 0.33))
    state = figure.add_axes((left, 0.1, 0.978 - left, 0.33))
    errors(energy, state, chart)
    state.set_xlabel("time")
    return greyed(energy, state, chart)


def _orbits(figure: Figure, chart: RunPicture) -> Show:
    """Bodies with trails; those in space are seen along z."""
    plane = (0, 1)
    bodies = chart.places.shape[1]
    centre, size = view(chart, plane)
    axes = figure.add_axes((0.06, 0.1, 0.43, 0.76))
    square(axes, centre, size, plane, chart.places.shape[2])
    y = np.clip(chart.places, -1e9, 1e9)[..., plane]
    fixed(axes, chart, plane)
    if chart.exact_places is not None:
        for i in range(bodies):
            exact(axes, chart.exact_places[:, i, plane].T)
    if left_picture(chart, [(centre, size)], size):
        figure.text(0.06, 0.02, "A body leaves the picture.", size=13, color=GREY)
    many = bodies > len(BODIES)
    elapsed = chart.elapsed
    length = TRAIL * float(elapsed[-1])
    if chart.scene.period is not None:
        length = min(length, TRAIL_OF_PERIOD * chart.scene.period)
    trails, marks = [], []
    for i in range(bodies):
        look = body(chart, i)
        trails += axes.plot([], [], color=look["color"], linewidth=0.8 if many else 2.2, alpha=0.6, zorder=3)
        face = {"markerfacecolor": look["color"], "markeredgecolor": "white"}
        marks += axes.plot([], [], linestyle="", marker=look["marker"], markersize=6 if many else 15, zorder=4, **face)

    def show(frame: int) -> None:
        first = int(np.searchsorted(elapsed, elapsed[frame] - length))
        for i, (trail, mark) in enumerate(zip(trails, marks, strict=True)):
            trail.set_data(*y[first : frame + 1, i].T)
            mark.set_data(*y[frame : frame + 1, i].T)

    return show


def _swing(figure: Figure, chart: RunPicture) -> Show:
    """The coordinate and the velocity as they grow over the exact curves."""
    panels = curves(figure, chart, [])
    panels[-1].set_xlabel("time")
    grown = [max(axes.lines, key=lambda line: line.get_zorder()) for axes in panels]
    given = [np.asarray(line.get_data()) for line in grown]
    dots = [axes.plot([], [], "o", color="black", markersize=11, zorder=4)[0] for axes in panels]

    def show(frame: int) -> None:
        # What is not finite was not drawn, so the states drawn are the first ones.
        for (t, values), line, dot in zip(given, grown, dots, strict=True):
            line.set_data(t[: frame + 1], values[: frame + 1])
            dot.set_data(t[frame : frame + 1], values[frame : frame + 1])

    return show


def _rows(figure: Figure, chart: RunPicture) -> Show:
    """The coordinates side by side as they are now."""
    run = chart.run
    y = np.clip(run.y.reshape(len(run.t), -1), -1e9, 1e9)
    n = y.shape[1]
    known = y[:1] if chart.exact is None else chart.exact[2].reshape(-1, n)
    size = max(float(np.abs(known).max()), 1e-300)
    size = min(3.0 * size, max(size, float(np.abs(y[chart.finite]).max())))
    place = np.arange(1, n + 1)
    axes = figure.add_axes((0.065, 0.1, 0.515, 0.76))
    axes.set(xlim=(0, n + 1), ylim=(-1.1 * size, 1.1 * size), xlabel="number", ylabel="coordinate")
    axes.axhline(0.0, color="#cccccc", linewidth=0.8, zorder=0)
    true = axes.plot([], [], marker="o", markersize=16 if n <= 30 else 5, **EXACT)[0]
    mark = axes.plot([], [], color="black", linewidth=0.9, marker="o", markersize=9 if n <= 30 else 3, zorder=3)[0]
    true.set_label("exact")
    mark.set_label(run.method.title)
    shown = [mark] if chart.scene.exact is None else [mark, true]
    place_of: dict[str, Any] = {"loc": "lower right", "bbox_to_anchor": (1.0, 1.0)}
    axes.legend(handles=shown, frameon=False, ncols=2, borderpad=0.1, **place_of)

    def show(frame: int) -> None:
        mark.set_data(place, y[frame])
        if chart.scene.exact is not None and run.t[frame] <= chart.scene.until:
            true.set_data(place, chart.scene.exact(run.t[frame : frame + 1])[1].ravel())

    return show
