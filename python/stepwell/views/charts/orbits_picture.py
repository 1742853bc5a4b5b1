"""The orbits of bodies in the picture of a run, with the exact orbits or those of the run without control."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from ...base.arrays import Array
from ...model.systems import NBody
from .run_panels import Points, falling, is_hanging, on_plane, view_of
from .runs import LARGEST, RunPicture
from .style import BOTTOM, EXACT, FAMILIES, GREY, LONG_CURVE, TOP, Axes, Figure

#: Colours, line styles and markers of bodies; further bodies repeat them. The colours are those of ``FAMILIES``, which differ in
#: grey, too.
BODIES: tuple[dict[str, Any], ...] = (
    {"color": FAMILIES["Runge-Kutta"], "linestyle": "-", "marker": "o"},
    {"color": FAMILIES["Heun"], "linestyle": (0, (6, 2)), "marker": "s"},
    {"color": FAMILIES["leapfrog"], "linestyle": (0, (1.5, 1.2)), "marker": "^"},
    {"color": FAMILIES["PEFRL"], "linestyle": (0, (6, 2, 1.2, 2)), "marker": "D"},
    {"color": FAMILIES["Euler"], "linestyle": "-", "marker": "v"},
)
#: The exact curve where it lies above the others.
DASHED: dict[str, Any] = {"color": "black", "linewidth": 1.5, "linestyle": (0, (3, 1.5))}

#: Paths longer than this many sides of the picture are drawn thin.
CROWDED = 20.0

#: Curves closer to each other than this fraction of their size are one.
ONE_CURVE = 0.01

#: The view of the run without control is at most so many times as wide as that of the run with it.
BEFORE_FACTOR = 2.5

#: How many times a net is drawn.
NET_TIMES = 4

#: The height of the time above it, as a share of the picture's.
NET_HEAD = 0.045


def draw_orbits(figure: Figure, chart: RunPicture) -> list[str]:
    """Draw one panel for points in a plane or hanging ones, or two projections to one scale for points in space. Return notes.

    With a control, draw the run without it and the run with it instead, seen along z.
    """
    if chart.before is not None:
        return _before_and_after(figure, chart, chart.before)
    planes = ((0, 1),) if chart.places.shape[2] == 2 or is_hanging(chart) else ((0, 1), (0, 2))
    views = [falling(chart)] if is_hanging(chart) else [on_plane(chart, plane) for plane in planes]
    size = max(view.half for view in views)
    side, gap, left = (0.44, 0.0, 0.065) if len(planes) == 1 else (0.28, 0.065, 0.058)
    for i, (plane, view) in enumerate(zip(planes, views, strict=True)):
        axes = figure.add_axes((left + i * (side + gap), BOTTOM, side, TOP - BOTTOM))
        square(axes, view, size, plane)
        _paths(axes, chart, view)
        if is_hanging(chart):
            axes.set(xlabel="", ylabel="", xticks=[], yticks=[])
            axes.set_title("", loc="left")
        if i == 0:
            _legend(axes, chart, crowded(chart, 2.0 * size), above=len(planes) == 1)
    notes = ["A body leaves the picture."] * any(view.leave(size) for view in views)
    notes += [f"The motion is {views[0].name}."] * is_hanging(chart)
    return [*notes, "Broad: where each body went last."] if one_curve(chart) else notes


def is_net(chart: RunPicture) -> bool:
    """True if the points are the knots of a net, which are drawn without their paths."""
    return bool(chart.links.size and chart.places.shape[1] > len(BODIES))


def draw_net(figure: Figure, chart: RunPicture, right: float) -> list[str]:
    """Draw a net at several times, one above the other or two side by side. Return notes."""
    from matplotlib.collections import LineCollection

    view = view_of(chart)
    finite = np.flatnonzero(chart.finite)
    shown = finite[np.round(np.linspace(0, len(finite) - 1, NET_TIMES)).astype(int)]
    points = view.places[shown]
    low, high = points.min(axis=(0, 1)), points.max(axis=(0, 1))
    middle, size = 0.5 * (low + high), np.maximum(1.06 * (high - low), 1e-300)
    wide, tall = figure.get_size_inches()
    panels = {n: (wide * (right - 0.02) / n, tall * ((TOP - 0.115) * n / NET_TIMES - NET_HEAD)) for n in (1, 2, 4)}
    across, panel = max(panels.items(), key=lambda item: min(item[1] / size))  # where the net is largest
    half = 0.5 * np.array(panel) / min(panel / size)
    for i, (saved, places) in enumerate(zip(shown, points, strict=True)):
        row, column = divmod(i, across)
        height = (TOP - 0.115) * across / NET_TIMES
        axes = figure.add_axes((0.02 + column * panel[0] / wide, TOP - (row + 1) * height, panel[0] / wide, panel[1] / tall))
        axes.add_collection(LineCollection(places[chart.links], colors="#222222", linewidths=0.6))
        (x, y), (dx, dy) = middle, half
        axes.set(xlim=(x - dx, x + dx), ylim=(y - dy, y + dy))
        axes.axis("off")
        axes.set_title(f"t = {chart.run.t[saved]:.4g}", loc="left", size=13, pad=2)
    return [f"The net is {view.name}."] if view.name else []


def _before_and_after(figure: Figure, chart: RunPicture, before: RunPicture) -> list[str]:
    """Draw the run without its control and the run with it, to the same scale."""
    old, new = on_plane(before), on_plane(chart)
    size = min(max(old.half, new.half), BEFORE_FACTOR * new.half)
    notes = []
    for i, (each, view, name) in enumerate(((before, old, "without control"), (chart, new, "with control"))):
        axes = figure.add_axes((0.068 + 0.332 * i, BOTTOM, 0.265, TOP - BOTTOM))
        view = replace(view, centre=new.centre)
        square(axes, view, size)
        axes.locator_params(nbins=4)
        _paths(axes, each, view)
        _legend(axes, each, crowded(each, 2.0 * size), above=False, part=i)
        axes.set_title(f"{name}, {view.name}" if view.name else name, loc="left", size=13)
        if view.leave(size):
            notes.append(f"A body leaves the picture {name}.")
    return notes


def _angles(places: Array) -> Array:
    """The angle of each point about the origin, without jumps, shape (saved, points)."""
    return np.asarray(np.unwrap(np.arctan2(places[..., 1], places[..., 0]), axis=0))


def _turns(places: Array, exact: Array) -> Array:
    """The angles of points in turns, in the direction of the exact motion, starting between 0 and 1."""
    way = np.sign(_angles(exact)[-1] - _angles(exact)[0])
    turned = way * _angles(places) / (2.0 * np.pi)
    return np.asarray(turned - np.floor(way * _angles(exact[:1])[0] / (2.0 * np.pi)))


def turning(chart: RunPicture) -> bool:
    """True if bodies circle the centre in one direction, which makes their distance from it a function of the angle."""
    exact = chart.exact_places
    if exact is None or not isinstance(chart.run.system, NBody) or exact.shape[2] != 2:
        return False
    turned = np.diff(_angles(exact), axis=0)
    return bool(((turned > 0.0).all(axis=0) | (turned < 0.0).all(axis=0)).all())


def radii(axes: Axes, chart: RunPicture) -> None:
    """The distance of each body from the centre over the angle that it has turned, which separates coinciding orbits."""
    y = np.clip(chart.places[chart.finite], -LARGEST, LARGEST)
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
    axes.set_title("distance from the centre by turns", loc="left", size=13.5)
    shown = np.clip(np.hypot(*y.transpose(2, 0, 1)), 0.0, 1.6 * r.max())
    low, high = min(float(shown.min()), float(r.min())), max(float(shown.max()), float(r.max()))
    room = max(0.12 * (high - low), 1e-9 * high)
    axes.set(xlim=(0.0, last), ylim=(low - room, high + room))
    axes.grid(color="#e6e6e6", linewidth=0.8)
    axes.set_axisbelow(True)


def one_curve(chart: RunPicture) -> bool:
    """True if several bodies follow each other on one curve, where the last one drawn would hide the others."""
    exact = chart.exact_places
    if exact is None or chart.scene.period is None or not 1 < exact.shape[1] <= len(BODIES):
        return False
    sample = exact[:: max(1, len(exact) // 200)]
    far = [
        np.hypot(*(sample[:, np.newaxis, i] - exact[np.newaxis, ::10, 0]).transpose(2, 0, 1)).min(axis=1).max() for i in (1, -1)
    ]
    return bool(max(far) < ONE_CURVE * np.abs(exact).max())


def crowded(chart: RunPicture, size: float) -> bool:
    """True if the paths are so long, relative to the side of the picture, that they are drawn thin."""
    y = np.clip(chart.places[chart.finite], -LARGEST, LARGEST)
    with np.errstate(all="ignore"):
        way = float(np.linalg.norm(np.diff(y, axis=0), axis=2).sum(axis=0).max())
    return bool(len(y) > LONG_CURVE and way > CROWDED * size)


def square(axes: Axes, view: Points, half: float, plane: tuple[int, int] = (0, 1)) -> None:
    """Set equal scales and the title of the view."""
    (x, y) = view.centre
    axes.set(xlim=(x - half, x + half), ylim=(y - half, y + half))
    axes.set_aspect("equal", adjustable="box", anchor="N")
    axes.set_xlabel("xyz"[plane[0]])
    axes.set_ylabel("xyz"[plane[1]], rotation=0, labelpad=10)
    axes.set_title(view.name, loc="left", size=13)
    axes.locator_params(nbins=6)
    axes.grid(color="#e6e6e6", linewidth=0.8)
    axes.set_axisbelow(True)


def exact(axes: Axes, curve: Array, *, above: bool = False) -> None:
    """Draw the exact curve: broad and grey below the others, or dashed above them where they would hide it."""
    if above:
        axes.plot(*curve, color="white", linewidth=3.6, zorder=3)
        axes.plot(*curve, zorder=3, **DASHED)
    else:
        axes.plot(*curve, **EXACT)


def body(chart: RunPicture, i: int) -> dict[str, Any]:
    """The colour, line style and marker of a body."""
    return BODIES[i] if chart.places.shape[1] <= len(BODIES) else BODIES[0]


def fixed(axes: Axes, view: Points) -> None:
    """Draw the bodies and the ends of rods that do not move."""
    for name, (x, y), _ in view.fixed:
        axes.plot([x], [y], linestyle="", marker="o", markersize=9.0 if name else 5.0, color=GREY, zorder=4)
        low, high = axes.get_xlim()
        side = -1 if x > 0.5 * (low + high) else 1  # towards the middle, where there is room
        way: dict[str, Any] = {"ha": "right" if side < 0 else "left", "textcoords": "offset points"}
        axes.annotate(name, (x, y), (10 * side, 9), size=12, color=GREY, zorder=6, **way)


def _paths(axes: Axes, chart: RunPicture, view: Points) -> None:
    y, bodies = view.places, view.places.shape[1]
    fixed(axes, view)
    joined = chart.links
    _draw_links(axes, joined, view)
    low, high = axes.get_xlim()
    long, many, shared = crowded(chart, high - low), bodies > len(BODIES), one_curve(chart)
    if view.exact is not None:
        for i in range(bodies):
            exact(axes, view.exact[:, i].T, above=long)
    if many and joined.size:
        return  # the springs show where particles are, and their paths would hide them
    for i in range(bodies):
        look = body(chart, i)
        line: dict[str, Any] = {"color": look["color"], "linestyle": "-" if long or many else look["linestyle"]}
        line |= {"linewidth": 0.5 if many else 0.35 if long else 1.4, "alpha": 0.25 if shared else 0.45 if many else 1.0}
        axes.plot(*y[:, i].T, zorder=2, rasterized=long, **line)
        if shared and chart.scene.period is not None:
            elapsed = chart.elapsed[chart.finite]
            arc = y[elapsed >= elapsed[-1] - chart.scene.period / bodies, i]  # where it went last, up to where the next one began
            axes.plot(*arc.T, color=look["color"], linewidth=3.0, zorder=3, solid_capstyle="butt")
        mark: dict[str, Any] = {"marker": look["marker"], "linestyle": "", "markersize": 4.0 if many else 10.0}
        start: dict[str, Any] = {"markerfacecolor": "white", "markeredgecolor": "black", "markeredgewidth": 0.7 if many else 1.6}
        end: dict[str, Any] = {"markerfacecolor": look["color"], "markeredgecolor": "white"}
        axes.plot(*y[:1, i].T, zorder=4, **mark, **start)
        axes.plot(*y[-1:, i].T, zorder=5, markeredgewidth=0.4 if many else 1.0, **mark, **end)


def _draw_links(axes: Axes, joined: Any, view: Points) -> None:
    """Draw springs and rods at the start and at the end, with those that hang on a fixed point."""
    from matplotlib.collections import LineCollection

    held = [(point.place, i) for point in view.fixed for i in point.joined]
    for state, colour in ((view.places[0], "#b0b0b0"), (view.places[-1], "#000000")):
        lines = [*state[joined], *(np.array([place, state[i]]) for place, i in held)]
        if lines:
            axes.add_collection(LineCollection(lines, colors=colour, linewidths=1.6, zorder=3))


def _legend(axes: Axes, chart: RunPicture, long: bool, *, above: bool, part: int | None = None) -> None:
    """Draw the names of the bodies where there are no orbits: above the panel, or below it if its title is above.

    Of two panels beside each other the first has the names of the bodies, part 0, and the second the others, part 1.
    """
    from matplotlib.lines import Line2D

    bodies = chart.places.shape[1]
    many = bodies > len(BODIES)
    handles, labels = [], []
    masses = getattr(chart.run.system, "masses", np.ones(bodies))
    for i in range(0 if many else bodies):
        look = body(chart, i)
        handles.append(Line2D([], [], **(look | {"linestyle": "-" if long else look["linestyle"]}), linewidth=1.4, markersize=8))
        alike = f"body {i + 1}" if bodies > 1 else chart.run.method.title
        labels.append(alike if np.ptp(masses) == 0.0 else f"mass {masses[i]:g}")
    if chart.exact is not None:
        handles.append(Line2D([], [], **(DASHED if long else EXACT)))
        labels.append("exact")
    for face, label in (("white", "start"), ("black", "end")):
        mark = {"linestyle": "", "marker": "o", "markersize": 8, "markerfacecolor": face, "markeredgecolor": "black"}
        net = {"color": "#b0b0b0" if label == "start" else "#000000", "linewidth": 1.6}
        handles.append(Line2D([], [], **(net if many and chart.links.size else mark)))
        labels.append(label)
    if part is not None:
        names = 0 if many else bodies
        chosen = slice(names) if part == 0 else slice(names, None)
        handles, labels = handles[chosen], labels[chosen]
    place: dict[str, Any] = {"loc": "lower right", "bbox_to_anchor": (1.0, 1.0)}
    if not above:
        place = {"loc": "upper left", "bbox_to_anchor": (-0.05, -0.17)}
    spacing: dict[str, Any] = {
        "handlelength": 1.3,
        "columnspacing": 0.8,
        "handletextpad": 0.4,
        "borderpad": 0.1,
        "fontsize": 11.5,
    }
    axes.legend(handles, labels, frameon=False, ncols=len(handles), **place, **spacing)
