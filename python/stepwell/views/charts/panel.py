"""Several scenes side by side, with the cheapest method of each."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...base import checks, registry
from ...base.checks import known
from ...base.immutable import ValueEquality
from ...base.pictures import Drawn, drawn
from ...base.tables import Columns, Table, columns_of
from ...errors import ArgumentError
from ...scenes import Scene
from ...scenes import scene as find_scene
from ...studies.measuring.data import ERRORS, WorkPrecision
from ...studies.measuring.work_precision import work_precision

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, eq=False)
class Panel(Drawn, Table, ValueEquality):
    """Work-precision charts of several scenes, whose tables stand below each other.

    Attributes:
        charts: one for each scene.
    """

    charts: tuple[WorkPrecision, ...]

    def draw(self, error: str = "state_error") -> Figure:
        """The picture, on a new figure."""
        figure: Figure = registry.task("draw_panel")(self, known("error", error, ERRORS))
        return figure

    def plot(self, path: str | Path | None = None, *, error: str = "state_error") -> Figure:
        """Draw the scenes beside each other, and write the picture to ``path`` if given; ``error`` as of a single chart.

        Raises:
            ArgumentError: if there is no such error or format.
            UnsupportedError: if matplotlib is missing.
        """
        return drawn(path, lambda: self.draw(error))

    def rows(self) -> list[dict[str, Any]]:
        """The rows of all charts."""
        return [row for chart in self.charts for row in chart.rows()]

    def summary(self) -> list[dict[str, Any]]:
        """The summaries of all charts."""
        return [row for chart in self.charts for row in chart.summary()]

    def front(self, error: str = "state_error", cost: str = "evaluations") -> list[dict[str, Any]]:
        """The fronts of all charts, one after another."""
        return [row for chart in self.charts for row in chart.front(error, cost)]

    def as_dict(self) -> list[dict[str, Any]]:
        """The ``as_dict()`` of each chart."""
        return [chart.as_dict() for chart in self.charts]

    def _columns(self) -> Columns:
        return columns_of(self.rows())


def panel(scenes: Iterable[Scene | str], *, progress: Callable[[float], object] | None = None, **options: Any) -> Panel:
    """Chart several scenes.

    Args:
        scenes: scenes, or their names.
        progress: a function that is called with the fraction that is done.
        **options: arguments of ``work_precision``: ``methods``, ``steps``, ``tolerances``, ``peers``.

    Raises:
        ArgumentError: what was given and what was expected.

    Example:
        >>> chart = sw.charts.panel(["oscillator"], methods=["leapfrog"], steps=[500, 1000], tolerances=[])
        >>> len(chart.charts)
        1
    """
    chosen = [find_scene(each) for each in checks.several("scenes", scenes, "scenes")]
    if not chosen:
        raise ArgumentError("scenes: expected at least one, got none")
    options = {name: value if value is None else checks.several(name, value, name) for name, value in options.items()}
    progress = checks.callback("progress", progress)
    charts = []
    for i, scene in enumerate(chosen):

        def part_done(share: float, before: int = i) -> None:
            if progress is not None:
                progress((before + share) / len(chosen))

        charts.append(work_precision(scene, progress=part_done, **options))
    return Panel(tuple(charts))
