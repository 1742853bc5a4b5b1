"""Writes the tables of README.md and of the pages in docs that are made from the methods' records.

A table stands between ``<!-- generated: NAME -->`` and ``<!-- end generated -->``. After a change to a record run
``.venv/bin/python docs/generate.py``, with the names of pages for these alone; the tests fail while a table is stale.
"""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Iterable
from pathlib import Path

import stepwell as sw
from stepwell.analysis.stability.criterion import signed

sys.path.insert(0, str(Path(__file__).resolve().parent))
import options
import speed

ROOT = Path(__file__).resolve().parent.parent
PLACE = re.compile(
    r"(<!-- generated: (\w+) -->\n).*?(<!-- end generated -->)", re.DOTALL
)


def limit(angle: float, digits: int) -> str:
    """A stability limit in words where it is no number."""
    if math.isinf(angle):
        return "stable at every step"
    return f"{angle:.{digits}g}" if angle else "never stable"


def table(head: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    """A Markdown table."""
    head = list(head)
    lines = [head, ["---"] * len(head), *map(list, rows)]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def or_dash(names: Iterable[str]) -> str:
    """The names, or a dash if there are none."""
    return "; ".join(names) or "—"


def methods() -> str:
    """What each method is, costs and stands."""
    head = (
        "name",
        "title",
        "standard name",
        "order",
        "function evaluations",
        "stable for Φ below",
    )
    return table(
        head,
        (
            (
                f"`{m.name}`",
                m.title,
                m.other_names[0] if m.other_names else "—",
                str(m.order),
                str(m.evaluations),
                limit(m.limit, 6),
            )
            for m in sw.methods()
        ),
    )


def names() -> str:
    """Hoffmann's names beside the standard ones."""
    head = "title", "section", "name", "also called", "not to be taken for"
    rows = (
        (
            m.title,
            m.section,
            f"`{m.name}`",
            or_dash(m.other_names),
            or_dash(m.false_friends),
        )
        for m in sw.methods()
    )
    return table(head, rows)


def requirements() -> str:
    """What each method asks of a system, when it checks it, and what it carries."""
    head = "name", "asks for", "rates at (of a step)", "carries", "starts"
    return table(
        head,
        (
            (
                f"`{m.name}`",
                "ÿ = a(t, y)" if m.needs_acceleration else "two rates",
                ", ".join(f"{node:g}" for node in m.nodes),
                f"`{m.carry}`" if m.carry else "`v`",
                or_dash(f"`{start}`" for start in m.starts),
            )
            for m in sw.methods()
        ),
    )


def criteria() -> str:
    """The undamped oscillator by each method: limits and series."""
    head = (
        "method",
        "stable for Φ below",
        "steps a period, more than",
        "r₁² − 1",
        "Ψ/Φ − 1",
    )
    return table(
        head,
        (
            (
                c.method.title,
                limit(c.limit, 10),
                f"{c.samples_per_period:.4g}" if c.limit else "—",
                c.r1_squared,
                c.deviation,
            )
            for c in sw.criteria()
        ),
    )


def deviations() -> str:
    """The undamped oscillator by each method, at some angles per step."""
    found = sw.criteria()
    head = ["method"]
    for at in found[0].at:
        head += [f"r₁² − 1 at Φ = {at.phi:g}", f"Ψ/Φ − 1 at {at.phi:g}"]
    rows = []
    for c in found:
        row = [c.method.title]
        for at in c.at:
            row += [signed(at.r1_squared - 1.0), signed(at.deviation, percent=True)]
        rows.append(row)
    return table(head, rows)


def operations() -> str:
    """The operations of a step of the undamped oscillator."""
    head = (
        "method",
        "additions",
        "products",
        "quotients",
        "roots",
        "function evaluations",
    )
    rows = []
    for c in sw.criteria():
        o = c.operations
        counts = (
            o.additions,
            o.multiplications,
            o.divisions,
            o.square_roots,
            o.rate_evaluations,
        )
        rows.append([c.method.title, *map(str, counts)])
    return table(head, rows)


def paper() -> str:
    """Hoffmann's statements, by section."""
    parts = []
    for section in dict.fromkeys(entry.section for entry in sw.paper.entries()):
        entries = sw.paper.entries(section)
        columns = [
            (
                entry.kind,
                entry.says,
                entry.corrected or "—",
                entry.here,
                entry.run().numbers,
            )
            for entry in entries
        ]
        rows = [[cell.replace("|", "\\|") for cell in row] for row in columns]
        parts.append(
            f"## {section}\n\n"
            + table(
                (
                    "kind",
                    "statement",
                    "correction",
                    "in stepwell",
                    "numbers",
                ),
                rows,
            )
        )
    return "\n" + "\n".join(parts) + "\n"


def speeds() -> str:
    """How many times as fast as a compiled peer, from the report of the benches."""
    head = "workload", "peer", "the same arithmetic", "the best of each", "error"
    return table(head, speed.rows())


def from_report(begin: str) -> str:
    """A table of the report of the benches, as it stands there."""
    title, rows = next(
        (title, rows)
        for title, rows in speed.tables().items()
        if title.startswith(begin)
    )
    lines = list(rows.values())
    return f"{title}\n\n" + table(lines[0], (line.values() for line in lines))


TABLES = {
    "speeds": speeds,
    "stages": lambda: from_report("A call by stages"),
    "one_orbit": lambda: from_report(
        "Adaptive steps: Kepler's ellipse, e = 0.9, 10 periods, one orbit"
    ),
    "many_orbits": lambda: from_report(
        "Adaptive steps: Kepler's ellipse, e = 0.9, 10 periods, 10,000"
    ),
    "one_round": lambda: from_report(
        "Adaptive steps: Arenstorf's orbit, once round, one"
    ),
    "paper": paper,
    "methods": methods,
    "names": names,
    "asks": requirements,
    "criteria": criteria,
    "deviations": deviations,
    "operations": operations,
    "options": options.tables,
}


def current(text: str) -> str:
    """A page with its tables as they should be."""
    return PLACE.sub(lambda place: place[1] + TABLES[place[2]]() + place[3], text)


def pages() -> list[Path]:
    """The pages that may hold tables."""
    return [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]


if __name__ == "__main__":
    for page in [Path(name).resolve() for name in sys.argv[1:]] or pages():
        old = page.read_text(encoding="utf-8")
        if (new := current(old)) != old:
            page.write_text(new, encoding="utf-8")
            print(f"{page.relative_to(ROOT)}: written anew")
