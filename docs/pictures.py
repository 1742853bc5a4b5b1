"""Draws the pictures of README.md and of the pages in docs anew into docs/images. Takes some minutes.

Run ``.venv/bin/python docs/pictures.py`` after a change to a chart or a method, and check what it drew.
"""

from __future__ import annotations

import ast
import io
import re
import runpy
import tempfile
import textwrap
import tomllib
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import stepwell as sw
from PIL import Image
from stepwell import _core
from stepwell.runs import engine

import contact_errors

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DOCS = Path(__file__).resolve().parent
IMAGES = DOCS / "images"

#: Errors in the table of the cheapest.
ERRORS = (0.1, 1e-2, 1e-4, 1e-6, 1e-9)
PLACE = re.compile(r"(<!-- drawn: best -->\n).*?(<!-- end drawn -->)", re.DOTALL)

#: A colour of fewer pixels than this share of a picture is a shade at an edge, and is rounded to multiples of this.
RARE, SHADE = 2e-4, 17

#: Colours of an example's picture, of few lines.
COLOURS = 64
#: The picture of an example has as many colours as fit into so many bytes.
MOST_BYTES = 60 * 1024

#: The methods whose maps are shown.
MAPS = ("standard_euler", "false_euler", "standard_heun", "rk4", "merson", "fehlberg_5")


def write(name: str, figure: Figure, dpi: float | None = None) -> None:
    """Write a picture, with fewer dots an inch than the figure has if ``dpi`` says so."""
    drawn = io.BytesIO()
    figure.savefig(drawn, format="png", facecolor="white", dpi=dpi or "figure")
    save(Image.open(drawn), IMAGES / name)


def save(drawn: Image.Image, path: Path) -> None:
    """Save all colours that are seen as such, in RGB: a palette would merge methods.

    Only the many shades at the edges of lines and letters are rounded, each channel to one of sixteen steps, so that hues stay.
    """
    pixels = np.asarray(drawn.convert("RGB"))
    code = pixels.astype(np.uint32) @ np.array([1 << 16, 1 << 8, 1], dtype=np.uint32)
    _, place, times = np.unique(code, return_inverse=True, return_counts=True)
    rare = (times < RARE * code.size)[place].reshape(code.shape)
    rounded = (np.rint(pixels / SHADE) * SHADE).astype(np.uint8)
    Image.fromarray(np.where(rare[..., np.newaxis], rounded, pixels)).save(
        path, optimize=True
    )
    print(f"docs/images/{path.name}")


#: The scenes of each picture of errors against cost: all in one would be too small to read. No fixed step of the chart is short
#: enough for the cloth.
FAMILIES: dict[str, tuple[str, ...]] = {
    "work-precision.png": (
        *(
            "oscillator",
            "forced_oscillator",
            "chain",
            "pendulum",
            "clover",
            "figure_eight",
        ),
        *("kepler", "arenstorf", "pythagorean", "energy_control", "plummer"),
    ),
    "work-precision-bodies.png": (
        *(
            "conical_pendulum",
            "double_pendulum",
            "triple_pendulum",
            "dzhanibekov",
            "symmetric_top",
            "heavy_top",
        ),
        *("aircraft", "gimbal_trap"),
    ),
    "work-precision-springs.png": ("rope_bridge", "jelly_cube"),
    "work-precision-contact.png": ("bouncing_ball", "sliding_block", "sticking_block"),
}
#: Dots an inch of these, the largest pictures of all.
PANEL_DPI = 100
#: Where the error of one step says nothing of the next, a table of the cheapest would list lucky ones.
NO_ROWS = ("work-precision-contact.png",)


def write_best(charts: Iterable[sw.charts.WorkPrecision]) -> None:
    """Write the table of the cheapest on each scene: steps, or with a tolerance attempts, repeat to the last."""
    head = ["scene", *(f"{error:g}" for error in ERRORS)]
    lines = [head, ["---"] * len(head)]
    for chart in charts:
        found = [chart.best(error) for error in ERRORS]
        lines.append(
            [
                f"`{chart.scene.name}`",
                *(
                    f"{row['method']}: {row['cost']:.3g}" if row else "—"
                    for row in found
                ),
            ]
        )
    made = "".join(f"| {' | '.join(line)} |\n" for line in lines)
    page = DOCS / "benchmarks" / "work-precision.md"
    page.write_text(
        PLACE.sub(lambda m: m[1] + made + m[2], page.read_text(encoding="utf-8")),
        encoding="utf-8",
    )
    print("docs/benchmarks/work-precision.md")


