"""The picture of an aircraft: its angles and the commanded ones over time, its angular velocity, and its attitudes in space."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ...base.arrays import Array
from ...model.systems.attitude import rotation_of_quaternion
from .orbits_picture import EXACT
from .runs import RunPicture
from .runs_picture import over_time
from .style import GREY

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Parts of a body by name: their corners along its axes, and how they are filled.
Parts = dict[str, tuple[tuple[tuple[float, float, float], ...], str]]

#: The parts of the aircraft, in its own axes (forward, left, up).
PARTS: Parts = {
    "fuselage": (((1.0, 0.0, 0.0), (0.55, 0.1, 0.0), (-0.9, 0.07, 0.0), (-0.9, -0.07, 0.0), (0.55, -0.1, 0.0)), "#4a4a4a"),
    "left wing": (((0.35, 0.08, 0.0), (-0.15, 0.95, 0.0), (-0.35, 0.95, 0.0), (-0.2, 0.08, 0.0)), "#f0f0f0"),
    "right wing": (((0.35, -0.08, 0.0), (-0.15, -0.95, 0.0), (-0.35, -0.95, 0.0), (-0.2, -0.08, 0.0)), "#8a8a8a"),
    "left tailplane": (((-0.65, 0.06, 0.0), (-0.85, 0.36, 0.0), (-0.95, 0.36, 0.0), (-0.9, 0.06, 0.0)), "#f0f0f0"),
    "right tailplane": (((-0.65, -0.06, 0.0), (-0.85, -0.36, 0.0), (-0.95, -0.36, 0.0), (-0.9, -0.06, 0.0)), "#8a8a8a"),
    "fin": (((-0.55, 0.0, 0.0), (-0.85, 0.0, 0.42), (-1.0, 0.0, 0.42), (-0.9, 0.0, 0.0)), "#000000"),
}

#: From where it is seen: degrees from straight ahead, to the left, and above the horizontal.
AZIMUTH, ELEVATION = 215.0, 25.0

#: Half the side of a panel with an aircraft, whose nose is 1 from its centre; the radius of the horizontal circle around it.
HALF_SIDE, CIRCLE = 1.4, 1.25

#: How many attitudes the picture shows, how many side by side, and the height of a row as a share of the picture's.
ATTITUDES, COLUMNS, ROW = 6, 3, 0.225

#: Names of the angles, and how a line and its label look.
ANGLES = ("roll φ", "pitch θ", "yaw ψ")
RATES = (("ω₁", "#000000", "-"), ("ω₂", "#5a5a5a", (0, (6, 2))), ("ω₃", "#8c8c8c", (0, (1.5, 1.2))))
COMMANDED: dict[str, Any] = {"color": "#7a7a7a", "linewidth": 1.6, "linestyle": (0, (5, 2)), "zorder": 2}

#: A run of more saved states has no mark at each of them.
MOST_MARKED = 250

#: Between the panels of the angles, as a share of the picture's height.
GAP = 0.045

#: Labels at the end of lines are at least this share of a panel's height apart.
LABEL_DISTANCE = 0.11

#: Angles of a broken run are drawn up to here, in degrees; angular velocities up to here.
LARGEST = 1e9


class Seen(NamedTuple):
    """The axes of a screen in space: to the right, up, and towards the viewer."""

    right: Array
    up: Array
    near: Array

    def flat(self, points: Array) -> Array:
        """Where points of space, shape (n, 3), are on the screen, shape (n, 2)."""
        return np.stack([points @ self.right, points @ self.up], axis=-1)


def viewed(azimuth: float = AZIMUTH, elevation: float = ELEVATION) -> Seen:
    """The screen of a viewer there."""
    a, e = np.radians([azimuth, elevation])
    near = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
    right = np.array([-np.sin(a), np.cos(a), 0.0])
    return Seen(right, np.cross(near, right), near)


def draw_panels(figure: Figure, chart: RunPicture, bottom: float, top: float, right: float) -> None:
    """All panels of the picture."""
    angle_panels(figure, chart, (0.06, bottom, 0.44, top - bottom))
    left = 0.59
    width = (right - left) / COLUMNS
    for i, frame in enumerate(chosen(chart)):
        row, column = divmod(i, COLUMNS)
        axes = figure.add_axes((left + column * width, top - (row + 1) * ROW + 0.01, width, ROW - 0.035))
        space(axes)
        solid(axes, PARTS)(rotation(chart)[..., frame])
        axes.set_title(f"t = {chart.run.t[frame]:.4g}", size=12, pad=2)
    below = top - ATTITUDES // COLUMNS * ROW - 0.065
    angular_velocity(figure.add_axes((left + 0.025, bottom, right - left - 0.05, below - bottom)), chart)


def chosen(chart: RunPicture, count: int = ATTITUDES) -> list[int]:
    """The saved states whose attitudes are shown: evenly from the first to the last finite one."""
    good = np.flatnonzero(chart.finite)
    return [int(each) for each in good[np.round(np.linspace(0, len(good) - 1, count)).astype(int)]]


def rotation(chart: RunPicture) -> Array:
    """The rotation matrices of the saved states, shape (3, 3, saved)."""
    system: Any = chart.run.system
    if chart.kind == "body":
        return turns(chart.run.y)
    matrices: Array = system.rotation(np.clip(chart.run.y, -LARGEST, LARGEST), axis=1)
    return matrices


def turns(y: Array) -> Array:
    """The rotation matrices of quaternions, shape (n, 4), of any length; shape (3, 3, n)."""
    with np.errstate(all="ignore"):
        return rotation_of_quaternion((y / np.abs(y).max(axis=1, keepdims=True)).T)


# ---- angles and angular velocity over time


def angle_panels(figure: Figure, chart: RunPicture, place: tuple[float, float, float, float]) -> list[Axes]:
    """A panel for each of the three angles, one above the other."""
    left, bottom, width, height = place
    system: Any = chart.run.system
    t, good = chart.run.t, chart.finite
    few = len(t) <= MOST_MARKED
    with np.errstate(all="ignore"):
        angles = np.clip(system.angles(chart.run.y, axis=1), -LARGEST, LARGEST)
    panels: list[Axes] = []
    each = (height - 2 * GAP) / 3
    for i, name in enumerate(ANGLES):
        axes = figure.add_axes((left, bottom + (2 - i) * (each + GAP), width, each))
        axes.set_title(f"{name}, degrees", loc="left", size=13.5)
        line = np.where(good, angles[:, i], np.nan)
        axes.plot(*broken(t, line), color="black", linewidth=1.5, marker="." if few else "", markersize=3.6, zorder=3)
        labels = [(name.split()[1], line, "black")]
        if i < 2 and not np.isnan(commanded := system.commanded(name.split()[0], t)).all():
            axes.plot(t, commanded, **COMMANDED)
            labels.append(("commanded", commanded, COMMANDED["color"]))
        over_time(axes, chart)
        _scaled(axes)
        label_ends(axes, t, labels)
        panels.append(axes)
    for axes in panels[:-1]:
        axes.tick_params(labelbottom=False)
    panels[-1].set_xlabel("time")
    return panels


def angular_velocity(axes: Axes, chart: RunPicture) -> None:
    """The three angular velocities over time, above the exact ones if they are known."""
    if chart.exact is not None:
        for each in chart.exact[1].T:
            axes.plot(chart.exact[0], each, **EXACT)
    v = np.where(chart.finite[:, np.newaxis], np.clip(chart.run.v, -LARGEST, LARGEST), np.nan)
    labels = []
    for i, (name, colour, line) in enumerate(RATES):
        axes.plot(chart.run.t, v[:, i], color=colour, linestyle=line, linewidth=1.5, zorder=3)
        labels.append((name, v[:, i], colour))
    axes.set_title("angular velocity, rad per unit of time", loc="left", size=13.5)
    over_time(axes, chart)
    _scaled(axes)
    label_ends(axes, chart.run.t, labels)
    axes.set_xlabel("time")


def broken(t: Array, angles: Array) -> tuple[Array, Array]:
    """Angles over time, with a gap where they jump by more than half a turn, as they do at ±180°."""
    with np.errstate(invalid="ignore"):
        jumps = np.flatnonzero(np.abs(np.diff(angles)) > 180.0) + 1
    return np.insert(t, jumps, t[jumps]), np.insert(angles, jumps, np.nan)


def _scaled(axes: Axes) -> None:
    """A scale that holds zero, with room at its ends."""
    values = np.concatenate([np.asarray(line.get_ydata(), dtype=np.float64) for line in axes.lines])
    values = values[np.isfinite(values)]
    low, high = min(0.0, values.min(initial=0.0)), max(0.0, values.max(initial=0.0))
    room = 0.1 * (high - low) or 1.0
    axes.set_ylim(low - room, high + room)


def label_ends(axes: Axes, t: Array, labels: list[tuple[str, Array, str]]) -> None:
    """The name of each line at its right end, beside the panel; names that would cover each other are moved apart."""
    low, high = axes.get_ylim()
    ends = [
        ((float(known[-1]) - low) / (high - low), name, colour) for name, line, colour in labels if len(known := _known(line))
    ]
    heights: list[float] = []
    for height, _, _ in sorted(ends):
        heights.append(max([height, *(each + LABEL_DISTANCE for each in heights[-1:])]))
    over = max([0.0, *(each - 1.0 for each in heights[-1:])])
    for height, (_, name, colour) in zip(heights, sorted(ends), strict=True):
        axes.text(1.008, height - over, name, transform=axes.transAxes, color=colour, va="center", size=12)


def _known(line: Array) -> Array:
    return line[np.isfinite(line)]


# ---- the aircraft in space


def space(axes: Axes) -> None:
    """A panel without scales: the horizontal circle around the aircraft, and the direction from which yaw is counted."""
    screen = viewed()
    around = np.linspace(0.0, 2.0 * np.pi, 121)
    circle = CIRCLE * np.stack([np.cos(around), np.sin(around), np.zeros_like(around)], axis=-1)
    axes.plot(*screen.flat(circle).T, color="#c8c8c8", linewidth=1.0, zorder=0)
    ahead = screen.flat(np.array([[0.0, 0.0, 0.0], [CIRCLE, 0.0, 0.0]]))
    axes.plot(*ahead.T, color="#c8c8c8", linewidth=1.0, linestyle=(0, (2, 2)), zorder=0)
    axes.set(xlim=(-HALF_SIDE, HALF_SIDE), ylim=(-0.85 * HALF_SIDE, 0.85 * HALF_SIDE), xticks=[], yticks=[])
    axes.set_aspect("equal")
    axes.axis("off")


def solid(axes: Axes, parts: Parts, screen: Seen | None = None) -> Callable[[Array], None]:
    """A body of flat parts on a panel, and what turns it by a rotation matrix: parts that are nearer cover the others."""
    from matplotlib.patches import Polygon

    screen = screen or viewed()
    corners = {name: np.array(points) for name, (points, _) in parts.items()}
    look: dict[str, Any] = {"closed": True, "edgecolor": "black", "linewidth": 0.9}
    drawn = {name: Polygon(np.zeros((3, 2)), facecolor=fill, **look) for name, (_, fill) in parts.items()}
    for part in drawn.values():
        axes.add_patch(part)

    def show(matrix: Array) -> None:
        for name, points in corners.items():
            turned = points @ matrix.T
            drawn[name].set_xy(screen.flat(turned))
            drawn[name].set_zorder(3.0 + 0.1 * float(turned.mean(axis=0) @ screen.near))

    return show


def animated(figure: Figure, chart: RunPicture) -> Callable[[int], None]:
    """The aircraft as it lies now, beside the panels of the angles."""
    axes = figure.add_axes((0.012, 0.06, 0.5, 0.8))
    space(axes)
    axes.text(0.5, 0.02, "dark wing: the right one", transform=axes.transAxes, ha="center", color=GREY, size=13)
    show, matrices = solid(axes, PARTS), rotation(chart)
    return lambda frame: show(matrices[..., frame])
