"""Labels that stand beside their curves in place of a legend, and never on each other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...base.arrays import Array
from .style import Axes, Figure, ink

#: Places that are tried along a curve, points of a curve that a label should not cover, and pixels from a curve to its label.
ANCHORS, POINTS, GAP = 24, 240, 7.0

#: A name at the end of a curve is so far from it, as a share of the width of the axes, with a line between them.
LEADER = 0.025

#: Air on each side of a label, in pixels.
AIR = 1.5


@dataclass(frozen=True, eq=False)
class Label:
    """A curve's name: its points in the units of the axes, shape (n, 2), and the keywords of the text."""

    text: str
    points: Array
    style: dict[str, Any]


#: The places of a label beside a point of its curve: its corner, as shares of its width and height.
PLACES = ((0.0, -0.5, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, 0.0), (-1.0, -0.5, 0.0), (-1.0, 0.0, 0.0), (-1.0, -1.0, 0.0))

#: The label of a single point may also be so many of its heights above or below it, with a line to it.
FARTHER = tuple((dx, dy, 1.15 * rows) for rows in range(1, 9) for dy in (-1.0, 0.0) for dx in (0.0, -0.5, -1.0))


def beside(axes: Axes, labels: Sequence[Label], keep_off: Sequence[tuple[float, float, float, float]] = ()) -> list[str]:
    """Put each label where it covers least, the first ones first; those for which there is no room are returned.

    The axes must have their final limits. A label lies within the axes and overlaps no other, and none of the boxes ``keep_off``
    (left, bottom, right, top, in pixels).
    """
    figure: Any = axes.get_figure()
    renderer = figure.canvas.get_renderer()
    frame = axes.get_window_extent(renderer)
    curves = [_pixels(axes, label.points) for label in labels]
    covered = np.concatenate([_dense(curve, POINTS) for curve in curves] or [np.empty((0, 2))])
    taken: list[Any] = [tuple(text.get_window_extent(renderer).extents) for text in axes.texts if text.get_text()]
    taken += keep_off
    left: list[str] = []
    for label, curve in zip(labels, curves, strict=True):
        style = label.style | ({"color": ink(label.style["color"])} if "color" in label.style else {})
        text = axes.text(0.0, 0.0, label.text, transform=None, ha="left", va="bottom", zorder=6, **style)
        size = text.get_window_extent(renderer)
        width, height = size.width + 2 * AIR, size.height + 2 * AIR
        best: tuple[float, float, float] | None = None
        inside = curve[
            (curve[:, 0] >= frame.x0) & (curve[:, 0] <= frame.x1) & (curve[:, 1] >= frame.y0) & (curve[:, 1] <= frame.y1)
        ]
        single = len(curve) == 1
        for place, (x, y) in enumerate(_dense(inside, ANCHORS)[::-1]):
            for dx, dy, rows in PLACES + FARTHER if single else PLACES:
                low_x = x + (GAP if dx == 0.0 else -GAP) + dx * width
                low_y = y + dy * height + (GAP + rows * height) * (2.0 * dy + 1.0)
                box = (low_x, low_y, low_x + width, low_y + height)
                out = box[0] < frame.x0 or box[1] < frame.y0 or box[2] > frame.x1 or box[3] > frame.y1
                if out or any(_overlap(box, other) for other in taken):
                    continue
                hidden = (covered[:, 0] > box[0]) & (covered[:, 0] < box[2]) & (covered[:, 1] > box[1]) & (covered[:, 1] < box[3])
                # The fine end of a curve is where curves are farthest apart.
                cost = float(hidden.sum()) + 0.2 * place + 0.3 * rows
                if best is None or cost < best[0]:
                    best = (cost, low_x, low_y)
        if best is None:
            text.remove()
            left.append(label.text)
            continue
        _, low_x, low_y = best
        taken.append((low_x, low_y, low_x + width, low_y + height))
        at = axes.transData.inverted().transform((low_x + AIR, low_y + AIR))
        text.set_transform(axes.transData)
        text.set_position((float(at[0]), float(at[1])))
        if single and not low_y - 2.0 * GAP <= curve[0, 1] <= low_y + height + 2.0 * GAP:
            end = axes.transData.inverted().transform(
                (float(np.clip(curve[0, 0], low_x, low_x + width)), low_y if low_y > curve[0, 1] else low_y + height)
            )
            axes.plot(*np.array([label.points[0], end]).T, color=text.get_color(), linewidth=0.7, zorder=1.5)
    return left


def at_ends(axes: Axes, ends: Sequence[tuple[float, float, str, str]], size: float, room: float) -> None:
    """The names of curves at their right ends, given as x, y, name and colour; those nearer than ``room`` are moved apart.

    ``room`` is a share of the height of the axes, which must have their final limits. The names begin a little to the right of
    the ends, and may leave the axes there.
    """
    axes.get_ylim()  # a scale that is still free is found now
    to_axes = axes.transData + axes.transAxes.inverted()
    placed = sorted((float(to_axes.transform((x, y))[1]), float(to_axes.transform((x, y))[0]), name, c) for x, y, name, c in ends)
    heights: list[float] = []
    for height, *_ in placed:
        heights.append(max([height, *(each + room for each in heights[-1:])]))
    # What was moved past the top is moved down again, and what is below it with it.
    top = 1.0 - 0.5 * room
    for i in reversed(range(len(heights))):
        heights[i] = min(heights[i], top)
        top = heights[i] - room
    for height, (at, x, name, colour) in zip(heights, placed, strict=True):
        line: dict[str, Any] = {
            "color": ink(colour),
            "linewidth": 0.9,
            "clip_on": False,
            "transform": axes.transAxes,
            "zorder": 5,
            "scalex": False,
        }
        axes.plot([x + 0.004, x + LEADER], [at, height], scaley=False, **line)
        axes.text(
            x + 1.2 * LEADER, height, name, transform=axes.transAxes, color=ink(colour), size=size, weight="bold", va="center"
        )


def title(figure: Figure, x: float, y: float, text: str, size: float) -> None:
    """A bold title at that place of the page, smaller where it would leave it."""
    drawn = figure.text(x, y, text, size=size, weight="bold")
    canvas: Any = figure.canvas
    box = drawn.get_window_extent(canvas.get_renderer())
    room = figure.bbox.width * (1.0 - x) - 10.0
    if box.width > room:
        drawn.set_fontsize(0.98 * size * room / box.width)  # letters do not shrink quite in proportion


def _pixels(axes: Axes, points: Array) -> Array:
    """The points of a curve on the page, without those that cannot be drawn."""
    finite = points[np.isfinite(points).all(axis=1)]
    if axes.get_yscale() == "log":
        finite = finite[finite[:, 1] > 0.0]
    return np.asarray(axes.transData.transform(finite)) if len(finite) else np.empty((0, 2))


def _dense(curve: Array, number: int) -> Array:
    """So many points at equal distances along a curve."""
    if len(curve) < 2:
        return curve
    way = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(curve, axis=0).T))])
    at = np.linspace(0.0, way[-1], number)
    return np.stack([np.interp(at, way, curve[:, 0]), np.interp(at, way, curve[:, 1])], axis=1)


def _overlap(a: Sequence[float], b: Sequence[float]) -> bool:
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]