def wing_nut() -> None:
    """The picture of the example of that name."""
    with tempfile.TemporaryDirectory() as folder:
        drawn = Path(folder) / "wing-nut.png"
        runpy.run_path(str(DOCS.parent / "examples" / "wing_nut.py"))["picture"](
            str(drawn)
        )
        save(Image.open(drawn), IMAGES / "wing-nut.png")


def examples() -> None:
    """The pictures of the examples of own equations, drawn by these."""
    with tempfile.TemporaryDirectory() as folder:
        for file in sorted((DOCS.parent / "examples" / "equations").glob("*.py")):
            runpy.run_path(str(file))["main"](Path(folder))
            drawn = Image.open(Path(folder) / f"{file.stem}.png").convert("RGB")
            written = IMAGES / "equations" / file.name.replace(".py", ".png")
            for colours in (256, COLOURS, 32, 16):
                few = drawn.convert(
                    "P", palette=Image.Palette.ADAPTIVE, colors=colours
                ).convert("RGB")
                few.save(written, optimize=True)
                if written.stat().st_size <= MOST_BYTES:
                    break
            print(f"docs/images/equations/{file.stem}.png")


#: Phases of an impact within a step, and the increment h·g of the velocity at an impact of speed 1.
PHASES, KICK = 401, 0.2


def impacts(floor: sw.Floor) -> Any:
    """The energy after an impact over that before it, by leapfrog; a point that a spring holds has left it after 12 steps."""
    y = (1.0 + 0.5 * KICK) * np.linspace(0.0, 1.0, PHASES, endpoint=False)
    ball = sw.Particles(gravity=KICK, floor=floor, dim=1)
    run = sw.integrate(
        ball, "leapfrog", v=-1.0, y=y[np.newaxis, np.newaxis], dt=1.0, steps=12, every=1
    )
    energy = (0.5 * run.v**2 + KICK * run.y)[:, 0, 0]
    away = (run.y[:, 0, 0] >= 0.0) & (run.v[:, 0, 0] > 0.0)
    return energy[np.argmax(away, axis=0), np.arange(PHASES)] / energy[0]


def mirrored() -> Any:
    """The same where v and y are both turned over, which no way does."""
    y = (1.0 + 0.5 * KICK) * np.linspace(0.0, 1.0, PHASES, endpoint=False)
    v = np.full(PHASES, -1.0)
    before, out, hit = (
        0.5 * v * v + KICK * y,
        np.ones(PHASES),
        np.zeros(PHASES, dtype=bool),
    )
    for _ in range(3):
        y, v = y + v - 0.5 * KICK, v - KICK
        now = (y < 0.0) & ~hit
        out = np.where(now, (0.5 * v * v - KICK * y) / before, out)
        hit |= now
    return out


