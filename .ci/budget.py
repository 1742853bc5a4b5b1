"""Compares the size of the project with .ci/budget.toml: ``python .ci/budget.py [lines | built | suite]``, all if none is named.

Lines are those of the files that git knows or would add. What is built is the wheel in dist/ and the package that this Python
imports. The suite is the last run of ``make test``. Above a number it fails; who raises one says why in the commit.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tomllib
import zipfile
from collections import Counter
from collections.abc import Iterable
from itertools import chain
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
#: What is counted under which name: the folder whose layers have a number each, and the files.
FOLDERS = {"package": ("python/stepwell", (".py", ".pyi")), "rust": ("rust", (".rs",)), "tests": ("tests", (".py",))}
#: The processor time of an import, without NumPy's: the least of some, since other work on the machine only adds to it.
IMPORT = "import time, numpy; start = time.process_time(); import stepwell; print(time.process_time() - start)"
TIMES = 7

Measured = Iterable[tuple[str, str, float]]


def lines() -> Measured:
    """Lines by layer, and in all."""
    listed = subprocess.run(
        ["git", "ls-files", "--cached", "--others", "--exclude-standard"], cwd=ROOT, capture_output=True, text=True, check=True
    )
    files = [Path(name) for name in listed.stdout.splitlines() if (ROOT / name).is_file()]
    for name, (folder, suffixes) in FOLDERS.items():
        counts: Counter[str] = Counter()
        for file in files:
            if file.is_relative_to(folder) and file.suffix in suffixes:
                *layer, _ = file.relative_to(folder).parts
                depth = {"rust": 3 if layer[:2] == ["core", "src"] else 2}.get(name, 1)
                counts["/".join(layer[:depth]) or "files"] += (ROOT / file).read_bytes().count(b"\n")
        yield from ((f"lines.{name}", layer, count) for layer, count in sorted(counts.items()))
        yield f"lines.{name}", "in all", counts.total()


def built() -> Measured:
    """Wheel, library and import."""
    for wheel in (ROOT / "dist").glob("*.whl"):
        yield "kilobytes", "wheel", wheel.stat().st_size / 1000
        with zipfile.ZipFile(wheel) as file:
            yield "kilobytes", "library", max(each.file_size for each in file.infolist()) / 1000
    taken = [float(subprocess.run([sys.executable, "-c", IMPORT], capture_output=True, check=True).stdout) for _ in range(TIMES)]
    yield "milliseconds", "import", 1000 * min(taken)


def suite() -> Measured:
    """The number of everyday tests, and the share of the longest file, in percent: seconds differ from machine to machine."""
    durations = json.loads((ROOT / ".venv/durations.json").read_text(encoding="utf-8"))
    yield "suite", "tests", sum(tests for tests, _ in durations.values())
    seconds = [seconds for _, seconds in durations.values()]
    yield "suite", "percent of a file", 100 * max(seconds) / sum(seconds)


def above(budget: dict[str, Any], measured: Measured) -> list[str]:
    """What is above the budget, in words; what has no number there may be nothing."""
    said = []
    for table, name, number in measured:
        limits = budget
        for key in table.split("."):
            limits = limits.get(key, {})
        if number > limits.get(name, 0):
            said.append(f".ci/budget.toml allows {limits.get(name, 0)} of {table}, {name}, and there are {number:.0f}")
    return said


def main(names: list[str]) -> int:
    """Returns the exit status."""
    budget = tomllib.loads((ROOT / ".ci/budget.toml").read_text(encoding="utf-8"))
    measures = [measure for measure in (lines, built, suite) if measure.__name__ in names or not names]
    if said := above(budget, chain.from_iterable(measure() for measure in measures)):
        print(*said, "Make it smaller, or raise the number in the same commit and say why in its message.", sep="\n")
    return bool(said)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
