"""Speeds beside peers, from the report of ``make bench``: the table of docs/benchmarks/speed.md, and its picture.

Run ``.venv/bin/python docs/speed.py`` to draw the picture; ``docs/generate.py`` writes the table.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

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
        plain, fused = (
            table["stepwell, 1 thread"],
            table.get("stepwell, fused, 1 thread", table["stepwell, 1 thread"]),
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


def draw() -> None:
    """The picture: a row for each work."""
    import matplotlib.pyplot as plt
    from stepwell.base.pictures import png

    found = ratios()
    figure, axes = plt.subplots(
        figsize=(8.6, 0.31 * len(found) + 1.3), layout="constrained"
    )
    exact, best = "#175ca6", "#c75a22"
    for place, r in enumerate(found):
        y = len(found) - 1 - place
        axes.plot([r.exact, r.best], [y, y], color="#bbbbbb", linewidth=1.2, zorder=1)
        axes.plot(r.exact, y, "o", color=exact, markersize=7, zorder=3)
        axes.plot(
            r.best,
            y,
            "D",
            color="white",
            markeredgecolor=best,
            markeredgewidth=1.6,
            markersize=6,
            zorder=2,
        )
    axes.axvline(1.0, color="#222222", linewidth=1.0, zorder=0)
    axes.set_xscale("log")
    every = [each for r in found for each in (r.exact, r.best)]
    low, high = min(0.45, *every) / 1.08, max(2.0, *every) * 1.08  # no point is cut off
    ticks = [
        tick
        for tick in (0.25, 0.35, 0.5, 0.7, 1.0, 1.4, 2.0, 2.8, 4.0)
        if low <= tick <= high
    ]
    axes.set_xticks(ticks, [f"{tick:g}×" for tick in ticks])
    axes.minorticks_off()
    axes.set_xlim(low, high)
    axes.set_ylim(-0.7, len(found) + 1.2)
    axes.set_yticks(
        range(len(found)), [f"{r.name}  ({r.peer})" for r in reversed(found)]
    )
    axes.tick_params(axis="y", length=0)
    axes.grid(axis="x", color="#e4e4e4", linewidth=0.8)
    axes.set_axisbelow(True)
    for side in ("top", "right", "left"):
        axes.spines[side].set_visible(False)
    top = len(found) + 0.35
    axes.text(0.985, top, "← the peer is faster", ha="right", color="#555555")
    axes.text(1.015, top, "stepwell is faster →", ha="left", color="#555555")
    axes.set_xlabel("times as fast as the peer in brackets, one thread, equal errors")
    ahead = sum(r.exact >= 0.995 for r in found)
    told = "By the same arithmetic stepwell is level with the fastest C or numba\n"
    told += f"that we could write, or ahead, in {ahead} of {len(found)} workloads"
    figure.suptitle(told, x=0.01, ha="left", fontsize=11.5, weight="bold")
    figure.legend(
        handles=[
            plt.Line2D([], [], marker="o", linestyle="", color=exact, label="the same sums and products, each rounded"),
            plt.Line2D(
                [], [], marker="D", linestyle="", color="white", markeredgecolor=best, markeredgewidth=1.6,
                label="each as fast as it can: fused, reordered, approximate roots",
            ),
        ],
        loc="outside lower right", ncols=2, frameon=False, fontsize=8.5,
    )  # fmt: skip
    (ROOT / "docs" / "images" / "speed.png").write_bytes(png(figure, 130))


if __name__ == "__main__":
    draw()
