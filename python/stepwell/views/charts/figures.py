"""Hoffmann's figures: the harmonic cases of §4, and the samples of each method on the undamped oscillator (§5 to §11)."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...analysis.stability import StabilityLimit, analyse, stability_limit
from ...base import checks, paths, registry
from ...base.arrays import Array
from ...base.immutable import ValueEquality
from ...base.pictures import drawn
from ...base.tables import Table, stacked
from ...errors import ArgumentError
from ...model.methods import Method, _section, choice
from ...model.methods import of_operations as find_method
from ...model.systems import Oscillator
from ...runs.integration import integrate
from .zplane import within

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: The picture of the harmonic cases.
HARMONIC_FILE = "04-harmonic.png"

#: More steps than this are a mistake, and no picture.
MAX_STEPS = 100_000

#: The angles Ψ of a step, in degrees, of which §4 draws the harmonic cases: 12, 4 and 2.4 samples a period.
HARMONIC_CASES = (30, 90, 150)
#: The number of periods of these that are drawn: after two, the samples of 150° a step repeat.
HARMONIC_PERIODS = 2

#: Hoffmann starts Verlet with y₋₁ = y₀ (Appendix B), which is this for v₀ = 0.
DOCUMENTS_START = "first_order"


@dataclass(frozen=True, eq=False)
class Samples(ValueEquality):
    """The samples of one method from v₀ = 0 and y₀ = 1; arrays are of shape (steps + 1,).

    Attributes:
        method: the method.
        start: how it was started, as in Hoffmann (2002) if it has several ways; None if it has one way.
        t: times in units of 1/ω₀: k·Φ.
        v: velocities, divided by ω₀.
        y: coordinates.
        r1_squared: r₁², the factor of the square of the amplitude in a step.
        ratio: Ψ/Φ, the frequency of the samples divided by the true one.
        kind: what the samples do, in Hoffmann's words.
        limit: below this Φ the method is stable; 0 for never.
    """

    method: Method
    start: str | None
    t: Array
    v: Array
    y: Array
    r1_squared: float
    ratio: float
    kind: str
    limit: StabilityLimit

    @property
    def name(self) -> str:
        """The method's name."""
        return self.method.name

    @property
    def exact(self) -> Array:
        """The exact coordinates at the times of the samples."""
        return np.asarray(np.cos(self.t))

    @property
    def file(self) -> str:
        """The name of its picture: the section's number, or 99 for none, and the method's name."""
        return f"{_section(self.method):02d}-{self.method.name}.png"


@dataclass(frozen=True, eq=False)
class HarmonicCase(ValueEquality):
    """Samples by Verlet that turn by the same angle in every step and keep their amplitude (§4); shape (steps + 1,).

    Attributes:
        degrees: the angle Ψ of a step.
        t: times in units of 1/ω₀: k·Φ, with Φ = 2·sin(Ψ/2).
        v: velocities, divided by ω₀.
        y: coordinates, cos kΨ.
    """

    degrees: int
    t: Array
    v: Array
    y: Array

    @property
    def samples_per_period(self) -> float:
        """360°/Ψ."""
        return 360.0 / self.degrees

    @property
    def exact(self) -> Array:
        """The sampled function g at the times of the samples."""
        return np.asarray(np.cos(np.radians(float(self.degrees) * np.arange(len(self.y)))))

    @property
    def name(self) -> str:
        """Its name in the rows, in place of a method's."""
        return f"harmonic, {self.degrees}°"


