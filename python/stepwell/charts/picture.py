"""The picture of a work-precision chart: error against cost, counted and measured, and where methods are unstable."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from ..methods import method as find_method
from .data import Curve, WorkPrecision
from .style import FONT, GREY, look, new_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Orders for which a slope is drawn.
SLOPES = (1, 2, 4)

#: Where the panels end and the legend begins, as a share of the width.
PANELS, LEGEND = 0.717, 0.727


def draw(chart: WorkPrecision) -> Figure:
    """Draw the chart on a new figure."""
    figure = new_figure(16.0, 9.0)
    from matplotlib import rc_context

    with rc_context(FONT):
        _panels(figure, chart)
        _legend(figure, chart)
        _text(figure, chart)
    return figure


def _panels(figure: Figure, chart: WorkPrecision) -> None:
    """Below, what has a digit right: error against cost. Above, one row for each method, what has none."""
    strip = 0.032 * (len(chart.curves) + 1)
    grid = figure.add_gridspec(
        2,
        2,
        height_ratios=(strip, 1.0 - strip),
        width_ratios=(1.1, 1.0),
        left=0.092,
        right=PANELS,
        bottom=0.165,
        top=0.88,
        hspace=0.0,
        wspace=0.04,
    )
    counted = figure.add_subplot(grid[1, 0])
    measured = figure.add_subplot(grid[1, 1], sharey=counted)
    above_counted = figure.add_subplot(grid[0, 0], sharex=counted)
    above_measured = figure.add_subplot(grid[0, 1], sharex=measured)

    _errors(counted, chart, _evaluations)
    _errors(measured, chart, _nanoseconds)
    _spreads(measured, chart)
    _wrong(above_counted, chart, _evaluations)
    _wrong(above_measured, chart, _nanoseconds)
    _slopes(counted)

    for axes in (counted, measured, above_counted, above_measured):
        axes.minorticks_off()
    counted.set_xlabel("rate evaluations per unit of simulated time")
    counted.set_ylabel("largest state error of the run, relative")
    measured.set_xlabel("measured ns per unit of simulated time")
    measured.tick_params(labelleft=False)
    for row, curve in enumerate(chart.curves):
        style = look(curve.method) | {
            "linestyle": "",
            "clip_on": False,
            "transform": above_counted.get_yaxis_transform(),
        }
        above_counted.plot([-0.02], [row], **style)
    above_counted.set_ylabel("no digit right:\n○ bounded\n× unstable", rotation=0, ha="right", va="center", labelpad=16, size=12)


def _evaluations(curve: Curve, dt: float) -> float:
    return curve.method.evaluations / dt


def _nanoseconds(curve: Curve, dt: float) -> float:
    return curve.step_time.median / dt


def _errors(axes: Axes, chart: WorkPrecision, cost: Callable[[Curve, float], float]) -> None:
    axes.set(xscale="log", yscale="log")
    for i, curve in enumerate(chart.curves):
        x = [cost(curve, point.dt) for point in curve.points]
        y = [point.state_error if point.usable else math.nan for point in curve.points]
        # Markers at different rungs, so that curves that fall together are still seen to be two.
        axes.plot(x, y, markevery=(2 * i % 5, 5), **look(curve.method))
    errors = [point.state_error for curve in chart.curves for point in curve.usable if point.state_error > 0.0]
    axes.set_ylim(min(errors, default=0.1) / 3.0, 1.0)
    axes.grid(which="major", color="#dddddd", linewidth=0.8)


def _spreads(axes: Axes, chart: WorkPrecision) -> None:
    """The least and the greatest measured time, at the end of each curve."""
    for curve in chart.curves:
        for point in curve.usable[-1:]:
            x = [ns / point.dt for ns in (curve.step_time.low, curve.step_time.high)]
            axes.plot(x, [point.state_error] * 2, color=look(curve.method)["color"], linewidth=1.0, marker="|")


def _wrong(strip: Axes, chart: WorkPrecision, cost: Callable[[Curve, float], float]) -> None:
    """A mark at each step that leaves no digit right, and the method's own marker where it becomes unstable."""
    for row, curve in enumerate(chart.curves):
        style = look(curve.method) | {"linestyle": ""}
        for marker, size, unstable in (("x", 5.0, True), ("o", 3.5, False)):
            x = [cost(curve, point.dt) for point in curve.points if not point.usable and point.unstable == unstable]
            mark = {"marker": marker, "markersize": size, "markerfacecolor": "none"}
            strip.plot(x, [row] * len(x), **(style | mark))
        if 0.0 < curve.largest_stable_step < math.inf:
            strip.plot([cost(curve, curve.largest_stable_step)], [row], **style)
    strip.set_ylim(len(chart.curves) - 0.2, -0.7)
    strip.set_yticks([])
    strip.tick_params(labelbottom=False, bottom=False)
    strip.grid(axis="x", color="#dddddd", linewidth=0.8)
    strip.set_facecolor("#f3f3f3")


