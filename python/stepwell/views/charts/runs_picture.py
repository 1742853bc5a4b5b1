"""The picture of one run: its motion on the left, the errors of energy and of state on the right."""

from __future__ import annotations

import textwrap

import numpy as np

from .kinds import kind_of
from .labels import title
from .orbits_picture import draw_net, draw_orbits, is_net, radii, turning
from .run_panels import is_hanging, swings
from .runs import LARGEST, RunPicture
from .runs_finding import broke_off, finding, steps_of
from .series_picture import draw_column, draw_errors, over_time
from .solids_picture import draw_aircraft, draw_body
from .style import BOTTOM, DPI, EXACT, GREY, LONG_CURVE, RIGHT, SIZE, TOP, Axes, Figure, page

#: Rows of a chain are drawn up to here; of more, these many evenly chosen ones.
MOST_ROWS = 24

#: The most letters of a line of notes.
LETTERS = 135


def draw(chart: RunPicture) -> Figure:
    """Draw the run on a new figure."""
    motions = {"attitude": draw_aircraft, "body": draw_body, "orbits": _orbits, "swing": _curves, "rows": _curves}
    with page(*SIZE, dpi=DPI) as figure:
        notes = motions[chart.kind](figure, chart)
        _text(figure, chart, notes)
    return figure


def _orbits(figure: Figure, chart: RunPicture) -> list[str]:
    if chart.before is None and is_net(chart):
        notes = draw_net(figure, chart, 0.63)
        _errors_beside(figure, chart, 0.71)
        return notes
    notes = draw_orbits(figure, chart)
    left = 0.55 if (chart.places.shape[2] == 2 or is_hanging(chart)) and chart.before is None else 0.735
    if turning(chart):
        radii(figure.add_axes((left, 0.68, RIGHT - left, TOP - 0.68)), chart)
        draw_errors(figure, chart, (left, 0.4225, RIGHT - left, 0.145), (left, BOTTOM, RIGHT - left, 0.145))
    else:
        _errors_beside(figure, chart, left)
    return notes


def _errors_beside(figure: Figure, chart: RunPicture, left: float) -> None:
    draw_errors(figure, chart, (left, 0.545, RIGHT - left, TOP - 0.545), (left, BOTTOM, RIGHT - left, 0.455 - BOTTOM))


# ---- curves over time


def _curves(figure: Figure, chart: RunPicture) -> list[str]:
    unknown = chart.state_error is None and chart.energy is None  # panels of errors would be empty
    planar = unknown and chart.kind == "swing" and chart.run.v[0].size > 0
    if chart.kind == "swing":
        notes = draw_swings(figure, chart, RIGHT - 0.065 if unknown and not planar else 0.515)[1]
    else:
        notes = _rows(figure, chart, RIGHT - 0.065 if unknown else 0.515)
    if planar:
        _phase_plane(figure.add_axes((0.66, BOTTOM, RIGHT - 0.66, TOP - BOTTOM)), chart)
    if unknown:
        return [*notes, "Its energy and its exact solution are not known, so neither are errors."]
    _errors_beside(figure, chart, 0.66)
    return notes


def draw_swings(figure: Figure, chart: RunPicture, width: float = 0.515) -> tuple[list[Axes], list[str]]:
    """The panels of a coordinate and its velocity, and notes."""
    panels = swings(chart)
    places = [(0.065, 0.545, width, TOP - 0.545), (0.065, BOTTOM, width, 0.455 - BOTTOM)]
    drawn = draw_column(figure, chart, panels, places if len(panels) == 2 else [(0.065, BOTTOM, width, TOP - BOTTOM)])
    for axes in drawn:
        axes.axhline(0.0, color="#cccccc", linewidth=0.8, zorder=0)
    _legend(drawn[0], chart)
    return drawn, [series.note for series in panels if series.note]


def _legend(axes: Axes, chart: RunPicture) -> None:
    from matplotlib.lines import Line2D

    handles = [Line2D([], [], color="black", linewidth=1.1)]
    labels = [chart.run.method.title]
    if chart.exact is not None:
        handles.append(Line2D([], [], **EXACT))
        labels.append("exact")
    axes.legend(handles, labels, frameon=False, loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, borderpad=0.1)


