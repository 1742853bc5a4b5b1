"""``python -m benches.compare``: every language on the same work, in one run."""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from pathlib import Path

from .. import stages
from ..budget import Budget
from . import extras, machine, peers, report, runner, workloads
from .chosen import solar, tables
from .own import first_call

EPILOG = """To compare at another CPU level: STEPWELL_KERNELS=avx2 (stepwell), STEPWELL_BENCH_MARCH=x86-64-v3 (C),
NUMBA_CPU_NAME=haswell NUMBA_CPU_FEATURES=+avx2,+fma (numba)."""


HERE, OUT = Path(__file__).parents[1], Path(__file__).parents[2] / "out"
#: For all of it, on two cores; ``python -m benches.stiff`` has the rest of half an hour.
MINUTES = 24.0
#: Tables besides those of the works: of adaptive steps, of own equations, of stages, and of what is besides steps.
TABLES = 9


def parts(asked: argparse.Namespace, budget: Budget) -> Iterator[str | report.Table]:
    """All tables, and what is said before some of them."""
    only, quick, repeats = tuple(asked.only.split(",")), asked.quick, asked.repeats
    contestants = peers.catalogue()
    for work in works(asked):
        rows = runner.measure(contestants, work, repeats, quick, budget)
        yield report.table(work, rows)
        yield report.threads(rows)
    if "chosen".startswith(only):
        yield "## Adaptive steps\n\n" + tables.READING.format(repeats=repeats, budget=solar.BUDGET)
        yield from tables.tables(repeats, quick, asked.members, budget)
    if first_call.NAME.startswith(only):
        yield "## Own equations\n\n" + first_call.READING.format(members=first_call.MEMBERS, repeats=repeats)
        yield first_call.table(repeats, quick, budget)
    if "stages".startswith(only):
        yield stages.table()
        yield stages.adaptive_table()
    yield "Besides steps", ["what", "measured", "aim"], [list(line) for line in extras.table(repeats, quick)]


def works(asked: argparse.Namespace) -> list[workloads.Workload]:
    """The works that are asked for; in a quick run the first of each class, since most of its time is for compilers."""
    chosen = [work for work in workloads.catalogue() if work.name.startswith(tuple(asked.only.split(",")))]
    return [work.quick() for work in {type(work): work for work in reversed(chosen)}.values()][::-1] if asked.quick else chosen


def main() -> None:
    """Time, show, write."""
    parser = argparse.ArgumentParser(prog="python -m benches.compare", description=__doc__, epilog=EPILOG)
    parser.add_argument(
        "-o", "--output", type=Path, help="the report (default: benches/RESULTS.md, of a quick run out/RESULTS.md)"
    )
    parser.add_argument("--quick", action="store_true", help="a little of everything, to see that it works")
    parser.add_argument("--repeats", type=int, help="how many samples of each contestant (default: 9, of a quick run 3)")
    about = "only the works that begin so, with commas between; chosen for adaptive steps, W7 for own equations, stages for a "
    about += "call; the others stay in the report as they are"
    parser.add_argument("--only", default="", metavar="W4", help=about)
    parser.add_argument("--members", type=int, default=1000, help="orbits with adaptive steps (default: 1000)")
    parser.add_argument("--minutes", type=float, default=MINUTES, help=f"for all of it (default: {MINUTES:g})")
    asked = parser.parse_args()
    asked.repeats = asked.repeats or (3 if asked.quick else 9)
    asked.output = asked.output or (OUT if asked.quick else HERE) / "RESULTS.md"
    asked.output.parent.mkdir(exist_ok=True)

    begin, load = time.perf_counter(), machine.load()
    budget = Budget(60.0 * asked.minutes, len(works(asked)) + TABLES)
    reading = report.READING.format(repeats=asked.repeats, sample=1e3 * runner.SAMPLE / (10 if asked.quick else 1))
    texts = [f"## How to read\n\n{reading}"]
    before = asked.output.read_text(encoding="utf-8") if asked.only and asked.output.is_file() else None
    described = machine.describe()
    if asked.quick:
        described.append(("left out", "of a quick run, all but the first work of a class, and most of their members and steps"))

    def write(*more: tuple[str, str]) -> None:
        """What is known so far, so that nothing is lost if a later work fails or is interrupted."""
        about = "\n".join(f"- {what}: {value}" for what, value in [*described, *more])
        whole = ["# Every language on the same work", "Written by `python -m benches.compare`; do not edit.", about, *texts]
        text = "\n\n".join(part.strip() for part in whole if part) + "\n"
        text = text if before is None else report.renewed(before, text, asked.only)
        asked.output.write_text(f"{text}\n{report.left_out(text)}\n", encoding="utf-8")

    with budget.last_resort(), runner.heard():
        for part in parts(asked, budget):
            if not isinstance(part, str):
                report.show(*part)
                part = report.markdown(*part)
            texts.append(part)
            write()
    minutes = (time.perf_counter() - begin) / 60.0
    write(("load of the machine", f"{load} before, {machine.load()} after"), ("minutes", f"{minutes:.1f} of {asked.minutes:g}"))
    print(f"{report.left_out(asked.output.read_text(encoding='utf-8'))}\nWritten to {asked.output} in {minutes:.1f} minutes.")


if __name__ == "__main__":
    main()
