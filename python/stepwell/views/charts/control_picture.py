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
from .style import DPI, GREY, Axes, Figure, apart, ink, page

#: Lines of the two forms.
FORMS: dict[str, dict[str, Any]] = {
    "limited": {"linestyle": "-", "linewidth": 2.0, "fillstyle": "full", "markersize": 5.0},
    "printed": {"linestyle": (0, (1, 1.2)), "linewidth": 1.4, "fillstyle": "none", "markersize": 6.0},
}

#: Control that lowers an error by less than this factor does not help.
HELPS = 1.5

#: Height of the strip of diverged runs, as a fraction of that of the panel below it.
STRIP = 0.1

#: The distance of names at the ends of the curves, as a fraction of the panel's height.
ROOM = 0.12

#: The width of the picture in inches.
WIDTH = 12.5

#: The smallest error on the logarithmic axis, on which 0 has no place; and the error below which it is rounding, drawn at the
#: edge.
LEAST_DRAWN, ROUNDING = 1e-17, 1e-12


def draw(chart: ControlSweep) -> Figure:
    """Draw the chart on a new figure."""
    rows = 0.42 * len(methods_of(chart))
    height = 5.7 + rows
    with page(WIDTH, height, dpi=DPI) as figure:
        kinds = ("energy_error", "state_error" if chart.exact else "largest")
        names = ("largest |E − E₀| / K₀", "error of the last state, relative" if chart.exact else "largest coordinate")
        for i, (what, name) in enumerate(zip(kinds, names, strict=True)):
            _over_gains(figure.add_axes((0.095 + 0.5 * i, 1.5 / height, 0.275, 2.0 / height)), chart, what, name)
        for i, (what, name) in enumerate(zip(kinds, names, strict=True)):
            place = (0.155 + 0.43 * i, 4.3 / height, 0.385, (rows + 0.25) / height)
            _before_and_after(figure.add_axes(place), chart, what, name, named=i == 0)
        title(figure, 0.012, 1.0 - 0.42 / height, f"{chart.title}: {finding(chart)}", 20)
        evaluations = ", ".join(map(str, chart.evaluations))
        what = f"{chart.horizon:.6g} units of time, {evaluations} function evaluations per run"
        figure.text(0.012, 1.0 - 0.74 / height, textwrap.shorten(what, 120), size=13, color=GREY)
        few = "" if len(_swept(chart)) == len(methods_of(chart)) else ", of the methods that it helps most and least"
        note = (
            "Above: hollow without control, full the median of all gains of the limited form. At the left edge: rounding alone.\n"
            f"Below: each gain{few}; solid the limited form, dotted the printed one; in the strip: diverged.\n"
            "E: energy, K: kinetic energy; C: the gain, h: the step."
        )
        figure.text(0.012, 0.12 / height, note, size=11.3, color=GREY, linespacing=1.3)
    return figure


def finding(chart: ControlSweep) -> str:
    """The methods whose energy error the control lowers at the median gain, with the factor, and those that it does not help."""
    helped = {method: factor for method, factor in factors(chart).items() if factor >= HELPS}
    others = [method.title for method in factors(chart) if method not in helped]
    if not helped and not others:
        return "energy and state under control"
    if not helped:
        return f"energy control does not help {others[0] if len(others) == 1 else f'any of {len(others)} methods'}"
    most = sorted(helped, key=lambda method: -helped[method])
    words = [f"{method.title} (÷{helped[method]:.2g})" for method in most]
    if len(words) > 2:
        words = [f"{len(words)} of {len(words) + len(others)} methods, most {words[0]}"]
    return f"energy control helps {' and '.join(words)}{f', not {others[0]}' if len(others) == 1 else ''}"


def factors(chart: ControlSweep) -> dict[Method, float]:
    """By what factor the control lowers the energy error of each method: medians of its gains, and of its steps."""
    found: dict[Method, list[float]] = {}
    for line in (each for each in chart.lines if each.kind == "limited"):
        alike = [same for same in chart.lines if (same.method, same.kind) == (line.method, "limited")]
        try:
            before = float(chart.line(line.method, "none", chart.evaluations[alike.index(line)]).energy_error[0])
        except UnknownNameError:
            continue
        errors = line.energy_error[np.isfinite(line.energy_error)]
        after = float(np.median(errors)) if errors.size else np.inf
        found.setdefault(line.method, []).append(before / max(after, LEAST_DRAWN))
    return {method: float(np.median(each)) for method, each in found.items()}


def _swept(chart: ControlSweep) -> list[Method]:
    """The two methods whose errors are drawn over the gain: those that control helps most and least."""
    known = factors(chart)
    chosen = (
        [max(known, key=lambda method: known[method]), min(known, key=lambda method: known[method])] if len(known) > 1 else []
    )
    return [method for method in methods_of(chart) if method in chosen or not chosen]


def look_of(chart: ControlSweep, method: Method) -> dict[str, Any]:
    """Keywords for the lines of a method, each of which has a colour of its own."""
    return apart(methods_of(chart), method)


def methods_of(chart: ControlSweep) -> list[Method]:
    """The methods of a chart, each once."""
    return list({line.method.name: line.method for line in chart.lines}.values())


