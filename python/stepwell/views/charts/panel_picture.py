"""The picture of several work-precision charts: a small one for each scene, and one legend."""

from __future__ import annotations

import math
import textwrap
from collections import Counter

from ...studies.measuring.data import StiffSteps, WorkPrecision
from .cheapest_picture import DIGITS, draw_table
from .labels import title as put_title
from .panel import Panel
from .picture import COUNTED, DIGITS_OF, ERRORS, draw_errors, family_of, has_implicit, name_curves, with_way
from .style import DPI, GREY, Axes, Figure, page

#: Subplots in a row; if each scene has two; and the most scenes that are all drawn by their curves.
ACROSS, ACROSS_PAIRS, MOST_CURVES = 3, 2, 4

#: In inches: the width, and the heights of the title, of a row of the table, of what is above it, of what is above curves, of a
#: row of these, and of the notes.
WIDTH, HEAD, ROW, TABLE_HEAD, CURVES_HEAD, EACH, FOOT = 12.5, 0.85, 0.62, 1.0, 0.55, 3.6, 0.75

#: The note on curves without a name.
PALE_IS = "Pale: never the cheapest."

#: A method that is the cheapest in less than this fraction of the cases leads by luck.
HALF = 0.5


def draw(panel: Panel, error: str) -> Figure:
    """Draw the charts on a new figure: few scenes by their curves, more by a table and the curves of the first ones."""
    # A correct energy does not imply a correct motion, so the energy error has the state error beside it.
    kinds = ("energy_error", "state_error") if error == "energy_error" else (error,)
    table = len(panel.charts) > MOST_CURVES
    each = [(chart, kind) for chart in panel.charts[: ACROSS // len(kinds) if table else None] for kind in kinds]
    across = min(ACROSS_PAIRS if len(kinds) > 1 and not table else ACROSS, len(each))
    down = math.ceil(len(each) / across)
    rows = TABLE_HEAD + ROW * len(panel.charts) if table else 0.0
    height = HEAD + rows + EACH * down + FOOT
    with page(WIDTH, height, dpi=DPI) as figure:
        if table:
            place = (0.22, 1.0 - (HEAD + rows - 0.5) / height, 0.77, ROW * len(panel.charts) / height)
            axes = figure.add_axes(place)
            draw_table(axes, panel, error)
            figure.text(0.012, place[1] + place[3] + 0.12 / height, "right digits:", size=12.5, color=GREY)
        grid = figure.add_gridspec(
            down,
            across,
            left=0.085,
            right=0.985,
            top=1.0 - (HEAD + rows + CURVES_HEAD) / height,
            bottom=(FOOT + 0.05) / height,
            hspace=0.5,
            wspace=0.3,
        )
        for i, (chart, kind) in enumerate(each):
            _curves(figure.add_subplot(grid[i // across, i % across]), chart, kind, named=len(kinds) > 1)
        title = f"{leader(panel, error)}: what an error{DIGITS_OF[error]} costs, scene by scene"
        put_title(figure, 0.012, 1.0 - 0.42 / height, title, 18)
        what = (
            "In a cell: the cheapest method, its function evaluations per unit of time; tol: by a tolerance. Empty: not reached."
        )
        figure.text(0.012, 1.0 - 0.72 / height, what if table else PALE_IS, size=12, color=GREY)
        foot = f"{' and '.join(ERRORS[kind] for kind in kinds)}, over {COUNTED}"
        if any(map(has_implicit, panel.charts)):
            foot += "; implicit methods without linear algebra"
        figure.text(0.012, 0.14 / height, textwrap.shorten(foot, 140), size=12, color=GREY)
    return figure


def _curves(axes: Axes, chart: WorkPrecision, kind: str, *, named: bool) -> None:
    draw_errors(axes, chart, kind, "evaluations")
    for line in axes.lines:
        line.set_markersize(0.75 * line.get_markersize())
        line.set_linewidth(line.get_linewidth() * 0.8)
    axes.minorticks_off()
    axes.locator_params(axis="y", numticks=7)
    name_curves(axes, chart, kind, "evaluations", 11.0)
    note = f"t up to {chart.scene.horizon:.4g}{_blows_up(chart.stiff)}"
    axes.set_title(chart.scene.title, size=13, weight="bold", loc="left", pad=22.0)
    axes.text(0.0, 1.02, f"{kind.replace('_', ' ')}, {note}" if named else note, transform=axes.transAxes, size=11, color=GREY)


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
