"""The picture of one run: orbits or curves on the left, errors of energy and of state on the right."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING, Any

import numpy as np

from .._checks import Array
from ..systems import Chain, NBody
from .runs import RunPicture
from .style import FAMILIES, FONT, GREY, new_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Hues, lines and marks of bodies. The hues are those of ``FAMILIES``, told apart in grey, too. More bodies are drawn alike.
BODIES: tuple[dict[str, Any], ...] = (
    {"color": FAMILIES["Runge-Kutta"], "linestyle": "-", "marker": "o"},
    {"color": FAMILIES["Heun"], "linestyle": (0, (6, 2)), "marker": "s"},
    {"color": FAMILIES["leapfrog"], "linestyle": (0, (1.5, 1.2)), "marker": "^"},
    {"color": FAMILIES["PEFRL"], "linestyle": (0, (6, 2, 1.2, 2)), "marker": "D"},
    {"color": FAMILIES["Euler"], "linestyle": "-", "marker": "v"},
)
EXACT: dict[str, Any] = {"color": "#d4d4d4", "linewidth": 5.0, "zorder": 1, "solid_capstyle": "round"}

#: A curve of more states than this is drawn thin and without dashes, and as pixels in files of lines.
LONG_CURVE = 3000

#: Paths longer than so many sides of the picture are drawn thin.
CROWDED = 20.0

#: Curves nearer to each other than this share of their size are one.
ONE_CURVE = 0.01

#: The view ends at this many times the size of the exact motion; without one, at this many times that of the start.
VIEW_FACTOR, VIEW_FACTOR_FROM_START = 4.0, 30.0

#: Rows of a chain are drawn up to here; of more, these many evenly chosen ones.
MOST_ROWS = 24

#: Where the panels are, as shares of width and height.
BOTTOM, TOP, RIGHT = 0.165, 0.87, 0.978


def draw(chart: RunPicture) -> Figure:
    """Draw the run on a new figure."""
    figure = new_figure(16.0, 9.0)
    from matplotlib import rc_context

    with rc_context(FONT):
        notes: list[str] = []
        if chart.kind == "attitude":
            from .attitude_picture import draw_panels

            draw_panels(figure, chart, BOTTOM, TOP, RIGHT)
            notes.append("The dark wing is the right one. A pitch angle above zero lowers the nose.")
            text(figure, chart, notes)
            return figure
        if chart.kind == "body":
            from .body_picture import draw_panels as draw_body

            draw_body(figure, chart, notes)
            text(figure, chart, notes)
            return figure
        if chart.kind == "orbits":
            _orbits(figure, chart, notes)
            left = 0.55 if chart.places.shape[2] == 2 else 0.735
        else:
            panels = curves(figure, chart, notes)
            left = 0.66
            panels[-1].set_xlabel("time")
        if chart.kind == "orbits" and turning(chart):
            radii(figure.add_axes((left, 0.68, RIGHT - left, TOP - 0.68)), chart)
            energy = figure.add_axes((left, 0.4225, RIGHT - left, 0.145))
            state = figure.add_axes((left, BOTTOM, RIGHT - left, 0.145))
        else:
            energy = figure.add_axes((left, 0.545, RIGHT - left, TOP - 0.545))
            state = figure.add_axes((left, BOTTOM, RIGHT - left, 0.455 - BOTTOM))
        errors(energy, state, chart)
        state.set_xlabel("time")
        text(figure, chart, notes)
    return figure


# ---- orbits


def _orbits(figure: Figure, chart: RunPicture, notes: list[str]) -> None:
    """One panel for bodies in a plane; two projections side by side, on one scale, for bodies in space."""
    planes = ((0, 1),) if chart.places.shape[2] == 2 else ((0, 1), (0, 2))
    views = [view(chart, plane) for plane in planes]
    size = max(half for _, half in views)
    side, gap, left = (0.44, 0.0, 0.065) if len(planes) == 1 else (0.29, 0.06, 0.058)
    for i, (plane, (centre, _)) in enumerate(zip(planes, views, strict=True)):
        axes = figure.add_axes((left + i * (side + gap), BOTTOM, side, TOP - BOTTOM))
        square(axes, centre, size, plane, chart.places.shape[2])
        _paths(axes, chart, plane, legend=i == 0)
    if left_picture(chart, views, size):
        notes.append("A body leaves the picture.")
    if one_curve(chart):
        notes.append("Broad: where each body went last.")


def _angles(places: Array) -> Array:
    """The angle of each point about the origin, without jumps, shape (saved, points)."""
    return np.asarray(np.unwrap(np.arctan2(places[..., 1], places[..., 0]), axis=0))


def _turns(places: Array, exact: Array) -> Array:
    """The angles of points in turns, counted the way in which the exact motion goes, the first between 0 and 1."""
    way = np.sign(_angles(exact)[-1] - _angles(exact)[0])
    found = way * _angles(places) / (2.0 * np.pi)
    return np.asarray(found - np.floor(way * _angles(exact[:1])[0] / (2.0 * np.pi)))


def turning(chart: RunPicture) -> bool:
    """Whether bodies in a plane go round their centre one way, so that their distance from it is a function of the angle."""
    exact = chart.exact_places
    if exact is None or not isinstance(chart.run.system, NBody) or exact.shape[2] != 2:
        return False
    turned = np.diff(_angles(exact), axis=0)
    return bool(((turned > 0.0).all(axis=0) | (turned < 0.0).all(axis=0)).all())


def radii(axes: Axes, chart: RunPicture) -> None:
    """The distance of each body from the centre over the angle that it has turned: orbits that lie on each other, spread out."""
    y = np.clip(chart.places[chart.finite], -1e9, 1e9)
    exact = chart.exact_places
    assert exact is not None
    angles, true = _turns(y, exact), _turns(exact, exact)
    last, r = float(angles.max()), np.hypot(*exact.transpose(2, 0, 1))
    for i in range(y.shape[1]):
        known = true[:, i]
        turn = known[-1] - known[0]
        for k in range(int((last - known[0]) / turn) + 1 if turn > 0.5 else 1):
            axes.plot(known + k * turn, np.hypot(*exact[:, i].T), **EXACT)
    for i in range(y.shape[1]):
        look = body(chart, i)
        axes.plot(angles[:, i], np.hypot(*y[:, i].T), color=look["color"], linestyle=look["linestyle"], linewidth=1.4, zorder=3)
    axes.set_title("distance from the centre r(θ) over turns θ/2π", loc="left", size=13.5)
    shown = np.clip(np.hypot(*y.transpose(2, 0, 1)), 0.0, 1.6 * r.max())
    low, high = min(float(shown.min()), float(r.min())), max(float(shown.max()), float(r.max()))
    room = max(0.12 * (high - low), 1e-9 * high)
    axes.set(xlim=(0.0, last), ylim=(low - room, high + room))
    axes.grid(color="#e6e6e6", linewidth=0.8)
    axes.set_axisbelow(True)


def one_curve(chart: RunPicture) -> bool:
    """Whether several bodies run after each other on one curve, where the last one drawn would hide the others."""
    exact = chart.exact_places
    if exact is None or chart.scene.period is None or not 1 < exact.shape[1] <= len(BODIES):
        return False
    some = exact[:: max(1, len(exact) // 200)]
    far = [np.hypot(*(some[:, np.newaxis, i] - exact[np.newaxis, ::10, 0]).transpose(2, 0, 1)).min(axis=1).max() for i in (1, -1)]
    return bool(max(far) < ONE_CURVE * np.abs(exact).max())


def crowded(chart: RunPicture, size: float) -> bool:
    """Whether the paths are so long, beside the side of the picture, that they must be thin."""
    y = np.clip(chart.places[chart.finite], -1e9, 1e9)
    with np.errstate(all="ignore"):
        way = float(np.linalg.norm(np.diff(y, axis=0), axis=2).sum(axis=0).max())
    return bool(len(y) > LONG_CURVE and way > CROWDED * size)


def view(chart: RunPicture, plane: tuple[int, int]) -> tuple[Array, float]:
    """The middle and half the side of a square that holds all that is not far away."""
    exact = chart.exact_places
    known, far = (chart.places[:1], VIEW_FACTOR_FROM_START) if exact is None else (exact, VIEW_FACTOR)
    reach = far * max(float(np.abs(known).max()), 1e-300)
    points = np.concatenate([known[..., plane].reshape(-1, 2), chart.places[chart.finite][..., plane].reshape(-1, 2)])
    points = points[(np.abs(points) <= reach).all(axis=1)]
    points = np.concatenate([points, *(np.array([[at[i] for i in plane]]) for _, at, _ in chart.fixed_points)])
    low, high = points.min(axis=0), points.max(axis=0)
    return 0.5 * (low + high), 0.54 * float((high - low).max())


def left_picture(chart: RunPicture, views: list[tuple[Array, float]], size: float) -> bool:
    """Whether a body goes where the panels do not reach."""
    y = chart.places[chart.finite]
    return any(
        bool((np.abs(y[..., plane] - centre) > size).any()) for plane, (centre, _) in zip(((0, 1), (0, 2)), views, strict=False)
    )


def square(axes: Axes, centre: Array, size: float, plane: tuple[int, int], dim: int) -> None:
    """Equal scales, and what is seen from where."""
    axes.set(xlim=(centre[0] - size, centre[0] + size), ylim=(centre[1] - size, centre[1] + size))
    axes.set_aspect("equal", adjustable="box", anchor="N")
    axes.set_xlabel("xyz"[plane[0]])
    axes.set_ylabel("xyz"[plane[1]], rotation=0, labelpad=10)
    if dim == 3:
        axes.set_title(f"seen along {'xyz'[3 - sum(plane)]}", loc="left", size=13)
    axes.grid(color="#e6e6e6", linewidth=0.8)
    axes.set_axisbelow(True)


def exact(axes: Axes, curve: Array, *, above: bool = False) -> None:
    """The exact curve: broad and grey below the others, or dashed above them where they would hide it."""
    if above:
        axes.plot(*curve, color="white", linewidth=3.6, zorder=3)
        axes.plot(*curve, color="black", linewidth=1.5, linestyle=(0, (3, 1.5)), zorder=3)
    else:
        axes.plot(*curve, **EXACT)


def body(chart: RunPicture, i: int) -> dict[str, Any]:
    """Colour, line and mark of a body."""
    return BODIES[i] if chart.places.shape[1] <= len(BODIES) else BODIES[0]


def fixed(axes: Axes, chart: RunPicture, plane: tuple[int, int]) -> None:
    """The bodies, and the ends of rods, that do not move."""
    for name, at, _ in chart.fixed_points:
        x, y = (at[i] for i in plane)
        axes.plot([x], [y], linestyle="", marker="o", markersize=9.0 if name else 5.0, color=GREY, zorder=4)
        low, high = axes.get_xlim()
        side = -1 if x > 0.5 * (low + high) else 1  # towards the middle, where there is room
        way: dict[str, Any] = {"ha": "right" if side < 0 else "left", "textcoords": "offset points"}
        axes.annotate(name, (x, y), (10 * side, 9), size=12, color=GREY, zorder=6, **way)


def links(chart: RunPicture) -> np.ndarray[Any, np.dtype[np.int64]]:
    """The pairs of points that springs or rods join, shape (pairs, 2)."""
    system = chart.run.system
    pairs = getattr(system, "pairs", None)
    if pairs is None:
        pairs = [rod for rod in getattr(system, "rods", ()) if all(isinstance(end, int) for end in rod)]
    return np.asarray(pairs, dtype=np.int64).reshape(-1, 2)


def _paths(axes: Axes, chart: RunPicture, plane: tuple[int, int], *, legend: bool) -> None:
    from matplotlib.lines import Line2D

    y = np.clip(chart.places[chart.finite], -1e9, 1e9)[..., plane]
    bodies = y.shape[1]
    fixed(axes, chart, plane)
    if (joined := links(chart)).size:
        from matplotlib.collections import LineCollection

        for state, colour in ((y[0], "#b0b0b0"), (y[-1], "#000000")):
            axes.add_collection(LineCollection(state[joined], colors=colour, linewidths=1.0, zorder=3))
    low, high = axes.get_xlim()
    long, many = crowded(chart, high - low), bodies > len(BODIES)
    shared = one_curve(chart)
    if chart.exact_places is not None:
        for i in range(bodies):
            exact(axes, chart.exact_places[:, i, plane].T, above=long)
    for i in range(bodies):
        look = body(chart, i)
        line: dict[str, Any] = {"color": look["color"], "linestyle": "-" if long or many else look["linestyle"]}
        width = 0.5 if many else 0.35 if long else 1.4
        if many and joined.size:
            continue  # the springs show where particles are, and their paths would hide them
        pale = 0.25 if shared else 0.45 if many else 1.0
        axes.plot(*y[:, i].T, linewidth=width, alpha=pale, zorder=2, rasterized=long, **line)
        if shared and chart.scene.period is not None:
            t = chart.run.t[chart.finite]
            arc = y[t >= t[-1] - chart.scene.period / bodies, i]  # where it went last, up to where the next one began
            axes.plot(*arc.T, color=look["color"], linewidth=3.0, zorder=3, solid_capstyle="butt")
        mark: dict[str, Any] = {"marker": look["marker"], "linestyle": "", "markersize": 4.0 if many else 10.0, "zorder": 4}
        start: dict[str, Any] = {"markerfacecolor": "white", "markeredgecolor": "black", "markeredgewidth": 0.7 if many else 1.6}
        end: dict[str, Any] = {
            "markerfacecolor": look["color"],
            "markeredgecolor": "white",
            "markeredgewidth": 0.4 if many else 1.0,
        }
        axes.plot(*y[:1, i].T, **mark, **start)
        axes.plot(*y[-1:, i].T, **(mark | {"zorder": 5}), **end)
    if not legend:
        return
    handles, labels = [], []
    masses = getattr(chart.run.system, "masses", np.ones(bodies))
    for i in range(0 if many else bodies):
        look = body(chart, i)
        handles.append(Line2D([], [], **(look | {"linestyle": "-" if long else look["linestyle"]}), linewidth=1.4, markersize=8))
        alike = f"body {i + 1}" if bodies > 1 else chart.run.method.title
        labels.append(alike if np.ptp(masses) == 0.0 else f"mass {masses[i]:g}")
    if chart.exact is not None:
        dashed = {"color": "black", "linewidth": 1.5, "linestyle": (0, (3, 1.5))}
        handles.append(Line2D([], [], **(dashed if long else EXACT)))
        labels.append("exact")
    for face, label in (("white", "start"), ("black", "end")):
        mark = {"linestyle": "", "marker": "o", "markersize": 8, "markerfacecolor": face, "markeredgecolor": "black"}
        net = {"color": "#b0b0b0" if label == "start" else "#000000", "linewidth": 1.6}
        handles.append(Line2D([], [], **(net if many and joined.size else mark)))
        labels.append(label)
    # Where no orbit can be: above the panel, or below it where its title is above.
    above = dict[str, Any](loc="lower right", bbox_to_anchor=(1.0, 1.0))
    place = above if plane_is_all(chart) else dict[str, Any](loc="upper left", bbox_to_anchor=(-0.05, -0.13))
    place["ncols"] = len(handles)
    spacing: dict[str, Any] = {"handlelength": 1.8, "columnspacing": 1.0, "handletextpad": 0.4, "borderpad": 0.1}
    axes.legend(handles, labels, frameon=False, **place, **spacing)


def plane_is_all(chart: RunPicture) -> bool:
    """Whether one panel shows all, without a title."""
    return bool(chart.places.shape[2] == 2)


# ---- curves over time


def curves(figure: Figure, chart: RunPicture, notes: list[str]) -> list[Axes]:
    """The panels of what is not bodies in space, and the states in them."""
    if chart.kind == "swing":
        above = figure.add_axes((0.065, 0.545, 0.515, TOP - 0.545))
        below = figure.add_axes((0.065, BOTTOM, 0.515, 0.455 - BOTTOM))
        for axes, name, block, index in ((above, "y", chart.run.y, 2), (below, "v", chart.run.v, 1)):
            _swing(axes, chart, block, None if chart.exact is None else chart.exact[index], notes)
            axes.set_ylabel(name, rotation=0, labelpad=10)
        _curve_legend(above, chart)
        return [above, below]
    axes = figure.add_axes((0.065, BOTTOM, 0.515, TOP - BOTTOM))
    _rows(axes, chart, notes)
    _curve_legend(axes, chart)
    return [axes]


def _curve_legend(axes: Axes, chart: RunPicture) -> None:
    from matplotlib.lines import Line2D

    handles = [Line2D([], [], color="black", linewidth=1.1)]
    labels = [chart.run.method.title]
    if chart.exact is not None:
        handles.append(Line2D([], [], **EXACT))
        labels.append("exact")
    axes.legend(handles, labels, frameon=False, loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, borderpad=0.1)


def _swing(axes: Axes, chart: RunPicture, block: Array, exact: Array | None, notes: list[str]) -> None:
    good = chart.finite
    values = np.clip(block[good], -1e9, 1e9)
    size = float(np.abs(values).max())
    if exact is not None and chart.exact is not None:
        axes.plot(chart.exact[0], exact, **EXACT)
        size = min(size, 3.0 * float(np.abs(exact).max()))
        size = max(size, float(np.abs(exact).max()))
    few = good.sum() <= 150
    axes.plot(chart.run.t[good], values, color="black", linewidth=1.1, marker="o" if few else "", markersize=3.6, zorder=3)
    if float(np.abs(values).max()) > size:
        notes.append("The curve leaves the picture.")
    axes.axhline(0.0, color="#cccccc", linewidth=0.8, zorder=0)
    axes.set(ylim=(-1.12 * (size or 1.0), 1.12 * (size or 1.0)))
    over_time(axes, chart)


def _rows(axes: Axes, chart: RunPicture, notes: list[str]) -> None:
    """Each coordinate on a line of its own, one above the other."""
    good = chart.finite
    y = np.clip(chart.run.y[good].reshape(int(good.sum()), -1), -1e9, 1e9)
    true = None if chart.exact is None else chart.exact[2].reshape(len(chart.exact[0]), -1)
    size = max(float(np.abs(y if true is None else true).max()), 1e-300)
    if true is None or float(np.abs(y).max()) < 3.0 * size:
        size = max(size, float(np.abs(y).max()))
    else:
        notes.append("Displacements grow out of their lines.")
    n = y.shape[1]
    chosen = np.unique(np.round(np.linspace(0, n - 1, min(n, MOST_ROWS))).astype(int))
    step = 1.25 * size
    for place, i in enumerate(chosen.tolist()):
        axes.axhline(place * step, color="#cccccc", linewidth=0.7, zorder=0)
        if true is not None and chart.exact is not None:
            axes.plot(chart.exact[0], place * step + true[:, i], **(EXACT | {"linewidth": 3.0}))
        axes.plot(
            chart.run.t[good], place * step + y[:, i], color="black", linewidth=0.9, zorder=3, rasterized=len(y) > LONG_CURVE
        )
    axes.set_yticks([place * step for place in range(len(chosen))], [str(i + 1) for i in chosen.tolist()])
    axes.set_ylim(-1.15 * size, (len(chosen) - 1) * step + 1.15 * size)
    what = "mass" if isinstance(chart.run.system, Chain) else "coordinate"
    axes.set_ylabel(f"number of the {what}; from line to line {step:.3g}")
    over_time(axes, chart)


def over_time(axes: Axes, chart: RunPicture) -> None:
    """The scale of the time, and a grid."""
    first, last = float(chart.run.t[0]), float(chart.run.t[-1])
    margin = 0.01 * (last - first)
    axes.set_xlim(first - margin, last + margin)
    axes.grid(color="#e6e6e6", linewidth=0.8)
    axes.set_axisbelow(True)


# ---- errors


def errors(energy: Axes, state: Axes, chart: RunPicture) -> None:
    """The error of the energy above that of the state; never the one alone."""
    for axes, error, title in (
        (energy, chart.energy_error, "energy error"),
        (state, chart.state_error, "state error"),
    ):
        over_time(axes, chart)
        axes.set_title(f"{title} over time, relative", loc="left", size=13.5)
        if error is None:
            missing = (
                ("its energy is not constant" if getattr(chart.scene.system, "torques_act", False) else "no energy of its own")
                if axes is energy
                else "no exact solution, so no state error:\na correct energy alone does not\nmake a motion correct"
            )
            axes.text(0.5, 0.5, missing, transform=axes.transAxes, ha="center", va="center", color=GREY, linespacing=1.4)
            axes.set(yticks=[])
            continue
        axes.set_yscale("log")
        shown = np.isfinite(error) & (error > 0.0)
        low, high = (float(error[shown].min()), float(error[shown].max())) if shown.any() else (1e-17, 1e-15)
        low = max(low, 1e-9 * high)  # the first steps, or a passage through zero, would press the rest together
        # Before the curve: a scale that is still free would look for room beyond the largest float.
        axes.set_ylim(0.4 * low, 3.0 * min(high, 1e300))
        axes.plot(chart.run.t, np.where(shown, error, np.nan), color="black", linewidth=1.0, rasterized=len(error) > LONG_CURVE)
        if np.isinf(error).any():
            first = int(np.argmax(np.isinf(error)))
            axes.axvline(float(chart.run.t[first]), color="black", linewidth=1.0, linestyle=(0, (4, 2)))
            place: dict[str, Any] = {"transform": axes.get_xaxis_transform(), "rotation": 90, "va": "top", "size": 11.5}
            right = 2 * first > len(error)
            axes.text(chart.run.t[first], 0.95, " not finite ", ha="right" if right else "left", **place)
        if np.isnan(error).any():
            place = {"transform": axes.transAxes, "ha": "right", "va": "bottom", "color": GREY, "size": 11.5}
            axes.text(0.98, 0.05, f"not known after t = {chart.scene.until:g}", **place)
        axes.minorticks_off()


def greyed(energy: Axes, state: Axes, chart: RunPicture) -> list[Axes]:
    """The panels of the errors that are known, whose curves are made grey: beside an animation they are not what is looked at."""
    known = [axes for axes, error in ((energy, chart.energy_error), (state, chart.state_error)) if error is not None]
    for axes in known:
        axes.lines[0].set_color("#9a9a9a")
    return known


def text(figure: Figure, chart: RunPicture, notes: list[str]) -> None:
    """Title, what was run, and what the numbers are relative to."""
    scene, run = chart.scene, chart.run
    figure.text(0.012, 0.955, chart.title, size=20, weight="bold")
    what = f"{run.steps} steps of {run.dt:.6g} from t = {run.t[0]:g} to {run.t[-1]:.6g}; {run.system!r} ({scene.section})"
    figure.text(0.012, 0.918, textwrap.shorten(what, 165, placeholder=" …"), size=13, color=GREY)
    said = []
    if run.status:
        step = int(run.first_bad_step)
        said.append(f"Diverged at step {step} (t = {run.t0 + step * run.dt:g}): drawn as far as it is finite.")
    if chart.state_error is not None:
        said.append(f"State error 1: {scene.error}.")
    if chart.energy_error is not None:
        said.append(f"Energy error: relative to {chart.energy_scale}.")
    said += dict.fromkeys(notes)
    if len(run.t) < run.steps + 1:
        said.append(f"{len(run.t)} states of {run.steps + 1} were saved and are drawn.")
    figure.text(0.012, 0.02, "\n".join(_lines(said)), size=12, color=GREY, linespacing=1.4)


def _lines(sentences: list[str]) -> list[str]:
    """Sentences in as few lines of the page's width as they need."""
    lines: list[str] = []
    for sentence in sentences:
        if lines and len(lines[-1]) + len(sentence) < 175:
            lines[-1] += "  " + sentence
        else:
            lines.append(sentence)
    return lines
