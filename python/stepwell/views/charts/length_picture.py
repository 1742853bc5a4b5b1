"""The picture of control charts of rods: errors of state and lengths over c, with resetting beside, a column for each step."""

from __future__ import annotations

import textwrap
from typing import Any

import numpy as np

from .control import ControlSweep
from .control_picture import LEAST_DRAWN, STRIP, look_of, mark_lost, methods_of, strip
from .control_runs import Held
from .style import GREY, Axes, Figure, page

#: The lines of the two, told apart without colour.
CONTROL: dict[str, Any] = {"linestyle": "-", "linewidth": 2.0, "markersize": 6.0}
RESETTING: dict[str, Any] = {"linestyle": (0, (4, 2)), "linewidth": 1.6, "marker": ""}

#: Letters of a line of the title, its height, where what is below it begins, and the height of the name of a column.
LINE, LINE_HEIGHT, HEAD, COLUMN_TITLE = 84, 0.036, 0.93, 0.035

#: Columns of the legend, the height of a row of it, and the lower end of the panels without any.
LEGEND_COLUMNS, LEGEND_ROW, BOTTOM = 6, 0.03, 0.15


def draw(chart: ControlSweep) -> Figure:
    """Draw the chart on a new figure."""
    count = len(chart.evaluations)
    with page(13.0, 9.4) as figure:
        head = textwrap.wrap(chart.answer or f"{chart.title}: lengths under control", LINE, break_on_hyphens=False)
        gap = STRIP + 0.02
        # Two frames, each with its strip above, below the title and the name of the column.
        share = STRIP / (2.0 + gap)
        bottom = BOTTOM + LEGEND_ROW * -(-(len(methods_of(chart)) + 2) // LEGEND_COLUMNS)
        top = (HEAD - LINE_HEIGHT * len(head) - COLUMN_TITLE + share * bottom) / (1.0 + share)
        places = {"left": 0.075, "right": 0.985, "bottom": bottom, "top": top, "wspace": 0.07, "hspace": gap}
        panels = figure.subplots(2, count, squeeze=False, sharex=True, sharey="row", gridspec_kw=places)
        for i, evaluations in enumerate(chart.evaluations):
            _column(panels[:, i], chart, evaluations)
        what = "state_error" if chart.exact else "energy_error"
        panels[0, 0].set_ylabel("error of the last state, relative" if chart.exact else "largest |E − E₀|, relative")
        panels[1, 0].set_ylabel("largest error of a length")
        _limits(panels[0, 0], chart, what)
        _limits(panels[1, 0], chart, "length_error")
        for i, line in enumerate(head):
            figure.text(0.012, 0.953 - LINE_HEIGHT * i, line, size=18, weight="bold")
        about = f"{chart.title}, {chart.horizon:.5g} units of time; each column is another step, the finer to the right"
        figure.text(0.012, 0.956 - LINE_HEIGHT * len(head), about, size=13.5, color=GREY)
        _legend(figure, chart)
    return figure


def _column(panels: Any, chart: ControlSweep, evaluations: int) -> None:
    """One number of evaluations: the state's error above, that of the lengths below."""
    above, below = panels
    methods = [method.name for method in methods_of(chart)]
    for axes, what in ((above, "state_error" if chart.exact else "energy_error"), (below, "length_error")):
        axes.set(xscale="log", yscale="log")
        axes.grid(which="major", color="#dddddd", linewidth=0.8)
        axes.minorticks_off()
        strip(axes)
        for row, name in enumerate(methods):
            kinds = {line.kind: chart.line(name, line.kind, evaluations) for line in chart.lines if line.method.name == name}
            if (controlled := kinds.get("control")) is not None:
                _curve(axes, chart, controlled, getattr(controlled, what), row, len(methods))
            reset = kinds.get("length")
            if reset is not None and what != "length_error" and np.isfinite(getattr(reset, what)[0]):
                axes.axhline(max(getattr(reset, what)[0], LEAST_DRAWN), **(look_of(chart, reset.method) | RESETTING))
    above.text(0.0, 1.0 + STRIP, f"{evaluations} function evaluations", size=13.5, transform=above.transAxes)
    below.set_xlabel("gain c of the control")


def _curve(axes: Axes, chart: ControlSweep, line: Held, values: Any, row: int, rows: int) -> None:
    """The errors of a method over c, and marks above the frame where its runs diverged."""
    style = look_of(chart, line.method) | CONTROL
    fine = np.isfinite(values)
    axes.plot(line.relative, np.where(fine, np.maximum(values, LEAST_DRAWN), np.nan), **style, markevery=(row, rows))
    mark_lost(axes, line, ~fine, (row + 0.5) / rows, style)


def _limits(axes: Axes, chart: ControlSweep, what: str) -> None:
    """From the least error that is drawn to the largest, or to where nothing is known any more."""
    kinds = ("control",) if what == "length_error" else ("control", "length")
    values = np.concatenate([getattr(line, what) for line in chart.lines if line.kind in kinds] or [np.ones(1)])
    values = values[np.isfinite(values) & (values > 0.0)]
    if values.size:
        axes.set_ylim(max(0.3 * values.min(), LEAST_DRAWN), min(3.0 * values.max(), 10.0))


def _legend(figure: Figure, chart: ControlSweep) -> None:
    from matplotlib.lines import Line2D

    handles: list[Any] = [Line2D([], [], **(look_of(chart, each) | CONTROL)) for each in methods_of(chart)]
    labels = [each.title for each in methods_of(chart)]
    handles += [Line2D([], [], color=GREY, **CONTROL), Line2D([], [], color=GREY, **RESETTING)]
    labels += ["under control", "lengths reset after every step"]
    figure.legend(
        handles,
        labels,
        frameon=False,
        loc="lower left",
        bbox_to_anchor=(0.005, 0.055),
        ncols=LEGEND_COLUMNS,
        columnspacing=1.0,
        handlelength=1.7,
    )
    note = (
        "Where a solid line is below the dashed one of its colour, control is better. Marks in the grey strip: a run diverged.\n"
        "Reset lengths are exact to rounding, and not drawn."
    )
    figure.text(0.012, 0.012, note, size=12, color=GREY, linespacing=1.3)
