"""Figures of matplotlib, and writing them to files."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

from ..errors import ArgumentError, UnsupportedError
from . import registry
from .paths import file

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def new_figure(width: float, height: float, dpi: float = 100.0) -> Figure:
    """An empty figure of that size in inches and so many dots an inch, which leaves pyplot's global state as it is.

    Raises:
        UnsupportedError: if matplotlib is missing.
    """
    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except ImportError:
        raise UnsupportedError("plot: a picture needs matplotlib; pip install 'stepwell[chart]'") from None
    figure = Figure(figsize=(width, height), dpi=dpi)
    FigureCanvasAgg(figure)
    # A notebook knows how to show matplotlib's figures only after pyplot was imported.
    vars(figure)["_repr_png_"] = partial(png, figure)
    return figure


def png(figure: Figure, dpi: float | None = None) -> bytes:
    """A figure as the bytes of a .png file in RGB, because printers differ in what they make of transparency."""
    from PIL import Image

    drawn, written = BytesIO(), BytesIO()
    figure.savefig(drawn, format="png", facecolor="white", dpi=dpi or "figure", pil_kwargs={"compress_level": 1})
    with Image.open(drawn) as picture:
        picture.convert("RGB").save(written, format="png", dpi=picture.info.get("dpi", (figure.dpi, figure.dpi)))
    return written.getvalue()


def drawn(path: str | Path | None, draw: Callable[[], Figure]) -> Figure:
    """Draw a figure, and write it if there is a path, whose suffix is the format.

    Raises:
        ArgumentError: before anything is drawn, if there is no such format or the file cannot be written.
        UnsupportedError: if matplotlib is missing.
    """
    if path is None:
        return draw()
    known = sorted(new_figure(1.0, 1.0).canvas.get_supported_filetypes())
    if (path := file("path", path)).suffix.lower().removeprefix(".") not in known:
        raise ArgumentError(f"path: expected an ending of a picture, one of {', '.join(known)}, got {str(path)!r}")
    figure = draw()
    if path.suffix.lower() == ".png":
        path.write_bytes(png(figure))
    else:
        figure.savefig(path, facecolor="white")
    return figure


class Drawn:
    """A chart with one picture."""

    #: The registered task that draws it.
    _painter: ClassVar[str]

    def draw(self) -> Figure:
        """The picture, on a new figure."""
        figure: Figure = registry.task(self._painter)(self)
        return figure

    def plot(self, path: str | Path | None = None) -> Figure:
        """Draw the picture, and write it to ``path`` if given; the suffix is the format.

        Raises:
            ArgumentError: if there is no such format.
            UnsupportedError: if matplotlib is missing.
        """
        return drawn(path, self.draw)