def _phase_plane(axes: Axes, chart: RunPicture) -> None:
    y, v = (np.clip(block[chart.finite], -LARGEST, LARGEST) for block in (chart.run.y, chart.run.v))
    axes.plot(y, v, color="black", linewidth=1.1, rasterized=len(y) > LONG_CURVE)
    for i, face in ((0, "white"), (-1, "black")):
        axes.plot(y[i], v[i], "o", markersize=8, markerfacecolor=face, markeredgecolor="black", zorder=4)
    axes.set_title("phase plane: v over y; circle: start, dot: end", loc="left", size=13.5)
    axes.set_xlabel("y")
    axes.grid(color="#e6e6e6", linewidth=0.8)
    axes.set_axisbelow(True)


def _rows(figure: Figure, chart: RunPicture, width: float) -> list[str]:
    axes = figure.add_axes((0.065, BOTTOM, width, TOP - BOTTOM))
    good = chart.finite
    y = np.clip(chart.run.y[good].reshape(int(good.sum()), -1), -LARGEST, LARGEST)
    exact = None if chart.exact is None else chart.exact[2].reshape(len(chart.exact[0]), -1)
    size, largest = max(float(np.abs(y if exact is None else exact).max()), 1e-300), float(np.abs(y).max())
    grown = exact is not None and largest >= 3.0 * size
    if not grown:
        size = max(size, largest)
    n = y.shape[1]
    shown = np.unique(np.round(np.linspace(0, n - 1, min(n, MOST_ROWS))).astype(int)).tolist()
    step = 1.25 * size
    for place, i in enumerate(shown):
        axes.axhline(place * step, color="#cccccc", linewidth=0.7, zorder=0)
        if exact is not None and chart.exact is not None:
            axes.plot(chart.exact[0], place * step + exact[:, i], **(EXACT | {"linewidth": 3.0}))
        line = place * step + y[:, i]
        axes.plot(chart.run.t[good], line, color="black", linewidth=0.9, zorder=3, rasterized=len(y) > LONG_CURVE)
    axes.set_yticks([place * step for place in range(len(shown))], [str(i + 1) for i in shown])
    axes.set_ylim(-1.15 * size, (len(shown) - 1) * step + 1.15 * size)
    axes.set_ylabel(f"number of the {kind_of(chart.run.system).owner}; from line to line {step:.3g}")
    over_time(axes, chart)
    axes.set_xlabel("time")
    _legend(axes, chart)
    return ["Displacements grow out of their lines."] * grown


# ---- words


def _text(figure: Figure, chart: RunPicture, notes: list[str]) -> None:
    """Title, what was run, and what the numbers are relative to."""
    scene, run = chart.scene, chart.run
    result = finding(chart)
    title(figure, 0.012, 0.955, f"{chart.title}: {result}", 20)
    section = f"; Hoffmann (2002), {scene.section}" if scene.section.startswith("§") else ""
    control = "" if run.system.keeper is None else f", under {type(run.system.keeper).__name__}"
    about = f"{steps_of(run)} from t = {run.t[0]:g} to {run.t[-1]:.6g}{control}{section}"
    figure.text(0.012, 0.915, textwrap.shorten(about, 120, placeholder=" …"), size=13, color=GREY)
    sentences = []
    if run.status:
        sentences.append(f"{broke_off(run)}: drawn as far as it is finite.")
    if chart.state_error is not None:
        sentences.append(f"State error 1: {scene.error}.")
    if chart.energy_error is not None:
        sentences.append(f"Energy error: relative to {chart.energy_scale}.")
        if chart.state_error is None:
            sentences.append("No exact solution is known: a correct energy alone does not make a motion correct.")
    sentences += dict.fromkeys(notes)
    if "control makes" in result:
        sentences.append("What control changes: medians of the saved states.")
    if run.paces is None and len(run.t) < run.steps + 1:
        sentences.append(f"{len(run.t)} states of {run.steps + 1} were saved and are drawn.")
    figure.text(0.012, 0.014, "\n".join(_lines(sentences)), size=11.3, color=GREY, linespacing=1.3)


def _lines(sentences: list[str]) -> list[str]:
    """Sentences in as few lines of the page's width as they need."""
    lines: list[str] = []
    for sentence in (part for whole in sentences for part in textwrap.wrap(whole, LETTERS)):
        if lines and len(lines[-1]) + len(sentence) < LETTERS:
            lines[-1] += "  " + sentence
        else:
            lines.append(sentence)
    return lines
