"""What a picture must be to be read where pages show it: checked on what is drawn, not on what was asked for."""

from __future__ import annotations

import re

import numpy as np
from matplotlib.colors import to_rgb
from matplotlib.text import Text
from stepwell.views.charts.style import CONTRAST, contrast

#: The width in pixels at which the site shows a picture, and the least size of its letters there.
SHOWN, LEAST = 736, 9.0

#: A picture is divided into so many cells; of these at most this share may be blank.
CELLS, BLANK = (16, 9), 0.45

#: More names than these in one legend are not read.
NAMES = 8

#: Texts overlap if their boxes do by more than this share of the lower one's height: boxes have air above and below letters.
AIR = 0.2

#: A class with its arguments, as Python writes it.
REPR = re.compile(r"\barray\(|\b[A-Z]\w*\([^)]*(?:=|\[)")


def drawn_texts(figure):
    """The figure's pixels, and each text that is drawn with its box."""
    texts = {}
    draw = Text.draw

    def record(self, renderer, *args, **options):
        if self.get_visible() and self.get_text().strip():
            texts[id(self)] = self, self.get_window_extent(renderer)
        return draw(self, renderer, *args, **options)

    Text.draw = record
    try:
        figure.canvas.draw()
    finally:
        Text.draw = draw
    return np.asarray(figure.canvas.buffer_rgba())[..., :3], list(texts.values())


def faults(figure):
    """What is wrong with a picture, one sentence each."""
    pixels, texts = drawn_texts(figure)
    page = figure.bbox
    said = []
    for text, box in texts:
        name = text.get_text().replace("\n", " ")[:40]
        size = text.get_fontsize() * figure.dpi / 72.0 * SHOWN / page.width
        if size < LEAST - 0.05:
            said.append(f"{name!r} has {size:.1f} pixels")
        if contrast(to_rgb(text.get_color()), ground(pixels, box)) < CONTRAST:
            said.append(f"{name!r} is too pale: {text.get_color()}")
        if box.x0 < page.x0 - 1 or box.y0 < page.y0 - 1 or box.x1 > page.x1 + 1 or box.y1 > page.y1 + 1:
            said.append(f"{name!r} leaves the picture")
        if REPR.search(text.get_text()):
            said.append(f"{name!r} is Python")
    for i, (text, box) in enumerate(texts):
        for other, another in texts[:i]:
            high = min(box.y1, another.y1) - max(box.y0, another.y0)
            wide = min(box.x1, another.x1) - max(box.x0, another.x0)
            if wide > 1.0 and high > AIR * min(box.height, another.height):
                said.append(f"{text.get_text()[:30]!r} is on {other.get_text()[:30]!r}")
    for axes in figure.axes:
        legend = axes.get_legend()
        if legend is not None and len(legend.get_texts()) > NAMES:
            said.append(f"{len(legend.get_texts())} names in a legend")
        if axes.get_visible() and axes.axison and not (axes.lines or axes.patches or axes.collections or axes.images):
            said.append(f"the panel {axes.get_title(loc='left')!r} is empty")
    if (share := blank(pixels)) > BLANK:
        said.append(f"{100 * share:.0f} % are blank")
    return said


def ground(pixels, box):
    """The colour of most of the pixels in a text's box."""
    height = len(pixels)
    part = pixels[max(0, int(height - box.y1)) : int(height - box.y0) + 1, max(0, int(box.x0)) : int(box.x1) + 1]
    colours, times = np.unique(part.reshape(-1, 3) @ [1 << 16, 1 << 8, 1], return_counts=True)
    if not len(colours):
        return (1.0, 1.0, 1.0)
    most = int(colours[times.argmax()])
    return tuple((most >> shift & 255) / 255.0 for shift in (16, 8, 0))


def blank(pixels):
    """The share of cells in which nothing is drawn."""
    across, down = CELLS
    rows = np.array_split((pixels != 255).any(axis=2), down, axis=0)
    cells = [cell.any() for row in rows for cell in np.array_split(row, across, axis=1)]
    return 1.0 - float(np.mean(cells))
