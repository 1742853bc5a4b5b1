"""The panels of the picture of a run as data: series over time, points on a plane, and coordinates side by side.

The picture, the frames of an animation and the page each draw these.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from ...base.arrays import Array
from .kinds import FixedPoint
from .runs import LARGEST, RunPicture
from .solids import viewed

#: The most saved states of a curve with a mark at each state: of a swing, and of an angle.
MOST_MARKED, MOST_MARKED_ANGLES = 150, 250

#: The angular velocities: name, colour and dashes.
RATES: tuple[tuple[str, str, Any], ...] = (
    ("ω₁", "#000000", "-"),
    ("ω₂", "#5a5a5a", (0, (6, 2))),
    ("ω₃", "#8c8c8c", (0, (1.5, 1.2))),
)
#: The angles of an aircraft, and the look of the commanded ones.
ANGLES = ("roll φ", "pitch θ", "yaw ψ")
COMMANDED: dict[str, Any] = {"colour": "#7a7a7a", "width": 1.6, "dashes": (0, (5, 2)), "front": False}

#: The errors of the run without control, and how far its curve may widen the scale.
BEFORE: dict[str, Any] = {"colour": "#9a9a9a", "width": 1.8, "front": False}
FARTHEST_BEFORE = 1e14

#: The view ends at this many times the size of the exact motion; without one, at this many times that of the start.
VIEW_FACTOR, VIEW_FACTOR_FROM_START = 4.0, 30.0

#: The direction from which falling points are seen: degrees from the first axis, and above the horizontal.
FALLING = viewed(-60.0, 15.0)


# ---- over time


class Line(NamedTuple):
    """A curve over the times of the saved states; NaN where nothing is drawn."""

    values: Array
    width: float = 1.5
    colour: str = "black"
    dashes: Any = "-"
    marker: str = ""
    name: str = ""  # at its right end
    front: bool = True  # above the others


@dataclass(frozen=True, eq=False)
class Series:
    """A panel of curves over time."""

    title: str
    lines: tuple[Line, ...]  # the main one first
    limits: tuple[float, float] | None = None  # None for those of the curves
    label: str = ""  # beside the scale
    exact: tuple[Array, ...] = ()  # at the times of RunPicture.exact
    log: bool = False
    angles: bool = False  # the main curve jumps at ±180°
    missing: str = ""  # in place of curves that are not known
    not_finite: int | None = None  # the first such state
    known_until: float | None = None
    note: str = ""


def swings(chart: RunPicture) -> list[Series]:
    """The coordinate and, if there is one, the velocity."""
    exact = (None, None) if chart.exact is None else chart.exact[1:]
    blocks = [("y", chart.run.y, exact[1])]
    if chart.run.v[0].size:  # a system of first order has none
        blocks.append(("v", chart.run.v, exact[0]))
    return [_swing(chart, *block) for block in blocks]


def _swing(chart: RunPicture, name: str, block: Array, exact: Array | None) -> Series:
    values = _drawn(chart, block)
    size = seen_size(values, values if exact is None else exact)
    note = "The curve leaves the picture." if np.nanmax(np.abs(values)) > size else ""
    line = Line(values, width=1.1, marker="o" if chart.finite.sum() <= MOST_MARKED else "")
    limit = 1.12 * (size or 1.0)
    return Series("", (line,), (-limit, limit), name, () if exact is None else (exact,), note=note)


def seen_size(values: Array, known: Array) -> float:
    """The size up to which values are shown: their own, but at least that of the exact values and at most three times that."""
    right, size = float(np.nanmax(np.abs(known))), float(np.nanmax(np.abs(values)))
    return min(3.0 * right, max(right, size)) or size


def angles(chart: RunPicture) -> list[Series]:
    """The angles of an aircraft, with the commanded ones."""
    system: Any = chart.run.system
    with np.errstate(all="ignore"):
        degrees = _drawn(chart, system.angles(chart.run.y, axis=1))
    marker = "." if len(chart.run.t) <= MOST_MARKED_ANGLES else ""
    panels = []
    for i, name in enumerate(ANGLES):
        word, letter = name.split()
        lines = [Line(degrees[:, i], marker=marker, name=letter)]
        if i < 2 and not np.isnan(commanded := system.commanded(word, chart.run.t)).all():
            lines.append(Line(commanded, name="commanded", **COMMANDED))
        panels.append(Series(f"{name}, degrees", tuple(lines), _around(lines), angles=True))
    return panels


def angular_velocity(chart: RunPicture) -> Series:
    """The three angular velocities."""
    v = _drawn(chart, chart.run.v)
    lines = [Line(v[:, i], colour=colour, dashes=dashes, name=name) for i, (name, colour, dashes) in enumerate(RATES)]
    exact = () if chart.exact is None else tuple(chart.exact[1].T)
    return Series("angular velocity, rad per unit of time", tuple(lines), _around(lines, exact), exact=exact)


def _drawn(chart: RunPicture, values: Array) -> Array:
    """Values of saved states; NaN where these are not finite."""
    finite = chart.finite.reshape(-1, *[1] * (values.ndim - 1))
    return np.where(finite, np.clip(values, -LARGEST, LARGEST), np.nan)


def _around(lines: list[Line], exact: tuple[Array, ...] = ()) -> tuple[float, float]:
    """A scale that holds all curves and zero, with room at its ends."""
    values = np.concatenate([line.values for line in lines] + list(exact))
    values = values[np.isfinite(values)]
    low, high = min(0.0, values.min(initial=0.0)), max(0.0, values.max(initial=0.0))
    room = 0.1 * (high - low) or 1.0
    return low - room, high + room


def errors(chart: RunPicture, before: RunPicture | None = None) -> tuple[Series, Series]:
    """The errors of energy and of state, with those of the run without control if it is given."""
    energy = _error(chart, "energy error", chart.energy_error, None if before is None else before.energy_error)
    state = _error(chart, "state error", chart.state_error, None if before is None else before.state_error)
    if chart.energy_error is None:
        if (values := chart.energy) is None:
            energy = Series(energy.title, (), missing="no energy of its own")
        else:
            line = Line(np.where(chart.finite, values, np.nan), width=1.0)
            energy = Series("energy over time; forces take or give it", (line,))
    return energy, state


def _error(chart: RunPicture, name: str, error: Array | None, before: Array | None) -> Series:
    title = f"{name} over time, relative"
    if error is None:
        missing = "no exact solution, so no state error:\na correct energy alone does not\nmake a motion correct"
        return Series(title, (), missing=missing)
    shown = np.isfinite(error) & (error > 0.0)
    low, high = (float(error[shown].min()), float(error[shown].max())) if shown.any() else (1e-17, 1e-15)
    lines, least = [Line(np.where(shown, error, np.nan), width=1.0)], 1e-9
    if before is not None:
        known = np.isfinite(before) & (before > 0.0)
        if known.any():
            high = max(high, min(float(before[known].max()), FARTHEST_BEFORE * high))
            low = min(low, max(float(np.median(before[known])), low / FARTHEST_BEFORE))
        least = 1.0 / FARTHEST_BEFORE
        lines.append(Line(np.where(known, before, np.nan), **BEFORE))
    low = max(low, least * high)  # the first steps, or a passage through zero, would press the rest together
    return Series(
        title,
        tuple(lines),
        (0.4 * low, 3.0 * min(high, 1e300)),
        log=True,
        not_finite=int(np.argmax(np.isinf(error))) if np.isinf(error).any() else None,
        known_until=chart.scene.until if np.isnan(error).any() else None,
    )


# ---- points on a plane


@dataclass(frozen=True, eq=False)
class Points:
    """Points on a plane, and the visible square."""

    places: Array  # of the saved states, shape (saved, points, 2)
    exact: Array | None  # at the times of RunPicture.exact
    fixed: list[FixedPoint]
    centre: Array
    half: float  # of the square's side
    name: str = ""  # from where it is seen, in space

    def leave(self, half: float) -> bool:
        """True if a point leaves the square whose sides have this distance from the centre."""
        return bool((np.abs(self.places - self.centre) > half).any())


def on_plane(chart: RunPicture, plane: tuple[int, int] = (0, 1)) -> Points:
    """The points as seen along an axis; the square holds all that is not far away."""

    def flat(places: Array) -> Array:
        return places[..., plane]

    name = f"seen along {'xyz'[3 - sum(plane)]}" if chart.places.shape[2] == 3 else ""
    points = _seen(chart, flat, name)
    known, far = (chart.places[:1], VIEW_FACTOR_FROM_START) if chart.exact_places is None else (chart.exact_places, VIEW_FACTOR)
    reach = far * max(float(np.abs(known).max()), 1e-300)
    every = np.concatenate([flat(known).reshape(-1, 2), points.places.reshape(-1, 2)])
    return _in_square(points, every[(np.abs(every) <= reach).all(axis=1)])


def view_of(chart: RunPicture) -> Points:
    """The points as they are seen: those that hang from the front and above, others along an axis."""
    return falling(chart) if is_hanging(chart) else on_plane(chart)


def is_hanging(chart: RunPicture) -> bool:
    """True if points in space hang on springs, rods or fixed points."""
    return chart.places.shape[2] == 3 and bool(len(chart.links) or chart.fixed_points)


def falling(chart: RunPicture) -> Points:
    """Points in space that hang or fall, as seen from the front, to the right and above."""
    points = _seen(chart, FALLING.flat, "seen from the front, to the right and above")
    return _in_square(points, points.places.reshape(-1, 2))


def _seen(chart: RunPicture, flat: Callable[[Array], Array], name: str) -> Points:
    fixed = [each._replace(place=tuple(flat(np.array(each.place)).tolist())) for each in chart.fixed_points]
    exact = None if chart.exact_places is None else flat(chart.exact_places)
    places = flat(np.clip(chart.places[chart.finite], -LARGEST, LARGEST))
    return Points(places, exact, fixed, np.zeros(2), 1.0, name)


def _in_square(points: Points, shown: Array) -> Points:
    """The points in a square that holds those that are shown, and all that is fixed."""
    shown = np.concatenate([shown, *(np.array([each.place]) for each in points.fixed)])
    low, high = shown.min(axis=0), shown.max(axis=0)
    half = 0.54 * float((high - low).max())
    return replace(points, centre=0.5 * (low + high), half=half)


# ---- coordinates side by side


class SideBySide(NamedTuple):
    """The coordinates by their number, one state at a time."""

    values: Array  # shape (saved, n)
    size: float  # up to which they are shown


def side_by_side(chart: RunPicture) -> SideBySide:
    """All coordinates of the saved states."""
    values = np.clip(chart.run.y.reshape(len(chart.run.t), -1), -LARGEST, LARGEST)
    size = seen_size(values[chart.finite], values[:1] if chart.exact is None else chart.exact[2])
    return SideBySide(values, max(size, 1e-300))
