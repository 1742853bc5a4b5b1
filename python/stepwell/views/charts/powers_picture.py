"""The picture of powers against steps: time and error over the number of steps."""

from __future__ import annotations

import textwrap
from typing import Any

import numpy as np

from .labels import title as put_title
from .powers import Powers
from .style import FAMILIES, GREY, Figure, page

LINE_STYLES: dict[str, Any] = {
    "direct": {"color": FAMILIES["Dormand-Prince"], "marker": "o", "linestyle": "-", "label": "direct: the method's own steps"},
    "matrix": {"color": FAMILIES["leapfrog"], "marker": "s", "linestyle": (0, (5, 2)), "label": "matrix: s ← P·s, step by step"},
    "power": {"color": FAMILIES["Heun"], "marker": "D", "linestyle": (0, (1, 1.2)), "label": "power: Pⁿ by squaring"},
}


def draw(chart: Powers) -> Figure:
    """Draw the chart on a new figure."""
    with page(14.0, 6.4) as figure:
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
        time.legend(frameon=False, loc="upper left", fontsize=12.5)
        put_title(figure, 0.012, 0.925, finding(chart), 20)
        what = f"{type(chart.system).__name__}, dt = {chart.dt:g}, one trajectory, kernels for {chart.isa}"
        figure.text(0.012, 0.865, textwrap.shorten(what, 140), size=13.5, color=GREY)
        note = (
            "Error: distance from the method's own state in exact arithmetic. Time: median, from the call in Python to its end."
        )
        figure.text(0.012, 0.03, note, size=12.5, color=GREY)
    return figure


def finding(chart: Powers) -> str:
    """From how many steps on the power is faster than stepping, and how much larger its error is at the end."""
    faster = np.asarray(chart.seconds["power"]) < np.asarray(chart.seconds["direct"])
    slow = np.flatnonzero(~faster)
    first = int(slow[-1]) + 1 if slow.size else 0
    what = f"{chart.method.title}: Pⁿ is computed at once"
    if first >= len(chart.steps):
        return f"{what}, and is never faster than {_spaced(chart.steps[-1])} steps"
    return f"{what}, faster than n steps from n = {_spaced(chart.steps[first])} on"


def _spaced(number: int) -> str:
    """A whole number, its thousands apart."""
    return f"{int(number):,}".replace(",", " ")
