"""The animation of a run: bodies with trails, growing curves, a swinging chain; the errors so far beside it, and the time."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from ...base import checks, paths
from ...base.pictures import new_figure
from ...errors import ArgumentError, UnsupportedError
from . import page_animation
from .orbits_picture import BODIES, body, exact, fixed, square
from .run_panels import on_plane, side_by_side
from .runs import RunPicture
from .runs_finding import steps_of
from .runs_picture import draw_swings
from .series_picture import draw_pale_errors
from .solids_picture import animate_aircraft, animate_body
from .style import EXACT, FONT, GREY, Axes, Figure

ENDINGS = (".gif", ".mp4", ".html")

#: More frames than this are a mistake, and no animation.
MOST_FRAMES = 20_000

#: Dots per inch, for an animation of about 1000 pixels' width.
DPI = 62.5

#: Shows a saved state.
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
    ending = paths.file("path", path).suffix.lower()
    if ending not in ENDINGS:
        raise ArgumentError(f"path: expected an ending of an animation, one of {', '.join(ENDINGS)}, got {str(path)!r}")
    if ending == ".html":
        return seconds, fps
    new_figure(1.0, 1.0)  # raises if matplotlib is missing
    from matplotlib.animation import FFMpegWriter

    if ending == ".mp4" and not FFMpegWriter.isAvailable():
        raise UnsupportedError("animate: an .mp4 needs the program ffmpeg, which is not found; .gif and .html do not")
    return seconds, fps


def animate(chart: RunPicture, path: str | Path, seconds: float, fps: float) -> None:
    """Write a page or frames, by the ending of the path."""
    seconds, fps = need(path, seconds, fps)
    (page_animation.write if Path(path).suffix.lower() == ".html" else write)(chart, path, seconds, fps)


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
    motions = {"attitude": animate_aircraft, "body": animate_body, "orbits": _orbits, "swing": _swing, "rows": _rows}
    show_motion, panels = motions[chart.kind](figure, chart)
    cursors = [axes.axvline(float(run.t[0]), color="black", linewidth=2.0) for axes in panels]
    digits = chart.digits
    width = len(f"{run.t[-1]:.{digits}f}")

    def show(saved: int) -> None:
        t = float(run.t[saved])
        now.set_text(f"t = {t:{width}.{digits}f}")
        for cursor in cursors:
            cursor.set_xdata([t, t])
        show_motion(saved)

    return figure, show


def _errors(figure: Figure, chart: RunPicture, left: float) -> list[Axes]:
    return draw_pale_errors(figure, chart, (left, 0.53, 0.978 - left, 0.33), (left, 0.1, 0.978 - left, 0.33))


def _orbits(figure: Figure, chart: RunPicture) -> tuple[Show, list[Axes]]:
    """Points with trails; those in space are seen along z."""
    view = on_plane(chart)
    points = view.places.shape[1]
    axes = figure.add_axes((0.06, 0.1, 0.43, 0.76))
    square(axes, view, view.half)
    fixed(axes, view)
    if view.exact is not None:
        for i in range(points):
            exact(axes, view.exact[:, i].T)
    if view.leave(view.half):
        figure.text(0.06, 0.02, "A body leaves the picture.", size=13, color=GREY)
    many = points > len(BODIES)
    trails, marks = [], []
    for i in range(points):
        look = body(chart, i)
        trails += axes.plot([], [], color=look["color"], linewidth=0.8 if many else 2.2, alpha=0.6, zorder=3)
        face = {"markerfacecolor": look["color"], "markeredgecolor": "white"}
        marks += axes.plot([], [], linestyle="", marker=look["marker"], markersize=6 if many else 15, zorder=4, **face)
    elapsed, places = chart.elapsed, view.places

    def show(saved: int) -> None:
        # Frames are finite states, which are the first ones.
        first = int(np.searchsorted(elapsed, elapsed[saved] - chart.trail))
        for i, (trail, mark) in enumerate(zip(trails, marks, strict=True)):
            trail.set_data(*places[first : saved + 1, i].T)
            mark.set_data(*places[saved : saved + 1, i].T)

    return show, _errors(figure, chart, 0.56)


def _swing(figure: Figure, chart: RunPicture) -> tuple[Show, list[Axes]]:
    """The coordinate and the velocity as they grow over the exact curves."""
    panels, _ = draw_swings(figure, chart)
    lines = [axes.lines[len(axes.lines) - 2] for axes in panels]  # below it there is zero
    curves = [np.asarray(line.get_data()) for line in lines]
    dots = [axes.plot([], [], "o", color="black", markersize=11, zorder=4)[0] for axes in panels]

    def show(saved: int) -> None:
        for curve, line, dot in zip(curves, lines, dots, strict=True):
            line.set_data(*curve[:, : saved + 1])
            dot.set_data(*curve[:, saved : saved + 1])

    return show, _errors(figure, chart, 0.66)


def _rows(figure: Figure, chart: RunPicture) -> tuple[Show, list[Axes]]:
    """The coordinates side by side."""
    values, size = side_by_side(chart)
    n = values.shape[1]
    numbers = np.arange(1, n + 1)
    axes = figure.add_axes((0.065, 0.1, 0.515, 0.76))
    axes.set(xlim=(0, n + 1), ylim=(-1.1 * size, 1.1 * size), xlabel="number", ylabel="coordinate")
    axes.axhline(0.0, color="#cccccc", linewidth=0.8, zorder=0)
    true = axes.plot([], [], marker="o", markersize=16 if n <= 30 else 5, **EXACT)[0]
    mark = axes.plot([], [], color="black", linewidth=0.9, marker="o", markersize=9 if n <= 30 else 3, zorder=3)[0]
    true.set_label("exact")
    mark.set_label(chart.run.method.title)
    known = [mark] if chart.scene.exact is None else [mark, true]
    place: dict[str, Any] = {"loc": "lower right", "bbox_to_anchor": (1.0, 1.0)}
    axes.legend(handles=known, frameon=False, ncols=2, borderpad=0.1, **place)

    def show(saved: int) -> None:
        mark.set_data(numbers, values[saved])
        if (exact := chart.exact_at(slice(saved, saved + 1))) is not None:
            true.set_data(numbers, exact[1].ravel())

    return show, _errors(figure, chart, 0.66)
