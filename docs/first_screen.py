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
#: Frames, how long one is seen in milliseconds, and for how long the first, which is the last state and what previews show.
FRAMES, MILLISECONDS, STILL = 94, 70, 1500
#: The length of a trail in units of time, and half the side of what is seen.
TRAIL, REACH = 7.0, 3.0
EDGE, ZERO = "#888888", "#888888"
#: Shades of each colour from the page to itself, for smooth edges.
SHADES = 24
#: The run: Hoffmann's start by Standard Euler, so many steps of the scene's dt, after which two bodies are out of the box, and
#: the steps from one saved state to the next.
STEPS, EVERY = 2860, 2
#: Percent between which the energy error is drawn.
PERCENT = (-35.0, 260.0)
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
        every=EVERY,
        control=control,
    )


def palette(paper: str, colours: tuple[str, ...]) -> Any:
    """The page's own colours and their shades, shape (n, 3): a palette that is chosen from a frame would merge bodies."""
    page, *others = (
        np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)])
        for colour in (paper, *colours)
    )
    shares = np.linspace(0.0, 1.0, SHADES)[:, np.newaxis]
    return np.rint(
        np.concatenate([(1.0 - shares) * page + shares * colour for colour in others])
    ).astype(np.uint8)


def in_colours(frame: Any, colours: Any) -> Image.Image:
    """A frame in the nearest colours of a palette; Pillow's own choice is not quite the nearest, and turns white into grey."""
    code, place = np.unique(
        frame[..., :3].astype(np.int64) @ np.array([1 << 16, 1 << 8, 1]),
        return_inverse=True,
    )
    seen = np.stack([code >> 16, code >> 8 & 255, code & 255], axis=-1)
    nearest = (
        ((seen[:, np.newaxis] - colours.astype(np.int64)) ** 2)
        .sum(axis=-1)
        .argmin(axis=1)
        .astype(np.uint8)
    )
    image = Image.fromarray(nearest[place].reshape(frame.shape[:2]), "P")
    image.putpalette(colours.ravel().tolist())
    return image


class Side:
    """One of the two runs: its box, and the curve of its energy below it."""

    def __init__(self, figure: Any, i: int, page: str, name: str, run: sw.Run) -> None:
        paper, ink, colours = PAGES[page]
        scene = sw.scenes.energy_control()
        self.run = run
        self.percent = (
            100.0 * (run.energy - run.energy[0]) / (0.5 * float((scene.v**2).sum()))
        )
        left = 0.075 + 0.475 * i
        box = figure.add_axes(
            (left, 0.3, 0.445, 0.6),
            xlim=(-REACH, REACH),
            ylim=(-REACH, REACH),
            xticks=[],
            yticks=[],
        )
        curve = figure.add_axes(
            (left, 0.055, 0.445, 0.215), xlim=(0.0, run.t[-1]), ylim=PERCENT, xticks=[]
        )
        curve.set_yticks(
            (0.0, 100.0, 200.0), ("0", "100 %", "200 %") if i == 0 else ("", "", "")
        )
        curve.tick_params(colors=ink, labelsize=9.5, length=0)
        curve.axhline(0.0, color=ZERO, linewidth=1.0)
        for axes in (box, curve):
            axes.set_facecolor(paper)
            for spine in axes.spines.values():
                spine.set_color(EDGE)
        centre = left + 0.2225
        figure.text(centre, 0.935, name, color=ink, size=14, weight="bold", ha="center")
        figure.text(
            centre, 0.012, "energy error over time", color=ink, size=10, ha="center"
        )
        self.number = curve.text(
            0.98,
            0.9,
            "",
            transform=curve.transAxes,
            color=ink,
            size=13,
            weight="bold",
            ha="right",
            va="top",
        )
        self.line = curve.plot(
            [], [], color=colours[1 if i == 0 else 2], linewidth=2.2
        )[0]
        self.trails = [
            box.plot([], [], color=colour, linewidth=2.0)[0] for colour in colours
        ]
        self.dots = [
            box.plot([], [], "o", color=colour, markersize=12)[0] for colour in colours
        ]

    def show(self, k: int) -> None:
        """Show a saved state, and what was before it."""
        first = int(np.searchsorted(self.run.t, self.run.t[k] - TRAIL))
        for body, (trail, dot) in enumerate(zip(self.trails, self.dots, strict=True)):
            trail.set_data(*self.run.y[first : k + 1, body].T)
            dot.set_data(*self.run.y[k : k + 1, body].T)
        self.line.set_data(self.run.t[: k + 1], self.percent[: k + 1])
        self.number.set_text(f"energy {self.percent[k]:+.0f} %".replace("-", "−"))


def energy_control(page: str) -> None:
    """Both runs side by side, as a GIF that begins with its last state."""
    paper, ink, colours = PAGES[page]
    figure: Any = style.new_figure(7.36, 5.46)
    figure.set_facecolor(paper)
    runs = (states(None), states(sw.scenes.energy_control().control))
    names = ("without control: they leave", "with control: they stay")
    sides = [
        Side(figure, i, page, name, run)
        for i, (name, run) in enumerate(zip(names, runs, strict=True))
    ]
    few = palette(paper, (ink, EDGE, *colours))
    frames = []
    last = len(runs[0].t) - 1
    for k in [last, *np.linspace(0, last, FRAMES).astype(int).tolist()]:
        for side in sides:
            side.show(k)
        figure.canvas.draw()
        frames.append(in_colours(np.asarray(figure.canvas.buffer_rgba()), few))
    written = IMAGES / f"energy-control-{page}.gif"
    times = [STILL, *[MILLISECONDS] * FRAMES]
    frames[0].save(
        written,
        save_all=True,
        append_images=frames[1:],
        duration=times,
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
