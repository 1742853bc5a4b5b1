"""Stability charts: the eigenvalues of every method as the step grows (§4), exactly and by the series of Appendix A."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...analysis.stability import StabilityLimit, analyse, series, stability_limit
from ...analysis.stability.eigen import Complex
from ...analysis.stability.expansion import text
from ...base import checks, registry
from ...base.arrays import Array
from ...base.immutable import ValueEquality
from ...base.pictures import drawn
from ...base.tables import Table, stacked
from ...errors import ArgumentError, ShapeError
from ...model.methods import Method, choice
from ...model.systems import Oscillator

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: The number of angles in each unit of Φ of the default grid, so that it has round values.
RUNGS = 200

#: The largest Φ, in rad: it is far past every limit, and a picture of a wider range would show nothing.
MAX_PHI = 100.0

#: The default grid goes past the largest limit by at least this factor.
LIMIT_MARGIN = 1.1

#: The kinds of pictures.
KINDS = ("loci", "curves")


@dataclass(frozen=True, eq=False)
class Locus(ValueEquality):
    """One method on the undamped oscillator at n angles per step; arrays are of shape (n,) unless said otherwise.

    Attributes:
        method: the method.
        phi: Φ = ω₀·dt, the true angle per step, in radians.
        eigenvalues: z₁ and z₂ of the transition matrix, shape (2, n): the larger first, of a pair the one that turns forwards.
        r1_squared: r₁², the squared magnitude of z₁.
        ratio: Ψ/Φ, the angle per step of z₁ divided by the true one. Where both are real, Ψ is 0 or π.
        kind: the behaviour of the samples, in Hoffmann's words.
        stable: whether they stay bounded.
        r1_squared_series: r₁² by 1 and the first two terms that follow.
        ratio_series: Ψ/Φ likewise.
        limit: below it the method is stable; 0 for never. Its ``mode`` says how z₁ leaves the unit circle.
        radius_terms: powers of Φ in r₁² − 1 with their coefficients.
        ratio_terms: those in Ψ/Φ − 1.
    """

    method: Method
    phi: Array
    eigenvalues: Complex
    r1_squared: Array
    ratio: Array
    kind: Any
    stable: Any
    r1_squared_series: Array
    ratio_series: Array
    limit: StabilityLimit
    radius_terms: tuple[tuple[int, Fraction], ...]
    ratio_terms: tuple[tuple[int, Fraction], ...]

    @property
    def samples_per_period(self) -> float:
        """The least steps per period, 2π/limit; infinite if it is never stable."""
        return 2.0 * math.pi / self.limit if self.limit else math.inf

    @property
    def leaves(self) -> str | None:
        """The behaviour of the samples past the limit, or None without a limit."""
        return None if self.limit.mode is None else self.limit.mode.kind

    @property
    def columns(self) -> dict[str, Any]:
        """Its columns in the table, by name."""
        z1, z2 = self.eigenvalues
        return {
            "method": self.method.name,
            "phi": self.phi,
            "z1_real": z1.real,
            "z1_imag": z1.imag,
            "z2_real": z2.real,
            "z2_imag": z2.imag,
            "r1_squared": self.r1_squared,
            "r1_squared_series": self.r1_squared_series,
            "ratio": self.ratio,
            "ratio_series": self.ratio_series,
            "stable": self.stable,
            "kind": self.kind,
        }


@dataclass(frozen=True, eq=False)
class Stability(Table, ValueEquality):
    """Methods on the undamped oscillator, over the angle per step: a row for each method and each angle.

    Attributes:
        phi: the angles Φ, shape (n,).
        loci: one for each method.
    """

    phi: Array
    loci: tuple[Locus, ...]

    def plot(self, path: str | Path | None = None, kind: str = "loci") -> Figure:
        """Draw it, and write it to ``path`` if given; the ending says in which format.

        Args:
            path: the file.
            kind: ``"loci"``: the eigenvalues in the z-plane; ``"curves"``: r₁² and Ψ/Φ over Φ.

        Raises:
            UnknownNameError: if there is no such kind.
            UnsupportedError: if matplotlib is missing.
        """
        kind = checks.known("kind", kind, KINDS)
        return drawn(path, lambda: registry.task(f"draw_{kind}")(self))

    def summary(self) -> list[dict[str, Any]]:
        """A row for each method: its limit, the steps per period that it needs, how it leaves the circle, its series."""
        return [
            {
                "method": locus.method.name,
                "title": locus.method.title,
                "limit": float(locus.limit),
                "samples_per_period": locus.samples_per_period,
                "leaves_by": locus.leaves,
                "r1_squared_minus_1": text(list(locus.radius_terms)),
                "frequency_deviation": text(list(locus.ratio_terms)),
            }
            for locus in self.loci
        ]

    def _columns(self) -> dict[str, list[Any]]:
        return stacked(locus.columns for locus in self.loci)


def stability(methods: Iterable[Method | str] | None = None, *, phi: Any = None) -> Stability:
    """The eigenvalues of methods on the undamped oscillator over the angle per step, exactly and by series (§4, Appendix A).

    Args:
        methods: names, or what ``stepwell.method`` returns; all if None.
        phi: angles Φ = ω₀·dt in radians, above zero, at most 100 and rising, shape (n,); if None, 200 in each unit of Φ up to
            past the largest limit.

    Raises:
        ArgumentError: what was given and what was expected.

    Example:
        >>> chart = sw.charts.stability(["rk4"])
        >>> round(chart.summary()[0]["limit"], 4)
        2.8284
    """
    chosen = choice(methods)
    angles = None if phi is None else checks.numbers("phi", phi, positive=True, unit="rad")
    if angles is not None and (angles.ndim != 1 or not angles.size):
        raise ShapeError(f"phi: expected a list of angles in rad, got an array of shape {angles.shape}")
    if angles is not None and (np.diff(angles) <= 0.0).any():
        raise ArgumentError("phi: expected angles that rise from one to the next")
    if angles is not None:
        within("phi", float(angles[-1]))
    limits = [stability_limit(Oscillator(), method) for method in chosen]
    if angles is None:
        angles = ladder(largest(limits))
    return Stability(angles, tuple(_locus(method, angles, limit) for method, limit in zip(chosen, limits, strict=True)))


def within(argument: str, phi: float) -> float:
    """An angle per step, checked to be small enough for a picture."""
    if phi > MAX_PHI:
        raise ArgumentError(f"{argument}: expected {MAX_PHI:g} rad a step or less, which is far past every limit, got {phi:g}")
    return phi


def largest(limits: Sequence[float]) -> float:
    """A round angle past all limits, and past 2, up to which every Euler method is interesting."""
    return math.ceil(2.0 * LIMIT_MARGIN * max([2.0, *filter(math.isfinite, limits)])) / 2.0


def ladder(top: float) -> Array:
    """Angles up to ``top``, evenly spread, without 0."""
    n = max(1, round(RUNGS * top))
    return np.asarray(np.arange(1, n + 1) * (top / n))


def _locus(method: Method, phi: Array, limit: StabilityLimit) -> Locus:
    analysis = analyse(Oscillator(), method, dt=phi)
    expansion = series(method)
    radius_terms, ratio_terms = expansion.radius_terms(), expansion.ratio_terms()
    return Locus(
        method=method,
        phi=phi,
        eigenvalues=analysis.eigenvalues,
        r1_squared=analysis.radius**2,
        ratio=analysis.frequency_ratio,
        kind=analysis.kind,
        stable=analysis.stable,
        r1_squared_series=_sum(radius_terms, phi),
        ratio_series=_sum(ratio_terms, phi),
        limit=limit,
        radius_terms=tuple(radius_terms),
        ratio_terms=tuple(ratio_terms),
    )


def _sum(terms: Sequence[tuple[int, Fraction]], phi: Array) -> Array:
    return sum((float(c) * phi**k for k, c in terms), start=np.ones_like(phi))
