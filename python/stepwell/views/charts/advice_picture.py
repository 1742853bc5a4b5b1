"""The picture of advice: the costs and the errors of the methods that are good enough."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import ArgumentError
from .labels import Label, beside, title
from .style import GREY, PALE, Figure, look, page

if TYPE_CHECKING:
    from ...studies.advice.result import Advice
    from ...studies.advice.rows import Row

#: The margins around the points, as factors: of cost, of error above the allowed one, and of error below the least.
WIDER, HIGHER, LOWER = 1.8, 2.5, 12.0


def draw(advice: Advice) -> Figure:
    """Draw the ranked methods on a new figure."""
    if not advice.ranked:
        why = " ".join(advice.summary())
        raise ArgumentError(f"plot: expected advice with a method that is good enough, got none to draw: {why}")
    costs = np.array([cost(advice, row) for row in advice.ranked])
    errors = np.array([max(row.error, 1e-17) for row in advice.ranked])
    leading = on_front(costs, errors) | {0}
    with page(12.0, 7.2) as figure:
        from matplotlib.ticker import FuncFormatter, LogLocator

        axes = figure.add_axes((0.09, 0.16, 0.89, 0.69))
        axes.set(xscale="log", yscale="log")
        axes.grid(which="major", color="#dddddd", linewidth=0.8)
        axes.set_axisbelow(True)
        axes.set_xlim(costs.min() / WIDER, costs.max() * WIDER)
        axes.set_ylim(errors.min() / LOWER, advice.tolerance * HIGHER)
        axes.axhspan(advice.tolerance, advice.tolerance * HIGHER, color="#f0f0f0", linewidth=0.0, zorder=0.4)
        axes.axhline(advice.tolerance, color="black", linewidth=1.6)
        allowed = f"asked for: {advice.tolerance:g} or less"
        axes.text(0.01, advice.tolerance, allowed, transform=axes.get_yaxis_transform(), va="bottom", size=12)
        labels = []
        for i in sorted(range(len(costs)), key=lambda i: (i not in leading, i)):
            row, style = advice.ranked[i], look(advice.ranked[i].method)
            colour = style["color"] if i in leading else PALE
            face = "white" if row.tolerance is not None else colour
            edge: dict[str, Any] = {"color": colour, "markerfacecolor": face, "markeredgewidth": 1.8, "zorder": 3}
            axes.plot(costs[i], errors[i], linestyle="", marker=style["marker"], markersize=11 if i in leading else 8, **edge)
            text: dict[str, Any] = {"bbox": {"facecolor": "white", "edgecolor": "none", "pad": 0.0, "alpha": 0.85}}
            text |= {"color": colour if i in leading else GREY, "size": 13.0 if i in leading else 10.5}
            labels.append(Label(name(row), np.array([[costs[i], errors[i]]]), text | {"weight": "bold" if i == 0 else "normal"}))
        line = axes.transData.transform((costs.min(), advice.tolerance))[1]
        marks = axes.transData.transform(np.stack([costs, errors], axis=1))
        frame = axes.get_window_extent()
        boxes = [(frame.x0, line - 3.0, frame.x1, frame.y1), *((x - 6.0, y - 6.0, x + 6.0, y + 6.0) for x, y in marks.tolist())]
        unnamed = beside(axes, labels, boxes)
        axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axes.xaxis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:g}"))
        axes.minorticks_off()
        axes.set_xlabel(unit(advice))
        axes.set_ylabel("largest state error of the run, relative")
        title(figure, 0.012, 0.945, finding(advice), 19)
        figure.text(0.012, 0.895, textwrap.shorten(advice.title, 140, placeholder=" …"), size=12.5, color=GREY)
        notes = "With the largest step or tolerance that is good enough. In colour: none is both cheaper and more accurate."
        if unnamed:
            notes += f"\nNot named: {', '.join(unnamed)}."
        figure.text(0.012, 0.015, notes, size=11, color=GREY, linespacing=1.3)
    return figure


def cost(advice: Advice, row: Row) -> float:
    """The cost of a row by which the advice is ranked, in a frame or a unit of time."""
    if advice.cost == "time":
        return 1e9 * (row.seconds_per_time if row.seconds_per_frame is None else row.seconds_per_frame)
    return row.evaluations_per_time if row.evaluations_per_frame is None else row.evaluations_per_frame


def unit(advice: Advice) -> str:
    """The name of the cost."""
    per = "unit of simulated time" if advice.frame is None else "frame"
    return f"measured ns per {per}" if advice.cost == "time" else f"function evaluations per {per}"


def name(row: Row) -> str:
    """A method and its step."""
    single = "float32, " if row.dtype == "float32" else ""
    return f"{row.method.title}, {single}" + (f"dt = {row.dt:.3g}" if row.tolerance is None else f"tolerance {row.tolerance:g}")


def on_front(costs: np.ndarray[Any, Any], errors: np.ndarray[Any, Any]) -> set[int]:
    """The rows that no other beats in both cost and accuracy."""
    return {
        i
        for i in range(len(costs))
        if not ((costs <= costs[i]) & (errors <= errors[i]) & ((costs < costs[i]) | (errors < errors[i]))).any()
    }


def finding(advice: Advice) -> str:
    """The advice as a title."""
    number = len(advice.ranked)
    among = "the only one that is good enough" if number == 1 else f"the best of {number} that are good enough"
    return f"{advice.scene.title}: {name(advice.ranked[0])} is {among}"
