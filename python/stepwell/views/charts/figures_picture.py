"""The pictures of Hoffmann's figures: samples joined by straight lines, and the exact cosine."""

from __future__ import annotations

import math

import numpy as np

from ...analysis.stability.criterion import signed
from ...base.arrays import Array
from ...model.methods import stable_for
from .figures import HARMONIC_PERIODS, Figures, HarmonicCase, Samples
from .labels import at_ends, title
from .runs_finding import percent
from .style import FAMILIES, GREY, Axes, Figure, family, look, named, page

#: Samples are shown up to here; what grows more leaves the picture.
Y_LIMIT = 2.2

#: Panels of the overview side by side.
COLUMNS = 2

#: Samples within this of the exact solution cannot be told from it: half the width of its line.
SEEN = 0.05

#: The panel of errors is so much wider than the lines, for their names, which are so far apart, as a share of a panel's height.
NAMES, ROOM = 1.6, 0.105

#: Of methods that differ by less in r₁² and in Ψ/Φ the eigenvalues are the same but for rounding.
ALIKE = 1e-9

#: A frequency that is wrong by less is right.
ON_TIME = 1e-9

MARKS = (
    "Grey: exact, cos ω₀t. Dots: samples, joined by straight lines.",
    "r₁² − 1: by what share the energy changes in a step, on average. Ψ/Φ − 1: by what share the samples turn too fast.",
)


#: Letters of a title; the names of more methods together are written smaller.
LETTERS = 50


