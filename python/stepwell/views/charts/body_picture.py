"""The picture of a rigid body: the path of an axis on a sphere, its attitudes, its angular velocity, and the errors."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from ...base.arrays import Array
from .attitude_picture import HALF_SIDE, Parts, Seen, angular_velocity, chosen, rotation, solid, turns, viewed
from .orbits_picture import EXACT, LONG_CURVE, RIGHT
from .runs import RunPicture
from .runs_picture import errors, greyed
from .style import GREY

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: How many attitudes the picture shows, side by side.
ATTITUDES = 8

#: From where the body and the sphere are seen: above the horizontal, so that a path around the vertical is open.
ELEVATION = 35.0

#: The half length of a box's longest side, and the least of any side; how far the axis reaches.
LONGEST, THINNEST, REACH = 0.85, 0.06, 1.3

#: Faces of a box: the ends of the axis are darkest and white, so that it is seen which way it points.
FRONT, BACK, SIDES = "#2b2b2b", "#ffffff", ("#c4c4c4", "#8f8f8f")

#: A top: corners of its disc, the disc's radius, and its height above the fixed point.
CORNERS, RADIUS, HEIGHT = 24, 0.75, 0.65

#: An animated body leaves the path of its axis over this share of the run.
TRAIL = 0.25


def draw_panels(figure: Figure, chart: RunPicture, notes: list[str]) -> None:
    """All panels of the picture."""
    up, axis, screen = upright(chart), main_axis(chart), viewed(elevation=ELEVATION)
    matrices = np.einsum("ij,jkn->ikn", up, rotation(chart))
    make, reach = parts(chart.run.system, axis)
    side = np.copysign(1.0, reach)
    ball = figure.add_axes((0.012, 0.315, 0.3, 0.53))
    sphere(ball, screen)
    if chart.exact is not None:
        _path(ball, screen, side * np.einsum("ij,jn->ni", up, turns(chart.exact[2])[:, axis]), None)
    path = side * matrices[:, axis, chart.finite].T
    _path(ball, screen, path, "#000000", long=len(path) > LONG_CURVE)
    for point, face in ((path[0], "white"), (path[-1], "black")):
        ball.plot(*screen.flat(point), marker="o", markersize=9, markerfacecolor=face, markeredgecolor="black", zorder=6)
    ball.set_title(f"path of the tip of axis {'−' if side < 0.0 else ''}{axis + 1}", size=13.5, pad=4)
    width = (RIGHT - 0.012) / ATTITUDES
    for i, frame in enumerate(chosen(chart, ATTITUDES)):
        axes = figure.add_axes((0.012 + i * width, 0.105, width, 0.175))
        _panel(axes)
        figure_of(axes, make, axis, reach, screen)(matrices[..., frame])
        axes.set_title(f"t = {chart.run.t[frame]:.4g}", size=12, pad=1)
    omega = figure.add_axes((0.365, 0.365, 0.265, 0.48))
    angular_velocity(omega, chart)
    energy = figure.add_axes((0.72, 0.645, RIGHT - 0.72, 0.2))
    state = figure.add_axes((0.72, 0.365, RIGHT - 0.72, 0.2))
    errors(energy, state, chart, compared=True)
    state.set_xlabel("time")
    notes.append(told(chart, axis))


def _system(chart: RunPicture) -> Any:
    return chart.run.system


def told(chart: RunPicture, axis: int) -> str:
    """What is drawn, and which way is up."""
    free = _system(chart).centre is None
    drawn = "A box with the body's moments of inertia" if free else "A top, not to scale"
    where = "the angular momentum at the start" if _by_momentum(chart) else "the third axis of space"
    marks = "dark at the tip of axis" if free else "whose rod is axis"
    exact = "" if chart.exact is None else " Broad grey: exact."
    return f"{drawn}, {marks} {axis + 1}; up is {where}. Circle: start. Dot: end. Dashed: behind the sphere.{exact}"


def momentum(chart: RunPicture) -> Array:
    """The angular momentum of the first saved state along the body's axes."""
    found: Array = _system(chart).inertia * chart.run.v[0]
    return found


