"""The picture of a stability map: r₁ by colour, by contour lines, and hatched where samples grow."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...analysis.stability import stability_limit
from ...base.arrays import Array
from ...model.systems import Oscillator
from .labels import title
from .maps import StabilityMap
from .style import GREY, Axes, Figure, page

#: Contour lines, besides that of 1.
LEVELS = (0.5, 0.8, 0.9, 1.1, 1.5, 2.0)

#: The colours end here: what grows more is as dark. Of the colours only the middle part is used, on which lines are seen, in so
#: many shades.
RADIUS_LIMIT, COLOURS, SHADES = 2.0, (0.13, 0.87), 64

#: A number stands on its line where the other lines are this far away, as a share of the picture; where none is, there is none.
LABEL_DISTANCE = 0.03


def draw(chart: StabilityMap) -> Figure:
    """Draw the map on a new figure."""
    with page(10.0, 7.0, options={"hatch.color": "#444444", "hatch.linewidth": 0.5}) as figure:
        from matplotlib import colormaps
        from matplotlib.colors import ListedColormap, TwoSlopeNorm

        axes = figure.add_axes((0.085, 0.175, 0.80, 0.665))
        bar = figure.add_axes((0.905, 0.175, 0.022, 0.665))
        x, y, shown = chart.phi, chart.damping, _decided(chart)
        extent = (float(x[0]), float(x[-1]), float(y[0]), float(y[-1]))
        colours = ListedColormap(colormaps["PuOr_r"](np.linspace(*COLOURS, SHADES)))
        image = axes.imshow(
            shown, norm=TwoSlopeNorm(1.0, 0.0, RADIUS_LIMIT), cmap=colours, extent=extent, origin="lower", aspect="auto"
        )
        if shown.min() < 1.0 < shown.max():
            axes.contourf(x, y, shown, levels=(1.0, np.inf), colors="none", hatches=["//"])
            axes.contour(x, y, shown, levels=(1.0,), colors="black", linewidths=2.8)
        elif shown.min() >= 1.0:
            axes.axhspan(*extent[2:], facecolor="none", edgecolor="#444444", hatch="//", linewidth=0.0)
        levels = [level for level in LEVELS if shown.min() < level < shown.max()]
        if levels:
            lines = axes.contour(x, y, shown, levels=levels, colors="black", linewidths=0.9)
            _numbers(axes, dict(zip(levels, lines.allsegs, strict=True)), extent)
        axes.set(xlabel="Φ = ω₀·dt (rad)", ylabel="damping ratio D", xlim=extent[:2], ylim=extent[2:])
        scale = figure.colorbar(image, cax=bar, extend="max")
        scale.set_ticks([0.0, *LEVELS, 1.0])
        scale.set_label("radius r₁: factor of the amplitude in a step", labelpad=8)
        title(figure, 0.012, 0.945, finding(chart), 18)
        below = "Damped oscillator (§3): the largest eigenvalue of a step, over its length and the damping."
        below = f"{chart.method.section}. {below}" if chart.method.section else below  # an own method has none
        figure.text(0.012, 0.895, below, size=12.5, color=GREY)
        notes = "Thick line: r₁ = 1. Hatched: growing samples. The exact solution decays wherever D > 0."
        figure.text(0.012, 0.025, notes, size=12, color=GREY)
    return figure


def finding(chart: StabilityMap) -> str:
    """Up to which angle the method is stable: with the least damping, and with D = 1 or what is nearest to it."""
    least, most = float(chart.damping[0]), float(chart.damping[-1])
    limits = []
    for ratio in sorted({least, min(max(1.0, least), most)}):
        limit = float(stability_limit(Oscillator(damping=ratio), chart.method))
        where = "undamped" if ratio == 0.0 else f"at D = {ratio:g}"
        stable = f"stable {'at every Φ' if limit == np.inf else f'to Φ = {limit:.3g}'}" if limit else "never stable"
        limits.append(f"{stable} {where}")
    return f"{chart.method.title}: {', '.join(limits)}"


def _decided(chart: StabilityMap) -> Array:
    """r₁ with what is on the unit circle moved off it, to the side on which the samples are: else lines would follow rounding."""
    radius = np.minimum(np.nan_to_num(chart.radius, nan=np.inf), 4.0 * RADIUS_LIMIT)
    off = 1e-9
    return np.where(chart.stable, np.minimum(radius, 1.0 - off), np.maximum(radius, 1.0 + off))


def _numbers(axes: Axes, lines: dict[float, Any], extent: tuple[float, float, float, float]) -> None:
    """The level of each line, where it is farthest from the others and from the edge."""
    low, size = np.array(extent[::2]), np.array(extent[1::2]) - np.array(extent[::2])
    points = {level: (np.concatenate(pieces) - low) / size for level, pieces in lines.items() if len(pieces)}
    taken = np.empty((0, 2))
    for level, own in points.items():
        others = np.concatenate([taken, *(line for other, line in points.items() if other != level)])
        own = own[:: max(1, len(own) // 200)]
        to_edge = np.minimum(own, 1.0 - own).min(axis=1)
        to_lines = np.full(len(own), 1.0)
        if len(others):
            to_lines = np.sqrt(((own[:, np.newaxis] - others) ** 2).sum(axis=2)).min(axis=1)
        room = np.minimum(to_edge, to_lines)
        best = int(room.argmax())
        if room[best] < LABEL_DISTANCE:
            continue
        at = own[best]
        taken = np.concatenate([taken, [at]])
        box = {"boxstyle": "round,pad=0.12", "facecolor": "white", "edgecolor": "none", "alpha": 0.85}
        place = low + at * size
        axes.text(place[0], place[1], f"{level:g}", size=11, ha="center", va="center", bbox=box)
