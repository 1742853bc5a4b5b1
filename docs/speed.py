"""Speeds beside peers, from the report of ``make bench``: the table of docs/benchmarks/speed.md, and its pictures.

``make bench`` runs it after the report is written: it draws the pictures and prints the figures that sentences give, in README.md
and docs/benchmarks/speed.md; ``docs/generate.py`` writes the tables.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

ROOT = Path(__file__).resolve().parent.parent
RESULTS = ROOT / "benches" / "RESULTS.md"

#: The works by the beginnings of their titles in the report, as they are called here.
WORKS = {
    "W1: undamped oscillators, own ω each, False Euler, 100,000": "100 000 oscillators, False Euler",
    "W1: undamped oscillators, own ω each, False Euler, 1,000 ": "1000 oscillators, False Euler",
    "W1: undamped oscillators, own ω each, False Euler, 1 ": "one oscillator, False Euler",
    "W1 forced: damped oscillators with a sinusoidal acceleration, all parameters their own, Standard Heun, 100,000": (
        "100 000 driven oscillators, Standard Heun"
    ),
    "W1 forced: damped oscillators with a sinusoidal acceleration, all parameters their own, Standard Heun, 1 ": (
        "one driven oscillator, Standard Heun"
    ),
    "W2 standard_heun": "10 000 driven pendulums, Standard Heun",
    "W2 rk4": "10 000 driven pendulums, Runge-Kutta 4",
    "W3: figure-eight of three bodies in the plane, leapfrog": "one figure-eight, leapfrog",
    "W6": "10 000 systems of three bodies, leapfrog",
    "W4: one star cluster in space, softened, leapfrog, one thread, 64": "64 stars, leapfrog",
    "W4: one star cluster in space, softened, leapfrog, one thread, 1,024": "1024 stars, leapfrog",
    "W4: one star cluster in space, softened, leapfrog, one thread, 8,192": "8192 stars, leapfrog",
    "W8": "a cloth of 1984 springs, leapfrog",
    "W1 float32: float32, undamped oscillators, own ω each, False Euler, 100,000": "100 000 oscillators in float32, False Euler",
    "W1 float32: float32, undamped oscillators, own ω each, False Euler, 1,000 ": "1000 oscillators in float32, False Euler",
    "W2 float32 standard_heun": "10 000 driven pendulums in float32, Standard Heun",
    "W2 float32 rk4": "10 000 driven pendulums in float32, Runge-Kutta 4",
    "W7 pendulum": "own equation: pendulum, Runge-Kutta 4",
    "W7 duffing": "own equation: Duffing",
    "W7 van_der_pol": "own equation: Van der Pol",
    "W7 lorenz": "own equation: Lorenz",
    "W7 lotka_volterra": "own equation: Lotka-Volterra",
    "W7 phosphorylation": "own equation: ten species",
    "W7 hodgkin_huxley": "own equation: Hodgkin-Huxley",
}


class Ratios(NamedTuple):
    """How many times as fast stepwell is in a work, on one thread.

    Attributes:
        name: of the work.
        peer: the fastest compiled peer: "C" or "numba".
        exact: beside the peer that computes the same sums and products, each rounded.
        best: with fused multiply-adds, where the work has them, beside the peer's best code, which may fuse and reorder.
        error: of all of them.
    """

    name: str
    peer: str
    exact: float
    best: float
    error: str


def tables() -> dict[str, dict[str, dict[str, str]]]:
    """The tables of the report: by title, contestant and head of a column."""
    found: dict[str, dict[str, dict[str, str]]] = {}
    for part in RESULTS.read_text(encoding="utf-8").split("\n## ")[1:]:
        rows = [
            [cell.strip() for cell in line.strip("|").split(" | ")]
            for line in part.splitlines()
            if line.startswith("|")
        ]
        if len(rows) > 2:
            found[part.partition("\n")[0]] = {
                row[0]: dict(zip(rows[0], row, strict=False)) for row in rows[2:]
            }
    return found


def ratios() -> list[Ratios]:
    """All works of the report."""
    made = []
    every = tables()
    for begin, name in WORKS.items():
        table = next(
            (rows for title, rows in every.items() if title.startswith(begin)), None
        )
        if table is None:
            continue
        peer = "C" if "C" in table else "numba"
        unit = list(next(iter(table.values())))[1]
        slow = unit.endswith("/step")  # a time, not a speed
        plain = table["stepwell, 1 thread"]
        shorter = [
            row
            for contestant, row in table.items()
            if contestant.startswith("stepwell, fused")
        ]
        fused = (min if slow else max)(
            shorter or [plain], key=lambda row: float(row[unit])
        )
        (own, exact), (own_best, best) = (
            [float(row[unit]) for row in pair]
            for pair in ((plain, table[f"{peer}, exact"]), (fused, table[peer]))
        )
        both = (
            (exact / own, best / own_best) if slow else (own / exact, own_best / best)
        )
        made.append(Ratios(name, peer, *both, plain["error"]))
    return made


def rows() -> list[list[str]]:
    """The table, row by row."""
    return [
        [r.name, r.peer, f"{r.exact:.2f}", f"{r.best:.2f}", r.error] for r in ratios()
    ]


#: The groups of the pictures: their titles, and what the names of their works contain.
GROUPS = {
    "own equations": ("own equation",),
    "in float32": ("float32",),
    "oscillators and pendulums": ("oscillator", "pendulum"),
    "bodies": ("figure-eight", "bodies", "stars"),
    "springs": ("springs",),
}
#: Within this of each other two programs are level.
LEVEL = 0.1
#: The file and the title of each picture, the ratio that it shows, and what is compared.
PICTURES = {
    "speed.png": (
        "exact",
        "Same arithmetic: as fast as {peers}, or faster, in {ahead} of {all}",
        "The same sums and products, each rounded",
    ),
    "speed-best.png": (
        "best",
        "Each as fast as it can: level or faster in {ahead} of {all}",
        "Fused, reordered and approximated where that is faster",
    ),
}


def grouped(found: list[Ratios], what: str) -> list[tuple[str, list[Ratios]]]:
    """The works in their groups, the fastest first."""
    groups: dict[str, list[Ratios]] = {name: [] for name in GROUPS}
    for each in found:
        groups[
            next(
                name
                for name, parts in GROUPS.items()
                if any(part in each.name for part in parts)
            )
        ].append(each)
    return [
        (name, sorted(works, key=lambda r: -float(getattr(r, what))))
        for name, works in groups.items()
        if works
    ]


def draw() -> None:
    """The pictures: a row for each work."""
    from matplotlib import rc_context
    from stepwell.base.pictures import png
    from stepwell.views.charts import style
    from stepwell.views.charts.labels import title

    found = ratios()
    for file, (what, head, about) in PICTURES.items():
        groups = grouped(found, what)
        rows = len(found) + len(groups)
        height = 0.27 * rows + 2.1
        ahead = sum(
            getattr(r, what) >= (0.995 if what == "exact" else 1.0 - LEVEL)
            for r in found
        )
        with rc_context(style.FONT):
            figure: Any = style.new_figure(12.0, height)
            axes = figure.add_axes(
                (0.375, 0.85 / height, 0.6, 0.27 * rows / height),
                xscale="log",
                ylim=(rows - 0.4, -0.4),
            )
            axes.axvspan(1.0 - LEVEL, 1.0 / (1.0 - LEVEL), color="#eeeeee", zorder=0)
            axes.axvline(1.0, color="#222222", linewidth=1.0, zorder=1)
            place, marks = 0, []
            for name, works in groups:
                marks.append((place, name, True))
                for r in works:
                    place += 1
                    value = float(getattr(r, what))
                    colour = style.FAMILIES[
                        "Runge-Kutta" if value >= 1.0 - LEVEL else "Heun"
                    ]
                    axes.plot(
                        [1.0, value],
                        [place, place],
                        color=colour,
                        linewidth=2.0,
                        zorder=2,
                    )
                    axes.plot(
                        [value], [place], "o", color=colour, markersize=8, zorder=3
                    )
                    marks.append(
                        (
                            place,
                            f"{r.name.removeprefix('own equation: ').replace(' in float32', '')}  ({r.peer})",
                            False,
                        )
                    )
                place += 1
            axes.set_yticks([at for at, *_ in marks], [text for _, text, _ in marks])
            for label, (*_, is_head) in zip(axes.get_yticklabels(), marks, strict=True):
                label.set(
                    weight="bold" if is_head else "normal",
                    size=12.0 if is_head else 11.5,
                )
            every = [float(getattr(r, what)) for r in found]
            low, high = (
                min(0.45, *every) / 1.08,
                max(2.0, *every) * 1.08,
            )  # no point is cut off
            ticks = [
                tick
                for tick in (0.35, 0.5, 0.7, 1.0, 1.4, 2.0, 2.8)
                if low <= tick <= high
            ]
            axes.set_xticks(ticks, [f"{tick:g}×" for tick in ticks])
            axes.minorticks_off()
            axes.set_xlim(low, high)
            axes.tick_params(axis="y", length=0)
            axes.grid(axis="x", color="#e4e4e4", linewidth=0.8)
            axes.set_axisbelow(True)
            axes.spines[["top", "right", "left"]].set_visible(False)
            axes.set_xlabel(
                "times as fast as the peer in brackets, one thread, equal errors; band: level within 10 %",
                size=12.0,
            )
            title(
                figure,
                0.012,
                1.0 - 0.45 / height,
                head.format(
                    peers="hand-written C or numba", ahead=ahead, all=len(found)
                ),
                18,
            )
            figure.text(
                0.012, 1.0 - 0.77 / height, f"{about}.", size=12.5, color=style.GREY
            )
            (ROOT / "docs" / "images" / file).write_bytes(png(figure))


#: Contestants that take many times as long as stepwell on own equations, as sentences say.
SLOWER = "numba, plain", "diffrax", "NumPy reference", "SciPy"


def figures() -> list[str]:
    """What sentences say of the report: how many times as long others take, and in how many works stepwell is level."""
    own = [table for title, table in tables().items() if title.startswith("W7")]
    lines = []
    for name in SLOWER:
        rows = [
            (each["stepwell, 1 thread"], each[name]) for each in own if name in each
        ]
        times = [
            float(ours["M steps/s"]) / float(row["M steps/s"])
            for ours, row in rows
            if row["M steps/s"] != "—"
        ]
        lines.append(
            f"{name} takes {min(times):.3g} to {max(times):.3g} times as long"
            if times
            else f"{name} was left out"
        )
    every = ratios()
    level = sum(each.exact >= 1.0 - LEVEL for each in every)
    return [*lines, f"level or ahead: {level} of {len(every)}"]


if __name__ == "__main__":
    draw()
    print(*figures(), sep="\n")