def main_axis(chart: RunPicture) -> int:
    """The axis that is shown: of a top that nearest to ``centre``, else that of most of the angular momentum at the start."""
    centre = _system(chart).centre
    return int(np.argmax(np.abs(momentum(chart) if centre is None else centre)))


def _by_momentum(chart: RunPicture) -> bool:
    """Whether the angular momentum at the start is drawn upright: a body without a vertical of its own."""
    system = _system(chart)
    return system.weight is None and system.space_torque is None and bool(momentum(chart).any())


def upright(chart: RunPicture) -> Array:
    """The shortest turn of space after which what is up is the third axis, shape (3, 3)."""
    if not _by_momentum(chart):
        return np.eye(3)
    found = rotation(chart)[..., 0] @ momentum(chart)
    x, y, z = found / np.linalg.norm(found)
    if z < -1.0 + 1e-12:
        return np.diag([1.0, -1.0, -1.0])
    cross = np.array([[0.0, 0.0, -x], [0.0, 0.0, -y], [x, y, 0.0]])
    turned: Array = np.eye(3) + cross + cross @ cross / (1.0 + z)
    return turned


# ---- the body


def parts(system: Any, axis: int) -> tuple[Parts, float]:
    """The body's parts, and where it meets the axis: a box, or the disc of a top, on the side of ``centre``."""
    if system.centre is None:
        half = half_sides(system.inertia)
        return box(half, axis), float(half[axis])
    side = 1.0 if system.centre[axis] >= 0.0 else -1.0
    return disc(axis, side * HEIGHT), side * HEIGHT


def half_sides(inertia: Array) -> Array:
    """Half the sides of the box with these moments, a₁² ∝ J₂ + J₃ − J₁, the longest as long as it is drawn."""
    half = np.sqrt(np.maximum(inertia.sum() - 2.0 * inertia, 0.0))
    return np.asarray(np.maximum(LONGEST * half / half.max(), THINNEST))


def box(half: Array, axis: int) -> Parts:
    """Six faces, each with the sign and the number of its axis for a name."""
    faces: Parts = {}
    for i in range(3):
        a, b = (i + 1) % 3, (i + 2) % 3
        for sign in (1.0, -1.0):
            corners = np.zeros((4, 3))
            corners[:, i] = sign * half[i]
            corners[:, a] = half[a] * np.array([1, 1, -1, -1])
            corners[:, b] = half[b] * np.array([1, -1, -1, 1])
            fill = (FRONT if sign > 0.0 else BACK) if i == axis else SIDES[(i - axis) % 3 - 1]
            faces["+-"[int(sign < 0.0)] + str(i + 1)] = (_points(corners), fill)
    return faces


def _points(corners: Array) -> tuple[tuple[float, float, float], ...]:
    return tuple((x, y, z) for x, y, z in corners.tolist())


