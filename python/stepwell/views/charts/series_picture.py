"""Curves over time on a panel of a run's picture."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...base.arrays import Array
from .run_panels import Series, errors
from .runs import RunPicture
from .style import EXACT, GREY, LONG_CURVE, Axes, Figure, ink

#: Labels at the end of lines are at least so many inches apart.
LABEL_DISTANCE = 0.2

#: Between two panels of errors beside an animation, as a share of the picture's height.
PALE_GAP = 0.1

Place = tuple[float, float, float, float]


def draw_column(figure: Figure, chart: RunPicture, panels: list[Series], places: list[Place]) -> list[Axes]:
    """Panels one above the other, with the time below the last."""
    drawn = [draw_series(figure.add_axes(place), chart, series) for series, place in zip(panels, places, strict=True)]
    drawn[-1].set_xlabel("time")
    return drawn


def draw_series(axes: Axes, chart: RunPicture, series: Series) -> Axes:
    """One panel."""
    t = chart.run.t
    over_time(axes, chart)
    axes.set_title(series.title, loc="left", size=13.5)
    axes.set_ylabel(series.label, rotation=0, labelpad=10)
    if series.missing:
        axes.text(0.5, 0.5, series.missing, transform=axes.transAxes, ha="center", va="center", color=GREY, linespacing=1.4)
        axes.set(yticks=[])
        return axes
    if series.log:
        axes.set_yscale("log")
    if series.limits is not None:  # before the curves: a scale that is still free would look for room beyond the largest float
        axes.set_ylim(*series.limits)
    for exact in series.exact:
        assert chart.exact is not None
        axes.plot(chart.exact[0], exact, **EXACT)
    for i, line in enumerate(series.lines):
        look: dict[str, Any] = {"color": line.colour, "linestyle": line.dashes, "linewidth": line.width, "marker": line.marker}
        look |= {"markersize": 3.6, "rasterized": len(t) > LONG_CURVE}
        look["zorder"] = 1.5 if not line.front else 2 if series.log else 3  # of errors, below the time of an animation
        axes.plot(*(broken(t, line.values) if series.angles and i == 0 else (t, line.values)), **look)
    if series.log:
        _not_known(axes, chart, series)
    else:
        label_ends(axes, series)
    return axes


def draw_errors(figure: Figure, chart: RunPicture, energy: Place, state: Place) -> None:
    """The error of the energy above that of the state, as far as they are known, with those of the run without control."""
    before = chart.before
    known = [series for series in errors(chart, before) if not series.missing]
    if not known:
        return
    left, bottom, width, _ = state
    whole = (left, bottom, width, energy[1] + energy[3] - bottom)
    panels = draw_column(figure, chart, known, [energy, state] if len(known) == 2 else [whole])
    if before is not None and chart.energy_error is not None and before.energy_error is not None:
        for line, label in zip(panels[0].lines, ("with control", "without"), strict=False):
            line.set_label(label)
        panels[0].legend(loc="best", fontsize=11.5, handlelength=1.4, borderpad=0.2)


def draw_pale_errors(figure: Figure, chart: RunPicture, place: Place) -> list[Axes]:
    """The errors that are known, in grey beside an animation; their panels, one above the other."""
    known = [series for series in errors(chart) if series.lines]
    if not known:
        return []
    left, bottom, width, height = place
    each = (height - PALE_GAP * (len(known) - 1)) / len(known)
    places = [(left, bottom + (len(known) - 1 - i) * (each + PALE_GAP), width, each) for i in range(len(known))]
    panels = draw_column(figure, chart, known, places)
    for axes in panels:
        axes.lines[0].set_color("#9a9a9a")
    return panels


def over_time(axes: Axes, chart: RunPicture) -> None:
    """The scale of the time, and a grid."""
    first, last = float(chart.run.t[0]), float(chart.run.t[-1])
    margin = 0.01 * (last - first)
    axes.set_xlim(first - margin, last + margin)
    axes.locator_params(axis="x", nbins=5)
    axes.grid(color="#e6e6e6", linewidth=0.8)
    axes.set_axisbelow(True)


def broken(t: Array, angles: Array) -> tuple[Array, Array]:
    """Angles over time, with a gap where they jump by more than half a turn, as they do at ±180°."""
    with np.errstate(invalid="ignore"):
        jumps = np.flatnonzero(np.abs(np.diff(angles)) > 180.0) + 1
    return np.insert(t, jumps, t[jumps]), np.insert(angles, jumps, np.nan)


def _not_known(axes: Axes, chart: RunPicture, series: Series) -> None:
    """Where errors are infinite, and from when on they are not known."""
    if series.not_finite is not None:
        t = float(chart.run.t[series.not_finite])
        axes.axvline(t, color="black", linewidth=1.0, linestyle=(0, (4, 2)))
        place: dict[str, Any] = {"transform": axes.get_xaxis_transform(), "rotation": 90, "va": "top", "size": 11.5}
        side = "right" if 2 * series.not_finite > len(chart.run.t) else "left"
        axes.text(t, 0.95, " not finite ", ha=side, **place)
    if series.known_until is not None:
        place = {"transform": axes.transAxes, "ha": "right", "va": "bottom", "color": GREY, "size": 11.5}
        axes.text(0.98, 0.05, f"not known after t = {series.known_until:g}", **place)
    axes.minorticks_off()


def label_ends(axes: Axes, series: Series) -> None:
    """The name of each line at its right end, beside the panel; names that would cover each other are moved apart."""
    low, high = axes.get_ylim()
    apart = LABEL_DISTANCE * axes.figure.dpi / axes.get_window_extent().height
    ends: list[tuple[float, str, str]] = []
    for line in series.lines:
        known = line.values[np.isfinite(line.values)]
        if line.name and len(known):
            ends.append(((float(known[-1]) - low) / (high - low), line.name, line.colour))
    heights: list[float] = []
    for height, _, _ in sorted(ends):
        heights.append(max([height, *(each + apart for each in heights[-1:])]))
    over = max([0.0, *(each - 1.0 for each in heights[-1:])])
    for height, (_, name, colour) in zip(heights, sorted(ends), strict=True):
        axes.text(1.008, height - over, name, transform=axes.transAxes, color=ink(colour), va="center", size=12)
