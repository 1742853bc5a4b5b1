"""The picture of a work-precision chart: error against cost, counted and measured, and where methods are unstable."""

from __future__ import annotations

import itertools
import math
import re
import textwrap
from collections.abc import Sequence
from typing import Any

import numpy as np

from ...model.methods import Method
from ...model.methods import methods as every_method
from ...studies.measuring.data import Curve, WorkPrecision
from ...studies.measuring.peers import Peer
from .labels import Label, beside
from .labels import title as put_title
from .style import DPI, GREY, PALE, SIZE, Axes, Figure, look, page, peer_look

#: The most letters of a line below the panels.
NOTE = 140

#: The height of the strip of runs without a correct digit, as a fraction of that of the panels.
STRIP = 0.1

#: The names of the errors on an axis.
ERRORS = {
    "state_error": "largest state error of the run, relative",
    "end_error": "state error at the end of the run, relative",
    "phase_error": "phase error at the end of the run, periods",
    "energy_error": "largest energy error of the run, relative",
}
#: The word before "digits" in a title, by kind of error; empty means the state.
DIGITS_OF = {"state_error": "", "end_error": " at the end", "phase_error": " of the phase", "energy_error": " of the energy"}
COUNTED = "function evaluations per unit of simulated time"
TIMES = {"batch": "batch", "single": "single run"}

#: Under the curves, the points that no other beats in both cost and error.
FRONT: dict[str, Any] = {"color": "#e4e4e4", "linewidth": 10.0, "solid_capstyle": "round", "zorder": 0.8}


def draw(chart: WorkPrecision, error: str, time: str) -> Figure:
    """Draw the chart on a new figure."""
    with page(*SIZE, dpi=DPI) as figure:
        unnamed = _panels(figure, chart, error, time)
        _text(figure, chart, error, time, unnamed)
    return figure


def look_of(chart: WorkPrecision, curve: Curve) -> dict[str, Any]:
    """Keywords for a line.

    With a tolerance a method's marker is hollow and its line dash-dotted; with fused multiply-adds the line is dotted and the
    marker small; in float32 the line is dashed.
    """
    if isinstance(curve.method, Peer):
        others = [each.method.name for each in chart.curves if isinstance(each.method, Peer)]
        return peer_look(others.index(curve.method.name))
    own = look(curve.method)
    if curve.fused:
        own |= {"linestyle": ":", "markersize": 0.6 * own.get("markersize", 6.0)}
    if curve.dtype == "float32":
        own |= {"linestyle": (0, (1, 3)) if curve.fused else "--", "markersize": 0.6 * own.get("markersize", 6.0), "alpha": 0.8}
    return own | {"markerfacecolor": "white", "linestyle": "-."} if curve.by == "tolerance" else own


def _panels(figure: Figure, chart: WorkPrecision, error: str, time: str) -> list[str]:
    """The panels: below, error against cost of points with a correct digit; above, a row for each method, of those without one.

    A correct energy does not imply a correct motion, so the energy error has the state error beside it, and not the measured
    time. Returns the names for which there was no space.
    """
    beside = error == "energy_error"
    other_error, other_cost = ("state_error", "evaluations") if beside else (error, time)
    grid = figure.add_gridspec(
        2,
        2,
        height_ratios=(STRIP, 1.0 - STRIP),
        width_ratios=(1.0, 1.0) if beside else (1.1, 1.0),
        left=0.102,
        right=0.985,
        bottom=0.245,
        top=0.87,
        hspace=0.0,
        wspace=0.24 if beside else 0.07,
    )
    counted = figure.add_subplot(grid[1, 0])
    measured = figure.add_subplot(grid[1, 1], sharey=None if beside else counted)
    above_counted = figure.add_subplot(grid[0, 0], sharex=counted)
    above_measured = figure.add_subplot(grid[0, 1], sharex=measured)

    draw_errors(counted, chart, error, "evaluations")
    draw_errors(measured, chart, other_error, other_cost)
    if error == "state_error":
        _spreads(measured, chart, time)
    _wrong(above_counted, chart, "evaluations")
    _wrong(above_measured, chart, other_cost)
    for axes in (counted, measured, above_counted, above_measured):
        axes.minorticks_off()
    counted.set_xlabel(COUNTED)
    counted.set_ylabel(ERRORS[error])
    if beside:
        measured.set(xlabel=COUNTED, ylabel=ERRORS[other_error])
    else:
        measured.set_xlabel(f"measured ns per unit of time, {TIMES[time]}")
        measured.tick_params(labelleft=False)
    above_counted.set_ylabel("no digit\nright", rotation=0, ha="right", va="bottom", y=0.15, labelpad=8, size=11.5)
    name_curves(measured, chart, other_error, other_cost, 12.0)
    return name_curves(counted, chart, error, "evaluations", 13.0)


