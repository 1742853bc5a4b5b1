"""The picture of several work-precision charts: a small one for each scene, and one legend."""

from __future__ import annotations

import math
import textwrap
from typing import TYPE_CHECKING, Any

from .panel import Panel
from .picture import COUNTED, ERRORS, FRONT, draw_errors, known_to, look_of
from .style import FONT, GREY, new_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Subplots in a row, and the height of one, of the title and of a line of the legend, in inches.
ACROSS, EACH, HEAD, LINE = 3, 4.3, 1.0, 0.27
#: Where each scene has two.
ACROSS_PAIRS = 4

WIDTH, COLUMNS = 16.0, 5


def draw(panel: Panel, error: str) -> Figure:
    """Draw the charts on a new figure."""
    entries: dict[str, Any] = {}
    for chart in panel.charts:
        for curve in chart.curves:
            entries.setdefault(curve.title, look_of(chart, curve))
    # A right energy does not make a motion right: the energy error has the state error beside it.
    kinds = ("energy_error", "state_error") if error == "energy_error" else (error,)
    each = [(chart, kind) for chart in panel.charts for kind in kinds]
    across = min(ACROSS_PAIRS if len(kinds) > 1 else ACROSS, len(each))
    down = math.ceil(len(each) / across)
    foot = 0.75 + LINE * math.ceil((len(entries) + 1) / COLUMNS)
    height = HEAD + EACH * down + foot
    figure = new_figure(WIDTH, height)
    from matplotlib import rc_context
    from matplotlib.lines import Line2D

    with rc_context(FONT):
        grid = figure.add_gridspec(
            down, across, left=0.065, right=0.985, top=1.0 - HEAD / height, bottom=(foot + 0.2) / height, hspace=0.32, wspace=0.2
        )
        for i, (chart, kind) in enumerate(each):
            axes = figure.add_subplot(grid[i // across, i % across])
            draw_errors(axes, chart, kind, "evaluations")
            for line in axes.lines:
                line.set_markersize(0.75 * line.get_markersize())
                line.set_linewidth(line.get_linewidth() * 0.8)
            axes.minorticks_off()
            note = f"t up to {chart.scene.horizon:.4g}{known_to(chart)}"
            note = f"{kind.replace('_', ' ')}, {note}" if len(kinds) > 1 else note
            axes.set_title(f"{chart.scene.title}\n", size=14, weight="bold", loc="left")
            axes.text(0.0, 1.02, note, transform=axes.transAxes, size=11, color=GREY)
        figure.text(0.012, 1.0 - 0.42 / height, "What an error costs, scene by scene", size=20, weight="bold")
        bottom = (foot - 0.42) / height
        figure.text(0.52, bottom, COUNTED, ha="center", size=14)
        figure.text(
            0.012, 0.5, textwrap.fill(" and ".join(ERRORS[kind] for kind in kinds), 60), rotation=90, va="center", size=14
        )
        handles = [Line2D([], [], **style) for style in entries.values()] + [Line2D([], [], **FRONT)]
        labels = [*entries, "the cheapest of all for its error"]
        figure.legend(
            handles, labels, loc="lower center", ncols=COLUMNS, frameon=False, handlelength=3.0, bbox_to_anchor=(0.5, 0.0)
        )
    return figure
