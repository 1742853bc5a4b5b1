"""The picture of control charts of rods: errors of state and lengths over c, with resetting beside, a column for each step."""

from __future__ import annotations

import textwrap
from typing import Any

import numpy as np

from ...model.methods import Method
from .control import ControlSweep
from .control_runs import Held
from .style import GREY, Axes, Figure, apart, page

#: Least error drawn: zero has no place on a logarithmic axis.
LEAST_DRAWN = 1e-17

#: The lines of the two, told apart without colour.
CONTROL: dict[str, Any] = {"linestyle": "-", "linewidth": 2.0, "markersize": 6.0}
RESETTING: dict[str, Any] = {"linestyle": (0, (4, 2)), "linewidth": 1.6, "marker": ""}

#: Height of the strip of diverged runs, as a share of that of the panel below it.
STRIP = 0.1

#: Letters of a line of the title, its height, where what is below it begins, and the height of the name of a column.
LINE, LINE_HEIGHT, HEAD, COLUMN_TITLE = 84, 0.036, 0.93, 0.035

#: Columns of the legend, the height of a row of it, and the lower end of the panels without any.
LEGEND_COLUMNS, LEGEND_ROW, BOTTOM = 6, 0.03, 0.15


def draw(chart: ControlSweep) -> Figure:
    """Draw the chart on a new figure."""
    count = len(chart.evaluations)
    with page(13.0, 9.4) as figure:
        head = textwrap.wrap(chart.answer or f"{chart.title}: lengths under control", LINE, break_on_hyphens=False)
        strip = STRIP
        gap = strip + 0.02
        # Two frames, each with its strip above, below the title and the name of the column.
        share = strip / (2.0 + gap)
        bottom = BOTTOM + LEGEND_ROW * -(-(len(_firsts(chart)) + 2) // LEGEND_COLUMNS)
        top = (HEAD - LINE_HEIGHT * len(head) - COLUMN_TITLE + share * bottom) / (1.0 + share)
        places = {"left": 0.075, "right": 0.985, "bottom": bottom, "top": top, "wspace": 0.07, "hspace": gap}
        panels = figure.subplots(2, count, squeeze=False, sharex=True, sharey="row", gridspec_kw=places)
        for i, evaluations in enumerate(chart.evaluations):
            _column(panels[:, i], chart, evaluations, strip)
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


def _column(panels: Any, chart: ControlSweep, evaluations: int, strip: float) -> None:
    """One number of evaluations: the state's error above, that of the lengths below."""
    from matplotlib.patches import Rectangle

    above, below = panels
    methods = list(dict.fromkeys(line.method.name for line in chart.lines))
    for axes, what in ((above, "state_error" if chart.exact else "energy_error"), (below, "length_error")):
        axes.set(xscale="log", yscale="log")
        axes.grid(which="major", color="#dddddd", linewidth=0.8)
        axes.minorticks_off()
        grey: dict[str, Any] = {"transform": axes.transAxes, "facecolor": "#eeeeee", "clip_on": False, "zorder": 0}
        axes.add_patch(Rectangle((0.0, 1.0), 1.0, STRIP, **grey))
        for row, name in enumerate(methods):
            kinds = {line.kind: chart.line(name, line.kind, evaluations) for line in chart.lines if line.method.name == name}
            if (controlled := kinds.get("control")) is not None:
                _curve(axes, chart, controlled, getattr(controlled, what), row, len(methods))
            reset = kinds.get("length")
            if reset is not None and what != "length_error" and np.isfinite(getattr(reset, what)[0]):
                axes.axhline(max(getattr(reset, what)[0], LEAST_DRAWN), **(_look(chart, reset.method) | RESETTING))
    above.text(0.0, 1.0 + strip, f"{evaluations} function evaluations", size=13.5, transform=above.transAxes)
    below.set_xlabel("gain c of the control")


def _look(chart: ControlSweep, method: Method) -> dict[str, Any]:
    return apart([line.method for line in _firsts(chart)], method)


def _curve(axes: Axes, chart: ControlSweep, line: Held, values: Any, row: int, rows: int) -> None:
    """The errors of a method over c, and marks above the frame where its runs diverged."""
    style = _look(chart, line.method) | CONTROL
    fine = np.isfinite(values)
    axes.plot(line.relative, np.where(fine, np.maximum(values, LEAST_DRAWN), np.nan), **style, markevery=(row, rows))
    if not fine.all():
        height = 1.0 + STRIP * (row + 0.5) / rows
        above: dict[str, Any] = {"transform": axes.get_xaxis_transform(), "clip_on": False}
        axes.plot(
            line.relative[~fine], np.full((~fine).sum(), height), **(style | {"linestyle": "none", "markersize": 4.0}), **above
        )


def _limits(axes: Axes, chart: ControlSweep, what: str) -> None:
    """From the least error that is drawn to the largest, or to where nothing is known any more."""
    kinds = ("control",) if what == "length_error" else ("control", "length")
    values = np.concatenate([getattr(line, what) for line in chart.lines if line.kind in kinds] or [np.ones(1)])
    values = values[np.isfinite(values) & (values > 0.0)]
    if values.size:
        axes.set_ylim(max(0.3 * values.min(), LEAST_DRAWN), min(3.0 * values.max(), 10.0))


def _legend(figure: Figure, chart: ControlSweep) -> None:
    from matplotlib.lines import Line2D

    handles: list[Any] = [Line2D([], [], **(_look(chart, line.method) | CONTROL)) for line in _firsts(chart)]
    labels = [line.method.title for line in _firsts(chart)]
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


def _firsts(chart: ControlSweep) -> list[Held]:
    firsts: dict[str, Held] = {}
    for line in chart.lines:
        firsts.setdefault(line.method.name, line)
    return list(firsts.values())
