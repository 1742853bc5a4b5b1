"""The picture of errors at contacts: each step is a point, and a line shows what no shorter step does worse."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np
import stepwell as sw
from stepwell.views.charts import labels, style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: One method of each order, and what is drawn of them: function evaluations per unit of time, and errors.
METHODS = ("false_euler", "standard_heun", "rk4", "dop853")
COSTS, ERRORS = (10.0, 1e6), (1e-9, 1.0)


def envelope(points: Any) -> Any:
    """The largest error of a step and all shorter ones, for (cost, error), by cost."""
    cost, error = points[np.argsort(points[:, 0])].T
    return np.stack([cost, np.maximum.accumulate(error[::-1])[::-1]], axis=1)


def draw(charts: Iterable[sw.charts.WorkPrecision]) -> Figure:
    """A panel for each scene."""
    from matplotlib import rc_context

    charts = list(charts)
    with rc_context(style.FONT):
        figure: Any = style.new_figure(12.5, 5.6)
        for i, chart in enumerate(charts):
            place = (0.07 + 0.315 * i, 0.2, 0.28, 0.57)
            axes = figure.add_axes(
                place, xscale="log", yscale="log", xlim=COSTS, ylim=ERRORS
            )
            names = []
            for name in METHODS:
                curve = next(curve for curve in chart.curves if curve.name == name)
                points = np.array(
                    [(point.cost, point.state_error) for point in curve.usable]
                )
                colour = style.look(sw.method(name))["color"]
                axes.plot(*points.T, ".", color=colour, markersize=4.0, alpha=0.6)
                worst = envelope(points)
                axes.plot(*worst.T, color=colour, linewidth=2.0)
                look = {"color": colour, "weight": "bold", "size": 11.5}
                names.append(labels.Label(curve.title, worst, look))
            labels.beside(axes, names)
            axes.set_title(chart.scene.title, loc="left", size=13, weight="bold")
            axes.set_yticks((1e-8, 1e-6, 1e-4, 1e-2, 1.0), None if i == 0 else [""] * 5)
            axes.set_xticks((1e2, 1e4, 1e6))
            axes.minorticks_off()
            axes.grid(color="#e6e6e6", linewidth=0.8)
        figure.text(
            0.52, 0.075, "function evaluations per unit of time", ha="center", size=13
        )
        title = "At contacts a higher order gains nothing: Heun is as good as orders 4 and 8"
        labels.title(figure, 0.012, 0.925, title, 19)
        about = "Largest error of the run. Dots: steps. Line: no shorter step is worse; dots below it are lucky."
        figure.text(0.012, 0.865, about, size=12.5, color=style.GREY)
    return figure
