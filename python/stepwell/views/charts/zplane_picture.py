"""The pictures of the stability charts: root loci in the z-plane, and r₁² and Ψ/Φ over Φ."""

from __future__ import annotations

import math
import textwrap
from typing import Any

import numpy as np

from ...analysis.stability.eigen import Complex
from ...base.arrays import Array
from ...model.methods import stable_for
from .curves_picture import overview
from .style import FAMILIES, GREY, Axes, Figure, family, named, page
from .zplane import Locus, Stability

#: Panels side by side at most, and the least width in inches, which the title and the notes need.
COLUMNS, WIDTH = 3, 10.5

#: A panel of the z-plane shows so much of it in each direction.
REACH = 1.72

#: More methods than these share two panels.
MOST_PAIRS = 4

#: Angles of the guides, the harmonic cases 1, 2 and 3 of §4, and where their names stand.
GUIDES = {30: (1.36, 0.79), 90: (0.21, 1.56), 150: (-1.36, 0.79)}

#: The locus is marked at the multiples of this angle, with the number at this distance, in the units of the plane.
MARKED, ASIDE = 0.5, 0.17

#: Below this, r₁² − 1 is shown on a linear scale, above on a logarithmic one, between these ends: what Fehlberg's results grow
#: by at usual steps must be seen.
LINEAR_BELOW, GROWTH_MIN, GROWTH_MAX = 1e-6, -1.6, 10.0

#: Methods whose eigenvalues differ by less than this at every Φ share a panel. They are the same but for rounding, of which a
#: double eigenvalue shows the root, some 10⁻⁸; methods that are not the same differ by far more at the largest Φ.
ALIKE = 1e-6

#: Letters in a line of names above a panel.
LETTERS = 34

#: The height of a number.
HIGH = 0.14

#: Ψ/Φ is shown up to here.
TURNS = 2.3


def loci(chart: Stability) -> Figure:
    """The eigenvalues in the z-plane, a panel for each method."""
    shared = groups(chart)
    across, down = _grid(len(shared))
    width, height = max(WIDTH, 3.7 * across + 0.9), 4.35 * down + 2.2
    with page(width, height) as figure:
        places = {
            "left": 0.8 / width,
            "right": 1.0 - 0.1 / width,
            "bottom": 1.15 / height,
            "top": 1.0 - 1.6 / height,
            "wspace": 0.06,
            "hspace": 0.26,
        }
        panels: Any = figure.subplots(down, across, sharex=True, sharey=True, squeeze=False, gridspec_kw=places)
        for axes in panels.ravel()[len(shared) :]:
            axes.set_visible(False)
        for i, (axes, same) in enumerate(zip(panels.ravel(), shared, strict=False)):
            _plane(axes)
            _path(axes, same[0], _colour(same))
            axes.set_title(_title(same), size=13, linespacing=1.25)
            if i % across == 0:
                axes.set_ylabel("Im z")
            if i + across >= len(shared):
                axes.set_xlabel("Re z")
                axes.tick_params(labelbottom=True)
        _text(
            figure,
            finding(chart),
            "Eigenvalues of a step as Φ = ω₀·dt grows, undamped oscillator (§4). Inside the circle samples decay.",
            "Solid: bounded samples; dashed: growing ones. Dots: Φ in radians. Diamond: where a root leaves the circle.\n"
            "Rays: Ψ = 30°, 90°, 150°, that is 12, 4 and 2.4 samples per period.",
        )
    return figure


def _plane(axes: Axes) -> None:
    from matplotlib.patches import Circle

    axes.add_patch(Circle((0.0, 0.0), 1.0, facecolor="#f0f0f0", edgecolor="#999999", linewidth=1.0, zorder=0))
    axes.axhline(0.0, color="#cccccc", linewidth=0.8, zorder=0.5)
    axes.axvline(0.0, color="#cccccc", linewidth=0.8, zorder=0.5)
    for degrees, place in GUIDES.items():
        x, y = 1.45 * math.cos(math.radians(degrees)), 1.45 * math.sin(math.radians(degrees))
        axes.plot([0.0, x], [0.0, y], color="#777777", linewidth=1.0, linestyle=(0, (1, 2)), zorder=0.6)
        axes.text(*place, f"{degrees}°", size=11, color=GREY, ha="center", va="center")
    axes.set(xlim=(-REACH, REACH), ylim=(-REACH, REACH), aspect="equal", xticks=(-1, 0, 1), yticks=(-1, 0, 1))


