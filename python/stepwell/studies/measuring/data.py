"""The data of a chart, and how they are written to files."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from ...base import registry
from ...base.checks import known
from ...base.immutable import ValueEquality
from ...base.pictures import Drawn, drawn
from ...base.tables import Columns, Table, columns_of
from ...model.methods import Method
from ...scenes import Scene
from .peers import Peer

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: State errors for which the summary gives the cheapest cost.
TARGETS = (1e-1, 1e-2, 1e-4)

#: A scene is stiff if an implicit method has errors up to FEW_DIGITS with steps that are so many times the longest stable ones of
#: explicit methods.
FEW_DIGITS, MUCH_LONGER = 1e-2, 5.0

#: Errors of a point, and costs: counted, or measured in a batch or alone.
ERRORS = ("state_error", "end_error", "phase_error", "energy_error")
COSTS = ("evaluations", "batch", "single")


@dataclass(frozen=True, eq=False)
class Timing(ValueEquality):
    """Measured nanoseconds, per step or per unit of time of one member: not repeatable.

    Attributes:
        median: the median of the repeats.
        low: the least of them.
        high: the greatest of them.
    """

    median: float
    low: float
    high: float

    def over(self, dt: float) -> Timing:
        """The time per unit of simulated time, from this time per step."""
        return Timing(self.median / dt, self.low / dt, self.high / dt)

    @classmethod
    def unknown(cls) -> Timing:
        """A time that was not measured."""
        return cls(math.nan, math.nan, math.nan)


@dataclass(frozen=True, eq=False)
class Point(ValueEquality):
    """One method with one step, or one tolerance.

    Attributes:
        steps: number of steps over the horizon; for adaptive steps all attempts. None if a peer does not report it.
        dt: the step, in units of time; for adaptive steps the mean of all attempts.
        cost: function (rate) evaluations per unit of simulated time; NaN if a peer does not report them.
        state_error: the largest of ``Scene.state_error`` over the run; with a tolerance at the output times.
        energy_error: the largest of ``Scene.energy_error`` over the run, likewise; NaN if the system has no energy.
        unstable: whether the state left the finite numbers, or has no correct digit (an error above 1) and grew: its largest
            amplitude in the second half of the run is more than a tenth above that in the first half, and above the exact one.
            With a tolerance: whether the run stopped early.
        end_error: the state error at the end of the run.
        phase_error: the number of periods by which the end is ahead of the exact motion (negative: behind); None for a scene
            without a period, and for a state without a correct digit.
        tolerance: the tolerance of adaptive steps, or None.
    """

    steps: int | None
    dt: float | None
    cost: float
    state_error: float
    energy_error: float
    unstable: bool
    end_error: float = math.nan
    phase_error: float | None = None
    tolerance: float | None = None

    def error(self, kind: str = "state_error") -> float:
        """One of ``ERRORS``, without its sign; NaN if it is not known."""
        value: float | None = getattr(self, kind)
        return math.nan if value is None else abs(value)

    @property
    def usable(self) -> bool:
        """True if it is stable and its error is at most 1."""
        return not self.unstable and self.state_error <= 1.0


#: A point is right by luck if one of the next LATER points has more than LUCKY times its error. Rounding errors grow at most with
#: the number of steps, by a factor of 2 within three rungs of the ladder.
LATER, LUCKY = 3, 4.0


@dataclass(frozen=True, eq=False)
class Curve(ValueEquality):
    """One method with all steps, or all tolerances; or a peer.

    Attributes:
        method: the method.
        points: from the largest step, or tolerance, to the smallest.
        largest_stable_step: below it the method is stable over the horizon, to 0.1 %; infinite if none of the steps
            is unstable, 0 if all are, and infinite with tolerances.
        step_time: measured time of a step of one member of a batch.
        single_time: measured time of a step of a single run.
        by: ``"step"`` or ``"tolerance"``: the setting in which the points differ.
        times: for a peer, the measured time per unit of simulated time at each point, in a single run.
        fused: whether it was computed with fused multiply-adds.
        dtype: ``"float64"`` or ``"float32"``, the precision of the runs.
    """

    method: Method | Peer
    points: tuple[Point, ...]
    largest_stable_step: float
    step_time: Timing
    single_time: Timing = field(default_factory=Timing.unknown)
    by: str = "step"
    times: tuple[Timing, ...] = ()
    fused: bool = False
    dtype: str = "float64"

    @property
    def name(self) -> str:
        """The method's name, followed by "tolerance", "fused" or "float32" where they apply: ``"rk4, fused"``."""
        return f"{self.method.name}{self._kind}"

    @property
    def title(self) -> str:
        """As ``name``, for pictures."""
        return f"{self.method.title}{self._kind}"

    @property
    def _kind(self) -> str:
        tolerance = ", tolerance" if self.by == "tolerance" and isinstance(self.method, Method) else ""
        return tolerance + (", fused" if self.fused else "") + ("" if self.dtype == "float64" else f", {self.dtype}")

    def time(self, i: int, cost: str) -> Timing:
        """Measured nanoseconds per unit of simulated time at point ``i``, with a ``cost`` of ``"batch"`` or ``"single"``."""
        if self.times:
            return self.times[i] if cost == "single" else Timing.unknown()
        dt = self.points[i].dt
        assert dt is not None
        return (self.step_time if cost == "batch" else self.single_time).over(dt)

    def costs(self, cost: str = "evaluations") -> list[float]:
        """The cost of each point, per unit of simulated time: one of ``COSTS``; NaN if it is not known."""
        if cost == "evaluations":
            return [point.cost for point in self.points]
        return [self.time(i, cost).median for i in range(len(self.points))]

    @property
    def usable(self) -> tuple[Point, ...]:
        """The points that are usable, from the largest step to the smallest."""
        return tuple(point for point in self.points if point.usable)

    def dependable(self, kind: str = "state_error", floor: float = 0.0) -> tuple[Point, ...]:
        """The usable points that are not right by luck: none of the next three has a much larger error of that kind.

        A step may meet an impact just right, or lie in a narrow window of stability; a slightly shorter one does not. Errors
        below ``floor`` count as ``floor``.
        """

        def error(point: Point) -> float:
            return max(point.error(kind), floor) if point.usable else math.inf

        return tuple(
            point
            for i, point in enumerate(self.points)
            if point.usable and not any(error(later) > LUCKY * error(point) for later in self.points[i + 1 : i + 1 + LATER])
        )

    def cheapest(self, error: float) -> float:
        """The least cost of the dependable points with at most that state error; infinite if there is none."""
        return min((point.cost for point in self.dependable() if point.state_error <= error), default=math.inf)