@dataclass(frozen=True, eq=False)
class Figures(Table, ValueEquality):
    """The samples of several methods with the same step.

    A row for each sample of each method, and of each harmonic case, with the exact solution beside it.

    Attributes:
        phi: Φ = ω₀·dt, the true angle per step, in radians.
        periods: how many periods of the exact solution are covered, at least.
        samples: one for each method.
        harmonic: the harmonic cases of §4; none if methods were chosen.
    """

    phi: float
    periods: float
    samples: tuple[Samples, ...]
    harmonic: tuple[HarmonicCase, ...] = ()

    def plot(self, path: str | Path | None = None, method: Method | str | None = None) -> Figure:
        """Draw them all, or one, and write the picture to ``path`` if given; the ending says in which format.

        Args:
            path: the file.
            method: a method's name for its own figure; None for all in one.

        Raises:
            ArgumentError: if that method is not here.
            UnsupportedError: if matplotlib is missing.
        """
        if method is None:
            return drawn(path, lambda: registry.task("draw_figures")(self))
        chosen = find_method(method)
        shown = [samples for samples in self.samples if samples.method is chosen]
        if not shown:
            names = ", ".join(samples.method.name for samples in self.samples)
            raise ArgumentError(f"method: expected one of these figures, {names}, got {chosen.name!r}")
        return drawn(path, lambda: registry.task("draw_figure")(self, shown[0]))

    def plot_harmonic(self, path: str | Path | None = None) -> Figure:
        """Draw the harmonic cases of §4, and write the picture to ``path`` if given.

        Raises:
            ArgumentError: if they are not here.
            UnsupportedError: if matplotlib is missing.
        """
        if not self.harmonic:
            raise ArgumentError("figures: the harmonic cases of §4 are among all figures only, and methods were chosen")
        return drawn(path, lambda: registry.task("draw_harmonic_figures")(self.harmonic))

    def save(self, folder: str | Path) -> list[Path]:
        """Write ``overview.png``, a picture for each method and the harmonic cases, named by section, and the numbers.

        The numbers are ``figures.csv`` and ``figures.json``. Returns the paths, in that order.

        Args:
            folder: the folder, which is created if it does not exist.

        Raises:
            ArgumentError: if nothing can be written there.
            UnsupportedError: if matplotlib is missing.
        """
        from ...base.pictures import new_figure

        names = ["overview.png", *(samples.file for samples in self.samples)]
        others: dict[str, Any] = {HARMONIC_FILE: self.plot_harmonic} if self.harmonic else {}
        others |= {"figures.csv": self.to_csv, "figures.json": self.to_json}
        place = paths.folder("folder", folder, [*names, *others])
        new_figure(1.0, 1.0)  # raises before the folder is created if nothing can be drawn
        place.mkdir(parents=True, exist_ok=True)
        places = [place / name for name in names]
        for path, method in zip(places, [None, *(samples.method for samples in self.samples)], strict=True):
            self.plot(path, method=method)
        for name, write in others.items():
            write(place / name)
        return places + [place / name for name in others]

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

    def _head(self) -> dict[str, Any]:
        return {"phi": self.phi, "periods": self.periods}

    def _columns(self) -> dict[str, list[Any]]:
        curves: tuple[Samples | HarmonicCase, ...] = (*self.samples, *self.harmonic)
        return stacked({"method": each.name, "t": each.t, "v": each.v, "y": each.y, "exact": each.exact} for each in curves)


def figures(methods: Iterable[Method | str] | None = None, *, phi: float = 0.5, periods: float = 4) -> Figures:
    """Run the undamped oscillator from v₀ = 0 and y₀ = 1 by each method, as Hoffmann's figures do (§5 to §11).

    Verlet starts as Hoffmann has it, with y₋₁ = y₀. Without a choice of methods there are also the harmonic cases of §4.

    Args:
        methods: names, or what ``stepwell.method`` returns; all if None.
        phi: Φ = ω₀·dt, the true angle per step, in radians, above zero and at most 100.
        periods: how many periods of the exact solution to cover, above zero; the last step goes to its end or past it.

    Raises:
        ArgumentError: what was given and what was expected.

    Warns:
        DivergenceWarning: if samples leave the finite numbers.

    Example:
        >>> chart = sw.charts.figures(["rk4"])
        >>> chart.summary()[0]["kind"]
        'damped oscillation'
    """
    chosen = choice(methods)
    phi = within("phi", checks.number("phi", phi, positive=True, unit="rad"))
    periods = checks.number("periods", periods, positive=True)
    if (steps := 2.0 * math.pi * periods / phi) > MAX_STEPS:
        raise ArgumentError(f"periods: {periods:g} periods with Φ = {phi:g} are {steps:.3g} steps, expected {MAX_STEPS} or fewer")
    harmonic = tuple(map(_harmonic, HARMONIC_CASES)) if methods is None else ()
    return Figures(phi, periods, tuple(_samples(method, phi, math.ceil(steps)) for method in chosen), harmonic)


def _harmonic(degrees: int) -> HarmonicCase:
    """Verlet turns by Ψ with sin(Ψ/2) = Φ/2, and started in its second order its samples are cos kΨ."""
    phi = 2.0 * math.sin(math.radians(degrees) / 2.0)
    steps = math.ceil(HARMONIC_PERIODS * 360 / degrees)
    run = integrate(Oscillator(), "verlet", v=0.0, y=1.0, dt=phi, steps=steps, every=1)
    return HarmonicCase(degrees, run.t, run.v, run.y)


def _samples(method: Method, phi: float, steps: int) -> Samples:
    start = DOCUMENTS_START if DOCUMENTS_START in method.starts else None
    run = integrate(Oscillator(), method, v=0.0, y=1.0, dt=phi, steps=steps, every=1, start=start)
    analysis = analyse(Oscillator(), method, dt=phi)
    return Samples(
        method=method,
        start=start,
        t=run.t,
        v=run.v,
        y=run.y,
        r1_squared=float(analysis.radius**2),
        ratio=float(analysis.frequency_ratio),
        kind=str(analysis.kind),
        limit=stability_limit(Oscillator(), method),
    )
