"""A table as a picture: for each scene and number of digits the cheapest method, with its cost."""

from __future__ import annotations

from itertools import groupby
from typing import Any, NamedTuple

from ...model.methods import methods as every_method
from ...studies.measuring.data import WorkPrecision
from .panel import Panel
from .style import FAMILIES, GREY, Axes, contrast, family

#: The numbers of digits for which the cheapest method is shown.
DIGITS = range(1, 13)

#: The colour of the cells of other programs.
OTHER = "#555555"

#: The size of letters in points, and the width of one and the air beside a name in that unit.
SIZE, LETTER, BESIDE = 11.0, 0.68, 0.5


class Cell(NamedTuple):
    """The cheapest way to so many digits."""

    digits: int
    name: str
    cost: float


def cells(chart: WorkPrecision, error: str) -> list[Cell]:
    """The cheapest way to each number of digits that any method reaches."""
    front = chart.front(error)
    found = []
    for digits in DIGITS:
        row = next((row for row in front if row["error"] <= 10.0**-digits), None)
        if row is not None:
            found.append(Cell(digits, row["method"], float(row["cost"])))
    return found


def draw_table(axes: Axes, panel: Panel, error: str) -> None:
    """A row for each scene: equal neighbours are one bar with the method's name, and below it what each error costs."""
    from matplotlib.colors import to_rgb
    from matplotlib.patches import Rectangle

    rows = len(panel.charts)
    axes.set(xlim=(0.5, len(DIGITS) + 0.5), ylim=(rows, 0.0))
    axes.axis("off")
    cell = axes.get_window_extent().width / len(DIGITS) / axes.figure.dpi * 72.0  # in points
    for digits in DIGITS:
        axes.text(digits, -0.12, str(digits), ha="center", va="bottom", size=12.5, color=GREY)
    for row, chart in enumerate(panel.charts):
        axes.text(0.42, row + 0.5, chart.scene.title, ha="right", va="center", size=12.5)
        for name, same in groupby(cells(chart, error), lambda cell: cell.name):
            bar = list(same)
            colour = _colour(name)
            first, count = bar[0].digits, len(bar)
            axes.add_patch(Rectangle((first - 0.48, row + 0.06), count - 0.04, 0.88, facecolor=colour, linewidth=0.0))
            letters = "white" if contrast(to_rgb(colour)) >= 4.5 else "#000000"
            shown = short(name) if _fits(short(name), count * cell) else short(name).replace("_", "_\n").replace(" ", "\n")
            if _fits(shown, count * cell):
                look: dict[str, Any] = {"size": SIZE, "weight": "bold", "linespacing": 0.9, "color": letters}
                axes.text(first - 0.42, row + 0.34, shown, va="center", **look)
            for each in bar:
                axes.text(each.digits, row + 0.78, number(each.cost), ha="center", va="center", size=SIZE, color=letters)


def _fits(text: str, room: float) -> bool:
    return (max(len(line) for line in text.split("\n")) * LETTER + BESIDE) * SIZE <= room


def number(cost: float) -> str:
    """A cost in few letters: 9.4, 137, 1230, 12k."""
    return (
        f"{cost:.2g}"
        if cost < 10.0
        else f"{cost:.0f}"
        if cost < 9999.5
        else f"{cost / 1e3:.0f}k"
        if cost < 999_500.0
        else f"{cost / 1e6:.2g}M"
    )


def short(name: str) -> str:
    """A curve's name as users type it, short enough for a cell."""
    first, *kinds = name.split(", ")
    return " ".join([first, *("tol" if kind == "tolerance" else kind for kind in kinds)])


def _colour(name: str) -> str:
    method = next((method for method in every_method() if method.name == name.split(", ")[0]), None)
    return OTHER if method is None else FAMILIES[family(method)]