def _path(axes: Axes, locus: Locus, colour: str) -> None:
    """Both eigenvalues, with the angles at which they are there, and where one leaves the circle."""
    z, stable = branches(locus.eigenvalues), np.asarray(locus.stable)
    # Between a pair and two real ones both meet on the axis; without that point a line would cut the corner.
    meet = np.flatnonzero(np.diff((z[0].imag != 0.0).astype(int)))
    middle = 0.25 * (z[:, meet] + z[:, meet + 1]).sum(axis=0)
    path = np.insert(z, meet + 1, middle, axis=1)
    bounded = np.insert(stable, meet + 1, stable[meet] & stable[meet + 1])
    for branch in path:
        inside = np.where(bounded, branch, np.nan)
        axes.plot(branch.real, branch.imag, color=colour, linewidth=1.3, linestyle=(0, (3, 1.5)), zorder=2)
        axes.plot(inside.real, inside.imag, color=colour, linewidth=2.4, zorder=3)
    taken = list(GUIDES.values())
    if locus.limit.mode is not None:
        edge = locus.limit.mode.eigenvalue
        x, y = [edge.real, edge.real], [edge.imag, -edge.imag]
        style: Any = {"linestyle": "", "marker": "D", "markersize": 11, "markerfacecolor": "none", "zorder": 5}
        axes.plot(x, y, color="black", markeredgewidth=1.6, **style)
        taken += zip(x, y, strict=True)
    _angles(axes, locus.phi, z, path, taken)


def _angles(axes: Axes, phi: Array, z: Complex, path: Complex, taken: list[tuple[float, float]]) -> None:
    """A dot at each round angle, and its number where there is most room: once for a pair, and for each of two real ones."""
    lines = np.stack([path.real.ravel(), path.imag.ravel()], axis=1)
    for angle in np.arange(1, math.floor(phi[-1] / MARKED + 1e-9) + 1) * MARKED:
        named: list[complex] = []
        for branch in z:
            at = complex(np.interp(angle, phi, branch.real), np.interp(angle, phi, branch.imag))
            if angle < phi[0] or max(abs(at.real), abs(at.imag)) > REACH:
                continue
            axes.plot([at.real], [at.imag], color="black", marker="o", markersize=5, zorder=4)
            if at.imag < 0.0 or at in named:
                continue
            named.append(at)
            outward = math.atan2(at.imag, at.real) if at.imag else 0.5 * math.pi
            places = [at + ASIDE * np.exp(1j * (outward + k * math.pi / 4)) for k in (0, 1, -1, 2, -2, 3, -3, 4)]
            room = [_room(place, lines, taken) for place in places]
            best = places[int(np.argmax(room))]
            if max(room) > 0.6 * ASIDE:
                axes.text(best.real, best.imag, f"{angle:g}", size=11, ha="center", va="center", zorder=6)
                taken.append((best.real, best.imag))


def _room(place: complex, lines: Array, taken: list[tuple[float, float]]) -> float:
    """The distance of a number there from what is drawn; all that are far enough count alike."""
    to_line = float(np.hypot(lines[:, 0] - place.real, lines[:, 1] - place.imag).min())
    # A number is wider than high, and so is its neighbour.
    to_names = min((max(0.6 * abs(x - place.real), abs(y - place.imag)) for x, y in taken), default=math.inf)
    if to_names < HIGH:
        return 0.0
    to_edge = REACH - max(abs(place.real), abs(place.imag))
    return round(min(to_line, to_names, 1.5 * to_edge, 0.95 * ASIDE), 3)


def branches(eigenvalues: Complex) -> Complex:
    """Both eigenvalues as lines without jumps: of a pair the upper one first, of two real ones the right one."""
    a, b = eigenvalues
    swap = (b.imag > a.imag) | ((b.imag == a.imag) & (b.real > a.real))
    return np.stack([np.where(swap, b, a), np.where(swap, a, b)])