class StiffSteps(NamedTuple):
    """The longest stable step of explicit methods on a stiff scene, and one that accuracy bears.

    Attributes:
        explicit: the title of the method with the longest stable step; empty if none was stable with any step that was tried.
        limit: that step, or the shortest that was tried.
        implicit: the title of the implicit method with the longest step that has two digits right.
        dt: that step, the mean of adaptive ones.
    """

    explicit: str
    limit: float
    implicit: str
    dt: float

    def __str__(self) -> str:
        where = (
            f"beyond dt = {self.limit:.2g} ({self.explicit})" if self.explicit else f"with every step to dt = {self.limit:.2g}"
        )
        return f"explicit methods blow up {where}; {self.implicit} has two digits with {self.dt:.2g}"


@dataclass(frozen=True, eq=False)
class WorkPrecision(Drawn, Table, ValueEquality):
    """Error against cost of several methods on one scene.

    Attributes:
        scene: the scene; if it has no exact solution, with that of a tight run, up to the time where that is known.
        curves: one for each method that can step the scene, then one for each with adaptive steps, then those of the peers.
        refused: why the others cannot step it, by name.
        members: members of the batch whose time was measured, on one thread.
        repeats: how often each method was timed.
        isa: the CPU level of the measurements.
        floor: the accuracy of the reference solution; errors below this are not meaningful.
        cut: whether the scene's horizon is longer than the time for which its true motion is known.
    """

    scene: Scene
    curves: tuple[Curve, ...]
    refused: dict[str, str]
    members: int
    repeats: int
    isa: str
    floor: float = 0.0
    cut: bool = False

    def draw(self, error: str = "state_error", time: str = "batch") -> Figure:
        """The picture, on a new figure."""
        figure: Figure = registry.task("draw_work_precision")(self, known("error", error, ERRORS), known("time", time, COSTS[1:]))
        return figure

    def plot(self, path: str | Path | None = None, *, error: str = "state_error", time: str = "batch") -> Figure:
        """Draw the chart.

        Args:
            path: the file to write, or None; its ending is that of the format.
            error: the error to show: ``"state_error"``, ``"end_error"``, ``"phase_error"``, ``"energy_error"``.
            time: whether measured times are those of a ``"batch"`` or of a ``"single"`` run.

        Raises:
            ArgumentError: if there is no such error, time or format.
            UnsupportedError: if matplotlib is missing.
        """
        return drawn(path, lambda: self.draw(error, time))

    def front(self, error: str = "state_error", cost: str = "evaluations") -> list[dict[str, Any]]:
        """The Pareto front: the points that no other beats in both cost and error, from the cheapest to the most accurate.

        Only points that are usable and not right by luck (``Curve.dependable``) count, with an error not below ``floor``.

        Args:
            error: one of ``"state_error"``, ``"end_error"``, ``"phase_error"``, ``"energy_error"``.
            cost: ``"evaluations"``, which is repeatable, or measured, ``"batch"`` or ``"single"``, which is not.

        Returns:
            A row for each: scene, method, steps, dt, tolerance, cost per unit of simulated time, error.

        Raises:
            ArgumentError: if there is no such error or cost.
        """
        known("error", error, ERRORS)
        known("cost", cost, COSTS)
        points = [
            (spent, point.error(error), i, curve, point)
            for i, curve in enumerate(self.curves)
            for dependable in [{id(point) for point in curve.dependable(error, self.floor)}]
            for spent, point in zip(curve.costs(cost), curve.points, strict=True)
            if id(point) in dependable  # which is not to compare each with all others, number by number
            and math.isfinite(spent)
            and math.isfinite(point.error(error))
            and point.error(error) >= self.floor
        ]
        rows: list[dict[str, Any]] = []
        least = math.inf
        for spent, wrong, _, curve, point in sorted(points, key=lambda each: each[:3]):
            if wrong < least:
                least = wrong
                which = {"steps": point.steps, "dt": point.dt, "tolerance": point.tolerance}
                rows.append({"scene": self.scene.name, "method": curve.name} | which | {"cost": spent, "error": wrong})
        return rows

    def best(self, error: float, cost: str = "evaluations") -> dict[str, Any] | None:
        """The row of the front that is the cheapest with at most that state error, or None."""
        return next((row for row in self.front(cost=cost) if row["error"] <= error), None)

    @property
    def stiff(self) -> StiffSteps | None:
        """How far explicit methods fall behind where stability holds down their steps; None where accuracy does.

        An implicit method must reach ``FEW_DIGITS`` with steps that are ``MUCH_LONGER`` than any stable ones of explicit methods.
        """
        methods = [(curve, curve.method) for curve in self.curves if isinstance(curve.method, Method)]
        explicit = [curve for curve, method in methods if not method.is_implicit and curve.by == "step"]
        coarse = [
            (point.dt, curve.title)
            for curve, method in methods
            if method.is_implicit
            for point in curve.dependable()
            if point.state_error <= FEW_DIGITS and point.dt is not None
        ]
        if not explicit or not coarse:
            return None
        most = max(explicit, key=lambda curve: curve.largest_stable_step)
        least = min(point.dt for point in most.points if point.dt is not None)
        limit = most.largest_stable_step or least
        dt, title = max(coarse)
        if not dt >= MUCH_LONGER * limit:
            return None
        return StiffSteps(most.title if most.largest_stable_step else "", limit, title, dt)

    def rows(self) -> list[dict[str, Any]]:
        """A row for each point, and one for each refused method. Columns named ``measured_…`` are not repeatable."""
        rows: list[dict[str, Any]] = []
        front = {(row["method"], row["steps"], row["tolerance"]) for row in self.front()}
        for curve in self.curves:
            head = {"scene": self.scene.name, "method": curve.name, "order": curve.method.order, "by": curve.by}
            for i, point in enumerate(curve.points):
                times = {f"measured_ns_per_time_{k}": ns for k, ns in asdict(curve.time(i, "batch")).items()}
                times |= {f"measured_ns_per_time_single_{k}": ns for k, ns in asdict(curve.time(i, "single")).items()}
                on = {"front": (curve.name, point.steps, point.tolerance) in front}
                rows.append(head | asdict(point) | on | times | {"refused": ""})
        empty = dict.fromkeys(rows[0], "") if rows else {}
        return rows + [
            empty | {"scene": self.scene.name, "method": name, "refused": reason} for name, reason in self.refused.items()
        ]

    def summary(self) -> list[dict[str, Any]]:
        """A row for each curve: its cheapest cost for each of three errors, its limits, its time per step."""
        rows: list[dict[str, Any]] = []
        for curve in self.curves:
            costs = {f"cost_at_error_{error:g}": curve.cheapest(error) for error in TARGETS}
            best = {"least_error": min((point.state_error for point in curve.dependable()), default=math.inf)}
            rows.append(
                {"scene": self.scene.name, "method": curve.name, "title": curve.title}
                | costs
                | best
                | {"largest_stable_step": curve.largest_stable_step}
                | {f"measured_ns_per_step_{k}": ns for k, ns in asdict(curve.step_time).items()}
                | {f"measured_ns_per_step_single_{k}": ns for k, ns in asdict(curve.single_time).items()}
            )
        return rows

    def as_dict(self) -> dict[str, Any]:
        """Scene, rows, front, summary and refusals."""
        scene = {
            k: getattr(self.scene, k) for k in ("name", "title", "section", "description", "error", "dt", "horizon", "period")
        }
        measured = {"members": self.members, "threads": 1, "repeats": self.repeats, "isa": self.isa}
        return {
            "scene": scene,
            "floor": self.floor,
            "cut": self.cut,
            "stiff": self.stiff._asdict() if self.stiff else None,
            "measured_on": measured,
            "rows": self.rows(),
            "front": self.front(),
            "summary": self.summary(),
            "refused": self.refused,
        }

    def _columns(self) -> Columns:
        return columns_of(self.rows())