def contact() -> Figure:
    """What four ways of contact make of the energy, for every phase of the impact."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure
    from stepwell.views.charts.style import COLOURS, FONT, GREY, ink

    lines = (
        (
            "one-sided spring, Φ = 1.5",
            impacts(sw.Floor(way="spring", omega=1.5)),
            COLOURS[2],
            (0.12, 0.83),
        ),
        (
            "one-sided spring, Φ = 0.5",
            impacts(sw.Floor(way="spring", omega=0.5)),
            COLOURS[1],
            (0.55, 0.92),
        ),
        ("naive reflection of v and y", mirrored(), COLOURS[4], (0.12, 1.78)),
        ("the ways “safe” and “flip”", impacts(sw.Floor()), "black", (0.24, 1.02)),
    )
    with rc_context(FONT):
        figure = Figure(figsize=(12.0, 6.4), dpi=100)
        axes = figure.add_axes((0.075, 0.12, 0.905, 0.72))
        phase = np.linspace(0.0, 1.0, PHASES, endpoint=False)
        for name, ratio, colour, place in lines:
            axes.plot(phase, ratio, color=colour, linewidth=2.2)
            axes.text(*place, name, color=ink(colour), weight="bold")
        axes.set_xlim(0.0, 1.0)
        axes.set_ylim(0.78, 1.92)
        axes.set_xlabel(
            "phase: height above the floor at the start of the step, as a share of the way of that step"
        )
        axes.set_ylabel("energy after the impact / before it")
        axes.spines[["top", "right"]].set_visible(False)
        figure.text(
            0.012,
            0.94,
            "An impact adds energy or takes it, by its phase; the safe way does neither",
            size=19,
            weight="bold",
        )
        figure.text(
            0.012,
            0.885,
            "Leapfrog, e = 1, h·g = 0.2 of the speed of impact.",
            size=13,
            color=GREY,
        )
    return figure


def tumbling() -> Figure:
    """A dumb-bell that is thrown, tumbles and rests, and what is left of its energy after an elastic impact at every angle."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure
    from stepwell.views.charts.style import COLOURS, FONT, GREY, ink

    thrown = sw.Rods(
        [1.0, 2.0],
        [(0, 1)],
        1.0,
        gravity=9.81,
        floor=sw.Floor(restitution=0.5, friction=0.3),
        dim=2,
    )
    start: dict[str, Any] = {
        "v": [[3.6, 1.0], [2.4, 1.8]],
        "y": [[0.0, 0.8], [0.8, 1.4]],
    }
    control = sw.Projection("length")
    run = sw.integrate(
        thrown, "rk4", **start, dt=1 / 240, steps=600, every=8, control=control
    )
    angle = np.linspace(0.0, 0.5 * np.pi, 91)
    rod = np.stack([np.sin(angle), np.cos(angle)])
    y = np.stack([np.zeros_like(rod), rod])
    v = np.zeros_like(y)
    v[:, 1] = -1.0
    bell = sw.Rods([1.0, 1.0], [(0, 1)], 1.0, gravity=0.0, floor=sw.Floor(), dim=2)
    together = sw.integrate(bell, "rk4", v=v, y=y, dt=1e-6, steps=1, control=control)
    bare = sw.Rods([1.0, 1.0], [(0, 1)], 1.0, gravity=0.0, dim=2)
    v[0, 1] = np.where(
        angle < 0.5 * np.pi, 1.0, v[0, 1]
    )  # the point alone returns, then velocities along the rod are removed
    apart = sw.integrate(bare, "rk4", v=v, y=y, dt=1e-6, steps=1, control=control)
    with rc_context(FONT):
        figure = Figure(figsize=(12.0, 5.4), dpi=100)
        axes = figure.add_axes((0.02, 0.12, 0.55, 0.68))
        for i, place in enumerate(run.y):
            late = 0.25 + 0.75 * i / len(run.y)
            axes.plot(*place.T, color="black", alpha=late, linewidth=1.2, zorder=1)
            axes.scatter(
                *place.T,
                s=[22.0, 44.0],
                color=[COLOURS[1], COLOURS[2]],
                alpha=late,
                zorder=2,
                linewidths=0.0,
            )
        axes.axhline(0.0, color="black", linewidth=1.5, zorder=0)
        axes.set_aspect("equal")
        axes.set_axis_off()
        right = figure.add_axes((0.665, 0.16, 0.32, 0.62))
        for name, ended, colour, at in (
            (
                "impulse and rod solved\ntogether (stepwell)",
                together,
                "black",
                (4.0, 1.04),
            ),
            (
                "point first, rod after:\nloses up to all",
                apart,
                COLOURS[2],
                (38.0, 0.1),
            ),
        ):
            right.plot(np.degrees(angle), ended.energy[-1], color=colour, linewidth=2.2)
            right.text(*at, name, color=ink(colour), weight="bold", size=12.0)
        right.set(
            xlim=(0.0, 90.0),
            ylim=(0.0, 1.3),
            xlabel="angle of rod and vertical, degrees",
        )
        right.set_xticks((0, 30, 60, 90))
        right.set_yticks((0.0, 0.5, 1.0))
        right.set_ylabel("energy after / before")
        right.spines[["top", "right"]].set_visible(False)
        figure.text(
            0.012,
            0.92,
            "An impulse at one end of a rod acts on the other at the same instant",
            size=19,
            weight="bold",
        )
        figure.text(
            0.012,
            0.855,
            "Left: e = 0.5, μ = 0.3, until it rests. Right: e = 1, an end meets the floor.",
            size=13,
            color=GREY,
        )
    return figure


