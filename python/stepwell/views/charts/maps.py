"""Stability maps: the largest eigenvalue of a method on the damped oscillator (§3) over the step and the damping."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...analysis.stability import analyse
from ...base import checks, registry
from ...base.arrays import Array
from ...base.immutable import ValueEquality
from ...base.pictures import drawn
from ...base.tables import Table
from ...errors import ArgumentError, ShapeError
from ...model.compatibility import fits_together, one_state
from ...model.methods import Method
from ...model.methods import of_operations as find_method
from ...model.systems import Oscillator
from ...runs.execution import step
from ...runs.options import Options
from ...runs.request import Request
from .zplane import within

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Points of a map over each of its axes, by default.
SIZE = 512

#: A map ends where the last of its rows has left the stable range, and this factor beyond; of how many points that is found.
BEYOND, COARSE = 1.25, (200, 33)

#: The end of a map on which nothing is stable, and of the search for the end of the others, in radians.
NOWHERE, FARTHEST = 4.0, 12.0

#: Rounding of a step, in parts of the state.
ROUNDING = 1000.0 * 2.0**-53

#: Rows of the map in the summary, evenly spread from the least damping to the most.
SUMMARY_ROWS = 5

Truths = np.ndarray[Any, np.dtype[np.bool_]]


@dataclass(frozen=True, eq=False)
class StabilityMap(Table, ValueEquality):
    """The radius r₁ of one method over angle per step and damping ratio: a row for each point.

    Attributes:
        method: the method.
        phi: Φ = ω₀·dt in radians, shape (columns,).
        damping: damping ratios D, dimensionless, shape (rows,); 0 alone for the undamped oscillator.
        radius: r₁, the largest magnitude of an eigenvalue, shape (rows, columns).
        stable: whether the samples stay bounded, by the eigenvalues, of the same shape.
        nonnormal: the distance of the transition matrix from z₁ times the identity: the Frobenius norm of P − z₁I, of the same
            shape. A stable oscillator may grow about so much before it decays.
        imaginary: the imaginary part of z₁, of the same shape; 0 where both eigenvalues are real.
        damped: whether the oscillator has a damping term, which some methods do not support.
    """

    method: Method
    phi: Array
    damping: Array
    radius: Array
    stable: Truths
    nonnormal: Array
    imaginary: Array
    damped: bool

    @property
    def system(self) -> Oscillator:
        """The oscillators of all points, with steps of one unit of time, of shape (rows, columns)."""
        omega = np.broadcast_to(self.phi, self.radius.shape)
        return Oscillator(omega, self.damping[:, np.newaxis] if self.damped else None)

    def observe(self, steps: int = 4000) -> Observation:
        """Run every point by the batch engine, and compare the motion with the prediction of the eigenvalues.

        Each point starts from the two unit vectors of its slots, of which every start is a linear combination, and after N steps
        the larger of the two states is compared with a threshold that no stable point can reach:
        for two eigenvalues Pᴺ = z₁ᴺ·I + (z₁ᴺ − z₂ᴺ)/(z₁ − z₂)·(P − z₁I), where the fraction is a sum of N products of N − 1
        eigenvalues and so at most N·r₁ᴺ⁻¹, also where both are equal. With r₁ ≤ 1 no state is longer than 1 + N·K, where K is
        the largest norm of P − z₁I of the stable points; the threshold is T = 2·(1 + N·K), and the 2 is for
        rounding.

        What grows passes T if it has the time. Of a left eigenvector w of z₁ with length 1, wᵀx is multiplied by z₁
        in every step, and of two unit vectors one has a share |wᵀx| of 1/√2 or more. So the state is longer than
        r₁ᴺ/√2, which is above T for r₁ ≥ 1 + b with b = (√2·T)^(1/N) − 1.

        Of a pair, growth much slower than that is seen by the area between the two states: it is multiplied by q = r₁² in
        every step, up to rounding, so what has more area after N steps than before grows. With ‖Pᵏ‖ ≤ r₁ᵏ·κ, κ = 1 + K/|Im z₁|,
        K the norm of P − z₁I of that point, and a step whose rounding is below ρ times the state, the area's share of rounding in
        a step is below δ = 2ρκ²‖P⁻¹‖ with ‖P⁻¹‖ ≤ (r₁ + K)/q. So a pair with q ≤ 1 ends with an area below (1 + δ)ᴺ, and one with
        q ≥ 1 + 3δ above it, however few the steps. ρ is 1000·2⁻⁵³: a step of the methods at hand has fewer than a hundred
        roundings, of numbers no larger than ten times the state.

        Nothing can be said for points that are nearer to 1 than b, or of pairs nearer than 3δ in q, and for double eigenvalues on
        the unit circle, from which samples grow linearly: after N steps they are no longer than those of a stable point with a
        large transient. Every other point is decided, on the circle too.

        Args:
            steps: N, how many steps are made.

        Raises:
            ArgumentError: if there are no steps.
        """
        steps = checks.count("steps", steps, 1)
        norms = self.nonnormal[self.stable]
        threshold = 2.0 * (1.0 + steps * float(norms.max(initial=0.0)))
        band = math.expm1(math.log(math.sqrt(2.0) * threshold) / steps)
        unit = np.eye(2).reshape(2, 2, 1, 1)
        request = Request.fixed(self.system, self.method, Options(v=unit[0], y=unit[1], dt=1.0, steps=steps))
        run = step(request._replace(carried=self.method.carry is not None))
        slot = run.v[-1] if run.carry is None else run.carry
        with np.errstate(all="ignore"):
            kappa = 1.0 + self.nonnormal / self.imaginary  # infinite for two real ones, whose area says nothing
            rounding = 2.0 * ROUNDING * kappa**2 * (self.radius + self.nonnormal) / self.radius**2
            area = slot[0] * run.y[-1][1] - slot[1] * run.y[-1][0]
            larger = np.abs(area) > np.exp(np.where(np.isfinite(rounding), steps * rounding, np.inf))
            # What is not finite is no number below the threshold.
            bounded = (np.hypot(slot, run.y[-1]) <= threshold).all(axis=0) & ~larger
            decided = self.stable | (self.radius >= 1.0 + band) | (self.radius**2 >= 1.0 + 3.0 * rounding)
        return Observation(self, steps, threshold, band, rounding, bounded, self.stable, decided)

    def plot(self, path: str | Path | None = None) -> Figure:
        """Draw it, and write it to ``path`` if given; the ending says in which format.

        Raises:
            ArgumentError: if it is too small for an area.
        """
        if min(self.radius.shape) < 2:
            raise ArgumentError(f"plot: expected a map of 2 × 2 points or more, got one of shape {self.radius.shape}")
        return drawn(path, lambda: registry.task("draw_map")(self))

    def summary(self) -> list[dict[str, Any]]:
        """Five rows, from the least damping to the most: the largest Φ up to which all points are stable, 0 for none."""
        rows = []
        for i in sorted({round(k) for k in np.linspace(0, len(self.damping) - 1, SUMMARY_ROWS).tolist()}):
            reached = np.flatnonzero(~self.stable[i])
            last = int(reached[0]) if reached.size else len(self.phi)
            rows.append(
                {
                    "method": self.method.name,
                    "damping": float(self.damping[i]),
                    "stable_up_to": float(self.phi[last - 1]) if last else 0.0,
                    "share_stable": float(self.stable[i].mean()),
                }
            )
        return rows

    def as_dict(self) -> dict[str, Any]:
        """The method, the axes and the summary. The points are in the CSV."""
        axes = {
            name: {"first": float(values[0]), "last": float(values[-1]), "points": len(values)}
            for name, values in (("phi", self.phi), ("damping", self.damping))
        }
        return {"method": self.method.name, "damped": self.damped} | axes | {"summary": self.summary()}

    def _columns(self) -> dict[str, list[Any]]:
        phi, damping = np.meshgrid(self.phi, self.damping)
        columns = {"phi": phi, "damping": damping, "radius": self.radius, "stable": self.stable}
        return {name: values.ravel().tolist() for name, values in columns.items()}


@dataclass(frozen=True, eq=False)
class Observation(ValueEquality):
    """The behaviour of a map's points when they are stepped, beside what their eigenvalues say.

    Attributes:
        map: of which.
        steps: how many steps were made.
        threshold: a state that is no longer than this counts as bounded; the starts have length 1.
        band: growing points with r₁ below 1 + band have not the time to pass the threshold.
        rounding: by this share the area between two states may change in a step for rounding alone, shape (rows, columns);
            infinite where both eigenvalues are real. A pair whose r₁² is above 1 by three times that is seen to grow by it.
        bounded: whether it stayed bounded, shape (rows, columns).
        predicted: whether it is stable by its eigenvalues, of the same shape.
        decided: where both must agree, of the same shape: where it is stable, or grows by at least one of these bands.
    """

    map: StabilityMap
    steps: int
    threshold: float
    band: float
    rounding: Array
    bounded: Truths
    predicted: Truths
    decided: Truths

    @property
    def disagreements(self) -> int:
        """How many of the decided points did not do what their eigenvalues say."""
        return int(np.count_nonzero((self.bounded != self.predicted) & self.decided))

    def __repr__(self) -> str:
        return (
            f"<observation of {self.map.method.name} over {self.steps} steps: {self.disagreements} disagreements in "
            f"{np.count_nonzero(self.decided)} decided of {self.decided.size} points>"
        )


def stability_map(
    method: Method | str,
    *,
    phi: tuple[float, float] | None = None,
    damping: tuple[float, float] | None = (0.0, 2.0),
    size: int | tuple[int, int] = SIZE,
) -> StabilityMap:
    """Map the largest eigenvalue of a method on the damped oscillator over angle per step and damping ratio (§3, §4).

    Args:
        method: its name, or what ``stepwell.method`` returns.
        phi: the range (lower, upper) of Φ = ω₀·dt in radians, within 0 … 100; the first point is one spacing above the lower end.
            If None, from 0 to a quarter past the largest angle to which any of the damping ratios is stable.
        damping: the range (lower, upper) of the damping ratio D, dimensionless, both ends included; None for the undamped
            oscillator over Φ alone, which every method can step.
        size: number of points over each axis, or a pair: over Φ, over D.

    Raises:
        UnsupportedError: if the method cannot step a damped oscillator.

    Example:
        >>> chart = sw.charts.stability_map("rk4", size=16)
        >>> chart.method.name
        'rk4'
    """
    chosen = find_method(method)
    low, high = (0.0, NOWHERE) if phi is None else _ends("phi", phi, "rad")
    if low < 0.0:
        raise ArgumentError(f"phi: expected angles of 0 rad or more, got {low:g}")
    within("phi", high)
    pair = size if isinstance(size, tuple) else (size, size)
    if len(pair) != 2:
        raise ShapeError(f"size: expected a number of points or a pair, over Φ and over D, got {size!r}")
    columns, rows = (checks.count("size", n, 1) for n in pair)
    least, most = (0.0, 0.0) if damping is None else _ends("damping", damping, "")
    rows = 1 if damping is None else rows
    # One oscillator is refused in fewer words than all.
    fits_together(Oscillator(damping=None if damping is None else most), chosen)
    one_state("method", chosen)
    checks.fits("size: the matrices", 48, (rows, columns), "ask for fewer points")

    if phi is None:
        high = _fitted(chosen, None if damping is None else (least, most))
    angles = low + (high - low) * np.arange(1, columns + 1) / columns
    ratios = np.linspace(least, most, rows)
    analysis = analyse(Oscillator(angles, None if damping is None else ratios[:, np.newaxis]), chosen, dt=1.0)
    P, z = analysis.P, analysis.eigenvalues[0]
    squares = np.abs(P[0, 0] - z) ** 2 + np.abs(P[1, 1] - z) ** 2 + P[0, 1] ** 2 + P[1, 0] ** 2
    shape = (rows, columns)
    return StabilityMap(
        method=chosen,
        phi=angles,
        damping=ratios,
        radius=analysis.radius.reshape(shape),
        stable=analysis.stable.reshape(shape),
        nonnormal=np.sqrt(squares).reshape(shape),
        imaginary=np.abs(z.imag).reshape(shape),
        damped=damping is not None,
    )


def _fitted(method: Method, damping: tuple[float, float] | None) -> float:
    """The end of the map's axis: a little past the largest angle up to which a row is stable from its start."""
    if damping is None and not method.limit:  # though small angles may grow by less than a rounding
        return NOWHERE
    columns, rows = COARSE
    angles = np.arange(1, columns + 1) * (FARTHEST / columns)
    ratios = None if damping is None else np.linspace(*damping, rows)[:, np.newaxis]
    stable = np.atleast_2d(analyse(Oscillator(angles, ratios), method, dt=1.0).stable)
    reached = np.where(stable.all(axis=1), columns, np.argmin(stable, axis=1)).max()
    # Rounded up, so that the axis ends at a round number.
    return math.ceil(20.0 * BEYOND * angles[reached - 1]) / 20.0 if reached else NOWHERE


def _ends(argument: str, value: Any, unit: str) -> tuple[float, float]:
    ends = checks.numbers(argument, value, unit=unit)
    if ends.shape != (2,):
        raise ShapeError(f"{argument}: expected two numbers, from where to where, got an array of shape {ends.shape}")
    low, high = ends.tolist()
    if low >= high:
        raise ArgumentError(f"{argument}: expected the lower end first, got {low:g} and {high:g}")
    return low, high