def overview(chart: Figures) -> Figure:
    """All methods on one figure: those of the same eigenvalues share a panel, and so do the errors of those that look exact."""
    apart, exact = groups(chart)
    count = len(apart) + bool(exact)
    across = min(COLUMNS, count)
    down = -(-count // across)
    width, height = 12.5, 2.3 * (down - 1 + _taller(exact)) + 2.3
    with page(width, height) as figure:
        places = {"left": 0.06, "right": 0.985, "bottom": 1.15 / height, "top": 1.0 - 1.55 / height, "wspace": 0.13}
        heights = [*[1.0] * (down - 1), _taller(exact)]
        panels = figure.subplots(down, across, squeeze=False, height_ratios=heights, gridspec_kw=places | {"hspace": 0.62})
        for i, axes in enumerate(panels.ravel()):
            if i >= count:
                axes.set_visible(False)
                continue
            if i < len(apart):
                _together(axes, chart, apart[i])
            else:
                _errors(axes, exact)
            if i + across >= count:
                axes.set_xlabel("time in periods of the exact solution")
        title(figure, 0.008, 1.0 - 0.42 / height, finding(chart), 20)
        figure.text(0.008, 1.0 - 0.74 / height, _start(chart), size=13, color=GREY)
        figure.text(0.008, 0.14 / height, MARKS[0], size=12, color=GREY)
    return figure


def _taller(exact: list[Samples]) -> float:
    """By how much the panel of errors is higher than others, so that its names have room."""
    return max(1.0, (len(exact) + 1) * ROOM)


def groups(chart: Figures) -> tuple[list[list[Samples]], list[Samples]]:
    """Methods that visibly differ from the exact solution, grouped by eigenvalues; and those that do not, if two."""
    exact = [samples for samples in chart.samples if _distance(samples).max() <= SEEN]
    exact = exact if len(exact) > 1 else []
    alike: list[list[Samples]] = []
    for samples in chart.samples:
        if any(samples is each for each in exact):
            continue
        for same in alike:
            pair = [(each.r1_squared, each.ratio if math.isfinite(each.ratio) else 0.0) for each in (same[0], samples)]
            if np.allclose(pair[0], pair[1], rtol=ALIKE, atol=ALIKE):
                same.append(samples)
                break
        else:
            alike.append([samples])
    return alike, exact


def finding(chart: Figures) -> str:
    """How many methods grow, die out, keep the amplitude but not the time, and cannot be told from the exact solution."""
    apart, exact = groups(chart)
    others = [samples for same in apart for samples in same]
    grow = sum("unstable" in samples.kind for samples in others)
    decay = sum("unstable" not in samples.kind and samples.r1_squared < 1.0 - ALIKE for samples in others)
    kinds = [
        (grow, "gains energy", "gain energy"),
        (decay, "loses it", "lose it") if grow else (decay, "loses energy", "lose energy"),
        (len(others) - grow - decay, "keeps the amplitude but not the time", "keep the amplitude but not the time"),
        (len(exact), "", "look exact"),
    ]
    parts = [f"{count} {one if count == 1 else several}" for count, one, several in kinds if count]
    return f"Of {len(chart.samples)} methods {', '.join(parts)}" if len(chart.samples) > 1 else in_words(chart.samples[0])


def _distance(samples: Samples) -> Array:
    """|y − cos ω₀t| of each sample; infinite where y is not finite."""
    with np.errstate(invalid="ignore"):
        return np.asarray(np.nan_to_num(np.abs(samples.y - np.cos(samples.t)), nan=np.inf))


def _together(axes: Axes, chart: Figures, same: list[Samples]) -> None:
    """The samples of methods with the same eigenvalues."""
    for samples in same:
        _samples(axes, chart, samples, FAMILIES[family(samples.method)], name=len(same) > 1)
    if len(same) > 1:
        _largest(axes, np.concatenate([samples.y for samples in same]))
    names = named(same[0].method) if len(same) == 1 else ", ".join(samples.method.title for samples in same)
    _head(axes, names, in_words(same[0]))
    axes.set_ylabel("y")


def _head(axes: Axes, name: str, words: str) -> None:
    """The title of a panel, and below it what it shows."""
    axes.set_title(name, loc="left", size=13 if len(name) <= LETTERS else 11, weight="bold", pad=23.0)
    axes.text(0.0, 1.03, words, transform=axes.transAxes, size=12, color=GREY)


def _errors(axes: Axes, exact: list[Samples]) -> None:
    """The errors of methods that look exact."""
    end = float(exact[0].t[-1]) / (2.0 * math.pi)
    ends = []
    for samples in exact:
        turns, error = samples.t / (2.0 * math.pi), np.maximum.accumulate(_distance(samples))
        shown = error > 0.0
        colour = FAMILIES[family(samples.method)]
        axes.plot(turns[shown], error[shown], color=colour, linewidth=1.8)
        if shown.any():
            ends.append((end, float(error[-1]), samples.method.title, colour))
    axes.set(yscale="log", xlim=(0.0, NAMES * end))
    axes.minorticks_off()
    axes.locator_params(axis="y", numticks=6)
    at_ends(axes, ends, 11.0, ROOM / _taller(exact))
    _head(axes, f"{len(exact)} methods that look exact", "the largest |y − cos ω₀t| so far")
    axes.grid(which="major", color="#dddddd", linewidth=0.8)


def one(chart: Figures, samples: Samples) -> Figure:
    """One method on a figure of its own."""
    looks_exact = bool(_distance(samples).max() <= SEEN)
    with page(11.0, 5.6) as figure:
        low = 0.5 if looks_exact else 0.245
        axes = figure.add_axes((0.1, low, 0.885, 0.78 - low))
        colour = FAMILIES[family(samples.method)]
        _samples(axes, chart, samples, colour)
        axes.set(ylabel="y")
        below = _difference(figure, axes, samples, colour) if looks_exact else axes
        below.set(xlabel="time in periods of the exact solution")
        method = samples.method
        title(figure, 0.012, 0.925, f"{named(method)}: {in_words(samples)}", 18)
        figure.text(0.012, 0.865, _start(chart, samples), size=12.5, color=GREY)
        limit = f"Stable for {stable_for(samples.limit)}." if samples.limit else "Never stable."
        figure.text(0.012, 0.805, f"{_words(samples)}. {limit}", size=12.5)
        figure.text(0.012, 0.03, "\n".join(MARKS), size=12, color=GREY, linespacing=1.35)
    return figure


def _difference(figure: Figure, above: Axes, samples: Samples, colour: str) -> Axes:
    """A panel of y − cos ω₀t, where the samples cannot be told from the exact solution."""
    axes = figure.add_axes((0.1, 0.245, 0.885, 0.2), sharex=above)
    above.tick_params(labelbottom=False)
    axes.axhline(0.0, color="#cccccc", linewidth=0.8)
    turns = samples.t / (2.0 * math.pi)
    axes.plot(turns, samples.y - np.cos(samples.t), color=colour, linewidth=1.3, marker=".", markersize=4.0)
    axes.set_ylabel("difference", size=12.0)
    axes.ticklabel_format(axis="y", style="sci", scilimits=(-2, 2), useMathText=True)
    axes.locator_params(axis="y", nbins=3)
    axes.grid(which="major", axis="x", color="#dddddd", linewidth=0.8)
    return axes


def harmonic(cases: tuple[HarmonicCase, ...]) -> Figure:
    """The harmonic cases of §4, one below the other."""
    with page(11.0, 8.6) as figure:
        places = {"left": 0.065, "right": 0.985, "bottom": 0.145, "top": 0.845, "hspace": 0.55}
        panels = figure.subplots(len(cases), 1, sharex=True, gridspec_kw=places)
        for axes, case in zip(panels, cases, strict=True):
            turns = np.arange(len(case.y)) * (case.degrees / 360.0)
            x = np.linspace(0.0, turns[-1], 1 + 120 * HARMONIC_PERIODS)
            axes.axhline(0.0, color="#cccccc", linewidth=0.8)
            axes.plot(x, np.cos(2.0 * math.pi * x), color="#8c8c8c", linewidth=2.6, zorder=2)
            axes.plot(turns, case.y, color="black", linewidth=1.1, marker="o", markersize=4.2, zorder=3)
            axes.set(xlim=(-0.02, HARMONIC_PERIODS + 0.15), ylim=(-1.15, 1.15), yticks=(-1, 0, 1), ylabel="g")
            axes.set_title(f"Ψ = {case.degrees}°: {case.samples_per_period:g} samples per period", loc="left", size=13.5)
            axes.grid(which="major", axis="x", color="#dddddd", linewidth=0.8)
            axes.tick_params(labelbottom=True)
        panels[-1].set_xlabel("time in periods of the samples")
        figure.text(0.012, 0.945, "The harmonic cases of §4", size=18, weight="bold")
        text = "Samples of Verlet with Φ = 2·sin(Ψ/2), started in second order: cos kΨ, of the same amplitude for ever."
        figure.text(0.012, 0.905, text, size=12.5, color=GREY)
        figure.text(0.012, 0.02, "Grey: g(t) = cos Ω₀t. Black: samples, joined by straight lines.", size=12, color=GREY)
    return figure


def _samples(axes: Axes, chart: Figures, samples: Samples, colour: str = "black", *, name: bool = False) -> None:
    turn = 2.0 * math.pi
    t = np.linspace(0.0, float(samples.t[-1]), 1 + 60 * math.ceil(samples.t[-1] / turn))
    axes.axhline(0.0, color="#cccccc", linewidth=0.8)
    axes.plot(t / turn, np.cos(t), color="#c4c4c4", linewidth=4.0, zorder=2)
    # Past the range of a picture's numbers lines are not drawn, but they must not fail either.
    y = np.clip(np.nan_to_num(samples.y, nan=np.nan, posinf=1e9, neginf=-1e9), -1e9, 1e9)
    many = len(y) > 60 * max(1.0, chart.periods)
    marker = "" if many else "o"
    marker = look(samples.method)["marker"] if name and not many else marker
    label = samples.method.title if name else None
    axes.plot(samples.t / turn, y, color=colour, linewidth=1.3, marker=marker, markersize=4.8, zorder=3, label=label)
    end = float(samples.t[-1]) / turn
    axes.set(xlim=(-0.01 * end, 1.01 * end), ylim=(-Y_LIMIT, Y_LIMIT), yticks=(-2, -1, 0, 1, 2))
    if not name:
        _largest(axes, samples.y)
    axes.grid(which="major", axis="x", color="#dddddd", linewidth=0.8)


def _largest(axes: Axes, y: Array) -> None:
    """The largest coordinate of samples that leave the picture."""
    if not np.abs(y).max() <= Y_LIMIT:
        box = {"boxstyle": "round,pad=0.2", "facecolor": "white", "edgecolor": "none"}
        largest = f"|y| up to {np.nanmax(np.abs(y)):.3g}"
        axes.text(0.985, 0.07, largest, transform=axes.transAxes, size=11.5, ha="right", bbox=box, zorder=5)


def in_words(samples: Samples) -> str:
    """The effect of a method on energy and frequency, in words."""
    if not math.isfinite(samples.ratio) or "double eigenvalue" in samples.kind:
        return samples.kind
    change, turn = samples.r1_squared - 1.0, samples.ratio - 1.0
    energy = (
        "keeps the energy"
        if abs(change) < ALIKE
        else f"{'gains' if change > 0.0 else 'loses'} {percent(abs(change))} energy a step"
    )
    return f"{energy}, {'on time' if abs(turn) < ON_TIME else percent(abs(turn)) + (' fast' if turn > 0.0 else ' slow')}"


def _words(samples: Samples, digits: int = 3) -> str:
    change = signed(samples.r1_squared - 1.0, digits=digits)
    ratio = f"Ψ/Φ − 1 = {signed(samples.ratio - 1.0, percent=True, digits=digits)}" if math.isfinite(samples.ratio) else "no Ψ"
    return f"r₁² − 1 = {change}, {ratio}".replace("-", "−") + f": {samples.kind}"


def _start(chart: Figures, samples: Samples | None = None) -> str:
    """Of all, or of one figure."""
    verlet = "" if samples is None or samples.start is None else ", y₋₁ = y₀ as in Hoffmann (2002)"
    return f"v₀ = 0, y₀ = 1{verlet}; Φ = ω₀·dt = {chart.phi:g} rad, {2.0 * math.pi / chart.phi:.4g} steps per period"
