"""From what was measured to the tables and the picture of the page."""

from __future__ import annotations

import math
import re
from pathlib import Path
from statistics import median
from typing import Any

from ..compare.report import number
from .contestants import OURS

ROOT = Path(__file__).resolve().parents[2]
PAGE, PICTURE = ROOT / "docs" / "benchmarks" / "stiff.md", ROOT / "docs" / "images" / "stiff.png"
PLACE = re.compile(r"(<!-- measured: stiff -->\n).*?(<!-- end measured -->)", re.DOTALL)

Rows = dict[str, dict[str, Any]]


def ratio(rows: Rows, way: str, place: int) -> tuple[list[float], str] | None:
    """How many times as fast stepwell is as the best peer, turn by turn, and that peer; None if nobody was as exact."""
    ours = rows[OURS.name][way][place]
    peers = {name: row[way][place] for name, row in rows.items() if name != OURS.name and not row["missing"] and row[way][place]}
    if not ours or not peers:
        return None
    best = min(peers, key=lambda name: median(peers[name]))
    return [peer / own for peer, own in zip(peers[best], ours, strict=False)], best


def compared(rows: Rows, way: str, place: int) -> str:
    """A cell of the first table."""
    found = ratio(rows, way, place)
    if found is None:
        return "—"
    times, best = found
    return f"**{number(median(times))}** ({number(min(times))} … {number(max(times))}), {best}"


def table(head: list[str], lines: list[list[str]]) -> str:
    """As Markdown, numbers to the right."""
    rows = [head, ["---"] + ["---:"] * (len(head) - 1), *lines]
    return "".join(f"| {' | '.join(row)} |\n" for row in rows)


def members(row: dict[str, Any]) -> str:
    """How many members the batch of a contestant has, with a space before the last three digits."""
    return f"{row['members']:,}".replace(",", " ")


def summary(known: dict[str, Any]) -> str:
    """Ratios for all problems."""
    lines = [
        [f"{name}, {f'{members(rows[OURS.name])} members' if way == 'batch' else 'one member'}", *cells(known, rows, way)]
        for way in ("batch", "one")
        for name, rows in known["problems"].items()
    ]
    return table(["", *(f"error {aim:.0e}" for aim in known["aims"])], lines)


def cells(known: dict[str, Any], rows: Rows, way: str) -> list[str]:
    """The ratios of a problem, an error each."""
    return [compared(rows, way, place) for place in range(len(known["aims"]))]


def details(known: dict[str, Any], rows: Rows) -> str:
    """Times of one problem."""
    head = ["", "first call, ms", "members", *(f"{aim:.0e}" for aim in known["aims"])]
    head += [f"one, {aim:.0e}" for aim in known["aims"]]
    lines = []
    for name, row in rows.items():
        if row["missing"]:
            lines.append([name, *["—"] * (len(head) - 2), row["missing"]])
            continue
        several = len({point[0][0] for point in row["points"]}) > 1

        def shown(way: str, place: int, row: dict[str, Any] = row, several: bool = several) -> str:
            if not (times := row[way][place]):
                return "—"
            cell = number(1e6 * median(times))
            return f"{cell}, {row['chosen'][place][0]}" if several and way == "batch" else cell

        times = [shown(way, place) for way in ("batch", "one") for place in range(len(known["aims"]))]
        lines.append([name, number(1e3 * max(row["first"], 0.0)), members(row), *times])
    return table(head, lines)


def write(known: dict[str, Any], page: Path) -> None:
    """Put the tables into the page."""
    parts = [known["machine"], "", "Times as fast as the best peer:", "", summary(known)]
    for name, rows in known["problems"].items():
        parts += [f"## {name}", "", details(known, rows)]
    text = (page if page.exists() else PAGE).read_text(encoding="utf-8")
    page.write_text(PLACE.sub(lambda found: found[1] + "\n".join(parts) + found[2], text), encoding="utf-8")


def front(points: list[list[Any]]) -> list[tuple[float, float]]:
    """Errors and seconds of those settings than which none is as cheap and more exact."""
    best, kept = math.inf, []
    for _, error, seconds in sorted(points, key=lambda point: point[2]):
        if error < best:
            best = error
            kept.append((error, seconds))
    return kept


def finding(known: dict[str, Any]) -> str:
    """The title of the picture: by how much the runs of a batch are cheaper than by the best peer."""
    found = [ratio(rows, "batch", place) for rows in known["problems"].values() for place in range(len(known["aims"]))]
    medians = [median(each[0]) for each in found if each is not None]
    if not medians or min(medians) < 1.0:
        return "Stiff systems: time of a run against the error that it achieves"
    return f"In a batch a stiff run takes 1/{min(medians):.0f} to 1/{max(medians):.0f} of the best peer's time"


def draw(known: dict[str, Any], path: Path = PICTURE) -> None:
    """Microseconds per trajectory against achieved error, a panel for each problem."""
    from stepwell.base.pictures import png
    from stepwell.views.charts import style

    names = list(dict.fromkeys(name for rows in known["problems"].values() for name, row in rows.items() if row["points"]))
    colours = dict(zip(names, (style.FAMILIES["Runge-Kutta"], *OTHERS), strict=False))
    with style.page(10.0, 8.4) as page:
        figure: Any = page
        for place, (problem, rows) in enumerate(known["problems"].items()):
            axes = figure.add_axes(
                (0.075 + 0.475 * (place % 2), 0.55 - 0.42 * (place // 2), 0.43, 0.32), xscale="log", yscale="log"
            )
            for name in names:
                kept = [each for each in front(rows[name]["points"] if name in rows else []) if 1e-11 < each[0] < 0.1]
                if kept:
                    errors, seconds = zip(*kept, strict=True)
                    width = 2.6 if name == OURS.name else 1.4
                    micro = [1e6 * each for each in seconds]
                    axes.plot(errors, micro, color=colours[name], linewidth=width, marker="o", markersize=3.0, label=name)
            axes.set(xlim=(0.05, 1.5e-10), title=problem)
            axes.title.set(ha="left", position=(0.0, 1.0))
            axes.grid(color="#e6e6e6", linewidth=0.8)
            axes.minorticks_off()
            axes.spines[["top", "right"]].set_visible(False)
            if place % 2 == 0:
                axes.set_ylabel("µs per trajectory")
            if place >= 2:
                axes.set_xlabel("achieved error")
        shown = dict(pair for axes in figure.axes for pair in zip(*reversed(axes.get_legend_handles_labels()), strict=True))
        figure.legend(shown.values(), shown.keys(), loc="lower center", ncols=4, frameon=False, fontsize=11)
        figure.text(0.012, 0.955, finding(known), size=17, weight="bold")
        figure.text(0.012, 0.92, known["machine"].split(", stepwell")[0], size=11, color=style.GREY)
        path.write_bytes(png(figure))


#: Colours of the peers.
OTHERS = ("#c75a22", "#7a7a7a", "#b8860b", "#2e8b57", "#8a5fb0", "#111111")
