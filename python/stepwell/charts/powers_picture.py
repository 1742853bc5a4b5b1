"""The picture of powers against steps: time and error over the number of steps."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING, Any

import numpy as np

from .powers import Powers
from .style import FONT, GREY, new_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LINE_STYLES: dict[str, Any] = {
    "direct": {"color": "#000000", "marker": "o", "linestyle": "-", "label": "direct: the method's own steps"},
    "matrix": {"color": "#0072b2", "marker": "s", "linestyle": (0, (5, 2)), "label": "matrix: s ← P·s, step by step"},
    "power": {"color": "#d55e00", "marker": "D", "linestyle": (0, (1, 1.2)), "label": "power: Pⁿ by squaring"},
}


def draw(chart: Powers) -> Figure:
    """Draw the chart on a new figure."""
    figure = new_figure(14.0, 6.4)
    from matplotlib import rc_context

    with rc_context(FONT):
        places = {"left": 0.075, "right": 0.985, "bottom": 0.2, "top": 0.78, "wspace": 0.2}
        time, error = figure.subplots(1, 2, gridspec_kw=places)
        for form, seconds in chart.seconds.items():
            time.plot(chart.steps, seconds, **LINE_STYLES[form])
            # What is exact has no place on a logarithmic axis; a tenth of the smallest rounding stands for it.
            error.plot(chart.steps, np.maximum(chart.errors[form], 1e-17), **LINE_STYLES[form])
        for axes in (time, error):
            axes.set(xscale="log", yscale="log", xlabel="steps n")
            axes.grid(which="major", color="#dddddd", linewidth=0.8)
            axes.minorticks_off()
        time.set_ylabel("measured time of the run in s")
        error.set_ylabel("error of the last state, relative")
        error.set_ylim(bottom=0.5e-17)
        error.plot(chart.steps, chart.steps * 2.0**-53, color=GREY, linewidth=0.9)
        middle = int(chart.steps[len(chart.steps) // 2])
        error.annotate("n·2⁻⁵³", (middle, middle * 2.0**-53), (-58, 4), textcoords="offset points", color=GREY)
        time.legend(frameon=False, loc="upper left")
        title = f"{chart.method.title}: n steps, made one by one and at once"
        figure.text(0.012, 0.925, title, size=20, weight="bold")
        what = f"{chart.system!r}, dt = {chart.dt:g}; one member, {chart.isa}"
        figure.text(0.012, 0.865, textwrap.shorten(what, 140), size=13.5, color=GREY)
        note = (
            "Error: distance from the method's own state in exact arithmetic. Time: median, from the call in Python to its end."
        )
        figure.text(0.012, 0.03, note, size=12, color=GREY)
    return figure
