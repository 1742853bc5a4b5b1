"""The picture of Verlet with friction by the secant: the ends of the motions, and the stability limit with drag."""

from __future__ import annotations

from typing import Any

import numpy as np

from .style import FAMILIES, GREY, Figure, page
from .verlet_friction import VerletFriction

LINES: dict[str, Any] = {
    "exact": {"color": "#c4c4c4", "linewidth": 4.0, "label": "exact"},
    "false_euler": {"color": FAMILIES["Euler"], "linewidth": 2.2, "linestyle": (0, (5, 2)), "label": "False Euler"},
    "verlet": {"color": FAMILIES["leapfrog"], "linewidth": 1.8, "label": "Verlet, v = (y − y_prev)/h"},
}

#: The part of each block's motion that is shown: its end.
VIEWS: Any = ({"xlim": (0.3, 5.0), "ylim": (0.78, 0.94)}, {"xlim": (8.0, 40.0), "ylim": (-0.1, 0.1)})
TITLES = ("y of a block that slides", "y of a block on a spring")


def draw(chart: VerletFriction) -> Figure:
    """Draw the chart on a new figure."""
    with page(12.6, 5.6) as figure:
        places = {"left": 0.06, "right": 0.985, "bottom": 0.2, "top": 0.73, "wspace": 0.3}
        *panels, limits = figure.subplots(1, 3, gridspec_kw=places)
        for axes, block, view, title in zip(panels, chart.blocks, VIEWS, TITLES, strict=True):
            for name, line in LINES.items():
                axes.plot(block.t, getattr(block, name), **line)
            axes.set(xlabel="time", **view)
            axes.set_title(title, loc="left", size=12.5, weight="bold")
        panels[0].legend(frameon=False, loc="lower left", fontsize=11.5)
        limits.axhline(2.0, color=GREY, linewidth=0.9)
        limits.annotate("without drag: 2", (chart.damping[-1], 2.0), (-4, 5), textcoords="offset points", ha="right", color=GREY)
        known = 2.0 * (np.sqrt(1.0 + chart.damping**2) - chart.damping)
        limits.plot(chart.damping, known, color="#c4c4c4", linewidth=4.0, label="2(√(1 + D²) − D)")
        limits.plot(
            chart.damping, chart.limits, color=FAMILIES["leapfrog"], marker="o", markersize=4.5, linestyle="", label="of the step"
        )
        limits.set(xlabel="damping ratio D", ylim=(0.0, 2.3), xlim=(-0.02, 1.02 * float(chart.damping[-1])))
        limits.set_title("Limit of Φ = ω₀h, secant drag", loc="left", size=12.5, weight="bold")
        limits.legend(frameon=False, loc="lower left", fontsize=11.5)
        for axes in (*panels, limits):
            axes.grid(which="major", color="#dddddd", linewidth=0.8)
        figure.text(0.008, 0.915, "Friction by the secant lets Verlet creep and takes its stability (§8)", size=18, weight="bold")
        text = (
            "The secant is the velocity of half a step ago: blocks never rest, and drag makes large steps unstable. "
            f"h = {chart.dt:.4g}"
        )
        figure.text(0.008, 0.845, text, size=12.5, color=GREY)
        note = "Coulomb's friction: −μN·sgn(y − y_prev); drag: −2Dω₀(y − y_prev)/h. Stepwell refuses both for Verlet."
        figure.text(0.008, 0.03, note, size=12, color=GREY)
    return figure