def draw_errors(axes: Axes, chart: WorkPrecision, error: str, cost: str) -> None:
    """The curves, and the front under them."""
    axes.set(xscale="log", yscale="log")
    front = chart.front(error, cost)
    for i, curve in enumerate(chart.curves):
        y = [point.error(error) if point.usable else math.nan for point in curve.points]
        # Markers at different rungs, so that two curves that coincide remain visible.
        axes.plot(curve.costs(cost), y, markevery=(2 * i % 5, 5), **muted(chart, curve, front))
    axes.plot([row["cost"] for row in front], [row["error"] for row in front], **FRONT)
    errors = [point.error(error) for curve in chart.curves for point in curve.usable if point.error(error) > 0.0]
    low = min(errors, default=0.1) / 3.0
    if chart.floor:
        low = max(low, chart.floor / 3.0)
        axes.axhspan(low, chart.floor, color="#dddddd", linewidth=0.0, zorder=0.5)
    axes.set_ylim(low, 1.0)
    axes.grid(which="major", color="#dddddd", linewidth=0.8)


def muted(chart: WorkPrecision, curve: Curve, front: list[dict[str, Any]]) -> dict[str, Any]:
    """Keywords for a line: in its colour if it is the cheapest for any error, else pale and thin."""
    style = look_of(chart, curve)
    if curve.name in {row["method"] for row in front}:
        return style | {"linewidth": 2.2, "zorder": 3.0}
    return style | {"color": PALE, "linewidth": 1.0, "markersize": 4.5, "zorder": 2.0}


def name_curves(axes: Axes, chart: WorkPrecision, error: str, cost: str, size: float) -> list[str]:
    """Write the names of the curves of the front beside them; returns those for which there was no space."""
    leading = {row["method"] for row in chart.front(error, cost)}
    labels = []
    for curve in (each for each in chart.curves if each.name in leading):
        y = [point.error(error) if point.usable else math.nan for point in curve.points]
        points = np.array([curve.costs(cost), y], dtype=np.float64).T
        if np.isfinite(points).all(axis=1).any():
            style = {"color": look_of(chart, curve)["color"], "weight": "bold", "size": size}
            labels.append(Label(curve.title.replace(", ", "\n"), points, style))
    return [name.replace("\n", ", ") for name in beside(axes, labels)]


def finding(chart: WorkPrecision, error: str = "state_error") -> str:
    """The method that is the cheapest for most digits of that error, and for which."""
    front = chart.front(error)
    cheapest: list[str] = []
    while front and front[-1]["error"] <= (wanted := 10.0 ** -(len(cheapest) + 1)):
        cheapest.append(next(row["method"] for row in front if row["error"] <= wanted))
    if not cheapest:
        return f"no method has a digit{DIGITS_OF[error]} right"
    alone = len({curve.method.name for curve in chart.curves}) == 1
    runs = [(kind, len(list(same))) for kind, same in itertools.groupby(each if alone else family_of(each) for each in cheapest)]
    longest = max(range(len(runs)), key=lambda i: runs[i][1])
    first = 1 + sum(length for _, length in runs[:longest])
    last = first + runs[longest][1] - 1
    digits = "one digit" if first == last == 1 else f"{first} digits" if first == last else f"{first} to {last} digits"
    ways = [curve.name for curve in chart.curves if family_of(curve.name) == family_of(runs[longest][0])]
    return f"{with_way(cheapest[first - 1 : last], ways)} is the cheapest for {digits}{DIGITS_OF[error]}"


def family_of(name: str) -> str:
    """The name of a curve's method alone."""
    return name.split(",")[0]


def with_way(cheapest: Sequence[str], ways: Sequence[str]) -> str:
    """The title of a method, with the choice of its steps if the chart has several and these curves share one."""
    first = cheapest[0]
    title = title_of(family_of(first))
    if len(set(ways)) < 2 or set(cheapest) != {first}:
        return title
    kinds = first.split(", ")[1:]
    step = "with a tolerance" if "tolerance" in kinds else "with fixed steps"
    return f"{title} {step}{', fused,' if 'fused' in kinds else ''}{', float32,' if 'float32' in kinds else ''}"


