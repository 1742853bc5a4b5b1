"""Aircraft and rigid bodies in the picture of a run: their attitudes in space, the path of an axis, and curves over time."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ...base.arrays import Array
from .run_panels import angles, angular_velocity
from .runs import RunPicture
from .series_picture import Place, draw_column, draw_errors, draw_pale_errors, draw_series
from .solids import BODY_TRAIL, HALF_SIDE, REACH, Screen, Solid, main_axis, solid_of, turns, upright, upright_by_momentum
from .style import BOTTOM, EXACT, GREY, LONG_CURVE, RIGHT, TOP, Axes, Figure

#: How many attitudes of an aircraft are shown, how many side by side, and the height of a row as a share of the picture's.
AIRCRAFT_ATTITUDES, COLUMNS, ROW = 6, 3, 0.225

#: How many attitudes of a rigid body, side by side.
BODY_ATTITUDES = 8

#: The radius of the horizontal circle around an aircraft.
CIRCLE = 1.25

#: Between the panels of the angles, as a share of the picture's height.
GAP = 0.045

Turn = Callable[[Array], None]


def draw_aircraft(figure: Figure, chart: RunPicture) -> list[str]:
    """The angles and the commanded ones over time, the angular velocity, and attitudes in space. Returns notes."""
    draw_angles(figure, chart, (0.06, BOTTOM, 0.44, TOP - BOTTOM))
    left, solid = 0.59, solid_of(chart)
    width = (RIGHT - left) / COLUMNS
    for i, saved in enumerate(attitudes(chart, AIRCRAFT_ATTITUDES)):
        row, column = divmod(i, COLUMNS)
        axes = figure.add_axes((left + column * width, TOP - (row + 1) * ROW + 0.01, width, ROW - 0.035))
        draw_solid(axes, solid)(solid.matrices[..., saved])
        axes.set_title(f"t = {chart.run.t[saved]:.4g}", size=12, pad=2)
    below = TOP - AIRCRAFT_ATTITUDES // COLUMNS * ROW - 0.065
    draw_column(figure, chart, [angular_velocity(chart)], [(left + 0.025, BOTTOM, RIGHT - left - 0.05, below - BOTTOM)])
    return ["The dark wing is the right one. A pitch angle above zero lowers the nose."]


def draw_body(figure: Figure, chart: RunPicture) -> list[str]:
    """The path of an axis on a sphere, attitudes, the angular velocity, and the errors. Returns notes."""
    solid = solid_of(chart)
    ball = figure.add_axes((0.012, 0.315, 0.3, 0.53))
    _sphere(ball, solid.screen)
    side, axis = np.copysign(1.0, solid.reach), main_axis(chart)
    if chart.exact is not None:
        _path(ball, solid.screen, side * np.einsum("ij,jn->ni", upright(chart), turns(chart.exact[2])[:, axis]), None)
    path = solid.tips[chart.finite]
    _path(ball, solid.screen, path, "#000000", long=len(path) > LONG_CURVE)
    for point, face in ((path[0], "white"), (path[-1], "black")):
        ball.plot(*solid.screen.flat(point), marker="o", markersize=9, markerfacecolor=face, markeredgecolor="black", zorder=6)
    ball.set_title(f"path of the tip of axis {'−' if side < 0.0 else ''}{axis + 1}", size=13.5, pad=4)
    width = (RIGHT - 0.012) / BODY_ATTITUDES
    for i, saved in enumerate(attitudes(chart, BODY_ATTITUDES)):
        axes = figure.add_axes((0.012 + i * width, 0.127, width, 0.16))
        draw_solid(axes, solid)(solid.matrices[..., saved])
        axes.set_title(f"t = {chart.run.t[saved]:.4g}", size=12, pad=1)
    draw_column(figure, chart, [angular_velocity(chart)], [(0.365, 0.4, 0.255, 0.445)])
    draw_errors(figure, chart, (0.72, 0.665, RIGHT - 0.72, 0.18), (0.72, 0.4, RIGHT - 0.72, 0.18))
    return [_about_body(chart, axis)]


def _about_body(chart: RunPicture, axis: int) -> str:
    """The note on the drawn axis, and on which way is up."""
    system: Any = chart.run.system
    free = system.centre is None
    drawn = "A box with the body's moments of inertia" if free else "A top, not to scale"
    up = "the angular momentum at the start" if upright_by_momentum(chart) else "the third axis of space"
    marks = "dark at the tip of axis" if free else "whose rod is axis"
    exact = "" if chart.exact is None else " Broad grey: exact."
    return f"{drawn}, {marks} {axis + 1}; up is {up}. Circle: start. Dot: end. Dashed: behind the sphere.{exact}"


def attitudes(chart: RunPicture, count: int) -> list[int]:
    """The saved states whose attitudes are shown: evenly from the first to the last finite one."""
    good = np.flatnonzero(chart.finite)
    return [int(each) for each in good[np.round(np.linspace(0, len(good) - 1, count)).astype(int)]]


def draw_angles(figure: Figure, chart: RunPicture, place: Place) -> list[Axes]:
    """A panel for each of the three angles, one above the other."""
    left, bottom, width, height = place
    each = (height - 2 * GAP) / 3
    panels = draw_column(figure, chart, angles(chart), [(left, bottom + (2 - i) * (each + GAP), width, each) for i in range(3)])
    for axes in panels[:-1]:
        axes.tick_params(labelbottom=False)
    return panels


# ---- in space


def draw_solid(axes: Axes, solid: Solid) -> Turn:
    """Draw the body on a panel without scales, near parts above others; returns the function that turns it by a matrix."""
    from matplotlib.patches import Polygon

    screen = solid.screen
    height = HALF_SIDE if solid.axis is not None else _horizon(axes, screen)
    axes.set(xlim=(-HALF_SIDE, HALF_SIDE), ylim=(-height, height))
    _bare(axes)
    corners = {name: np.array(points) for name, (points, _) in solid.parts.items()}
    look: dict[str, Any] = {"closed": True, "edgecolor": "black", "linewidth": 0.9}
    drawn = {name: Polygon(np.zeros((3, 2)), facecolor=fill, **look) for name, (_, fill) in solid.parts.items()}
    for part in drawn.values():
        axes.add_patch(part)
    turn_axis = None if solid.axis is None else _draw_axis(axes, solid)

    def turn(matrix: Array) -> None:
        for name, points in corners.items():
            turned = points @ matrix.T
            drawn[name].set_xy(screen.flat(turned))
            drawn[name].set_zorder(3.0 + 0.1 * float(turned.mean(axis=0) @ screen.near))
        if turn_axis is not None:
            turn_axis(matrix)

    return turn


def _bare(axes: Axes) -> None:
    axes.set(xticks=[], yticks=[])
    axes.set_aspect("equal")
    axes.axis("off")


def _horizon(axes: Axes, screen: Screen) -> float:
    """The horizontal circle around an aircraft, and the direction from which yaw is counted; half the height of its panel."""
    around = np.linspace(0.0, 2.0 * np.pi, 121)
    circle = CIRCLE * np.stack([np.cos(around), np.sin(around), np.zeros_like(around)], axis=-1)
    axes.plot(*screen.flat(circle).T, color="#c8c8c8", linewidth=1.0, zorder=0)
    ahead = screen.flat(np.array([[0.0, 0.0, 0.0], [CIRCLE, 0.0, 0.0]]))
    axes.plot(*ahead.T, color="#c8c8c8", linewidth=1.0, linestyle=(0, (2, 2)), zorder=0)
    return 0.85 * HALF_SIDE


def _draw_axis(axes: Axes, solid: Solid) -> Turn:
    """Draw the axis of a body; returns the function that turns it by a rotation matrix."""
    from matplotlib.patheffects import withStroke

    around = [withStroke(linewidth=4.6, foreground="white")]  # seen on a dark face, too
    rod, foot = (axes.plot([], [], color="black", linewidth=2.2, path_effects=around)[0] for _ in range(2))
    screen, reach = solid.screen, solid.reach

    def turn(matrix: Array) -> None:
        # The rod ends at the body, at either end, and is before or behind it.
        tip = np.copysign(1.0, reach) * matrix[:, solid.axis]
        near = float(tip @ screen.near) > 0.0
        rod.set_data(*screen.flat(np.stack([abs(reach) * tip, REACH * tip])).T)
        rod.set_zorder(5.0 if near else 2.0)
        if "half 1" in solid.parts:  # a top stands on a foot
            foot.set_data(*screen.flat(np.stack([0.0 * tip, abs(reach) * tip])).T)
            foot.set_zorder(2.0 if near else 5.0)

    return turn


def _sphere(axes: Axes, screen: Screen) -> None:
    """The unit sphere: its outline, its equator and its vertical."""
    around = np.linspace(0.0, 2.0 * np.pi, 181)
    circle = np.stack([np.cos(around), np.sin(around)], axis=-1)
    axes.plot(*circle.T, color="#b0b0b0", linewidth=1.2, zorder=0)
    equator = np.concatenate([circle, np.zeros((len(circle), 1))], axis=1)
    _path(axes, screen, equator, "#c8c8c8")
    vertical = screen.flat(np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 1.3]]))
    axes.plot(*vertical.T, color="#9a9a9a", linewidth=1.2, zorder=0)
    axes.text(float(vertical[1, 0]) + 0.04, float(vertical[1, 1]), "up", color=GREY, size=12, va="center")
    axes.set(xlim=(-1.15, 1.15), ylim=(-1.08, 1.15))
    _bare(axes)


def _path(axes: Axes, screen: Screen, path: Array, colour: str | None, *, long: bool = False) -> None:
    """A path on the sphere, dashed where it is behind it; without a colour the exact one, below the others."""
    flat, front = screen.flat(path), path @ screen.near >= 0.0
    for side, dashes in ((front, "-"), (~front, (0, (2, 2)))):
        # The point after the last one of a side belongs to it, too, so that there is no gap.
        shown = side | np.append(False, side[:-1])
        line = np.where(shown[:, np.newaxis], flat, np.nan)
        if colour is None:
            axes.plot(*line.T, **(EXACT | {"color": EXACT["color"] if side is front else "#ececec"}))
        else:
            width = 1.3 if side is front else 0.8
            axes.plot(*line.T, color=colour, linestyle=dashes, linewidth=width, zorder=3, rasterized=long)


# ---- the animation


def animate_aircraft(figure: Figure, chart: RunPicture) -> tuple[Callable[[int], None], list[Axes]]:
    """The function that shows the aircraft of a saved state, and the panels of the angles beside it."""
    solid = solid_of(chart)
    axes = figure.add_axes((0.012, 0.06, 0.5, 0.8))
    turn = draw_solid(axes, solid)
    axes.text(0.5, 0.02, "dark wing: the right one", transform=axes.transAxes, ha="center", color=GREY, size=13)
    panels = draw_angles(figure, chart, (0.56, 0.1, 0.335, 0.74))
    return lambda saved: turn(solid.matrices[..., saved]), panels


def animate_body(figure: Figure, chart: RunPicture) -> tuple[Callable[[int], None], list[Axes]]:
    """The function that shows the body of a saved state with the trail of its axis, and the panels over time beside it."""
    solid = solid_of(chart)
    axes = figure.add_axes((0.012, 0.06, 0.5, 0.8))
    _sphere(axes, solid.screen)
    turn = draw_solid(axes, solid)
    trail = axes.plot([], [], color="#7a7a7a", linewidth=1.6, zorder=1)[0]
    path = solid.screen.flat(REACH * solid.tips)
    elapsed, length = chart.elapsed, BODY_TRAIL * float(chart.elapsed[-1])
    omega = draw_series(figure.add_axes((0.57, 0.64, 0.36, 0.2)), chart, angular_velocity(chart))
    others = draw_pale_errors(figure, chart, (0.57, 0.1, 0.36, 0.44))

    def show(saved: int) -> None:
        turn(solid.matrices[..., saved])
        first = int(np.searchsorted(elapsed, elapsed[saved] - length))
        trail.set_data(*path[first : saved + 1].T)

    return show, [omega, *others]