def _slopes(axes: Axes) -> None:
    """Thin lines of the slopes of some orders, in the corner that is always empty: little cost and little error."""
    left, right = (math.log10(x) for x in axes.get_xlim())
    low, high = (math.log10(y) for y in axes.get_ylim())
    x, y = left + 0.05 * (right - left), low + 0.52 * (high - low)
    for order in SLOPES:
        run = min(0.14 * (right - left), 0.45 * (high - low) / order)
        to_x, to_y = 10 ** (x + run), 10 ** (y - order * run)
        axes.plot([10**x, to_x], [10**y, to_y], color=GREY, linewidth=0.9)
        axes.annotate(f"order {order}", (to_x, to_y), (5, -4), textcoords="offset points", size=11, color=GREY)


def _legend(figure: Figure, chart: WorkPrecision) -> None:
    from matplotlib.lines import Line2D

    handles = [Line2D([], [], **look(curve.method)) for curve in chart.curves]
    labels = [_label(curve) for curve in chart.curves]
    place: dict[str, Any] = {"loc": "upper left", "bbox_to_anchor": (LEGEND, 0.89)}
    legend = figure.legend(handles, labels, frameon=False, handlelength=3.0, labelspacing=0.7, borderpad=0.0, **place)
    figure.draw_without_rendering()
    bottom = legend.get_window_extent().transformed(figure.transFigure.inverted()).y0
    refusals = [f"{find_method(name).title} is refused: {reason}." for name, reason in chart.refused.items()]
    text = "\n\n".join(textwrap.fill(refusal, 44) for refusal in refusals)
    figure.text(LEGEND + 0.003, bottom - 0.03, text, size=11.5, color=GREY, va="top")


def _label(curve: Curve) -> str:
    method, limit = curve.method, curve.largest_stable_step
    name = f"{method.title} ({method.other_names[0]})" if method.other_names else method.title
    # A method without a limit on the oscillator grows at every step; how far it gets depends on the horizon.
    up_to = "stable up to dt" if method.limit else "grows; fails past dt"
    stable = "stable throughout" if limit == math.inf else f"{up_to} = {limit:#.3g}" if limit else "never stable"
    return f"{textwrap.fill(name, 41, break_on_hyphens=False)}\norder {method.order}, {stable}"


def _text(figure: Figure, chart: WorkPrecision) -> None:
    scene = chart.scene
    figure.text(0.012, 0.955, f"{scene.title}: what each method costs and how wrong it is", size=20, weight="bold")
    system = f"{scene.system!r} over {scene.horizon:.4g} units of time ({scene.section})"
    figure.text(0.012, 0.915, textwrap.shorten(system, 150), size=13.5, color=GREY)
    notes = (
        f"Error 1, no digit right: {scene.error}.",
        "Unstable: not finite, or no digit right and a growing amplitude; a method's own marker is where that begins.",
        f"Time: one member of a batch of {chart.members}, one thread, {chart.isa}; median of {chart.repeats} runs, "
        "the bar at a curve's end spans them.",
    )
    figure.text(0.012, 0.018, "\n".join(notes), size=12, color=GREY, linespacing=1.4)
