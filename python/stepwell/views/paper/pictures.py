"""Hoffmann's pictures: motions of scenes, and those for which there is no chart."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from ...base.arrays import Array
from ...base.pictures import drawn
from ...scenes import scene
from ..charts import run_picture
from ..charts.style import GREY, Figure, page

#: The colours of three bodies. They differ in lightness, too, so that they can be told apart in grey.
BODIES = ("#0072b2", "#e69f00", "#222222")


def motion(name: str, **options: Any) -> Callable[[Path], object]:
    """Draws the motion of a scene by False Euler."""

    def draw(path: Path) -> object:
        moving = scene(name)
        return run_picture(moving, moving.run("false_euler", every=1, **options)).plot(path)

    return draw


def paths(path: Path, title: str, about: str, panels: Sequence[tuple[str, Array]], reach: float) -> object:
    """Draw paths of bodies in the plane into a file, in panels side by side of the same scale, up to ``reach`` on each side.

    A panel is its title and the positions, shape (saved, bodies, 2); ``about`` is the line below the title.
    """

    def draw() -> Figure:
        width, height = 6.2 * len(panels) + 0.6, 7.6
        with page(width, height) as figure:
            places = {"left": 0.06, "right": 0.985, "bottom": 0.95 / height, "top": 1.0 - 1.7 / height, "wspace": 0.12}
            row = figure.subplots(1, len(panels), sharex=True, sharey=True, squeeze=False, gridspec_kw=places)[0]
            for axes, (title, y) in zip(row, panels, strict=True):
                for body, colour in zip(range(y.shape[1]), BODIES, strict=False):
                    axes.plot(*y[:, body].T, color=colour, linewidth=0.5)
                    axes.plot(*y[0, body], "o", color=colour, markersize=9, markeredgecolor="white", zorder=5)
                axes.set(xlim=(-reach, reach), ylim=(-reach, reach), xlabel="x", aspect="equal")
                axes.set_title(title, loc="left", size=15, weight="bold")
            row[0].set_ylabel("y")
            figure.text(0.015, 1.0 - 0.5 / height, title, size=20, weight="bold")
            figure.text(0.015, 1.0 - 0.9 / height, about, size=13, color=GREY)
            figure.text(
                0.015, 0.2 / height, "Dots: the start. One colour per body; lengths in units of the start's.", size=12, color=GREY
            )
        return figure

    return drawn(path, draw)
