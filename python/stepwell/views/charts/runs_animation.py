"""The animation of a run: bodies with trails, growing curves, a swinging chain; the errors so far beside it, and the time."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from ...base import checks, paths
from ...base.arrays import Array
from ...base.pictures import new_figure
from ...errors import ArgumentError, UnsupportedError
from . import page_animation
from .frames import Frames, write_gif, write_mp4
from .labels import title
from .orbits_picture import BODIES, body, exact, fixed, square
from .run_panels import Points, errors, is_hanging, side_by_side, view_of
from .runs import RunPicture
from .runs_finding import steps_of
from .runs_picture import draw_swings
from .series_picture import draw_pale_errors
from .solids_picture import animate_aircraft, animate_body
from .style import EXACT, FONT, GREY, RIGHT, Axes, Figure

ENDINGS = (".html", ".gif", ".mp4")

#: More frames than this are a mistake, and no animation.
MOST_FRAMES = 20_000

#: Inches of an animation with panels beside the motion, dots per inch for a width of 1000 pixels, and inches of a motion alone:
#: the width, and the least height.
SIZE, DPI = (12.8, 7.2), 1000.0 / 12.8
ALONE, LOWEST = 9.0, 4.0

#: Room above and below a motion alone, in inches.
ABOVE, BELOW = 1.25, 0.7

#: The colour of springs and rods. More than MANY_LINKS are thin; of more particles than MOST_MARKED only the springs are drawn.
LINKS, MANY_LINKS, MOST_MARKED = "#333333", 60, 200

#: Springs that are one curve with gaps, which is drawn many times as fast as a curve for each.
BUNCH = 2000

#: Shows a saved state.
Show = Callable[[int], None]

#: Function that shows the motion, parts that move on the figure, and panels over time.
Motion = tuple[Show, list[Any], list[Axes]]


def need(path: str | Path, seconds: float, fps: float) -> tuple[float, float]:
    """Raise if no such animation can be written, before any work is done; or return its seconds and frames a second."""
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


def animate(
    chart: RunPicture, path: str | Path, seconds: float, fps: float, progress: Callable[[float], object] | None = None
) -> None:
    """Write a page or frames, by the ending of the path."""
    seconds, fps = need(path, seconds, fps)
    progress = checks.callback("progress", progress)
    if Path(path).suffix.lower() == ".html":
        page_animation.write(chart, path, seconds, fps)
    else:
        write(chart, Path(path), seconds, fps, progress)


def write(chart: RunPicture, path: Path, seconds: float, fps: float, progress: Callable[[float], object] | None = None) -> None:
    """Draw every frame and write the animation."""
    from matplotlib import rc_context

    good = np.flatnonzero(chart.finite)
    count = max(2, min(len(good), round(seconds * fps)))
    states = good[np.round(np.linspace(0, len(good) - 1, count)).astype(int)]
    with rc_context(FONT):
        frames = Frames(*stage(chart), states.tolist(), progress)
        (write_gif if path.suffix.lower() == ".gif" else write_mp4)(frames, path, count / seconds)


def stage(chart: RunPicture) -> tuple[Figure, Show]:
    """The figure, and what shows a saved state on it. What moves is ``animated``."""
    points = view_of(chart) if chart.kind == "orbits" else None
    alone = points is not None and not any(series.lines for series in errors(chart))
    width, height = _size_alone(points) if points is not None and alone else SIZE
    figure = new_figure(width, height)
    figure.set_dpi(DPI)
    now = figure.text(1.0 - 0.3 / width, 1.0 - 0.6 / height, "", size=17 if alone else 20, ha="right", family="monospace")
    title(figure, 0.16 / width, 1.0 - 0.34 / height, chart.title, 20)
    figure.text(0.16 / width, 1.0 - 0.6 / height, steps_of(chart.run), size=15, color=GREY)
    motions = {"attitude": _aircraft, "body": _body, "swing": _swing, "rows": _rows}
    if points is None:
        show_motion, moving, panels = motions[chart.kind](figure, chart)
    else:
        place = (0.0, BELOW / height, 1.0, 1.0 - (ABOVE + BELOW) / height) if alone else (0.06, 0.1, 0.43, 0.74)
        show_motion, moving = _points(figure, chart, points, place)
        panels = [] if alone else draw_pale_errors(figure, chart, (0.56, 0.1, RIGHT - 0.56, 0.74))
    run = chart.run
    cursors = [axes.axvline(float(run.t[0]), color="black", linewidth=2.0) for axes in panels]
    for artist in (now, *moving, *cursors):
        artist.set_animated(True)
    digits = chart.digits
    places = len(f"{run.t[-1]:.{digits}f}")

    def show(saved: int) -> None:
        t = float(run.t[saved])
        now.set_text(f"t = {t:{places}.{digits}f}")
        for cursor in cursors:
            cursor.set_xdata([t, t])
        show_motion(saved)

    return figure, show


def _size_alone(view: Points) -> tuple[float, float]:
    """Inches of a motion without panels beside it: as high as the motion needs."""
    low, high = view.places.min(axis=(0, 1)), view.places.max(axis=(0, 1))
    aspect = float((high - low)[1] / max(2.0 * view.half, 1e-300))
    return ALONE, max(LOWEST, ABOVE + BELOW + min(1.0, 1.1 * aspect) * (ALONE - 1.0))


def _points(figure: Figure, chart: RunPicture, view: Points, place: tuple[float, float, float, float]) -> tuple[Show, list[Any]]:
    """Points with trails, and springs and rods as lines, in the view of the page."""
    count, links = view.places.shape[1], chart.links
    axes = figure.add_axes(place)
    square(axes, view, view.half)
    if is_hanging(chart):
        axes.set_axis_off()
    elif place[0] == 0.0:
        axes.set_position((0.09, place[1], 0.88, place[3]))
    axes.set_anchor("C" if is_hanging(chart) else "N")
    fixed(axes, view)
    if view.exact is not None and count <= len(BODIES):
        for i in range(count):
            exact(axes, view.exact[:, i].T)
    if view.leave(view.half):
        figure.text(0.06, 0.02, "A body leaves the picture.", size=13, color=GREY)
    held = [(point.place, i) for point in view.fixed for i in point.joined]
    width = 0.7 if len(links) > MANY_LINKS else 2.2
    rods = [axes.plot([], [], color=LINKS, linewidth=width, zorder=2.5)[0] for _ in range(0, len(links) + len(held), BUNCH)]
    many, marked = count > len(BODIES), count <= MOST_MARKED or not len(links)
    long = 0.0 if len(links) > len(BODIES) else chart.trail
    trails, marks = [], []
    for i in range(count if marked else 0):
        look = body(chart, i)
        trails += axes.plot([], [], color=look["color"], linewidth=0.8 if many else 2.2, alpha=0.6, zorder=2)
        face = {"markerfacecolor": look["color"], "markeredgecolor": "white"}
        marks += axes.plot([], [], linestyle="", marker=look["marker"], markersize=6 if many else 13, zorder=4, **face)
    elapsed, places = chart.elapsed, view.places

    def show(saved: int) -> None:
        # Frames are finite states, which are the first ones.
        first = int(np.searchsorted(elapsed, elapsed[saved] - long)) if long else saved
        here = places[saved]
        if rods:
            ends = np.concatenate([here[links], *(np.array([[anchor, here[i]]]) for anchor, i in held)])
            for k, rod in enumerate(rods):
                rod.set_data(*_apart(ends[k * BUNCH : (k + 1) * BUNCH]))
        for i, (trail, mark) in enumerate(zip(trails, marks, strict=True)):
            trail.set_data(*places[first : saved + 1, i].T)
            mark.set_data(*places[saved : saved + 1, i].T)

    return show, [*rods, *trails, *marks]


def _apart(ends: Array) -> Array:
    """Lines from the first to the second of each pair of points, shape (pairs, 2, 2), as one curve with gaps, shape (2, n)."""
    return np.concatenate([ends, np.full((len(ends), 1, 2), np.nan)], axis=1).reshape(-1, 2).T


def _swing(figure: Figure, chart: RunPicture) -> Motion:
    """The coordinate and the velocity as they grow over the exact curves."""
    known = any(series.lines for series in errors(chart))
    panels, _ = draw_swings(figure, chart, 0.515 if known else RIGHT - 0.065)
    lines = [axes.lines[len(axes.lines) - 2] for axes in panels]  # below it there is zero
    curves = [np.asarray(line.get_data()) for line in lines]
    dots = [axes.plot([], [], "o", color="black", markersize=11, zorder=4)[0] for axes in panels]

    def show(saved: int) -> None:
        for curve, line, dot in zip(curves, lines, dots, strict=True):
            line.set_data(*curve[:, : saved + 1])
            dot.set_data(*curve[:, saved : saved + 1])

    return show, [*lines, *dots], draw_pale_errors(figure, chart, (0.66, 0.1, RIGHT - 0.66, 0.74))


def _rows(figure: Figure, chart: RunPicture) -> Motion:
    values, size = side_by_side(chart)
    n = values.shape[1]
    numbers = np.arange(1, n + 1)
    axes = figure.add_axes((0.065, 0.1, 0.515, 0.74))
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

    return show, [mark, true], draw_pale_errors(figure, chart, (0.66, 0.1, RIGHT - 0.66, 0.74))


def _aircraft(figure: Figure, chart: RunPicture) -> Motion:
    return _in_space(figure, *animate_aircraft(figure, chart))


def _body(figure: Figure, chart: RunPicture) -> Motion:
    return _in_space(figure, *animate_body(figure, chart))


def _in_space(figure: Figure, show: Show, panels: list[Axes]) -> Motion:
    """A body, all of whose panel is drawn anew: its faces are before and behind other lines."""
    axes = figure.axes[0]
    return show, [*axes.lines, *axes.patches], panels
