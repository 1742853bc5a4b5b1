"""``python -m benches.compare``: every language on the same work, in one run."""

from __future__ import annotations

import argparse
import warnings
from pathlib import Path

from .. import stages
from . import extras, machine, peers, report, runner, workloads
from .chosen import solar, tables
from .own import first_call

EPILOG = """To compare at another CPU level: STEPWELL_KERNELS=avx2 (stepwell), STEPWELL_BENCH_MARCH=x86-64-v3 (C),
NUMBA_CPU_NAME=haswell NUMBA_CPU_FEATURES=+avx2,+fma (numba)."""


def main() -> None:
    """Time, show, write."""
    parser = argparse.ArgumentParser(prog="python -m benches.compare", description=__doc__, epilog=EPILOG)
    parser.add_argument("-o", "--output", type=Path, default=Path(__file__).parents[1] / "RESULTS.md", help="the report")
    parser.add_argument("--quick", action="store_true", help="a little of everything, to see that it works")
    parser.add_argument("--repeats", type=int, default=9, help="how many samples of each contestant (default: 9)")
    about = "only the works that begin so, with commas between; chosen for adaptive steps, W7 for own equations, stages for a "
    about += "call; the others stay in the report as they are"
    parser.add_argument("--only", default="", metavar="W4", help=about)
    parser.add_argument("--members", type=int, default=10_000, help="orbits with adaptive steps (default: 10 000)")
    given = parser.parse_args()
    repeats, only = 3 if given.quick else given.repeats, tuple(given.only.split(","))
    warnings.simplefilter("error")

    load = machine.load()
    reading = report.READING.format(repeats=repeats, sample=1e3 * runner.SAMPLE / (10 if given.quick else 1))
    parts = [f"## How to read\n\n{reading}"]
    before = given.output.read_text(encoding="utf-8") if given.only and given.output.is_file() else None
    contestants = peers.catalogue()
    described = [*machine.describe(), ("load of the machine", f"{load} before")]

    def write() -> None:
        """What is known so far, so that nothing is lost if a later work fails or is interrupted."""
        told = "\n".join(f"- {what}: {value}" for what, value in described)
        whole = ["# Every language on the same work", "Written by `python -m benches.compare`; do not edit.", told, *parts]
        text = "\n\n".join(part.strip() for part in whole) + "\n"
        given.output.write_text(text if before is None else report.renewed(before, text, given.only), encoding="utf-8")

    for work in workloads.catalogue():
        if not work.name.startswith(only):
            continue
        if given.quick:
            work = work.quick()
        rows = runner.measure(contestants, work, repeats, given.quick)
        made = report.table(work, rows)
        report.show(*made)
        parts += [report.markdown(*made), report.threads(rows)]
        write()
    if "chosen".startswith(only):
        parts.append("## Adaptive steps\n\n" + tables.READING.format(repeats=repeats, budget=solar.BUDGET))
        for made in tables.tables(repeats, given.quick, given.members):
            report.show(*made)
            parts.append(report.markdown(*made))
            write()
    if first_call.NAME.startswith(only):
        parts.append("## Own equations\n\n" + first_call.READING.format(members=first_call.MEMBERS, repeats=repeats))
        made = first_call.table(repeats, given.quick)
        report.show(*made)
        parts.append(report.markdown(*made))
        write()
    if "stages".startswith(only):
        for make in (stages.table, stages.adaptive_table):
            made = make()
            report.show(*made)
            parts.append(report.markdown(*made))
            write()
    made = "Besides steps", ["what", "measured", "aim"], [list(line) for line in extras.table(repeats, given.quick)]
    report.show(*made)
    parts += [report.markdown(*made)]
    described[-1] = ("load of the machine", f"{load} before, {machine.load()} after")
    write()
    print(f"Written to {given.output}.")


main()