def _spreads(axes: Axes, chart: WorkPrecision, time: str) -> None:
    """The least and the greatest measured time, at the end of each curve."""
    leading = {row["method"] for row in chart.front("state_error", time)}
    for curve in chart.curves:
        if curve.name not in leading:
            continue
        usable = [i for i, point in enumerate(curve.points) if point.usable]
        for i in usable[-1:]:
            spent = curve.time(i, time)
            y = [curve.points[i].state_error] * 2
            axes.plot([spent.low, spent.high], y, color=look_of(chart, curve)["color"], linewidth=1.0, marker="|")


def _wrong(strip: Axes, chart: WorkPrecision, cost: str) -> None:
    """A mark at each step without a correct digit, and the method's own marker where it becomes unstable."""
    for row, curve in enumerate(chart.curves):
        style = look_of(chart, curve) | {"linestyle": "", "markersize": 5.0}
        costs = list(zip(curve.costs(cost), curve.points, strict=True))
        for marker, size, unstable in (("x", 3.0, True), ("o", 2.4, False)):
            x = [spent for spent, point in costs if not point.usable and point.unstable == unstable]
            mark = {"marker": marker, "markersize": size, "markerfacecolor": "none", "markeredgewidth": 0.8}
            strip.plot(x, [row] * len(x), **(style | mark))
        if 0.0 < curve.largest_stable_step < math.inf:
            strip.plot([_at_edge(curve, cost)], [row], **style)
    strip.set_ylim(len(chart.curves), -1.0)
    strip.set_yticks([])
    strip.tick_params(labelbottom=False, bottom=False)
    strip.grid(axis="x", color="#dddddd", linewidth=0.8)
    strip.set_facecolor("#f3f3f3")


def _at_edge(curve: Curve, cost: str) -> float:
    if cost == "evaluations":
        assert isinstance(curve.method, Method)
        point = curve.points[0]
        assert point.dt is not None
        return round(point.cost * point.dt) / curve.largest_stable_step
    return (curve.step_time if cost == "batch" else curve.single_time).median / curve.largest_stable_step


def title_of(name: str) -> str:
    """The title of a method, or the name of a peer."""
    first, *kinds = name.split(", ")
    return ", ".join([next((method.title for method in every_method() if method.name == first), first), *kinds])


def _text(figure: Figure, chart: WorkPrecision, error: str, time: str, unnamed: list[str]) -> None:
    scene = chart.scene
    put_title(figure, 0.012, 0.95, f"{scene.title}: {finding(chart, error)}", 20)
    parts = [f"{scene.horizon:.4g} units of time{', as far as the true motion is known' * bool(chart.cut)}"]
    parts += [str(chart.stiff)] if chart.stiff else []
    parts += [f"Hoffmann (2002), {scene.section}"] if scene.section.startswith("§") else []
    figure.text(0.012, 0.908, textwrap.shorten("; ".join(parts), NOTE - 15), size=13, color=GREY)
    counted = "Evaluations: without the linear algebra of implicit methods. " if has_implicit(chart) else ""
    what = f"one trajectory of a batch of {chart.members}" if time == "batch" else "a single run"
    not_named = f" Not named: {', '.join(unnamed)}." if unnamed else ""
    notes = (
        f"In colour: cheapest for some error.{not_named} Error 1, no digit right: {scene.error}."
        + (" Grey: not known." if chart.floor else ""),
        "Above the panels: runs without a right digit, ○ bounded, × unstable; a method's own marker is where that begins.",
        f"{counted}Time: {what}, one thread, {chart.isa}; median of {chart.repeats} runs, bars span them.",
        *not_applicable(chart),
    )
    lines = [textwrap.shorten(note, NOTE, placeholder=" …") for note in notes]
    figure.text(0.012, 0.014, "\n".join(lines), size=11.0, color=GREY, linespacing=1.25)


def has_implicit(chart: WorkPrecision) -> bool:
    """True if evaluations are less than the work of some method: it solves equations, too."""
    return any(getattr(curve.method, "is_implicit", False) for curve in chart.curves)


def not_applicable(chart: WorkPrecision) -> list[str]:
    """The methods and programs that cannot solve the system, by reason, in one line; none if all can."""
    reasons: dict[str, list[str]] = {}
    for name, reason in chart.refused.items():
        reasons.setdefault(in_short(name, reason), []).append(title_of(name))
    return ["Not applicable: " + "; ".join(f"{', '.join(names)} ({reason})" for reason, names in reasons.items()) + "."] * bool(
        reasons
    )


def in_short(name: str, reason: str) -> str:
    """The reason alone: without the method's name before it, the system's numbers and what to do instead."""
    return re.sub(r", but \w+\(.*\) has (.*?)(?:;.*)?$", r"; here: \1", reason).removeprefix(f"{name} ")
