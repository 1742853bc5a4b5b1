"""The picture of control charts: energy error, and state error, over the gain."""

from __future__ import annotations

import textwrap
from typing import Any

import numpy as np

from ...errors import UnknownNameError
from ...model.methods import Method
from .control import ControlSweep
from .control_runs import Held
from .labels import at_ends, title
from .style import GREY, Axes, Figure, apart, page

#: Lines of the two forms.
FORMS: dict[str, dict[str, Any]] = {
    "limited": {"linestyle": "-", "linewidth": 2.0, "fillstyle": "full", "markersize": 5.0},
    "printed": {"linestyle": (0, (1, 1.2)), "linewidth": 1.4, "fillstyle": "none", "markersize": 6.0},
}

#: Marks of the runs without a gain, and their names.
MARKS: dict[str, tuple[str, str]] = {
    "none": ("o", "without control"),
    "scaling": ("s", "velocities scaled"),
    "nacozy": ("D", "Nacozy's projection"),
}

#: Height of the strip of diverged runs, as a fraction of that of the panel below it.
STRIP = 0.1

#: The distance of names at the ends of the curves, as a fraction of the panel's height.
ROOM = 0.065

#: The smallest error on the logarithmic axis, on which 0 has no place; and the error below which it is rounding, drawn at the
#: edge.
LEAST_DRAWN, ROUNDING = 1e-17, 1e-12


def draw(chart: ControlSweep) -> Figure:
    """Draw the chart on a new figure."""
    with page(16.0, 10.0) as figure:
        kinds = ("energy_error", "state_error" if chart.exact else "largest")
        names = ("largest |E − E₀| / K₀", "error of the last state, relative" if chart.exact else "largest coordinate")
        for i, (what, name) in enumerate(zip(kinds, names, strict=True)):
            _over_gains(figure.add_axes((0.065 + 0.49 * i, 0.135, 0.325, 0.31)), chart, what, name)
        for i, (what, name) in enumerate(zip(kinds, names, strict=True)):
            _before_and_after(figure.add_axes((0.122 + 0.466 * i, 0.6, 0.392, 0.25)), chart, what, name, named=i == 0)
        title(figure, 0.012, 0.95, f"{chart.title}: {finding(chart)}", 20)
        evaluations = ", ".join(map(str, chart.evaluations))
        what = f"{chart.system!r}, {chart.horizon:.6g} units of time, {evaluations} function evaluations per run"
        figure.text(0.012, 0.915, textwrap.shorten(what, 150), size=13.5, color=GREY)
        note = (
            "Above: hollow without control; full the median of all gains in the limited form, its line from the least to the "
            "largest;\nsquare: velocities scaled after every step; diamond: Nacozy's projection; left edge: rounding alone. "
            "Below: solid limited form, dotted printed form; in the strip: diverged. K: kinetic energy."
        )
        figure.text(0.012, 0.018, note, size=12, color=GREY, linespacing=1.35)
    return figure


def finding(chart: ControlSweep) -> str:
    """The number of methods whose energy error the control lowers at the median gain, and the factor, as a title."""
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
        errors = line.energy_error[np.isfinite(line.energy_error)]
        after = float(np.median(errors)) if errors.size else np.inf
        factors.append(before / max(after, LEAST_DRAWN))
    if not factors:
        return "energy and state under control"
    better = sum(1 for factor in factors if factor > 1.0)
    better_in = f"control lowers the energy error of {better} of {len(factors)} runs"
    return f"{better_in}, by a factor of {float(np.median(factors)):.2g}" if better == len(factors) else better_in


def _look(chart: ControlSweep, method: Method) -> dict[str, Any]:
    """Each method has a colour of its own."""
    return apart(_methods(chart), method)


def _methods(chart: ControlSweep) -> list[Method]:
    """The methods, each once."""
    return list({line.method.name: line.method for line in chart.lines}.values())