def tape() -> Figure:
    """The tape of a step between its source and its readers."""
    from matplotlib.figure import Figure
    from matplotlib.patches import FancyBboxPatch

    plan = engine.Plan(sw.Oscillator(omega=1.0), sw.method("false_euler"), (), 0.1)
    symbols = _core.Tape()
    _, y = symbols.trace(engine.model(plan), "step")
    figure = Figure(figsize=(14, 6.4))
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_axis_off()
    axes.set(xlim=(0, 100), ylim=(0, 46))

    def box(
        x: float,
        y: float,
        width: float,
        height: float,
        title: str,
        text: str,
        shade: str = "#ffffff",
        mono: bool = True,
    ) -> None:
        axes.add_patch(
            FancyBboxPatch(
                (x, y),
                width,
                height,
                boxstyle="round,pad=0,rounding_size=0.8",
                facecolor=shade,
                edgecolor="#333333",
            )
        )
        axes.text(x + 1, y + height - 1, title, fontsize=12, weight="bold", va="top")
        family = "monospace" if mono else "sans-serif"
        axes.text(
            x + 1,
            y + height - 3.9,
            text,
            fontsize=11,
            family=family,
            va="top",
            linespacing=1.45,
        )

    def arrow(start: tuple[float, float], end: tuple[float, float]) -> None:
        axes.annotate(
            "",
            end,
            start,
            arrowprops={
                "arrowstyle": "-|>",
                "color": "#333333",
                "linewidth": 1.6,
                "mutation_scale": 18,
            },
        )

    for x, head in (
        (2, "Source, once in each language"),
        (41, "Tape of one step"),
        (67, "Readers"),
    ):
        axes.text(x, 44.5, head, fontsize=15, va="top")
    box(
        2,
        29,
        30,
        12,
        "A method, over blocks: False Euler",
        "v = v + s.dv(t, v, y)\ny = y + s.dy(t, v, y)",
        "#f2f2f2",
    )
    box(
        2,
        15,
        30,
        12,
        "A system, over numbers: the oscillator",
        "dv = -(stiffness * y)\ndy = speed * v",
        "#f2f2f2",
    )
    box(
        2,
        1,
        30,
        12,
        "Wrapped around them",
        "control, projection, inputs,\nrecorded quantities,\nstep-size control",
        "#f2f2f2",
        mono=False,
    )
    box(41, 1, 20, 40, "v, y → v, y", symbols.listing(y).rstrip(), "#dcdcdc")
    axes.text(
        42,
        12.6,
        "%6 is the same in every step:\ncomputed once, before them",
        fontsize=10,
        va="top",
        style="italic",
    )
    axes.text(
        42,
        7.6,
        "the last four lines\nare the hot loop",
        fontsize=10,
        va="top",
        style="italic",
    )
    for height in (35, 21, 7):
        arrow((32.3, height), (40.7, height))
    axes.text(
        36.4, 36.2, "run once\nwith symbols", fontsize=10, ha="center", va="bottom"
    )
    readers = (
        ("Kernel writer", "machine code at run time (AVX2, AVX-512, NEON)"),
        ("Interpreter", "the same bits, on any machine"),
        ("Comparer", "proves that core and reference are equal"),
        ("Fuser", "fused multiply-adds, on request"),
        ("Counter", "operations of a step, by kind"),
        ("Printer", "listings and formulas"),
    )
    for i, (title, text) in enumerate(readers):
        low = 34.9 - 6.78 * i
        box(67, low, 31, 6.1, title, text, mono=False)
        arrow((61.3, low + 3.05), (66.7, low + 3.05))
    return figure


def cloth() -> Figure:
    """The scene of that name at four times: each row and column a line, seen from the side."""
    import numpy as np
    from matplotlib.figure import Figure

    scene, n = sw.scenes.cloth(), 32
    run = scene.run("leapfrog", every=160)
    figure = Figure(figsize=(14, 4.2))
    for i, (t, y) in enumerate(zip(run.t, run.y, strict=True)):
        axes = figure.add_axes((0.01 + 0.245 * i, 0.02, 0.24, 0.9))
        net = y.reshape(n, n, 3)
        seen = np.stack(
            [net[..., 0] + 0.55 * net[..., 1], net[..., 2] + 0.35 * net[..., 1]],
            axis=-1,
        )
        for line in (*seen, *seen.transpose(1, 0, 2)):
            axes.plot(*line.T, color="#333333", linewidth=0.6)
        axes.plot(*seen[0, [0, -1]].T, "o", color="#000000", markersize=6)
        axes.set(xlim=(-0.62, 1.05), ylim=(-1.45, 0.1), aspect="equal")
        axes.set_title(f"t = {t:.2f}", fontsize=14)
        axes.set_axis_off()
    return figure


