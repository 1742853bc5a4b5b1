"""What a chart holds, and how it is written down."""

from __future__ import annotations

import csv
import json
import math
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..methods import Method
from ..scenes import Scene
from .style import Drawn

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: State errors for which the summary gives the cheapest cost.
TARGETS = (1e-1, 1e-2, 1e-4)


@dataclass(frozen=True)
class Timing:
    """Measured nanoseconds per step of one member of a batch: not repeatable.

    Attributes:
        median: of the repeats.
        low: the least of them.
        high: the greatest.
    """

    median: float
    low: float
    high: float


@dataclass(frozen=True)
class Point:
    """One method with one step.

    Attributes:
        steps: how many steps were made over the horizon.
        dt: the step, in units of time.
        cost: rate evaluations per unit of simulated time.
        state_error: the largest of ``Scene.state_error`` over the run.
        energy_error: the largest of ``Scene.energy_error`` over the run.
        unstable: the state left the finite numbers, or is wrong altogether (an error above 1) and grew: its largest
            amplitude in the second half of the run is more than a tenth above that in the first half, and above the
            exact one.
    """

    steps: int
    dt: float
    cost: float
    state_error: float
    energy_error: float
    unstable: bool

    @property
    def usable(self) -> bool:
        """Whether it is stable and at least the size of the solution is right: an error of 1 or less."""
        return not self.unstable and self.state_error <= 1.0


@dataclass(frozen=True)
class Curve:
    """One method on the whole ladder of steps.

    Attributes:
        method: which.
        points: from the largest step to the smallest.
        largest_stable_step: below it the method is stable over the horizon, to 0.1 %; infinite if no step of the ladder
            is unstable, 0 if all are.
        step_time: measured.
    """

    method: Method
    points: tuple[Point, ...]
    largest_stable_step: float
    step_time: Timing

    @property
    def usable(self) -> tuple[Point, ...]:
        """The points that are usable, from the largest step to the smallest."""
        return tuple(point for point in self.points if point.usable)

    def cheapest(self, error: float) -> float:
        """The least cost of the usable points with at most that state error; infinite if there is none."""
        return min((point.cost for point in self.usable if point.state_error <= error), default=math.inf)


@dataclass(frozen=True)
class WorkPrecision(Drawn):
    """Error against cost of several methods on one scene.

    Attributes:
        scene: which.
        curves: one for each method that can do the scene.
        refused: why the others cannot, by name.
        members: members of the batch whose time was measured, on one thread.
        repeats: how often each method was timed.
        isa: the CPU level at which it was measured.
    """

    scene: Scene
    curves: tuple[Curve, ...]
    refused: dict[str, str]
    members: int
    repeats: int
    isa: str

    def draw(self) -> Figure:
        """The picture, on a new figure."""
        from .picture import draw

        return draw(self)

    def rows(self) -> list[dict[str, Any]]:
        """A row for each point, and one for each refused method. Columns named ``measured_…`` are not repeatable."""
        rows: list[dict[str, Any]] = []
        for curve in self.curves:
            head = {"scene": self.scene.name, "method": curve.method.name, "order": curve.method.order}
            for point in curve.points:
                times = {f"measured_ns_per_time_{k}": ns / point.dt for k, ns in asdict(curve.step_time).items()}
                rows.append(head | asdict(point) | times | {"refused": ""})
        empty = dict.fromkeys(rows[0], "") if rows else {}
        return rows + [
            empty | {"scene": self.scene.name, "method": name, "refused": reason} for name, reason in self.refused.items()
        ]

    def summary(self) -> list[dict[str, Any]]:
        """A row for each method: its cheapest cost for each of three errors, its limits, its time per step."""
        rows: list[dict[str, Any]] = []
        for curve in self.curves:
            costs = {f"cost_at_error_{error:g}": curve.cheapest(error) for error in TARGETS}
            best = {"least_error": min((point.state_error for point in curve.usable), default=math.inf)}
            rows.append(
                {"scene": self.scene.name, "method": curve.method.name, "title": curve.method.title}
                | costs
                | best
                | {"largest_stable_step": curve.largest_stable_step}
                | {f"measured_ns_per_step_{k}": ns for k, ns in asdict(curve.step_time).items()}
            )
        return rows

    def to_csv(self, path: str | Path) -> None:
        """Write ``rows()``, one line each; every number reads back as itself."""
        rows = self.rows()
        with Path(path).open("w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
            writer.writeheader()
            writer.writerows(rows)

    def to_json(self, path: str | Path) -> None:
        """Write scene, rows, summary and refusals; what is infinite is null."""
        scene = {k: getattr(self.scene, k) for k in ("name", "title", "section", "description", "error", "dt", "horizon")}
        measured = {"members": self.members, "threads": 1, "repeats": self.repeats, "isa": self.isa}
        whole = {
            "scene": scene,
            "measured_on": measured,
            "rows": self.rows(),
            "summary": self.summary(),
            "refused": self.refused,
        }
        Path(path).write_text(json.dumps(finite(whole), ensure_ascii=False, indent=1) + "\n", encoding="utf-8")


def finite(value: Any) -> Any:
    """The same for JSON, which knows no infinity: None in its place."""
    if isinstance(value, dict):
        return {k: finite(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [finite(v) for v in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
