"""The look of a method in every picture: the colour of its family and its own marker; the line shows its order."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from ...base.pictures import new_figure
from ...model.methods import Method
from ...model.methods import methods as every_method

if TYPE_CHECKING:
    from matplotlib.axes import Axes as Axes
    from matplotlib.figure import Figure as Figure
else:
    Axes = Figure = Any  # matplotlib is imported when something is drawn

MARKERS: tuple[Any, ...] = (
    *"osD^vPh*<>pdX8H",
    *((4, 1, 0), (6, 1, 0), (3, 1, 0), (8, 1, 0), (3, 1, 180), (4, 1, 45), (3, 1, 90), (3, 1, 270), (5, 1, 180)),
    *((7, 1, 0), (5, 0, 180), (6, 1, 30), (4, 1, 22), (9, 1, 0)),
)
#: A colour for each family of methods, the same in every chart. No two are alike in grey, in print, or to an eye without green
#: cones: tests/views/test_looks.py measures them.
FAMILIES = {
    "Euler": "#efb02e",
    "leapfrog": "#25a985",
    "Heun": "#c75a22",
    "Runge-Kutta": "#175ca6",
    "PEFRL": "#74194f",
    "Dormand-Prince": "#10123a",
}
COLOURS = tuple(FAMILIES.values())
#: The colour of curves that are not the finding.
PALE = "#b8b8b8"
#: For a second, third and fourth method of one family.
SECOND = ("#111111", "#666666", "#999999")
PEERS = "1234+|"
#: The line shows the order: the higher, the more solid.
LINES = {1: (0, (1, 1.2)), 2: (0, (5, 2)), 3: (0, (8, 1.8)), 5: (0, (12, 1.5)), 8: (0, (24, 1.2))}
GREY = "#666666"

#: The least contrast of text on white (WCAG 2, level AA).
CONTRAST = 4.5

#: The exact motion of a run, below all else.
EXACT: dict[str, Any] = {"color": "#d4d4d4", "linewidth": 5.0, "zorder": 1, "solid_capstyle": "round"}

#: A curve of more states than this is drawn thin and without dashes, and as pixels in vector files.
LONG_CURVE = 3000

#: Where the panels of a run's picture are, as shares of width and height.
BOTTOM, TOP, RIGHT = 0.19, 0.845, 0.978

#: The size of a page in inches on which 11 points are still 9 pixels where a site shows pictures 736 pixels wide, and its dots an
#: inch, which make it 1600 pixels wide.
SIZE, DPI = (12.5, 7.03125), 128.0

#: Sizes in points.
FONT: Any = {"font.size": 14.0, "axes.labelsize": 14.0, "legend.fontsize": 12.0}


@contextmanager
def page(
    width: float = 16.0, height: float = 9.0, dpi: float = 100.0, *, options: dict[str, Any] | None = None
) -> Iterator[Figure]:
    """A new figure, on which text has the sizes of ``FONT``; options are matplotlib's."""
    figure = new_figure(width, height, dpi)
    from matplotlib import rc_context

    with rc_context(FONT | (options or {})):
        yield figure


def ink(colour: str) -> str:
    """The colour of a text that belongs to marks of that colour: darker where its contrast on white would be too small."""
    from matplotlib.colors import to_hex, to_rgb

    rgb = to_rgb(colour)
    share = 1.0
    while contrast((share * rgb[0], share * rgb[1], share * rgb[2])) < CONTRAST + 0.5:  # on a tinted ground, too
        share -= 0.01
    return str(to_hex((share * rgb[0], share * rgb[1], share * rgb[2])))


def contrast(rgb: tuple[float, float, float], ground: tuple[float, float, float] = (1.0, 1.0, 1.0)) -> float:
    """The contrast of two colours by WCAG 2; each of red, green and blue is between 0 and 1."""
    light, dark = sorted((_luminance(rgb), _luminance(ground)), reverse=True)
    return (light + 0.05) / (dark + 0.05)


def _luminance(rgb: tuple[float, float, float]) -> float:
    linear = [each / 12.92 if each <= 0.04045 else ((each + 0.055) / 1.055) ** 2.4 for each in rgb]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def look(method: Method) -> dict[str, Any]:
    """Keywords for a line of that method."""
    names = [m.name for m in every_method()]
    i = names.index(method.name) if method.name in names else len(names)  # a user's own, or the exact one
    return {
        "color": FAMILIES[family(method)],
        "marker": MARKERS[i % len(MARKERS)],
        "linestyle": LINES.get(method.order, "-"),
        "linewidth": 1.6,
        "markersize": 7.5,
    }


def apart(methods: Iterable[Method], method: Method) -> dict[str, Any]:
    """Keywords for a line of a method in a chart where each has a colour of its own: the second of a family is black.

    The third and fourth are grey. Where curves have their names beside them, methods of a family share its colour.
    """
    before: list[str] = []
    for each in methods:
        if each.name == method.name:
            break
        before.append(family(each))
    place = before.count(family(method))
    return look(method) | ({} if place == 0 else {"color": SECOND[min(place, len(SECOND)) - 1]})


def family(method: Method) -> str:
    """The one of ``FAMILIES`` to which a method belongs; the default is the Runge-Kutta methods."""
    known = {"verlet": "leapfrog", "wisdom_holman": "leapfrog", "pefrl": "PEFRL"}
    known |= dict.fromkeys(("dopri5", "dop853"), "Dormand-Prince")
    last = method.name.rsplit("_", 1)[-1]
    return {"euler": "Euler", "heun": "Heun", "leapfrog": "leapfrog"}.get(last, known.get(method.name, "Runge-Kutta"))


def named(method: Method) -> str:
    """Its title, and its section if it is in Hoffmann (2002)."""
    return f"{method.title} ({method.section})" if method.section.startswith("§") else method.title


def peer_look(number: int) -> dict[str, Any]:
    """Keywords for a line of another program, the first being 0."""
    return {
        "color": "#333333",
        "marker": PEERS[number % len(PEERS)],
        "linestyle": (0, (1, 2)),
        "linewidth": 1.3,
        "markersize": 9.0,
        "markeredgewidth": 1.8,
    }
