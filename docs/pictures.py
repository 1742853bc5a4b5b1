"""Draws the pictures of README.md and docs/*.md anew into docs/images. Takes some minutes.

Run ``.venv/bin/python docs/pictures.py`` after a change to a chart or a method, and look at what it drew.
"""

from __future__ import annotations

import io
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import stepwell as sw
from PIL import Image

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DOCS = Path(__file__).resolve().parent
IMAGES = DOCS / "images"

#: Errors in the table of the cheapest.
ERRORS = (0.1, 1e-2, 1e-4, 1e-6, 1e-9)
PLACE = re.compile(r"(<!-- drawn: best -->\n).*?(<!-- end drawn -->)", re.DOTALL)

#: Colours of a picture: enough for lines and letters, and a fraction of the bytes. A map's shades want more.
COLOURS, SHADES = 64, 256

#: The methods whose maps are shown.
MAPS = ("standard_euler", "false_euler", "standard_heun", "rk4", "merson", "fehlberg_5")


def write(name: str, figure: Figure, colours: int = COLOURS) -> None:
    """Write a picture with a palette."""
    drawn = io.BytesIO()
    figure.savefig(drawn, format="png", facecolor="white")
    Image.open(drawn).convert("RGB").convert("P", palette=Image.Palette.ADAPTIVE, colors=colours).save(
        IMAGES / name, optimize=True
    )
    print(f"docs/images/{name}")


def write_best(panel: sw.charts.Panel) -> None:
    """Write the table of the cheapest on each scene: steps, or with a tolerance attempts, repeat to the last."""
    head = ["scene", *(f"{error:g}" for error in ERRORS)]
    lines = [head, ["---"] * len(head)]
    for chart in panel.charts:
        found = [chart.best(error) for error in ERRORS]
        lines.append([f"`{chart.scene.name}`", *(f"{row['method']}: {row['cost']:.3g}" if row else "—" for row in found)])
    made = "".join(f"| {' | '.join(line)} |\n" for line in lines)
    page = DOCS / "work-precision.md"
    page.write_text(PLACE.sub(lambda m: m[1] + made + m[2], page.read_text(encoding="utf-8")), encoding="utf-8")
    print("docs/work-precision.md")


if __name__ == "__main__":
    for scene in ("oscillator", "clover"):
        write(f"{scene}.png", sw.charts.work_precision(scene).plot())
    panel = sw.charts.panel(each.name for each in sw.scenes.scenes())
    write("work-precision.png", panel.plot())
    write_best(panel)
    stability = sw.charts.stability()
    write("stability-loci.png", stability.plot(kind="loci"))
    write("stability-curves.png", stability.plot(kind="curves"))
    for method in MAPS:
        write(f"stability-map-{method}.png", sw.charts.stability_map(method).plot(), SHADES)
    write("figures.png", sw.charts.figures().plot())
    write("powers.png", sw.charts.powers().plot())
    eight = sw.scenes.figure_eight()
    assert eight.period is not None
    periods: dict[str, Any] = {"horizon": 100 * eight.period, "evaluations": 100_000}
    write("control-figure-eight.png", sw.charts.control(eight, **periods, title="Figure-eight, 100 periods").plot())
    write("control-appendix-d.png", sw.charts.control("energy_control", title="Appendix D").plot())
