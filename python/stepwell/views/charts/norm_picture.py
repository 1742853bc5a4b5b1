"""The picture of a norm under control: the error of the angle beside that of resetting, and where the norm settles."""

from __future__ import annotations

from typing import Any

import numpy as np

from .labels import title
from .norm import NormSweep, Settled
from .style import GREY, Axes, Figure, ink, look, page

#: The least and the largest ratio that are drawn: below a thirtieth, ratios do not matter.
LEAST_RATIO, LARGEST_RATIO = 0.03, 30.0

#: Errors of angles that differ by less than this fraction count as equal: it is the rounding of the smallest.
ALIKE = 1e-3

#: The smallest error on the logarithmic axis, on which 0 has no place.
LEAST_NORM = 1e-17

#: The name of a line stands at its left end if no other name is there, within this factor.
APART = 1.3

#: Shades of the halves in which control and resetting are better.
BETTER, WORSE = "#f1f8f3", "#fcf4f0"


def draw(chart: NormSweep) -> Figure:
    """Draw the chart on a new figure."""
    with page(13.0, 7.8) as figure:
        places = {"left": 0.065, "right": 0.985, "bottom": 0.17, "top": 0.8, "wspace": 0.17}
        left, right = figure.subplots(1, 2, gridspec_kw=places)
        _ratios(left, chart)
        _norms(right, chart)
        title(figure, 0.012, 0.945, finding(chart), 20)
        degrees = float(np.degrees(2.0 * chart.phi))
        what = f"A body turns steadily, by {degrees:.3g}° a step (Φ = ½h|ω| = {chart.phi:g}). Control adds k·(1 − q·q)·q to q̇."
        figure.text(0.012, 0.9, what, size=13.5, color=GREY)
        note = (
            "Resetting divides q by its length after every step: its norm error is rounding, "
            "its angles are those without any correction.\n"
            "A line ends where the norm no longer settles."
        )
        figure.text(0.012, 0.02, note, size=12, color=GREY, linespacing=1.3)
    return figure


def finding(chart: NormSweep) -> str:
    """For which methods control is better than resetting: at every gain, at some, or at none."""
    titles: dict[str, list[str]] = {"at every gain": [], "at some gains": [], "at no gain": []}
    for line in chart.lines:
        with np.errstate(all="ignore"):
            ratio = np.abs(line.angle_error / line.angle_error_reset)
        better = ratio[np.isfinite(ratio)] < 1.0 - ALIKE
        if better.size:
            titles["at every gain" if better.all() else "at some gains" if better.any() else "at no gain"].append(
                line.method.title
            )
    parts = [f"{' and '.join(names)} {when}" for when, names in titles.items() if names]
    text = ", ".join(parts)
    return f"Quaternion: control beats resetting for {text}" if parts else "Norm of a quaternion under control"


def _ratios(axes: Axes, chart: NormSweep) -> None:
    """The error of the angle under control, relative to that with resetting."""
    axes.axhspan(LEAST_RATIO, 1.0, color=BETTER, zorder=0)
    axes.axhspan(1.0, LARGEST_RATIO, color=WORSE, zorder=0)
    axes.axhline(1.0, color="#555555", linewidth=1.2)
    for line in chart.lines:
        _line(axes, line, _ratio(line))
    axes.set_title("error of the angle of a step: control / resetting", loc="left", size=14)
    where: dict[str, Any] = {"transform": axes.transAxes, "size": 14, "color": "#555555", "style": "italic"}
    axes.text(0.02, 0.96, "resetting is better", va="top", **where)
    axes.text(0.02, 0.14, "control is better", va="bottom", **where)
    _gain(axes, chart)
    axes.set_ylim(LEAST_RATIO, LARGEST_RATIO)
    axes.set_yticks([0.1, 0.5, 1.0, 2.0, 10.0], ["0.1", "0.5", "1", "2", "10"])
    axes.minorticks_off()
    resets = [f"{100 * line.angle_error_reset:+.2g} %".replace("-", "−") for line in chart.lines]
    names = [f"{line.method.title} (reset: {reset})" for line, reset in zip(chart.lines, resets, strict=True)]
    _labels(axes, chart, [_ratio(line) for line in chart.lines], names)


def _ratio(line: Settled) -> Any:
    with np.errstate(all="ignore"):
        return np.clip(np.abs(line.angle_error / line.angle_error_reset), LEAST_RATIO, LARGEST_RATIO)


def _norms(axes: Axes, chart: NormSweep) -> None:
    errors = [np.maximum(np.abs(line.norm_error), LEAST_NORM) for line in chart.lines]
    for line, error in zip(chart.lines, errors, strict=True):
        _line(axes, line, error)
    axes.set_title("norm error under control, |q·q − 1|, when it has settled", loc="left", size=14)
    _gain(axes, chart)
    if any(np.isfinite(error).any() for error in errors):
        low, high = axes.get_ylim()
        axes.set_ylim(low, max(high, 1.0))
    _labels(axes, chart, errors, [line.method.title for line in chart.lines])


def _line(axes: Axes, line: Settled, values: Any) -> None:
    seen = look(line.method)
    axes.plot(line.gains, values, color=seen["color"], linestyle=seen["linestyle"], linewidth=2.4)
    known = np.flatnonzero(np.isfinite(line.norm_error))
    if known.size and known[-1] + 1 < len(line.gains):
        axes.plot(line.gains[known[-1]], values[known[-1]], marker="|", color=seen["color"], markersize=14, markeredgewidth=2.4)


def _labels(axes: Axes, chart: NormSweep, values: list[Any], names: list[str]) -> None:
    """The names above the lines; there is no legend."""
    done: list[Any] = []
    for line, own, name in zip(chart.lines, values, names, strict=True):
        known = np.flatnonzero(np.isfinite(own))
        if not known.size:
            continue
        at, side = known[len(known) // 12], "left"
        with np.errstate(all="ignore"):
            apart = np.nanmin([np.full(len(own), np.inf), *(np.abs(np.log(own / other)) for other in done)], axis=0)
        if apart[at] < np.log(APART):
            at, side = known[int(np.argmax(apart[known]))], "right"
        color = ink(look(line.method)["color"])
        place: dict[str, Any] = {"textcoords": "offset points", "ha": side, "color": color, "size": 13.5}
        axes.annotate(name, (line.gains[at], own[at]), (0 if side == "left" else -12, 7), **place)
        done.append(own)


def _gain(axes: Axes, chart: NormSweep) -> None:
    axes.set(xscale="log", yscale="log", xlabel="gain h·k, without a unit")
    gains = np.concatenate([line.gains for line in chart.lines])
    if gains.min() < gains.max():
        axes.set_xlim(gains.min(), gains.max())
    ticks = [tick for tick in (0.001, 0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0) if gains.min() <= tick <= gains.max()]
    axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    axes.minorticks_off()
    axes.grid(which="major", color="#dddddd", linewidth=0.8)
    axes.set_axisbelow(True)
