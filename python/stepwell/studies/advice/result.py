"""The result of ``advise``, as data and as text."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...base import registry
from ...base.arrays import Array
from ...base.pictures import drawn
from ...base.reprs import table
from ...base.tables import finite, json_text, write_json
from ...errors import ArgumentError
from ...runs.integration import integrate
from ...runs.result import Run
from ...scenes import Scene
from .motion import grid_of
from .rows import Rejected, Row, Shortfall
from .stiff import Stiff

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: The most methods with a line in the text; ``ranked`` and ``rejected`` have all.
LINES = 6

#: The most rejected methods of each kind whose reasons the text says; it names the others.
REASONS = 2

#: A run of a row may attempt this many times its steps, since these depend slightly on the output times.
MORE_STEPS = 10

#: Why further methods of a kind are rejected.
LIKEWISE = {
    "dominated": "also too expensive",
    "inaccurate": "also not accurate enough",
    "unstable": "also unstable",
    "refused": "also not applicable",
    "budget": "also beyond the budget",
}

#: The columns of the table; those whose name ends in ``>`` are flush right.
COLUMNS = ("method", "steps>", "dt>", "error>", "predicted>", "evaluations>", "ns>", "objects>", "blows up at dt>")


@dataclass(frozen=True)
class Advice:
    """The advised methods and steps for a scene.

    Attributes:
        scene: the scene, up to the horizon over which its true motion is known.
        frame: the frame, in units of time, or None for any step.
        tolerance: the largest allowed state error.
        budget: the seconds allowed in a frame (in a unit of time without one), or None for any number.
        cost: the order of ``ranked``, by ``"time"`` or ``"evaluations"``.
        ranked: the methods that are good enough and fit, the cheapest first; among those whose costs differ by ``cost_noise`` or
            less, the one with the smallest error.
        rejected: the other methods, and why.
        shortfall: the tolerance and the budget that would suffice; None if something fits.
        runs: the number of runs of the search.
        cut: whether the scene's horizon is longer than its true motion is known.
        cost_noise: the relative difference of measured times that means nothing; 0 for evaluations.
        dtype: ``"float64"``, ``"float32"`` or ``"both"``, the precision of the tried steps.
        stiff: why the best method is an implicit one: what stability leaves to explicit ones; None if that is not the reason.
    """

    scene: Scene
    frame: float | None
    tolerance: float
    budget: float | None
    cost: str
    ranked: tuple[Row, ...]
    rejected: tuple[Rejected, ...]
    shortfall: Shortfall | None
    runs: int
    cut: bool = False
    cost_noise: float = 0.0
    dtype: str = "float64"
    stiff: Stiff | None = None

    @property
    def best(self) -> Row | None:
        """The first of ``ranked``, or None."""
        return self.ranked[0] if self.ranked else None

    def data(self) -> dict[str, Any]:
        """The advice as a dictionary; infinite numbers become None."""
        whole = {
            "scene": self.scene.name,
            "horizon": self.scene.horizon,
            "frame": self.frame,
            "tolerance": self.tolerance,
            "budget": self.budget,
            "cost": self.cost,
            "best": self.best.data() if self.best else None,
            "ranked": [row.data() for row in self.ranked],
            "rejected": [asdict(each) for each in self.rejected],
            "shortfall": asdict(self.shortfall) if self.shortfall else None,
            "runs": self.runs,
            "cut": self.cut,
            "cost_noise": self.cost_noise,
            "dtype": self.dtype,
            "stiff": asdict(self.stiff) if self.stiff else None,
        }
        return dict(finite(whole))

    def to_json(self, path: str | Path | None = None) -> str:
        """The text of ``data()`` in JSON, which is also written to ``path`` if there is one."""
        if path is not None:
            write_json(self.data(), path)
        return json_text(self.data())

    @property
    def asked(self) -> Array:
        """Output times of the runs with a tolerance: the ends of frames, or ten equidistant times, in units of time."""
        return grid_of(self.scene.horizon, self.frame).output_times

    def run(self, row: Row | None = None) -> Run:
        """The run of a row, in full.

        Args:
            row: a row of ``ranked``; the best if None.

        Returns:
            A ``Run`` with every step saved, or with a tolerance the states at ``asked``. ``advice.scene.state_error`` computes
            its errors.
        """
        row = self.best if row is None else row
        if row is None:
            raise ArgumentError("row: nothing fits, so there is nothing to run")
        if row.tolerance is None:
            return self.scene.run(row.method, row.dt, steps=row.steps, every=1, dtype=row.dtype)
        scene = self.scene
        options: dict[str, Any] = {
            "tolerance": row.tolerance,
            "at": self.asked,
            "max_steps": MORE_STEPS * row.steps,
        } | scene.adaptive_options
        return integrate(scene.system, row.method, v=scene.v, y=scene.y, **options)

    def summary(self) -> list[str]:
        """The advice in sentences, a line each."""
        per = "a frame" if self.frame is not None else "a unit of time"
        best = self.best
        if best is None:
            return [*self._cut(), *self._what_would_have_to_give(per)]
        if best.tolerance is not None:
            run = f"error {best.error:.2g} in the run of {best.steps} steps, {best.rejected_steps} of them rejected"
            lines = [f"Use {best.method.name} with adaptive steps to a tolerance of {best.tolerance:g}: {run}."]
        else:
            count = f"{best.substeps} step{'s' * (best.substeps != 1)} a frame" if best.substeps else f"{best.steps} steps"
            run = f"error {best.error:.2g} in the run of {best.steps} steps"
            single = " in float32" if best.dtype == "float32" else ""
            lines = [f"Use {best.method.name}{single} with {count}, dt = {best.dt:.4g}: {run}."]
        lines += [*([str(self.stiff)] if self.stiff else []), *self._cut()]
        ns = 1e9 * (best.seconds_per_frame if best.seconds_per_frame is not None else best.seconds_per_time)
        evaluations = best.evaluations_per_frame if best.evaluations_per_frame is not None else best.evaluations_per_time
        worst = f", {best.worst_evaluations} in the worst frame" if best.tolerance is not None and best.worst_evaluations else ""
        counted = f"{evaluations:.4g} function evaluation{'s' * (evaluations != 1)}{worst}"
        lines.append(f"Cost per {per.removeprefix('a ')}: {counted}; {ns:.2g} ns measured in a batch on one thread.")
        lines += self._as_cheap(best) + self._beside(best)
        if best.objects is not None:
            objects = f"{about(best.objects)} such object{'s' * (best.objects != 1)}{', also then' * bool(worst)}"
            lines.append(f"The budget of {self.budget:.3g} s {per} suffices for {objects}.")
        lines.append(_margin(best))
        if not best.is_robust:
            lines.append(self._uneven(best))
        return lines

    def _as_cheap(self, best: Row) -> list[str]:
        """The other methods whose costs equal the best one's up to the noise; the best has the smallest error of them."""
        if self.cost != "time":
            return []
        alike = best.seconds_per_time * (1.0 + self.cost_noise)
        same = [row.name for row in self.ranked[1:] if row.seconds_per_time <= alike and row.error >= best.error]
        if not same:
            return []
        # A name may have a comma, as that of a curve by tolerance.
        names = " and ".join(filter(None, ("; ".join(same[:-1]), same[-1])))
        measured = f"within the error of measurement (±{100 * self.cost_noise:.0f} %)"
        return [f"{names} cost{'s' * (len(same) == 1)} the same {measured}, with a larger error."]

    def _beside(self, best: Row) -> list[str]:
        """The gain and the cost of float32, if it was tried."""
        row = next((row for row in self.ranked if row.dtype == "float32"), None)
        if row is None or row.float64_error is None or row.float64_ns_per_step is None:
            return []
        ratio = f"a step takes {row.float64_ns_per_step / row.ns_per_step:.2g} times as long"
        if row is best:
            return [f"In float64 these steps have an error of {row.float64_error:.2g}, and {ratio}."]
        error = f"error {row.error:.2g}, {row.float64_error:.2g} in float64, where {ratio}"
        return [f"Of float32 the best is {row.method.name}, dt = {row.dt:.4g}: {error}."]

    def _cut(self) -> list[str]:
        if not self.cut:
            return []
        return [f"Errors are judged up to t = {self.scene.horizon:.4g} only: beyond, the true motion is not known well enough."]

    def _uneven(self, row: Row) -> str:
        unit = "steps a frame" if self.frame is not None else "steps"
        if row.robust is None:
            where = "nowhere near"
        else:
            where = f"from {row.robust:g} {unit} on" if row.tolerance is None else f"from a tolerance of {row.robust:g} down"
        return f"Errors are not even here: {where} all that were tried are good enough too."

    def _what_would_have_to_give(self, per: str) -> list[str]:
        gap, unit = self.shortfall, "steps a frame" if self.frame is not None else "steps"
        if gap is None:
            return ["Nothing was tried."]
        lines = ["Nothing fits."]
        if gap.method is not None:
            within = "within the budget" if self.budget is not None else "found"
            steps = f"{gap.substeps} {unit}" if gap.tolerance is None else f"a tolerance of {gap.tolerance:g}"
            single = " in float32" if gap.dtype == "float32" else ""
            lines.append(f"The least error {within} is {gap.least_error:.2g}, by {gap.method}{single} with {steps}.")
        elif self.budget is not None:
            lines.append(f"The budget of {self.budget:.3g} s {per} does not suffice for one step of any method.")
        if gap.needed_budget is not None:
            lines.append(f"The tolerance needs a budget of {gap.needed_budget:.3g} s {per}, by {gap.needed_method}.")
        else:
            lines.append("Nothing that was tried meets the tolerance: allow a larger error, or a shorter horizon.")
        return lines

    def table(self) -> list[tuple[str, ...]]:
        """The ranked rows as text, in ``COLUMNS``."""
        rows: list[tuple[str, ...]] = []
        for row in self.ranked:
            framed = row.seconds_per_frame is not None and row.evaluations_per_frame is not None
            steps = f"{row.steps / self._frames:.3g}" if framed and row.substeps is None else str(row.substeps or row.steps)
            rows.append(
                (
                    row.name if row.tolerance is None else f"{row.method.name} to {row.tolerance:g}",
                    steps + ("" if row.is_robust else "*"),
                    ("" if row.tolerance is None else "~") + f"{row.dt:.4g}",
                    f"{row.error:.2g}",
                    "–" if row.predicted is None else f"{row.predicted:.2g}",
                    f"{row.evaluations_per_frame if framed else row.evaluations_per_time:.4g}",
                    f"{1e9 * ((row.seconds_per_frame or 0.0) if framed else row.seconds_per_time):.2g}",
                    "–" if row.objects is None else about(row.objects).removeprefix("about "),
                    _blows(row),
                )
            )
        return rows

    @property
    def _frames(self) -> int:
        return grid_of(self.scene.horizon, self.frame).spans

    def rejections(self, most: int | None = None) -> list[str]:
        """Why other methods are rejected, a line for each reason; for each kind at most ``most``, then names only."""
        lines = []
        for kind in dict.fromkeys(each.kind for each in self.rejected):
            reasons: dict[str, list[str]] = {}
            for each in self.rejected:
                if each.kind == kind:
                    reasons.setdefault(each.reason, []).append(each.name)
            groups = ["; ".join(names) for names in reasons.values()]
            lines += [f"{names}: {reason}" for names, reason in zip(groups[:most], reasons, strict=False)]
            if most is not None and len(groups) > most:
                lines.append(f"{LIKEWISE.get(kind, kind)}: {'; '.join(groups[most:])}")
        return lines

    def plot(self, path: str | Path | None = None) -> Figure:
        """Draw cost and error of each ranked method, with the allowed error.

        Args:
            path: the file to write, or None; its ending is that of the format.

        Returns:
            The figure; a notebook shows it.

        Raises:
            ArgumentError: if no method is good enough, or there is no such format.

        Example:
            >>> import stepwell as sw
            >>> advice = sw.advise("oscillator", tolerance=1e-3, methods=["rk4", "leapfrog"], cost="evaluations")
            >>> figure = advice.plot()
        """
        return drawn(path, lambda: registry.task("draw_advice")(self))

    @property
    def title(self) -> str:
        """The scene and the arguments of the advice, in a line."""
        frame = "any step" if self.frame is None else f"frame {self.frame:.4g}"
        per = "a unit of time" if self.frame is None else "a frame"
        request = f"error of {self.tolerance:g} or less up to t = {self.scene.horizon:.4g}, {frame}"
        return f"{self.scene.title}: {request}; costs are for {per}"

    def __str__(self) -> str:
        lines = [self.title, *self.summary()]
        if self.ranked:
            head = [name.removesuffix(">") for name in COLUMNS]
            rows = [head, *map(list, self.table()[:LINES])]
            widths = [max(len(row[i]) for row in rows) for i in range(len(head))]
            lines += ["", *("  ".join(_aligned(cell, i, widths) for i, cell in enumerate(row)).rstrip() for row in rows)]
            if len(self.ranked) > LINES:
                lines.append(f"and {len(self.ranked) - LINES} more")
        if self.rejected:
            lines += ["", *self.rejections(REASONS)]
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        return table(self.title, COLUMNS, self.table(), [*self.summary(), *self.rejections(REASONS)])

    def __repr__(self) -> str:
        best = self.best
        if best is None:
            return f"<advice for {self.scene.name}: nothing fits>"
        steps = f"dt = {best.dt:g}" if best.tolerance is None else f"tolerance {best.tolerance:g}"
        single = ", float32" if best.dtype == "float32" else ""
        return f"<advice for {self.scene.name}: {best.method.name}{single}, {steps}, error {best.error:.2g}>"


