"""Pictures of environments: lines in metres, drawn by matplotlib's Agg, in windows only where they are asked for."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from ...base.pictures import new_figure

Frame = np.ndarray[Any, np.dtype[np.uint8]]
#: Width and height of a frame in inches, and dots an inch.
SIZE, DPI = (6.0, 4.0), 100
#: Colours of what moves, of what carries it, and of what is fixed.
MOVING, CARRYING, FIXED = "#c75a22", "#175ca6", "#b8b8b8"
#: The most frames that a window shows side by side.
MOST_TILES = 16


class Line(NamedTuple):
    """A line of a sketch.

    Attributes:
        points: its corners (x, y), in the units of the view; of a single one a disc is drawn.
        width: its width in points, 1/72 inch; of a disc its diameter.
        colour: its colour.
    """

    points: Sequence[tuple[float, float]]
    width: float = 5.0
    colour: str = MOVING


class Camera:
    """Draws sketches of one view (left, right, bottom and top of what is seen), each as a frame of its own."""

    def __init__(self, view: tuple[float, float, float, float]) -> None:
        self._figure = new_figure(*SIZE, dpi=DPI)
        left, right, bottom, top = view
        self._axes = self._figure.add_axes((0.0, 0.0, 1.0, 1.0))
        self._axes.set(xlim=(left, right), ylim=(bottom, top), aspect="equal")
        self._axes.set_axis_off()
        self._lines: list[Any] = []

    def frame(self, lines: Sequence[Line]) -> Frame:
        """The picture of a sketch, shape (height, width, 3)."""
        while len(self._lines) < len(lines):
            self._lines += self._axes.plot([], [], solid_capstyle="round", solid_joinstyle="round")
        for artist in self._lines[len(lines) :]:
            artist.set_data([], [])
        for artist, line in zip(self._lines, lines, strict=False):
            single = len(line.points) == 1
            artist.set_data(*zip(*line.points, strict=True))
            artist.set(color=line.colour, linewidth=line.width, marker="o" if single else "", markersize=line.width)
        canvas: Any = self._figure.canvas
        canvas.draw()
        return np.array(np.asarray(canvas.buffer_rgba())[..., :3])


def tiled(frames: Sequence[Frame]) -> Frame:
    """Frames side by side and below each other, as one picture."""
    columns = int(np.ceil(np.sqrt(len(frames))))
    rows = -(-len(frames) // columns)
    blank = np.full_like(frames[0], 255)
    cells = [*frames, *[blank] * (rows * columns - len(frames))]
    return np.concatenate([np.concatenate(cells[k * columns : (k + 1) * columns], axis=1) for k in range(rows)], axis=0)


class Window:
    """Shows frames in a window of matplotlib's pyplot; where its backend has none, nothing is seen."""

    def __init__(self) -> None:
        import matplotlib.pyplot as plt

        self._plt = plt
        self._figure, axes = plt.subplots(figsize=SIZE)
        self._figure.subplots_adjust(0.0, 0.0, 1.0, 1.0)
        axes.set_axis_off()
        self._axes = axes
        self._image: Any = None

    def show(self, frame: Frame, seconds: float) -> None:
        """Show a frame for so long."""
        if self._image is None:
            self._image = self._axes.imshow(frame)
            self._plt.show(block=False)
        else:
            self._image.set_data(frame)
        self._figure.canvas.draw_idle()
        self._plt.pause(seconds)

    def close(self) -> None:
        """Close the window."""
        self._plt.close(self._figure)