#: Methods of the picture of a stiff pair of masses: where their names stand, upright beside a wall, and their colours.
EXPLICIT = {
    "false_euler": (3e-4, 2.5e-5, 0),
    "rk4": (1.83e-3, 2e-9, 90),
    "merson": (2.95e-3, 2e-9, 90),
    "dop853": (3.9e-3, 1e-9, 90),
}
IMPLICIT = {
    "backward_euler": (5e-3, 0.2, 0),
    "trapezoidal": (6e-3, 6e-4, 0),
    "rodas4": (1.3e-2, 1e-8, 0),
    "rodas5p": (0.16, 8e-12, 0),
}
EXPLICIT_COLOUR, IMPLICIT_COLOUR = "#a33b0a", "#17508f"


def where_methods_fail() -> Figure:
    """Error over step of two masses that a stiff spring joins, by explicit and by implicit methods."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure
    from stepwell.views.charts.style import FONT, GREY

    def exact(t: Any) -> Any:
        return np.outer(-np.sin(t), [1, 1]), np.outer(np.cos(t), [1, 1])

    scene = sw.Scene(
        sw.Chain(2, stiffness=[1.0, 1e6, 1.0]), v=0.0, y=1.0, horizon=10.0, exact=exact
    )
    limits = {name: float(sw.stability_limit(scene.system, name)) for name in EXPLICIT}
    most = max(limits.values())
    with rc_context(FONT):
        figure = Figure(figsize=(12.0, 6.6), dpi=100)
        axes = figure.add_axes((0.085, 0.12, 0.895, 0.73))
        axes.set(xscale="log", yscale="log", xlim=(1e-4, 1.0), ylim=(1e-16, 10.0))
        for names, colour in ((EXPLICIT, EXPLICIT_COLOUR), (IMPLICIT, IMPLICIT_COLOUR)):
            for name, (x, y, turn) in names.items():
                steps = 10.0 / np.rint(
                    10.0 / np.geomspace(1e-4, min(limits.get(name, 1.0), 1.0), 40)
                )
                errors = [
                    error_of(scene, name, dt)
                    for dt in steps
                    if dt < limits.get(name, np.inf)
                ]
                steps = steps[: len(errors)]
                if name in limits:
                    steps, errors = (
                        np.append(steps, [limits[name]] * 2),
                        [*errors, errors[-1], 10.0],
                    )
                axes.plot(steps, np.maximum(errors, 1e-16), color=colour, linewidth=2.2)
                axes.text(
                    x,
                    y,
                    sw.method(name).title,
                    color=colour,
                    weight="bold",
                    size=12.5,
                    rotation=turn,
                    ha="right" if turn else "left",
                )
        axes.axvspan(most, 1.0, color="#f0f0f0", zorder=0)
        axes.text(
            most * 1.1,
            2.0,
            f"no explicit method is stable beyond {most:.2g}",
            size=12.5,
            color="#333333",
        )
        axes.set_xlabel("step")
        axes.set_ylabel("largest error over 10 units of time, relative")
        axes.spines[["top", "right"]].set_visible(False)
        digits = int(-np.log10(error_of(scene, "rodas5p", 0.5)))
        longer = f"steps {0.5 / most:.0f} times as long have {digits} digits by Rodas5P"
        title = f"Explicit steps blow up beyond {most:.2g}; {longer}"
        figure.text(0.012, 0.945, title, size=16.5, weight="bold")
        figure.text(
            0.012,
            0.893,
            "Two masses between soft springs, joined by one a million times as stiff, which never moves.",
            size=13,
            color=GREY,
        )
    return figure


def error_of(scene: sw.Scene, method: str, dt: float) -> float:
    """The largest state error of a run."""
    return float(
        scene.state_error(scene.run(method, dt, every=max(1, round(0.01 / dt)))).max()
    )


ROOT = DOCS.parent


def layers_of_package() -> list[tuple[str, str]]:
    """The layers of the linter's contract, from the top, each with the first line of its docstring."""
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))[
        "tool"
    ]["importlinter"]["contracts"]
    names = next(
        contract["layers"] for contract in contracts if contract["type"] == "layers"
    )
    source = ROOT / "python" / "stepwell"
    texts = [
        ast.get_docstring(
            ast.parse((source / name / "__init__.py").read_text(encoding="utf-8"))
        )
        or ""
        for name in names
    ]
    return [
        (name, text.splitlines()[0]) for name, text in zip(names, texts, strict=True)
    ]


