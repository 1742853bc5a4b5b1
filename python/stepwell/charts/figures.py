"""The document's figures (§5 to §11): the samples of each method on the undamped oscillator beside the exact cosine."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .. import _checks
from .._checks import Array
from .._value import Value
from ..errors import ArgumentError
from ..integrate import integrate
from ..methods import Method, _section, choice
from ..methods import method as find_method
from ..stability import StabilityLimit, analyse, stability_limit
from ..systems import Oscillator
from .files import write_csv, write_json
from .zplane import within

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: More steps than this are a mistake, and no picture.
MAX_STEPS = 100_000


@dataclass(frozen=True, eq=False)
class Samples(Value):
    """The samples of one method from v₀ = 0 and y₀ = 1; arrays are of shape (steps + 1,).

    Attributes:
        method: the method.
        t: times in units of 1/ω₀: k·Φ.
        v: velocities, divided by ω₀.
        y: coordinates.
        r1_squared: r₁², what the square of the amplitude is multiplied by in a step.
        ratio: Ψ/Φ, the frequency of the samples divided by the true one.
        kind: what the samples do, in the document's words.
        limit: below this Φ the method is stable; 0 for never.
    """

    method: Method
    t: Array
    v: Array
    y: Array
    r1_squared: float
    ratio: float
    kind: str
    limit: StabilityLimit

    @property
    def file(self) -> str:
        """The name of its picture: the section's number, or 99 for none, and the method's name."""
        return f"{_section(self.method):02d}-{self.method.name}.png"


@dataclass(frozen=True, eq=False)
class Figures(Value):
    """The samples of several methods with the same step.

    Attributes:
        phi: Φ = ω₀·dt, the true angle per step, in radians.
        periods: how many periods of the exact solution are covered, at least.
        samples: one for each method.
    """

    phi: float
    periods: float
    samples: tuple[Samples, ...]

    def plot(self, path: str | Path | None = None, method: Method | str | None = None) -> Figure:
        """Draw them all, or one, and write the picture to ``path`` if given; the ending says in which format.

        Args:
            path: the file.
            method: a method's name for its own figure; None for all in one.

        Raises:
            ArgumentError: if that method is not here.
            UnsupportedError: if matplotlib is missing.
        """
        from .figures_picture import one, overview
        from .style import drawn

        if method is None:
            return drawn(path, lambda: overview(self))
        how = find_method(method)
        found = [samples for samples in self.samples if samples.method is how]
        if not found:
            names = ", ".join(samples.method.name for samples in self.samples)
            raise ArgumentError(f"method: expected one of these figures, {names}, got {how.name!r}")
        return drawn(path, lambda: one(self, found[0]))

    def save(self, folder: str | Path) -> list[Path]:
        """Write ``overview.png`` and a picture for each method, named by section and method, and return the paths.

        Args:
            folder: where to; it is made if it is not there.

        Raises:
            ArgumentError: if nothing can be written there.
            UnsupportedError: if matplotlib is missing.
        """
        from .style import new_figure

        names = ["overview.png", *(samples.file for samples in self.samples)]
        place = _checks.folder("folder", folder, names)
        new_figure(1.0, 1.0)  # before the folder is made: it may be that nothing can be drawn
        place.mkdir(parents=True, exist_ok=True)
        paths = [place / name for name in names]
        for path, method in zip(paths, [None, *(samples.method for samples in self.samples)], strict=True):
            self.plot(path, method=method)
        return paths

    def rows(self) -> list[dict[str, Any]]:
        """A row for each sample of each method, with the exact solution beside it."""
        columns = self._columns()
        return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]

    def summary(self) -> list[dict[str, Any]]:
        """A row for each method: what its samples do."""
        return [
            {
                "method": samples.method.name,
                "title": samples.method.title,
                "section": samples.method.section,
                "r1_squared": samples.r1_squared,
                "ratio": samples.ratio,
                "kind": samples.kind,
                "limit": float(samples.limit),
                "largest_y": float(np.abs(samples.y).max()),
                "last_y": float(samples.y[-1]),
            }
            for samples in self.samples
        ]

    def to_csv(self, path: str | Path) -> None:
        """Write ``rows()``, one line each; every number reads back as itself."""
        write_csv(self._columns(), path)

    def to_json(self, path: str | Path) -> None:
        """Write Φ, periods, summary and rows; what is not finite is null."""
        write_json({"phi": self.phi, "periods": self.periods, "summary": self.summary(), "rows": self.rows()}, path)

    def _columns(self) -> dict[str, list[Any]]:
        columns: dict[str, list[Any]] = {name: [] for name in ("method", "t", "v", "y", "exact")}
        for samples in self.samples:
            columns["method"] += [samples.method.name] * len(samples.t)
            for name, values in (("t", samples.t), ("v", samples.v), ("y", samples.y), ("exact", np.cos(samples.t))):
                columns[name] += values.tolist()
        return columns


def figures(methods: Iterable[Method | str] | None = None, *, phi: float = 0.5, periods: float = 4) -> Figures:
    """Run the undamped oscillator from v₀ = 0 and y₀ = 1 by each method, as the document's figures do (§5 to §11).

    Args:
        methods: names, or what ``stepwell.method`` returns; all if None.
        phi: Φ = ω₀·dt, the true angle per step, in radians, above zero and at most 100.
        periods: how many periods of the exact solution to cover, above zero; the last step goes to its end or past it.

    Returns:
        A ``Figures``.

    Raises:
        ArgumentError: what was given and what was expected.

    Warns:
        DivergenceWarning: if samples leave the finite numbers.
    """
    chosen = choice(methods)
    phi = within("phi", _checks.number("phi", phi, positive=True, unit="rad"))
    periods = _checks.number("periods", periods, positive=True)
    if (steps := 2.0 * math.pi * periods / phi) > MAX_STEPS:
        raise ArgumentError(f"periods: {periods:g} periods with Φ = {phi:g} are {steps:.3g} steps, expected {MAX_STEPS} or fewer")
    return Figures(phi, periods, tuple(_samples(method, phi, math.ceil(steps)) for method in chosen))


def _samples(method: Method, phi: float, steps: int) -> Samples:
    run = integrate(Oscillator(), method, v=0.0, y=1.0, dt=phi, steps=steps, every=1)
    found = analyse(Oscillator(), method, dt=phi)
    return Samples(
        method=method,
        t=run.t,
        v=run.v,
        y=run.y,
        r1_squared=float(found.radius**2),
        ratio=float(found.frequency_ratio),
        kind=str(found.kind),
        limit=stability_limit(Oscillator(), method),
    )
