"""The report: rows to tables, on the screen and as Markdown."""

from __future__ import annotations

from .runner import Row
from .workloads import Workload

Table = tuple[str, list[str], list[list[str]]]

HEAD = ["contestant", "speed", "min … max", "error", "remarks"]

READING = """\
A call goes from the user's arrays to the final state. A number is the median of {repeats} repeats; the least and the
most follow. The contestants take turns in every repeat, and each sample lasts at least {sample:.0f} ms. The columns with ÷
say how many times as fast it is as that contestant.

- G steps/s: 10⁹ member-steps a second, members × steps ÷ time.
- ns/step: time ÷ steps, of one member.
- M system-steps/s: 10⁶ member-steps a second.
- G pairs/s: 10⁹ directed pairs a second. N bodies have N(N − 1) in an evaluation, also if each pair is computed once.
  The number of evaluations is steps + 1 by C and numba, steps + 2 by stepwell, whose leapfrog makes both
  half kicks separately, and steps by REBOUND.

*Error* is the largest distance of a member's, or a body's, (v, y) from the true one at the end: the exact solution,
or that of a better method with a fine step. Amplitudes are about 1. A contestant whose error is larger than the method
explains is not timed. All contestants use the same method, so equal errors mean equal work and the speeds may be
compared; one that did a smaller share has the error of that share. Only REBOUND's leapfrog is another: drift-kick-drift in
place of kick-drift-kick.

*C* may contract to FMA, and with bodies also reorder and replace root and division by a close approximation (rsqrt);
*numba* may contract and reorder. *C, exact* computes as stepwell does, whose results are the same to the last bit on
every machine. All of them are the best of several shapes, found before the timing; one thread each, unless the title
says all. *stepwell* is `stepwell.integrate`, checks of the arguments included. Only ratios within this file mean
anything: another machine, or another hour on a shared one, gives other speeds.

W7 are equations that users write themselves. stepwell traces them anew in every call, and that is timed; the compilation of
others is not. *numba* there is the best of several shapes that may contract, or reorder, too; *numba, exact* the best that
may not; *numba, plain* steps one member after another with the functions of `math`, as most people write it. The blocks of
numba have polynomials for the sine and the exponential that hold for results of usual size only; stepwell's hold for all.
*diffrax* and *JAX* take some thousand members as one array, unless the name says all at once. *heyoka* and *SciPy* choose
their own, longer steps: they get the coarsest tolerance at which their error is no larger than that of the common method
and step, and are shown as if they had made as many steps as the others.
"""


def number(x: float) -> str:
    """Three digits."""
    return f"{x:.3g}" if x < 999.5 else f"{x:.0f}"


def table(work: Workload, rows: list[Row]) -> Table:
    """One workload's table, fastest first."""
    speed = {row.name: row.rates[1] for row in rows if row.seconds}
    head = [HEAD[0], work.unit.name, *HEAD[2:-1], *(f"÷ {peer}" for peer in work.beside), HEAD[-1]]
    lines = []
    for row in sorted(rows, key=lambda row: -speed.get(row.name, 0.0)):
        if row.missing:
            lines.append([row.name, *["—"] * (len(head) - 2), row.missing])
            continue
        middle = row.rates[1]
        ratios = [f"{middle / speed[peer]:.2f}" if peer in speed else "—" for peer in work.beside]
        low, shown, high = (number(each) for each in sorted(work.unit.shown(rate) for rate in row.rates))
        lines.append([row.name, shown, f"{low} … {high}", f"{row.error:.1e}", *ratios, row.note])
    title = f"{work.name}: {work.about}, {work.size}, {work.steps:,} steps of {work.dt:g}"
    return title, head, lines


def threads(rows: list[Row]) -> str:
    """How much all threads bring."""
    timed = [row for row in rows if row.name.startswith("stepwell") and row.seconds]
    return " ".join(f"{row.name}: {row.rates[1] / timed[0].rates[1]:.2f} times the speed of one." for row in timed[1:])


def show(title: str, head: list[str], lines: list[list[str]]) -> None:
    """On the screen; as Markdown if there is no rich."""
    try:
        from rich.console import Console
        from rich.table import Table as RichTable
    except ImportError:
        print(markdown(title, head, lines))
        return
    shown = RichTable(title=title, title_justify="left")
    for i, name in enumerate(head):
        last = i == len(head) - 1
        shown.add_column(name, justify="left" if last or i == 0 else "right", no_wrap=not last)
    for line in lines:
        shown.add_row(*line)
    console = Console()
    (console if console.is_terminal else Console(width=150)).print(shown)


def markdown(title: str, head: list[str], lines: list[list[str]]) -> str:
    """As Markdown."""
    rows = [head, ["---"] * len(head), *lines]
    return "\n".join([f"## {title}", "", *(f"| {' | '.join(row)} |" for row in rows), ""])


def sections(text: str) -> dict[str, str]:
    """The parts of a report by their titles; what is before the first has none."""
    parts = ("\n" + text).split("\n## ")
    return {"": parts[0].strip()} | {part.partition("\n")[0]: f"## {part.strip()}" for part in parts[1:]}


def left_out(text: str) -> str:
    """The last section of a report: every row of its tables with a dash, and why; what is so in several tables is said once."""
    tables: dict[str, list[str]] = {}
    for title, part in sections(text).items():
        head, _, *lines = [line.strip("| ").split(" | ") for line in part.splitlines() if line.startswith("|")] or [[], []]
        for line in lines:
            cells = dict(zip(head, line, strict=False))
            columns = [name for name, cell in cells.items() if cell == "—" and not name.startswith("÷")]
            if columns:
                every = len(columns) >= len([name for name in head if not name.startswith("÷")]) - 2
                where = "" if every else f", {', '.join(columns)}"
                why = cells.get("remarks") or "not as exact, or not in time"
                tables.setdefault(f"{line[0]}{where}: {why}", []).append(title)
    items = [line.replace("left out: ", "", 1) for line in sections(text)[""].splitlines() if line.startswith("- left out: ")]
    items += [f"- {what} ({'; '.join(titles)})" for what, titles in tables.items()]
    return "\n".join(["## Left out", "", *(items or ["Nothing."])])


def renewed(before: str, now: str, only: str) -> str:
    """A report in which some works were done again, in a run of their own. Ratios are within a work, so they hold on."""
    old, new = sections(before), sections(now)
    old.pop("Left out", None)
    date = next((line for line in new[""].splitlines() if line.startswith("- date: ")), "- date: unknown")
    again = f"- done again in a run of their own, {date.removeprefix('- date: ')}: {only}"
    head = [line for line in old[""].splitlines() if line != again]
    return "\n\n".join((old | new | {"": "\n".join([*head, again])}).values()) + "\n"