def layers_of_core() -> list[tuple[str, str]]:
    """The layers of the test of imports, from the top, each with the first line of its file."""
    core = ROOT / "rust" / "core"
    order = re.search(
        r"const LAYERS: .*?\[([^\]]*)\];",
        (core / "tests" / "layers.rs").read_text(encoding="utf-8"),
    )
    assert order is not None
    layers = []
    for name in reversed(re.findall(r"\w+", order[1])):
        files = [core / "src" / name / "mod.rs", core / "src" / f"{name}.rs"]
        first = (
            next(file for file in files if file.exists())
            .read_text(encoding="utf-8")
            .splitlines()[0]
        )
        layers.append((name, first.removeprefix("//! ")))
    return layers


def layers() -> Figure:
    """The layers of the package and of the core: each imports from those below it only."""
    from matplotlib.figure import Figure
    from matplotlib.patches import FancyBboxPatch

    columns = {
        "Package: python/stepwell/": layers_of_package(),
        "Core: rust/core/src/": layers_of_core(),
    }
    figure = Figure(figsize=(14, 7.4))
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_axis_off()
    axes.set(xlim=(0, 100), ylim=(0, 53))
    for x, (title, rows) in zip((1.5, 51.5), columns.items(), strict=True):
        axes.text(x, 52, title, fontsize=15, va="top")
        height = 47.0 / len(rows)
        for i, (name, text) in enumerate(rows):
            y = 48.0 - height * (i + 1)
            shape = "round,pad=0,rounding_size=0.6"
            axes.add_patch(
                FancyBboxPatch(
                    (x, y + 0.35),
                    47,
                    height - 0.7,
                    boxstyle=shape,
                    facecolor="#f2f2f2",
                    edgecolor="#333333",
                )
            )
            sentence = text.replace("``", "").partition(". ")[0].removesuffix(".")
            axes.text(
                x + 1, y + height / 2, name, fontsize=12.5, weight="bold", va="center"
            )
            axes.text(
                x + 9,
                y + height / 2,
                textwrap.fill(sentence, 60),
                fontsize=11,
                va="center",
                linespacing=1.3,
            )
    return figure


if __name__ == "__main__":
    write("layers.png", layers())
    write("contact.png", contact())
    write("contact-rods.png", tumbling())
    write("tape.png", tape())
    write("cloth.png", cloth())
    write("where-methods-fail.png", where_methods_fail())
    examples()
    turns = sw.scenes.aircraft()
    write(
        "aircraft.png",
        sw.charts.run_picture(turns, turns.run("false_euler", every=1)).plot(),
    )
    wing_nut()
    top = sw.scenes.heavy_top()
    write("heavy-top.png", sw.charts.run_picture(top, top.run("rk4", every=1)).plot())
    panels = {name: sw.charts.panel(scenes) for name, scenes in FAMILIES.items()}
    for name, panel in panels.items():
        contact = name == "work-precision-contact.png"
        figure = contact_errors.draw(panel.charts) if contact else panel.plot()
        write(name, figure, PANEL_DPI)
    write_best(
        chart
        for name, panel in panels.items()
        if name not in NO_ROWS
        for chart in panel.charts
    )
    stability = sw.charts.stability()
    write("stability-loci.png", stability.plot(kind="loci"))
    write("stability-curves.png", stability.plot(kind="curves"))
    for method in MAPS:
        write(f"stability-map-{method}.png", sw.charts.stability_map(method).plot())
    write("quaternion-norm.png", sw.charts.norm().plot())
    write("figures.png", sw.charts.figures().plot())
    plant = sw.TransferFunction(1.0, [1.0, 0.2, 1.0])
    write("bode.png", sw.charts.bode(plant, dt=0.5).plot())
    write("verlet-friction.png", sw.charts.verlet_friction().plot())
    eight = sw.scenes.figure_eight()
    assert eight.period is not None
    periods: dict[str, Any] = {"horizon": 100 * eight.period, "evaluations": 100_000}
    write(
        "control-figure-eight.png",
        sw.charts.control(eight, **periods, title="Figure-eight, 100 periods").plot(),
    )
    write(
        "control-appendix-d.png",
        sw.charts.control("energy_control", title="Appendix D").plot(),
    )
    write("control-rods.png", sw.charts.control("conical_pendulum").plot())