def curves(chart: Stability) -> Figure:
    """r₁² − 1 and Ψ/Φ over Φ, a pair of panels for each method; of many methods, both errors on two panels."""
    shared = groups(chart)
    if len(shared) > MOST_PAIRS:
        return overview(chart, shared)
    across, down = _grid(len(shared))
    width, height = max(WIDTH, 3.8 * across + 1.4), 4.75 * down + 2.2
    with page(width, height) as figure:
        from matplotlib.ticker import MaxNLocator

        outer = figure.add_gridspec(
            down,
            across,
            left=1.25 / width,
            right=1.0 - 0.15 / width,
            bottom=1.3 / height,
            top=1.0 - 1.6 / height,
            wspace=0.06,
            hspace=0.33,
        )
        first: dict[int, Axes] = {}
        for i, same in enumerate(shared):
            inner = outer[i // across, i % across].subgridspec(2, 1, hspace=0.06)
            pair = []
            for row, draw in enumerate((_radius, _ratio)):
                axes = figure.add_subplot(inner[row], sharex=first.get(0), sharey=first.get(row))
                first.setdefault(row, axes)
                draw(axes, same[0], _colour(same))
                axes.grid(which="major", color="#dddddd", linewidth=0.8)
                axes.tick_params(labelleft=i % across == 0)
                pair.append(axes)
            pair[0].tick_params(labelbottom=False)
            pair[0].set_title(_title(same), size=13, linespacing=1.25)
            if i % across == 0:
                pair[0].set_ylabel("r₁² − 1")
                pair[1].set_ylabel("Ψ/Φ")
                for axes in pair:
                    axes.yaxis.set_label_coords(-0.72 * across / (width - 1.35), 0.5)
            if i + across >= len(shared):
                pair[1].set_xlabel("Φ = ω₀·dt (rad)")
        first[0].set_xlim(0.0, float(chart.phi[-1]))
        first[0].xaxis.set_major_locator(MaxNLocator(4, prune="upper"))
        _text(
            figure,
            "How much each method grows or damps, and how fast it turns",
            "Undamped oscillator: r₁² is the mean factor of the energy in a step, Ψ/Φ the relative frequency. Both should be 1.",
            "Solid: exact. Dotted: the first two terms of the series. Grey dashes: no oscillation; both eigenvalues are real.\n"
            "Vertical line: the stability limit. Hatched: growing samples.",
        )
    return figure


def _radius(axes: Axes, locus: Locus, colour: str) -> None:
    from matplotlib.ticker import NullLocator

    axes.set_yscale("symlog", linthresh=LINEAR_BELOW, linscale=0.6)
    axes.set_ylim(GROWTH_MIN, GROWTH_MAX)
    ticks = (-1.0, -1e-2, -1e-4, 0.0, 1e-4, 1e-2, 1.0)
    axes.set_yticks(ticks, ["−1", "−10⁻²", "−10⁻⁴", "0", "10⁻⁴", "10⁻²", "1"])
    axes.yaxis.set_minor_locator(NullLocator())
    axes.axhspan(0.0, GROWTH_MAX, facecolor="none", edgecolor="#cccccc", hatch="//", linewidth=0.0, zorder=0)
    _lines(axes, locus, colour, locus.r1_squared - 1.0, locus.r1_squared_series - 1.0)


def _ratio(axes: Axes, locus: Locus, colour: str) -> None:
    axes.set_ylim(-0.08, TURNS)
    axes.set_yticks((0.0, 0.5, 1.0, 1.5, 2.0))
    axes.axhline(1.0, color=GREY, linewidth=0.8)
    _lines(axes, locus, colour, locus.ratio, locus.ratio_series)


def _lines(axes: Axes, locus: Locus, colour: str, exact: Array, approximate: Array) -> None:
    pair = locus.eigenvalues[0].imag != 0.0
    axes.plot(locus.phi, np.where(pair, exact, np.nan), color=colour, linewidth=2.4, zorder=3)
    axes.plot(locus.phi, np.where(pair, np.nan, exact), color=GREY, linewidth=1.4, linestyle=(0, (3, 1.5)), zorder=3)
    axes.plot(locus.phi, approximate, color="black", linewidth=1.6, linestyle=(0, (1, 1.6)), zorder=4)
    if 0.0 < locus.limit <= locus.phi[-1]:
        axes.axvline(float(locus.limit), color="black", linewidth=0.9, zorder=2)


def _grid(panels: int) -> tuple[int, int]:
    """How many panels across and down."""
    across = min(COLUMNS, panels)
    return across, -(-panels // across)


def groups(chart: Stability) -> list[tuple[Locus, ...]]:
    """The methods with the same eigenvalues together, each group where its first one is."""
    alike: list[list[Locus]] = []
    for locus in chart.loci:
        for same in alike:
            if np.allclose(same[0].eigenvalues, locus.eigenvalues, rtol=ALIKE, atol=ALIKE):
                same.append(locus)
                break
        else:
            alike.append([locus])
    return [tuple(same) for same in alike]


def finding(chart: Stability) -> str:
    """How many methods are never stable, and which are the same."""
    if len(chart.loci) == 1:
        return f"{chart.loci[0].method.title}: {_limit(chart.loci[0])}"
    never = sum(1 for locus in chart.loci if not locus.limit)
    text = f"{never} of {len(chart.loci)} methods {'is' if never == 1 else 'are'} never stable"
    most = max(groups(chart), key=len)
    others = " others" if never and most[0].limit else ""
    return f"{text}; {len(most)}{others} have the same eigenvalues" if len(most) > 1 else text


def _colour(same: tuple[Locus, ...]) -> str:
    families = {family(locus.method) for locus in same}
    return FAMILIES[families.pop()] if len(families) == 1 else "black"


def _limit(locus: Locus) -> str:
    return f"stable for {stable_for(locus.limit, digits=5)}" if locus.limit else "never stable"


def _title(same: tuple[Locus, ...]) -> str:
    first = same[0].method
    names = named(first) if len(same) == 1 else ", ".join(locus.method.title for locus in same)
    return "\n".join([*textwrap.wrap(names, LETTERS), _limit(same[0])] if len(same) > 1 else [names, _limit(same[0])])


def _text(figure: Figure, title: str, below: str, notes: str) -> None:
    width, height = figure.get_size_inches()
    figure.text(0.15 / width, 1.0 - 0.42 / height, title, size=18, weight="bold")
    figure.text(0.15 / width, 1.0 - 0.72 / height, below, size=12.5, color=GREY)
    figure.text(0.15 / width, 0.1 / height, notes, size=12, color=GREY, linespacing=1.35)
