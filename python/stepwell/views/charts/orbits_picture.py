"""The orbits of bodies in the picture of a run: where each went, beside the exact motion or the run without control."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ...base.arrays import Array
from ...model.systems import NBody
from .runs import RunPicture
from .style import FAMILIES, GREY

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

#: What is seen of the run without control is at most so many times as wide as the run with it.
BEFORE_FACTOR = 2.5

#: Where the panels are, as shares of width and height.
BOTTOM, TOP, RIGHT = 0.165, 0.87, 0.978


def orbits(figure: Figure, chart: RunPicture, notes: list[str]) -> None:
    """One panel for bodies in a plane; two projections side by side, on one scale, for bodies in space.

    Under a control there are the run without it and the run with it instead, seen along z.
    """
    if chart.before is not None:
        _before_and_after(figure, chart, chart.before, notes)
        return
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


def _before_and_after(figure: Figure, chart: RunPicture, before: RunPicture, notes: list[str]) -> None:
    """The run without its control beside the run with it, on one scale."""
    plane, dim = (0, 1), chart.places.shape[2]
    (_, old), (centre, new) = view(before, plane), view(chart, plane)
    size = min(max(old, new), BEFORE_FACTOR * new)
    for i, (each, name) in enumerate(((before, "without control"), (chart, "with control"))):
        axes = figure.add_axes((0.055 + 0.33 * i, BOTTOM, 0.275, TOP - BOTTOM))
        square(axes, centre, size, plane, dim)
        axes.locator_params(nbins=6)
        _paths(axes, each, plane, legend=i == 0, below=True)
        axes.set_title(name if dim == 2 else f"{name}, seen along z", loc="left", size=13)
        if left_picture(each, [(centre, size)], size):
            notes.append(f"A body leaves the picture {name}.")


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


def _paths(axes: Axes, chart: RunPicture, plane: tuple[int, int], *, legend: bool, below: bool = False) -> None:
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
            elapsed = chart.elapsed[chart.finite]
            arc = y[elapsed >= elapsed[-1] - chart.scene.period / bodies, i]  # where it went last, up to where the next one began
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
    place = above if plane_is_all(chart) and not below else dict[str, Any](loc="upper left", bbox_to_anchor=(-0.05, -0.13))
    place["ncols"] = len(handles)
    spacing: dict[str, Any] = {"handlelength": 1.8, "columnspacing": 1.0, "handletextpad": 0.4, "borderpad": 0.1}
    axes.legend(handles, labels, frameon=False, **place, **spacing)


def plane_is_all(chart: RunPicture) -> bool:
    """Whether one panel shows all, without a title."""
    return bool(chart.places.shape[2] == 2)
