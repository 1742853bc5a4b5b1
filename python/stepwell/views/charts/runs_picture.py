"""The picture of one run: orbits or curves on the left, errors of energy and of state on the right."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING, Any

import numpy as np

from ...base import registry
from ...base.arrays import Array
from ...base.pictures import new_figure
from ...model.systems import Chain
from .labels import title
from .orbits_picture import BOTTOM, EXACT, LONG_CURVE, RIGHT, TOP, orbits, radii, turning
from .runs import RunPicture
from .runs_finding import broke_off, finding, steps_of
from .style import FONT, GREY

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Rows of a chain are drawn up to here; of more, these many evenly chosen ones.
MOST_ROWS = 24

#: The errors of the run without control, and how far its curve may widen the scale.
BEFORE, FARTHEST_BEFORE = "#9a9a9a", 1e14


def draw(chart: RunPicture) -> Figure:
    """Draw the run on a new figure."""
    figure = new_figure(16.0, 9.0)
    from matplotlib import rc_context

    with rc_context(FONT):
        notes: list[str] = []
        if chart.kind == "attitude":
            registry.task("draw_attitude")(figure, chart, BOTTOM, TOP, RIGHT)
            notes.append("The dark wing is the right one. A pitch angle above zero lowers the nose.")
            text(figure, chart, notes)
            return figure
        if chart.kind == "body":
            registry.task("draw_body")(figure, chart, notes)
            text(figure, chart, notes)
            return figure
        if chart.kind == "orbits":
            orbits(figure, chart, notes)
            left = 0.55 if chart.places.shape[2] == 2 and chart.before is None else 0.735
        else:
            unknown = chart.state_error is None and chart.energy is None
            planar = unknown and chart.kind == "swing" and chart.run.v[0].size > 0
            panels = curves(figure, chart, notes, width=RIGHT - 0.065 if unknown and not planar else 0.515)
            left = 0.66
            panels[-1].set_xlabel("time")
            if unknown:  # panels of errors would be empty
                if planar:
                    _phase_plane(figure.add_axes((left, BOTTOM, RIGHT - left, TOP - BOTTOM)), chart)
                notes.append("Its energy and its exact solution are not known, so neither are errors.")
                text(figure, chart, notes)
                return figure
        if chart.kind == "orbits" and turning(chart):
            radii(figure.add_axes((left, 0.68, RIGHT - left, TOP - 0.68)), chart)
            energy = figure.add_axes((left, 0.4225, RIGHT - left, 0.145))
            state = figure.add_axes((left, BOTTOM, RIGHT - left, 0.145))
        else:
            energy = figure.add_axes((left, 0.545, RIGHT - left, TOP - 0.545))
            state = figure.add_axes((left, BOTTOM, RIGHT - left, 0.455 - BOTTOM))
        errors(energy, state, chart, compared=True)
        state.set_xlabel("time")
        text(figure, chart, notes)
    return figure


# ---- curves over time


def curves(figure: Figure, chart: RunPicture, notes: list[str], *, width: float = 0.515) -> list[Axes]:
    """The panels of what is not bodies in space, and the states in them."""
    if chart.kind == "swing" and not chart.run.v[0].size:
        axes = figure.add_axes((0.065, BOTTOM, width, TOP - BOTTOM))
        _swing(axes, chart, chart.run.y, None if chart.exact is None else chart.exact[2], notes)
        axes.set_ylabel("y", rotation=0, labelpad=10)
        _curve_legend(axes, chart)
        return [axes]
    if chart.kind == "swing":
        above = figure.add_axes((0.065, 0.545, width, TOP - 0.545))
        below = figure.add_axes((0.065, BOTTOM, width, 0.455 - BOTTOM))
        for axes, name, block, index in ((above, "y", chart.run.y, 2), (below, "v", chart.run.v, 1)):
            _swing(axes, chart, block, None if chart.exact is None else chart.exact[index], notes)
            axes.set_ylabel(name, rotation=0, labelpad=10)
        _curve_legend(above, chart)
        return [above, below]
    axes = figure.add_axes((0.065, BOTTOM, width, TOP - BOTTOM))
    _rows(axes, chart, notes)
    _curve_legend(axes, chart)
    return [axes]


def _curve_legend(axes: Axes, chart: RunPicture) -> None:
    from matplotlib.lines import Line2D

    handles = [Line2D([], [], color="black", linewidth=1.1)]
    labels = [chart.run.method.title]
    if chart.exact is not None:
        handles.append(Line2D([], [], **EXACT))
        labels.append("exact")
    axes.legend(handles, labels, frameon=False, loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, borderpad=0.1)


def _swing(axes: Axes, chart: RunPicture, block: Array, exact: Array | None, notes: list[str]) -> None:
    good = chart.finite
    values = np.clip(block[good], -1e9, 1e9)
    size = float(np.abs(values).max())
    if exact is not None and chart.exact is not None:
        axes.plot(chart.exact[0], exact, **EXACT)
        size = min(size, 3.0 * float(np.abs(exact).max()))
        size = max(size, float(np.abs(exact).max()))
    few = good.sum() <= 150
    axes.plot(chart.run.t[good], values, color="black", linewidth=1.1, marker="o" if few else "", markersize=3.6, zorder=3)
    if float(np.abs(values).max()) > size:
        notes.append("The curve leaves the picture.")
    axes.axhline(0.0, color="#cccccc", linewidth=0.8, zorder=0)
    axes.set(ylim=(-1.12 * (size or 1.0), 1.12 * (size or 1.0)))
    over_time(axes, chart)


def _phase_plane(axes: Axes, chart: RunPicture) -> None:
    """The velocity over the coordinate, with start and end."""
    y, v = (np.clip(block[chart.finite], -1e9, 1e9) for block in (chart.run.y, chart.run.v))
    axes.plot(y, v, color="black", linewidth=1.1, rasterized=len(y) > LONG_CURVE)
    for i, face in ((0, "white"), (-1, "black")):
        axes.plot(y[i], v[i], "o", markersize=8, markerfacecolor=face, markeredgecolor="black", zorder=4)
    axes.set_title("phase plane: v over y; circle: start, dot: end", loc="left", size=13.5)
    axes.set_xlabel("y")
    axes.grid(color="#e6e6e6", linewidth=0.8)
    axes.set_axisbelow(True)


def _rows(axes: Axes, chart: RunPicture, notes: list[str]) -> None:
    """Each coordinate on a line of its own, one above the other."""
    good = chart.finite
    y = np.clip(chart.run.y[good].reshape(int(good.sum()), -1), -1e9, 1e9)
    true = None if chart.exact is None else chart.exact[2].reshape(len(chart.exact[0]), -1)
    size = max(float(np.abs(y if true is None else true).max()), 1e-300)
    if true is None or float(np.abs(y).max()) < 3.0 * size:
        size = max(size, float(np.abs(y).max()))
    else:
        notes.append("Displacements grow out of their lines.")
    n = y.shape[1]
    chosen = np.unique(np.round(np.linspace(0, n - 1, min(n, MOST_ROWS))).astype(int))
    step = 1.25 * size
    for place, i in enumerate(chosen.tolist()):
        axes.axhline(place * step, color="#cccccc", linewidth=0.7, zorder=0)
        if true is not None and chart.exact is not None:
            axes.plot(chart.exact[0], place * step + true[:, i], **(EXACT | {"linewidth": 3.0}))
        axes.plot(
            chart.run.t[good], place * step + y[:, i], color="black", linewidth=0.9, zorder=3, rasterized=len(y) > LONG_CURVE
        )
    axes.set_yticks([place * step for place in range(len(chosen))], [str(i + 1) for i in chosen.tolist()])
    axes.set_ylim(-1.15 * size, (len(chosen) - 1) * step + 1.15 * size)
    what = "mass" if isinstance(chart.run.system, Chain) else "coordinate"
    axes.set_ylabel(f"number of the {what}; from line to line {step:.3g}")
    over_time(axes, chart)


def over_time(axes: Axes, chart: RunPicture) -> None:
    """The scale of the time, and a grid."""
    first, last = float(chart.run.t[0]), float(chart.run.t[-1])
    margin = 0.01 * (last - first)
    axes.set_xlim(first - margin, last + margin)
    axes.grid(color="#e6e6e6", linewidth=0.8)
    axes.set_axisbelow(True)


# ---- errors


def errors(energy: Axes, state: Axes, chart: RunPicture, *, compared: bool = False) -> None:
    """The error of the energy above that of the state, never the one alone; if compared, with those without control."""
    before = chart.before if compared else None
    for axes, error, name in (
        (energy, chart.energy_error, "energy error"),
        (state, chart.state_error, "state error"),
    ):
        old = None if before is None else before.energy_error if axes is energy else before.state_error
        over_time(axes, chart)
        axes.set_title(f"{name} over time, relative", loc="left", size=13.5)
        if error is None and axes is energy and (values := chart.energy) is not None:
            axes.set_title("energy over time; forces take or give it", loc="left", size=13.5)
            axes.plot(chart.run.t, np.where(chart.finite, values, np.nan), color="black", linewidth=1.0)
            continue
        if error is None:
            missing = (
                "no energy of its own"
                if axes is energy
                else "no exact solution, so no state error:\na correct energy alone does not\nmake a motion correct"
            )
            axes.text(0.5, 0.5, missing, transform=axes.transAxes, ha="center", va="center", color=GREY, linespacing=1.4)
            axes.set(yticks=[])
            continue
        axes.set_yscale("log")
        shown = np.isfinite(error) & (error > 0.0)
        low, high = (float(error[shown].min()), float(error[shown].max())) if shown.any() else (1e-17, 1e-15)
        if old is not None and (known := old[np.isfinite(old) & (old > 0.0)]).size:
            high = max(high, min(float(known.max()), FARTHEST_BEFORE * high))
            low = min(low, max(float(np.median(known)), low / FARTHEST_BEFORE))
        low = max(
            low, (1e-9 if old is None else 1.0 / FARTHEST_BEFORE) * high
        )  # the first steps, or a passage through zero, would press the rest together
        # Before the curve: a scale that is still free would look for room beyond the largest float.
        axes.set_ylim(0.4 * low, 3.0 * min(high, 1e300))
        axes.plot(chart.run.t, np.where(shown, error, np.nan), color="black", linewidth=1.0, rasterized=len(error) > LONG_CURVE)
        if old is not None:
            axes.plot(chart.run.t, np.where(np.isfinite(old) & (old > 0.0), old, np.nan), color=BEFORE, linewidth=1.8, zorder=1.5)
            if axes is energy:
                axes.lines[0].set_label("with control")
                axes.lines[1].set_label("without")
                axes.legend(loc="best", fontsize=11.5, handlelength=1.4, borderpad=0.2)
        if np.isinf(error).any():
            first = int(np.argmax(np.isinf(error)))
            axes.axvline(float(chart.run.t[first]), color="black", linewidth=1.0, linestyle=(0, (4, 2)))
            place: dict[str, Any] = {"transform": axes.get_xaxis_transform(), "rotation": 90, "va": "top", "size": 11.5}
            right = 2 * first > len(error)
            axes.text(chart.run.t[first], 0.95, " not finite ", ha="right" if right else "left", **place)
        if np.isnan(error).any():
            place = {"transform": axes.transAxes, "ha": "right", "va": "bottom", "color": GREY, "size": 11.5}
            axes.text(0.98, 0.05, f"not known after t = {chart.scene.until:g}", **place)
        axes.minorticks_off()


def greyed(energy: Axes, state: Axes, chart: RunPicture) -> list[Axes]:
    """The panels of the errors that are known, whose curves are made grey: beside an animation they are not what is looked at."""
    known = [axes for axes, error in ((energy, chart.energy_error), (state, chart.state_error)) if error is not None]
    for axes in known:
        axes.lines[0].set_color("#9a9a9a")
    return known


def text(figure: Figure, chart: RunPicture, notes: list[str]) -> None:
    """Title, what was run, and what the numbers are relative to."""
    scene, run = chart.scene, chart.run
    told = finding(chart)
    title(figure, 0.012, 0.955, f"{chart.title}: {told}", 20)
    where = f" ({scene.section})" if scene.section else ""
    what = f"{steps_of(run)} from t = {run.t[0]:g} to {run.t[-1]:.6g}; {run.system!r}{where}"
    figure.text(0.012, 0.918, textwrap.shorten(what, 165, placeholder=" …"), size=13, color=GREY)
    said = []
    if run.status:
        said.append(f"{broke_off(run)}: drawn as far as it is finite.")
    if chart.state_error is not None:
        said.append(f"State error 1: {scene.error}.")
    if chart.energy_error is not None:
        said.append(f"Energy error: relative to {chart.energy_scale}.")
    said += dict.fromkeys(notes)
    if "control makes" in told:
        said.append("What control changes: medians of the saved states.")
    if run.paces is None and len(run.t) < run.steps + 1:
        said.append(f"{len(run.t)} states of {run.steps + 1} were saved and are drawn.")
    figure.text(0.012, 0.02, "\n".join(_lines(said)), size=12, color=GREY, linespacing=1.4)


def _lines(sentences: list[str]) -> list[str]:
    """Sentences in as few lines of the page's width as they need."""
    lines: list[str] = []
    for sentence in sentences:
        if lines and len(lines[-1]) + len(sentence) < 175:
            lines[-1] += "  " + sentence
        else:
            lines.append(sentence)
    return lines
