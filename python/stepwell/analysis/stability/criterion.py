"""``criteria``: Hoffmann's four questions (§1), answered for every method on its own test, the undamped oscillator.

Is a programmed oscillator stable? How wrong is its frequency? How many calculations does a step take? How large may a step be?
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ...base import checks
from ...base.immutable import by_value
from ...base.reprs import MAX_LINE, shortened, table
from ...base.tables import write_json
from ...errors import ArgumentError
from ...model.methods import Method, choice
from ...model.systems import Oscillator
from .analysis import analyse
from .counted import Operations, operations
from .expansion import Series, series, text
from .limit import StabilityLimit, stability_limit

#: The angles per step at which errors are given: 63, 13 and 6 samples per period.
PHI = (0.1, 0.5, 1.0)

#: A difference below this is written as 0: it is rounding.
ROUNDING = 1e-13


@by_value
class At(NamedTuple):
    """A method at one angle per step.

    Attributes:
        phi: Φ = ω₀·dt.
        r1_squared: r₁², the square of the largest eigenvalue's magnitude: the factor of the energy per step.
        r1_squared_series: r₁² from the first two terms of its series.
        deviation: Ψ/Φ − 1, the relative error of the frequency.
        deviation_series: Ψ/Φ − 1 from the first two terms of its series.
        kind: what the samples do, in Hoffmann's words.
    """

    phi: float
    r1_squared: float
    r1_squared_series: float
    deviation: float
    deviation_series: float
    kind: str


class Criterion(NamedTuple):
    """The answers for one method.

    Attributes:
        method: the method.
        limit: the undamped oscillator is stable for Φ below this; 0 if never.
        samples_per_period: the least steps per period, 2π/limit; infinite if it is never stable.
        series: the exact polynomials and series in Φ.
        at: errors at each of the chosen angles per step.
        operations: the operations of a step of the undamped oscillator.
    """

    method: Method
    limit: StabilityLimit
    samples_per_period: float
    series: Series
    at: tuple[At, ...]
    operations: Operations

    def __repr__(self) -> str:
        limit = f"stable for Φ < {float(self.limit):.7g}" if self.limit else "never stable"
        return f"<criterion of {self.method.name}: {limit}, r₁² − 1 = {self.r1_squared}, Ψ/Φ − 1 = {self.deviation}>"

    @property
    def r1_squared(self) -> str:
        """The series of r₁² − 1, as text."""
        return text(self.series.radius_terms())

    @property
    def deviation(self) -> str:
        """The series of Ψ/Φ − 1, as text."""
        return text(self.series.ratio_terms())


class Criteria(tuple[Criterion, ...]):
    """A ``Criterion`` for each method, and their table as text, Markdown, HTML and JSON."""

    __slots__ = ()

    def __repr__(self) -> str:
        phis = ", ".join(f"{at.phi:g}" for at in self[0].at) if self else ""
        return shortened(f"<criteria of {', '.join(c.method.name for c in self)}; errors at Φ = {phis}>", MAX_LINE)

    def _repr_html_(self) -> str:
        return table("The undamped oscillator by each method, Φ = ω₀·dt", *self.table())

    def rows(self) -> list[dict[str, Any]]:
        """A row for each method; None for values that do not exist."""
        rows = []
        for c in self:
            row: dict[str, Any] = {
                "method": c.method.name,
                "title": c.method.title,
                "order": c.method.order,
                "limit": float(c.limit),
                "samples_per_period": c.samples_per_period if math.isfinite(c.samples_per_period) else None,
                "leaves_by": None if c.limit.mode is None else c.limit.mode.kind,
                "r1_squared_minus_1": c.r1_squared,
                "frequency_deviation": c.deviation,
            }
            rows.append(row | c.operations._asdict() | {"at": [at._asdict() for at in c.at]})
        return rows

    def to_json(self, path: str | Path) -> None:
        """Write ``rows()``; values that are not finite become null."""
        write_json(self.rows(), path)

    def table(self) -> tuple[list[str], list[list[str]]]:
        """Head and rows as text, for a page or a screen. A head that ends in ``>`` is that of a column of numbers."""
        head = ["method", "stable for Φ <>", "steps a period >>", "r₁² − 1", "Ψ/Φ − 1"]
        phis = [at.phi for at in self[0].at] if self else []
        head += [f"{what} at {phi:g}>" for phi in phis for what in ("r₁² − 1", "Ψ/Φ − 1")]
        head += ["+>", "×>", "÷>", "√>", "rates>"]
        rows = []
        for c in self:
            limit = f"{float(c.limit):.7g}" if c.limit else "never"
            row = [c.method.title, limit, f"{c.samples_per_period:.4g}" if c.limit else "–", c.r1_squared, c.deviation]
            for at in c.at:
                row += [signed(at.r1_squared - 1.0), signed(at.deviation, percent=True)]
            o = c.operations
            counts = (o.additions, o.multiplications, o.divisions, o.square_roots, o.rate_evaluations)
            rows.append(row + [str(n) for n in counts])
        return head, rows

    def markdown(self) -> str:
        """A table in Markdown."""
        head, rows = self.table()
        lines = [[h.removesuffix(">") for h in head], ["--:" if h.endswith(">") else "---" for h in head], *rows]
        return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def signed(value: float, *, percent: bool = False, digits: int = 3) -> str:
    """An error as text, with its sign; 0 if it is only rounding."""
    if abs(value) <= ROUNDING:
        return "0"
    return f"{100 * value:+.{digits}g} %" if percent else f"{value:+.{digits}g}"


def criteria(methods: Iterable[Method | str] | None = None, *, phi: Any = PHI) -> Criteria:
    """Answer Hoffmann's four criteria (§1) for methods on the undamped oscillator.

    Args:
        methods: names, or what ``stepwell.method`` returns; all if None.
        phi: angles per step Φ = ω₀·dt, above zero, at which the errors are given.

    Returns:
        A ``Criteria``: a tuple of ``Criterion``.

    Raises:
        ArgumentError: what was given and what was expected.

    Example:
        >>> for answer in sw.criteria(["false_euler", "rk4"]):
        ...     print(answer)
        <criterion of false_euler: stable for Φ < 2, r₁² − 1 = 0, Ψ/Φ − 1 = Φ²/24 + 3Φ⁴/640>
        <criterion of rk4: stable for Φ < 2.828427, r₁² − 1 = −Φ⁶/72 + Φ⁸/576, Ψ/Φ − 1 = −Φ⁴/120 + Φ⁶/336>
    """
    chosen = choice(methods)
    angles = np.atleast_1d(checks.numbers("phi", phi, positive=True, unit="rad"))
    if angles.ndim > 1:
        raise ArgumentError(f"phi: expected a list of angles, got an array of shape {angles.shape}")
    return Criteria(_criterion(method, angles.tolist()) for method in chosen)


def _criterion(method: Method, angles: list[float]) -> Criterion:
    limit = stability_limit(Oscillator(), method)
    expansion = series(method)
    radius, ratio = (_sum(terms) for terms in (expansion.radius_terms(), expansion.ratio_terms()))
    at = []
    for phi in angles:
        step = analyse(Oscillator(), method, dt=phi)
        at.append(At(phi, float(step.radius**2), 1.0 + radius(phi), float(step.frequency_ratio) - 1.0, ratio(phi), step.kind))
    samples = 2.0 * math.pi / limit if limit else math.inf
    return Criterion(method, limit, samples, expansion, tuple(at), operations(method))


def _sum(terms: list[tuple[int, Any]]) -> Any:
    def at(phi: float) -> float:
        with np.errstate(all="ignore"):  # far past every limit a power may be infinite
            return float(sum(float(c) * np.float64(phi) ** k for k, c in terms))

    return at