def about(number: int) -> str:
    """A number from a measured time, to its significant digits: ``"about 7·10⁷"``; a small number is exact."""
    if number < 100:
        return str(number)
    digits = f"{number:.0e}" if number >= 10_000 else f"{float(f'{number:.1g}'):.0f}"
    mantissa, _, exponent = digits.partition("e")
    if not exponent:
        return f"about {mantissa}"
    power = str(int(exponent)).translate(str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹"))
    return f"about {mantissa}·10{power}"


def _aligned(cell: str, i: int, widths: list[int]) -> str:
    return cell.rjust(widths[i]) if COLUMNS[i].endswith(">") else cell.ljust(widths[i])


def _blows(row: Row) -> str:
    """Where a row blows up, in a few letters."""
    if row.tolerance is not None:
        return "–"
    if row.limit_by == "linear" and row.limit is not None:
        return "grows always" if row.limit == 0.0 else ("never" if math.isinf(row.limit) else f"{row.limit:.4g}")
    return "not seen" if math.isinf(row.observed_limit) else f"~{row.observed_limit:.3g}"


def _margin(row: Row) -> str:
    """How far a row is from blowing up, in a sentence."""
    if row.tolerance is not None:
        return "There is no step at which it blows up: what is too long is rejected."
    seen = "" if math.isinf(row.observed_limit) else f" Runs up to the horizon are stable to dt = {row.observed_limit:.3g}."
    turns = "" if not row.mode_frequency else f" of {row.mode_frequency:.4g} rad per unit of time"
    if row.limit_by == "linear" and row.limit is not None:
        if math.isinf(row.limit):
            return "Nothing grows with any step."
        if row.limit == 0.0:
            return f"It is never stable: {row.mode}{turns} grows slowly with every step, so not beyond this horizon.{seen}"
        return f"It blows up beyond dt = {row.limit:.5g}, a step {row.margin:.3g} times as long: {row.mode}{turns}."
    sentence = f"It blows up beyond about dt = {row.observed_limit:.3g}, a step {row.margin:.3g} times as long."
    if math.isinf(row.observed_limit):
        sentence = "No step that was tried blows up."
    if row.limit and row.mode_frequency and not math.isinf(row.limit):
        sentence += f" The fastest oscillation along the motion,{turns[3:]}, could be held up to dt = {row.limit:.3g}."
    return sentence