def _before_and_after(axes: Axes, chart: ControlSweep, what: str, name: str, *, named: bool) -> None:
    """A row for each method: an error without control and with it."""
    methods = _methods(chart)
    values = np.concatenate([getattr(line, what) for line in chart.lines] or [np.ones(1)])
    values = values[np.isfinite(values) & (values > ROUNDING)]
    low, high = (0.3 * values.min(), 3.0 * values.max()) if values.size else (LEAST_DRAWN, 1.0)
    axes.set(xscale="log", xlim=(low, high), ylim=(len(methods) - 0.4, -0.6))
    for row, method in enumerate(methods):
        colour = _look(chart, method)["color"]
        kinds: dict[str, list[Held]] = {}
        for line in chart.lines:
            if line.method == method:
                kinds.setdefault(line.kind, []).append(line)
        limited = np.concatenate([getattr(line, what) for line in kinds.get("limited", [])] or [np.empty(0)])
        limited = np.maximum(limited[np.isfinite(limited)], low)
        before = [float(getattr(line, what)[0]) for line in kinds.get("none", [])]
        if limited.size:
            axes.plot([limited.min(), limited.max()], [row, row], color=colour, linewidth=2.0, zorder=2)
            after = float(np.median(limited))
            axes.plot([after], [row], color=colour, marker="o", markersize=12, zorder=4)
            for each in before:
                if np.isfinite(each):
                    way: dict[str, Any] = {"arrowstyle": "-|>", "color": "#888888", "shrinkA": 7, "shrinkB": 7}
                    axes.annotate("", (after, row - 0.28), (max(each, low), row - 0.28), arrowprops=way)
        for kind, (mark, _) in MARKS.items():
            for line in kinds.get(kind, []):
                value = float(getattr(line, what)[0])
                if np.isfinite(value):
                    size = 12 if kind == "none" else 8
                    style: dict[str, Any] = {"markerfacecolor": "white", "markeredgewidth": 2.2, "clip_on": False}
                    axes.plot([max(value, low)], [row], color=colour, marker=mark, markersize=size, zorder=3, **style)
    axes.set_yticks(range(len(methods)), [method.title for method in methods] if named else [""] * len(methods))
    for tick, method in zip(axes.get_yticklabels(), methods, strict=True):
        tick.set_color(_look(chart, method)["color"])
        tick.set_fontweight("bold")
    axes.tick_params(axis="y", length=0, pad=9)
    axes.set_title(f"{name}: before and after", loc="left", size=14)
    axes.grid(which="major", axis="x", color="#dddddd", linewidth=0.8)
    axes.minorticks_off()


def _over_gains(axes: Axes, chart: ControlSweep, what: str, name: str) -> None:
    """The errors over the gain, and above them the diverged runs."""
    from matplotlib.patches import Rectangle

    gains = np.unique(np.concatenate([line.relative[np.isfinite(line.relative)] for line in chart.lines] or [np.ones(1)]))
    low, high = (gains[0], gains[-1]) if gains.size else (1e-1, 1e1)
    wide = max(float(np.log10(high / low)), 1.0)
    axes.set(xscale="log", yscale="log", xlabel="gain h·C·K at the start", ylabel=name)
    axes.set_xlim(low / 10 ** (0.02 * wide), high * 10 ** (0.02 * wide))
    axes.axvline(1.0, color=GREY, linewidth=0.9)
    axes.grid(which="major", color="#dddddd", linewidth=0.8)
    below: dict[str, Any] = {"transform": axes.transAxes, "facecolor": "#eeeeee", "clip_on": False, "zorder": 0}
    axes.add_patch(Rectangle((0.0, 1.0), 1.0, STRIP, **below))
    axes.text(1.012, 1.0 + 0.5 * STRIP, "diverged", transform=axes.transAxes, size=12, color=GREY, va="center")
    methods = _methods(chart)
    ends = []
    for line in (each for each in chart.lines if each.kind in FORMS):
        values = np.maximum(getattr(line, what), LEAST_DRAWN)
        shown = np.where(np.isfinite(values), values, np.nan)
        look = _look(chart, line.method) | FORMS[line.kind]
        axes.plot(line.relative, shown, **look, markevery=_every(line, methods))
        _strip(axes, line, ~np.isfinite(values), methods, look)
        if line.kind == "limited" or not any(each.kind == "limited" for each in chart.lines):
            known = np.flatnonzero(np.isfinite(shown))
            ends += [(float(gains[-1]), float(shown[i]), line.method.title, str(look["color"])) for i in known[-1:]]
    axes.minorticks_off()
    at_ends(axes, ends, 12.0, ROOM)


def _every(line: Held, methods: list[Method]) -> tuple[int, int]:
    """Markers on every third point, those of each method at others."""
    step = max(1, len(line.relative) // 8)
    return methods.index(line.method) % step, step


def _strip(axes: Axes, line: Held, lost: Any, methods: list[Method], look: dict[str, Any]) -> None:
    """Markers above the frame, a row for each method, where runs were lost."""
    if not lost.any():
        return
    height = 1.0 + STRIP * (methods.index(line.method) + 0.5) / len(methods)
    style = look | {"linestyle": "none", "clip_on": False, "markersize": 4.0}
    axes.plot(line.relative[lost], np.full(lost.sum(), height), transform=axes.get_xaxis_transform(), **style)
