"""Draws the pictures of README.md's first screen: Appendix D without and with energy control, and five methods on one chart.

Run ``.venv/bin/python docs/first_screen.py``. Nothing in them is measured, so they come out the same on every machine.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import stepwell as sw
from PIL import Image
from stepwell.base.pictures import png
from stepwell.views.charts import labels, style

IMAGES = Path(__file__).resolve().parent / "images"

#: The bodies' colours on a light page and on a dark one, with the page and its letters.
PAGES = {
    "light": ("#ffffff", "#222222", ("#175ca6", "#c75a22", "#25a985")),
    "dark": ("#0d1117", "#e6edf3", ("#6cb2f5", "#f09a5b", "#4fd6ae")),
}
#: Frames, how long one is seen in milliseconds, states of a trail, and half the side of what is seen.
FRAMES, MILLISECONDS, TRAIL, REACH = 100, 80, 40, 5.0
EDGE = "#888888"
#: Shades of each colour from the page to itself, for smooth edges.
SHADES = 24
#: The run: Hoffmann's start by Standard Euler, so many steps of the scene's dt.
STEPS = 4000
METHODS = ("false_euler", "leapfrog", "standard_heun", "rk4", "dop853")


def states(control: sw.EnergyControl | None) -> sw.Run:
    """Appendix D by Standard Euler."""
    scene = sw.scenes.energy_control()
    return sw.integrate(
        scene.system,
        "standard_euler",
        v=scene.v,
        y=scene.y,
        dt=scene.dt,
        steps=STEPS,
        every=STEPS // 800,
        control=control,
    )


def palette(paper: str, colours: tuple[str, ...]) -> Image.Image:
    """The page's own colours and their shades: one that is chosen from a frame would merge bodies."""
    shades = [
        np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)])
        for colour in (paper, *colours)
    ]
    values = [
        round(float(value))
        for colour in shades[1:]
        for share in np.linspace(0.0, 1.0, SHADES)
        for value in (1.0 - share) * shades[0] + share * colour
    ]
    image = Image.new("P", (1, 1))
    image.putpalette(values)
    return image


def energy_control(page: str) -> None:
    """Both runs side by side, as a GIF."""
    paper, ink, colours = PAGES[page]
    scene = sw.scenes.energy_control()
    runs = (
        ("without control", states(None)),
        ("with energy control", states(scene.control)),
    )
    start = float(runs[0][1].energy[0])
    kinetic = 0.5 * float((scene.v**2).sum())
    figure: Any = style.new_figure(7.2, 4.1)
    figure.set_facecolor(paper)
    parts = []
    for i, (name, run) in enumerate(runs):
        axes = figure.add_axes(
            (0.01 + 0.5 * i, 0.02, 0.48, 0.82),
            aspect="equal",
            xlim=(-REACH, REACH),
            ylim=(-REACH, REACH),
        )
        axes.set(xticks=[], yticks=[], facecolor=paper)
        for spine in axes.spines.values():
            spine.set_color(EDGE)
        figure.text(
            0.25 + 0.5 * i, 0.93, name, color=ink, size=14, weight="bold", ha="center"
        )
        said = figure.text(0.25 + 0.5 * i, 0.865, "", color=ink, size=11, ha="center")
        trails = [
            axes.plot([], [], color=colour, linewidth=1.8)[0] for colour in colours
        ]
        dots = [
            axes.plot([], [], "o", color=colour, markersize=9)[0] for colour in colours
        ]
        parts.append((run, said, trails, dots))
    frames = []
    for k in np.linspace(0, len(runs[0][1].t) - 1, FRAMES).astype(int).tolist():
        for run, said, trails, dots in parts:
            grown = (float(run.energy[k]) - start) / kinetic
            said.set_text(f"energy error {100.0 * grown:+.0f} %".replace("-", "−"))
            for body, (trail, dot) in enumerate(zip(trails, dots, strict=True)):
                trail.set_data(*run.y[max(0, k - TRAIL) : k + 1, body].T)
                dot.set_data(*run.y[k : k + 1, body].T)
        figure.canvas.draw()
        frames.append(
            Image.fromarray(np.asarray(figure.canvas.buffer_rgba())).convert("RGB")
        )
    few = palette(paper, (ink, EDGE, *colours))
    drawn = [frame.quantize(palette=few, dither=Image.Dither.NONE) for frame in frames]
    written = IMAGES / f"energy-control-{page}.gif"
    drawn[0].save(
        written,
        save_all=True,
        append_images=drawn[1:],
        duration=MILLISECONDS,
        loop=0,
        optimize=True,
    )
    print(written.name, written.stat().st_size)


def five_methods() -> None:
    """Errors against function evaluations on the clover leaf: no time is in it."""
    from matplotlib import rc_context
    from stepwell.views.charts.picture import finding

    steps = [round(steps) for steps in np.geomspace(18, 20_000, 27)]
    chart = sw.charts.work_precision("clover", METHODS, steps, tolerances=[])
    with rc_context(style.FONT):
        figure: Any = style.new_figure(10.0, 5.6)
        axes = figure.add_axes((0.1, 0.12, 0.88, 0.72), xscale="log", yscale="log")
        given = []
        for curve in chart.curves:
            points = np.array(
                [(point.cost, point.state_error) for point in curve.usable]
            )
            assert isinstance(curve.method, sw.Method)
            look = style.look(curve.method)
            axes.plot(
                *points.T,
                **(look | {"linestyle": "-", "linewidth": 2.2, "markersize": 5.0}),
            )
            given.append(
                labels.Label(
                    curve.title,
                    points,
                    {"color": look["color"], "weight": "bold", "size": 14},
                )
            )
        axes.set(
            ylim=(1e-14, 1.0),
            xlabel="function evaluations per unit of time",
            ylabel="largest error of the run",
        )
        axes.grid(color="#e6e6e6", linewidth=0.8)
        axes.minorticks_off()
        axes.spines[["top", "right"]].set_visible(False)
        assert not labels.beside(axes, given)
        title = finding(chart)
        figure.text(0.012, 0.935, f"Of five methods, {title}", size=16, weight="bold")
        figure.text(
            0.012,
            0.88,
            "Three bodies on a clover leaf (Appendix C), 30 units of time.",
            size=12.5,
            color=style.GREY,
        )
        (IMAGES / "five-methods.png").write_bytes(png(figure))
    print("five-methods.png", (IMAGES / "five-methods.png").stat().st_size)


if __name__ == "__main__":
    for page in PAGES:
        energy_control(page)
    five_methods()