def disc(axis: int, height: float) -> Parts:
    """A disc across the axis, of two halves of different fill so that its spin is seen."""
    a, b = (axis + 1) % 3, (axis + 2) % 3
    around = np.linspace(0.0, 2.0 * np.pi, CORNERS + 1)
    faces: Parts = {}
    for half in (0, 1):
        some = around[half * CORNERS // 2 : (half + 1) * CORNERS // 2 + 1]
        rim = np.zeros((len(some), 3))
        rim[:, a], rim[:, b], rim[:, axis] = RADIUS * np.cos(some), RADIUS * np.sin(some), height
        faces[f"half {half + 1}"] = (_points(rim), (SIDES[0], FRONT)[half])
    return faces


def figure_of(axes: Axes, shape: Parts, axis: int, reach: float, screen: Seen) -> Callable[[Array], None]:
    """The body with its axis on a panel, and what turns it by a rotation matrix."""
    from matplotlib.patheffects import withStroke

    turn = solid(axes, shape, screen)
    around = [withStroke(linewidth=4.6, foreground="white")]  # seen on a dark face, too
    rod, foot = (axes.plot([], [], color="black", linewidth=2.2, path_effects=around)[0] for _ in range(2))
    top = "half 1" in shape

    def show(matrix: Array) -> None:
        turn(matrix)
        # The rod ends at the body, whichever end that is, and is before or behind it.
        tip = np.copysign(1.0, reach) * matrix[:, axis]
        near = float(tip @ screen.near) > 0.0
        rod.set_data(*screen.flat(np.stack([abs(reach) * tip, REACH * tip])).T)
        rod.set_zorder(5.0 if near else 2.0)
        if top:
            foot.set_data(*screen.flat(np.stack([0.0 * tip, abs(reach) * tip])).T)
            foot.set_zorder(2.0 if near else 5.0)

    return show


def _panel(axes: Axes) -> None:
    axes.set(xlim=(-HALF_SIDE, HALF_SIDE), ylim=(-HALF_SIDE, HALF_SIDE), xticks=[], yticks=[])
    axes.set_aspect("equal")
    axes.axis("off")


# ---- the path of the axis


def sphere(axes: Axes, screen: Seen) -> None:
    """The unit sphere: its outline, its equator and its vertical."""
    around = np.linspace(0.0, 2.0 * np.pi, 181)
    circle = np.stack([np.cos(around), np.sin(around)], axis=-1)
    axes.plot(*circle.T, color="#b0b0b0", linewidth=1.2, zorder=0)
    equator = np.concatenate([circle, np.zeros((len(circle), 1))], axis=1)
    _path(axes, screen, equator, "#c8c8c8")
    vertical = screen.flat(np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 1.3]]))
    axes.plot(*vertical.T, color="#9a9a9a", linewidth=1.2, zorder=0)
    axes.text(float(vertical[1, 0]) + 0.04, float(vertical[1, 1]), "up", color=GREY, size=12, va="center")
    axes.set(xlim=(-1.15, 1.15), ylim=(-1.08, 1.15), xticks=[], yticks=[])
    axes.set_aspect("equal")
    axes.axis("off")


def _path(axes: Axes, screen: Seen, path: Array, colour: str | None, *, long: bool = False) -> None:
    """A path on the sphere, dashed where it is behind it; without a colour the exact one, below the others."""
    flat, front = screen.flat(path), path @ screen.near >= 0.0
    for side, look in ((front, "-"), (~front, (0, (2, 2)))):
        # The point after a side's last belongs to it, too, so that there is no gap.
        kept = side | np.append(False, side[:-1])
        line = np.where(kept[:, np.newaxis], flat, np.nan)
        if colour is None:
            axes.plot(*line.T, **(EXACT | {"color": EXACT["color"] if side is front else "#ececec"}))
        else:
            axes.plot(*line.T, color=colour, linestyle=look, linewidth=1.3 if side is front else 0.8, zorder=3, rasterized=long)


# ---- the animation


def animated(figure: Figure, chart: RunPicture) -> tuple[Callable[[int], None], list[Axes]]:
    """The body as it lies now with the trail of its axis; and the panels over time."""
    up, axis, screen = upright(chart), main_axis(chart), viewed(elevation=ELEVATION)
    matrices = np.einsum("ij,jkn->ikn", up, rotation(chart))
    axes = figure.add_axes((0.012, 0.06, 0.5, 0.8))
    sphere(axes, screen)
    axes.set(xlim=(-HALF_SIDE, HALF_SIDE), ylim=(-HALF_SIDE, HALF_SIDE))
    make, reach = parts(chart.run.system, axis)
    turn = figure_of(axes, make, axis, reach, screen)
    trail = axes.plot([], [], color="#7a7a7a", linewidth=1.6, zorder=1)[0]
    path = screen.flat(np.copysign(REACH, reach) * matrices[:, axis].T)
    elapsed = chart.elapsed
    length = TRAIL * float(elapsed[-1])
    omega = figure.add_axes((0.57, 0.64, 0.36, 0.22))
    energy = figure.add_axes((0.57, 0.37, 0.36, 0.17))
    state = figure.add_axes((0.57, 0.1, 0.36, 0.17))
    angular_velocity(omega, chart)
    omega.set_xlabel("")
    errors(energy, state, chart)
    state.set_xlabel("time")

    def show(frame: int) -> None:
        turn(matrices[..., frame])
        first = int(np.searchsorted(elapsed, elapsed[frame] - length))
        trail.set_data(*path[first : frame + 1].T)

    return show, [omega, *greyed(energy, state, chart)]