def _before_and_after(axes: Axes, chart: ControlSweep, what: str, name: str, *, named: bool) -> None:
    """A row for each method: an error without control, and with it."""
    methods = methods_of(chart)
    values = np.concatenate([getattr(line, what) for line in chart.lines if line.kind in ("none", "limited")] or [np.ones(1)])
    values = values[np.isfinite(values) & (values > ROUNDING)]
    low, high = (0.3 * values.min(), 3.0 * values.max()) if values.size else (LEAST_DRAWN, 1.0)
    axes.set(xscale="log", xlim=(low, high), ylim=(len(methods) - 0.5, -0.95))
    told = False
    for row, method in enumerate(methods):
        colour = look_of(chart, method)["color"]
        of = [line for line in chart.lines if line.method == method]
        limited = np.concatenate([getattr(line, what) for line in of if line.kind == "limited"] or [np.empty(0)])
        limited = np.maximum(limited[np.isfinite(limited)], low)
        before = [max(float(getattr(line, what)[0]), low) for line in of if line.kind == "none"]
        before = [each for each in before if np.isfinite(each)]
        after = [float(np.median(limited))] if limited.size else []
        for each in before:
            axes.plot([each, *after], [row] * (1 + len(after)), color=colour, linewidth=2.5, zorder=2)
            look: dict[str, Any] = {"markerfacecolor": "white", "markeredgewidth": 2.2, "clip_on": False}
            axes.plot([each], [row], color=colour, marker="o", markersize=11, zorder=3, **look)
        axes.plot(after, [row] * len(after), color=colour, marker="o", markersize=11, zorder=4, linestyle="", clip_on=False)
        if before and after and not told:
            told = True
            sides = ("left", "right") if before[0] > after[0] else ("right", "left")
            for at, word, side in ((after[0], "with control", sides[1]), (before[0], "without", sides[0])):
                axes.annotate(word, (at, row), (7 if side == "left" else -7, 9), textcoords="offset points", size=11.5, ha=side)
    axes.set_yticks(range(len(methods)), [method.title for method in methods] if named else [""] * len(methods))
    for tick, method in zip(axes.get_yticklabels(), methods, strict=True):
        tick.set_color(ink(look_of(chart, method)["color"]))
        tick.set_fontweight("bold")
        tick.set_fontsize(13.0)
    axes.tick_params(axis="y", length=0, pad=9)
    axes.set_title(f"{name}: before and after", loc="left", size=13)
    axes.grid(which="major", axis="x", color="#dddddd", linewidth=0.8)
    axes.minorticks_off()


def _over_gains(axes: Axes, chart: ControlSweep, what: str, name: str) -> None:
    """The errors over the gain, and above them the diverged runs."""
    gains = np.unique(np.concatenate([line.relative[np.isfinite(line.relative)] for line in chart.lines] or [np.ones(1)]))
    low, high = (gains[0], gains[-1]) if gains.size else (1e-1, 1e1)
    wide = max(float(np.log10(high / low)), 1.0)
    axes.set(xscale="log", yscale="log", xlabel="gain h·C·K at the start")
    axes.set_ylabel(name, size=12.0)
    axes.set_xlim(low / 10 ** (0.02 * wide), high * 10 ** (0.02 * wide))
    axes.axvline(1.0, color=GREY, linewidth=0.9)
    axes.grid(which="major", color="#dddddd", linewidth=0.8)
    strip(axes)
    axes.text(1.012, 1.0 + 0.5 * STRIP, "diverged", transform=axes.transAxes, size=12, color=GREY, va="center")
    methods = _swept(chart)
    ends = []
    for line in (each for each in chart.lines if each.kind in FORMS and each.method in methods):
        values = np.maximum(getattr(line, what), LEAST_DRAWN)
        shown = np.where(np.isfinite(values), values, np.nan)
        look = look_of(chart, line.method) | FORMS[line.kind]
        step = max(1, len(line.relative) // 8)  # between markers, those of each method at other points
        axes.plot(line.relative, shown, **look, markevery=(methods.index(line.method) % step, step))
        mark_lost(axes, line, ~np.isfinite(values), (methods.index(line.method) + 0.5) / len(methods), look)
        if line.kind == "limited" or not any(each.kind == "limited" for each in chart.lines):
            known = np.flatnonzero(np.isfinite(shown))
            ends += [(float(gains[-1]), float(shown[i]), line.method.title, str(look["color"])) for i in known[-1:]]
    axes.minorticks_off()
    at_ends(axes, ends, 12.0, ROOM)


def strip(axes: Axes) -> None:
    """The grey strip above the frame."""
    from matplotlib.patches import Rectangle

    below: dict[str, Any] = {"transform": axes.transAxes, "facecolor": "#eeeeee", "clip_on": False, "zorder": 0}
    axes.add_patch(Rectangle((0.0, 1.0), 1.0, STRIP, **below))


def mark_lost(axes: Axes, line: Held, lost: Any, share: float, look: dict[str, Any]) -> None:
    """Markers in the strip, at this share of its height, where runs were lost."""
    if lost.any():
        style = look | {"linestyle": "none", "clip_on": False, "markersize": 4.0}
        axes.plot(line.relative[lost], np.full(lost.sum(), 1.0 + STRIP * share), transform=axes.get_xaxis_transform(), **style)
