"""The picture of several work-precision charts: a small one for each scene, and one legend."""

from __future__ import annotations

import math
import textwrap
from collections import Counter

from ...studies.measuring.data import StiffSteps
from .labels import title as put_title
from .panel import Panel
from .picture import COUNTED, DIGITS_OF, ERRORS, draw_errors, family_of, known_to, name_curves, with_way
from .style import GREY, Figure, page

#: Subplots in a row, and the height of one, and of the title, in inches.
ACROSS, EACH, HEAD = 3, 4.3, 1.35
#: Subplots in a row if each scene has two.
ACROSS_PAIRS = 4

WIDTH = 16.0

#: The note on curves without a name.
PALE_IS = "Pale: never the cheapest."

#: A method that is the cheapest in less than this fraction of the cases leads by luck.
HALF = 0.5

#: The numbers of digits for which the cheapest method is counted.
DIGITS = range(1, 13)


def draw(panel: Panel, error: str) -> Figure:
    """Draw the charts on a new figure."""
    # A correct energy does not imply a correct motion, so the energy error has the state error beside it.
    kinds = ("energy_error", "state_error") if error == "energy_error" else (error,)
    each = [(chart, kind) for chart in panel.charts for kind in kinds]
    across = min(ACROSS_PAIRS if len(kinds) > 1 else ACROSS, len(each))
    down = math.ceil(len(each) / across)
    foot = 0.75
    height = HEAD + EACH * down + foot
    with page(WIDTH, height) as figure:
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
            name_curves(axes, chart, kind, "evaluations", 10.5, all_of_them=False)
            note = f"t up to {chart.scene.horizon:.4g}{known_to(chart)}{_blows_up(chart.stiff)}"
            note = f"{kind.replace('_', ' ')}, {note}" if len(kinds) > 1 else note
            axes.set_title(f"{chart.scene.title}\n", size=14, weight="bold", loc="left")
            axes.text(0.0, 1.02, note, transform=axes.transAxes, size=11, color=GREY)
        title = f"{leader(panel, error)}: what an error{DIGITS_OF[error]} costs, scene by scene"
        put_title(figure, 0.012, 1.0 - 0.42 / height, title, 20)
        bottom = 0.12 / height
        figure.text(0.012, bottom, PALE_IS, size=12, color=GREY)
        figure.text(0.52, bottom, COUNTED, ha="center", size=14)
        figure.text(
            0.012, 0.5, textwrap.fill(" and ".join(ERRORS[kind] for kind in kinds), 60), rotation=90, va="center", size=14
        )
    return figure


def _blows_up(stiff: StiffSteps | None) -> str:
    """Where explicit methods are unstable, in a few words."""
    if stiff is None:
        return ""
    return f"; explicit: unstable {'beyond' if stiff.explicit else 'even with'} dt = {stiff.limit:.2g}"


def leader(panel: Panel, error: str = "state_error") -> str:
    """The method that is the cheapest most often, over all scenes and numbers of digits of that error that any method reaches."""
    best = []
    for chart in panel.charts:
        front = chart.front(error)
        best += [next((row["method"] for row in front if row["error"] <= 10.0**-digits), None) for digits in DIGITS]
    names = [name for name in best if name is not None]
    if not names:
        return f"No method has a digit{DIGITS_OF[error]} right"
    curves = dict.fromkeys(curve.name for chart in panel.charts for curve in chart.curves)
    alone = len({family_of(name) for name in curves}) == 1
    first, times = Counter(name if alone else family_of(name) for name in names).most_common(1)[0]
    meant = [name for name in names if first in (name, family_of(name))]
    ways = [name for name in curves if family_of(name) == family_of(first)]
    if times < HALF * len(names):
        return f"No method is the cheapest in half of {len(names)} cases"
    return f"{with_way(meant, ways)} is the cheapest in {times} of {len(names)} cases"
