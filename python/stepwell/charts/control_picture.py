"""The picture of control charts: energy error, and state error, over the gain."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import UnknownNameError
from ..methods import Method
from .control import ControlSweep
from .control_runs import Held
from .labels import title
from .style import FONT, GREY, apart, new_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Lines of the two forms; the markers are the methods'.
FORMS: dict[str, dict[str, Any]] = {
    "limited": {"linestyle": "-", "linewidth": 1.6, "fillstyle": "full", "markersize": 5.5},
    "printed": {"linestyle": (0, (1, 1.2)), "linewidth": 1.6, "fillstyle": "none", "markersize": 8.5},
}

#: Where the marks of runs without a gain begin, as a share of the width: no control at the left, projections at the right.
PLACES = {"none": 0.0, "scaling": 0.93, "nacozy": 0.965}

#: Height of the row of a method in the strip of diverged runs, and the first above the frame, as shares of the frame's height.
ROW, FIRST = 0.031, 0.022

#: What is exact has no place on a logarithmic axis.
LEAST_DRAWN = 1e-17


def draw(chart: ControlSweep) -> Figure:
    """Draw the chart on a new figure."""
    figure = new_figure(16.0, 8.6)
    from matplotlib import rc_context

    with rc_context(FONT):
        places = {"left": 0.065, "right": 0.985, "bottom": 0.235, "top": 0.755, "wspace": 0.17}
        left, right = figure.subplots(1, 2, gridspec_kw=places)
        methods = list(dict.fromkeys(line.method for line in chart.lines))
        _panel(left, chart, "energy_error")
        left.set_ylabel("largest |E − E₀| / K₀")
        _panel(right, chart, "state_error" if chart.exact else "largest")
        right.set_ylabel("error of the last state, relative" if chart.exact else "largest coordinate")
        title(figure, 0.012, 0.945, f"{chart.title}: {finding(chart)}", 20)
        evaluations = ", ".join(map(str, chart.evaluations))
        what = f"{chart.system!r}, {chart.horizon:.6g} units of time, {evaluations} function evaluations per run"
        figure.text(0.012, 0.905, textwrap.shorten(what, 150), size=13.5, color=GREY)
        _legend(figure, chart, methods)
        note = (
            "Left edge: without control. Right edge: projected after every step. Above the frame: gains at which a run diverged. "
            "K: kinetic energy. In the title: the limited form, median of all gains."
        )
        figure.text(0.012, 0.022, note, size=12, color=GREY)
    return figure


def finding(chart: ControlSweep) -> str:
    """Before and after: for how many methods control at the median gain has a smaller energy error than none, and by how much."""
    factors = []
    for line in chart.lines:
        if line.kind != "limited":
            continue
        count = chart.evaluations[
            [same for same in chart.lines if (same.method, same.kind) == (line.method, "limited")].index(line)
        ]
        try:
            before = float(chart.line(line.method, "none", count).energy_error[0])
        except UnknownNameError:
            continue
        held = line.energy_error[np.isfinite(line.energy_error)]
        after = float(np.median(held)) if held.size else np.inf
        factors.append(before / max(after, LEAST_DRAWN))
    if not factors:
        return "energy and state under control"
    better = sum(1 for factor in factors if factor > 1.0)
    said = f"control lowers the energy error of {better} of {len(factors)} runs"
    return f"{said}, by a factor of {float(np.median(factors)):.2g}" if better == len(factors) else said


def _look(chart: ControlSweep, method: Method) -> dict[str, Any]:
    """Each method has a colour of its own."""
    return apart({line.method.name: line.method for line in chart.lines}.values(), method)


def _panel(axes: Axes, chart: ControlSweep, what: str) -> None:
    """The lines of one kind of error, with the marks at the edges and above."""
    gains = np.unique(np.concatenate([line.relative[np.isfinite(line.relative)] for line in chart.lines] or [np.ones(1)]))
    low, high = (gains[0], gains[-1]) if gains.size else (1e-1, 1e1)
    wide = max(float(np.log10(high / low)), 1.0)
    axes.set(xscale="log", yscale="log", xlabel="gain h·C·K at the start")
    axes.set_xlim(low / 10 ** (0.09 * wide), high * 10 ** (0.13 * wide))
    for line in chart.lines:
        values = np.maximum(getattr(line, what), LEAST_DRAWN)
        seen = _look(chart, line.method)
        if line.kind in FORMS:
            shown = np.where(np.isfinite(values), values, np.nan)
            axes.plot(line.relative, shown, **(seen | FORMS[line.kind]), markevery=_every(line, chart))
            _strip(axes, line, ~np.isfinite(values), chart)
            continue
        start = PLACES[line.kind]
        if not np.isfinite(values[0]):
            continue
        hollow = "none" if line.kind == "nacozy" else "full"
        at = axes.get_yaxis_transform()
        where = {"transform": at, "color": seen["color"]}
        axes.plot([start, start + 0.03], [values[0]] * 2, linewidth=2.2, **where)
        axes.plot([start + 0.015], [values[0]], marker=seen["marker"], markersize=9, fillstyle=hollow, **where)
    axes.axvline(1.0, color=GREY, linewidth=0.9)
    axes.grid(which="major", color="#dddddd", linewidth=0.8)
    axes.minorticks_off()
    # Walls at the edges: what is outside has no gain.
    for edge in (0.04, 0.92):
        axes.plot([edge, edge], [0.0, 1.0], color="#bbbbbb", linewidth=0.8, transform=axes.transAxes)


def _every(line: Held, chart: ControlSweep) -> tuple[int, int]:
    """Markers on every third point, those of each method at others."""
    names = list(dict.fromkeys(each.method.name for each in chart.lines))
    step = max(1, len(line.relative) // 8)
    return names.index(line.method.name) % step, step


def _strip(axes: Axes, line: Held, lost: Any, chart: ControlSweep) -> None:
    """Markers above the frame, a row for each method, where runs were lost."""
    if not lost.any():
        return
    names = list(dict.fromkeys(each.method.name for each in chart.lines))
    height = 1.0 + FIRST + ROW * names.index(line.method.name)
    style = _look(chart, line.method) | FORMS[line.kind] | {"linestyle": "none", "clip_on": False}
    axes.plot(line.relative[lost], np.full(lost.sum(), height), transform=axes.get_xaxis_transform(), **style)


def _legend(figure: Figure, chart: ControlSweep, methods: list[Any]) -> None:
    """What markers and lines mean."""
    from matplotlib.lines import Line2D

    handles: list[Any] = []
    labels = []
    for method in methods:
        handles.append(Line2D([], [], **(_look(chart, method) | {"linestyle": "none"})))
        dt = next(line.dt for line in chart.lines if line.method == method)
        labels.append(f"{method.title}, h = {dt:.4g}")
    texts = {"limited": "limited form", "printed": "printed form"}
    for form, style in FORMS.items():
        if any(line.kind == form for line in chart.lines):
            handles.append(Line2D([], [], color="#000000", marker="o", **style))
            labels.append(texts[form])
    edges = {"none": "no control", "scaling": "velocities scaled", "nacozy": "Nacozy's projection"}
    fills: dict[str, Any] = {"none": "full", "scaling": "full", "nacozy": "none"}
    for kind, text in edges.items():
        if any(line.kind == kind for line in chart.lines):
            side = "left" if kind == "none" else "right"
            handles.append(Line2D([], [], color=GREY, marker="s", markersize=9, linewidth=2.2, fillstyle=fills[kind]))
            labels.append(f"{text} ({side} edge)")
    figure.legend(handles, labels, frameon=False, loc="lower left", bbox_to_anchor=(0.005, 0.055), ncols=4)
