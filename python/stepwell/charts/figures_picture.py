"""The pictures of the document's figures: samples joined by straight lines, and the exact cosine."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from ..stability.criterion import signed
from .figures import HARMONIC_PERIODS, Figures, HarmonicCase, Samples
from .style import FONT, GREY, named, new_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Samples are shown up to here; what grows more leaves the picture.
Y_LIMIT = 2.2

#: Panels of the overview side by side.
COLUMNS = 2

MARKS = (
    "Grey: exact, cos ω₀t. Black: samples, joined by straight lines.",
    "r₁² − 1: by what share the energy changes in a step, on average. Ψ/Φ − 1: by what share the samples turn too fast.",
)


def overview(chart: Figures) -> Figure:
    """All methods on one figure."""
    across = min(COLUMNS, len(chart.samples))
    down = -(-len(chart.samples) // across)
    width, height = 17.0, 2.75 * down + 2.3
    figure = new_figure(width, height)
    from matplotlib import rc_context

    with rc_context(FONT):
        places = {"left": 0.055, "right": 0.988, "bottom": 1.15 / height, "top": 1.0 - 1.5 / height, "wspace": 0.05}
        panels = figure.subplots(down, across, sharex=True, sharey=True, squeeze=False, gridspec_kw=places | {"hspace": 0.42})
        for i, axes in enumerate(panels.ravel()):
            if i >= len(chart.samples):
                axes.set_visible(False)
                continue
            samples = chart.samples[i]
            _samples(axes, chart, samples)
            axes.set_title(named(samples.method), loc="left", size=13.5, weight="bold")
            axes.set_title(_said(samples, digits=2).split(" (")[0], loc="right", size=11)  # the rest has no room
            if i % across == 0:
                axes.set_ylabel("y")
            if i + across >= len(chart.samples):
                axes.set_xlabel("time in periods of the exact solution")
                axes.tick_params(labelbottom=True)
        figure.text(0.008, 1.0 - 0.45 / height, "The undamped oscillator by each method", size=20, weight="bold")
        figure.text(0.008, 1.0 - 0.82 / height, _start(chart), size=13.5, color=GREY)
        figure.text(0.008, 0.14 / height, "   ".join(MARKS), size=12, color=GREY)
    return figure


def one(chart: Figures, samples: Samples) -> Figure:
    """One method on a figure of its own."""
    figure = new_figure(11.0, 5.6)
    from matplotlib import rc_context

    with rc_context(FONT):
        axes = figure.add_axes((0.075, 0.245, 0.91, 0.535))
        _samples(axes, chart, samples)
        axes.set(xlabel="time in periods of the exact solution", ylabel="y")
        method = samples.method
        figure.text(0.012, 0.925, f"{method.title} ({method.section}): y(t)", size=18, weight="bold")
        figure.text(0.012, 0.865, _start(chart, samples), size=12.5, color=GREY)
        limit = f"Stable for Φ < {samples.limit:.6g}." if samples.limit else "Never stable."
        figure.text(0.012, 0.805, f"{_said(samples)}. {limit}", size=12.5)
        figure.text(0.012, 0.03, "\n".join(MARKS), size=12, color=GREY, linespacing=1.35)
    return figure


def harmonic(cases: tuple[HarmonicCase, ...]) -> Figure:
    """The harmonic cases of §4, one below the other."""
    figure = new_figure(11.0, 8.6)
    from matplotlib import rc_context

    with rc_context(FONT):
        places = {"left": 0.065, "right": 0.985, "bottom": 0.145, "top": 0.845, "hspace": 0.55}
        panels = figure.subplots(len(cases), 1, sharex=True, gridspec_kw=places)
        for axes, case in zip(panels, cases, strict=True):
            turns = np.arange(len(case.y)) * (case.degrees / 360.0)
            x = np.linspace(0.0, turns[-1], 1 + 120 * HARMONIC_PERIODS)
            axes.axhline(0.0, color="#cccccc", linewidth=0.8)
            axes.plot(x, np.cos(2.0 * math.pi * x), color="#8c8c8c", linewidth=2.6, zorder=2)
            axes.plot(turns, case.y, color="black", linewidth=1.1, marker="o", markersize=4.2, zorder=3)
            axes.set(xlim=(-0.02, HARMONIC_PERIODS + 0.15), ylim=(-1.15, 1.15), yticks=(-1, 0, 1), ylabel="g")
            axes.set_title(f"Ψ = {case.degrees}°: {case.samples_per_period:g} samples per period", loc="left", size=13.5)
            axes.grid(which="major", axis="x", color="#dddddd", linewidth=0.8)
            axes.tick_params(labelbottom=True)
        panels[-1].set_xlabel("time in periods of the samples")
        figure.text(0.012, 0.945, "The harmonic cases of §4", size=18, weight="bold")
        text = "Samples of Verlet with Φ = 2·sin(Ψ/2), started in second order: cos kΨ, of the same amplitude for ever."
        figure.text(0.012, 0.905, text, size=12.5, color=GREY)
        figure.text(0.012, 0.02, "Grey: g(t) = cos Ω₀t. Black: samples, joined by straight lines.", size=12, color=GREY)
    return figure


def _samples(axes: Axes, chart: Figures, samples: Samples) -> None:
    turn = 2.0 * math.pi
    t = np.linspace(0.0, float(samples.t[-1]), 1 + 60 * math.ceil(samples.t[-1] / turn))
    axes.axhline(0.0, color="#cccccc", linewidth=0.8)
    axes.plot(t / turn, np.cos(t), color="#8c8c8c", linewidth=2.6, zorder=2)
    # Past the range of a picture's numbers lines are not drawn, but they must not fail either.
    y = np.clip(np.nan_to_num(samples.y, nan=np.nan, posinf=1e9, neginf=-1e9), -1e9, 1e9)
    many = len(y) > 60 * max(1.0, chart.periods)
    marker = "" if many else "o"
    axes.plot(samples.t / turn, y, color="black", linewidth=1.1, marker=marker, markersize=4.2, zorder=3)
    end = float(samples.t[-1]) / turn
    axes.set(xlim=(-0.01 * end, 1.01 * end), ylim=(-Y_LIMIT, Y_LIMIT), yticks=(-2, -1, 0, 1, 2))
    if not np.abs(samples.y).max() <= Y_LIMIT:
        box = {"boxstyle": "round,pad=0.2", "facecolor": "white", "edgecolor": "none"}
        largest = f"|y| up to {np.nanmax(np.abs(samples.y)):.3g}"
        axes.text(0.985, 0.07, largest, transform=axes.transAxes, size=11.5, ha="right", bbox=box, zorder=5)
    axes.grid(which="major", axis="x", color="#dddddd", linewidth=0.8)


def _said(samples: Samples, digits: int = 3) -> str:
    change = signed(samples.r1_squared - 1.0, digits=digits)
    ratio = f"Ψ/Φ − 1 = {signed(samples.ratio - 1.0, percent=True, digits=digits)}" if math.isfinite(samples.ratio) else "no Ψ"
    return f"r₁² − 1 = {change}, {ratio}".replace("-", "−") + f": {samples.kind}"


def _start(chart: Figures, samples: Samples | None = None) -> str:
    """Of all, or of one figure."""
    verlet = "" if samples is None or samples.start is None else ", y₋₁ = y₀ as in the document"
    return f"v₀ = 0, y₀ = 1{verlet}; Φ = ω₀·dt = {chart.phi:g} rad, {2.0 * math.pi / chart.phi:.4g} steps per period"
