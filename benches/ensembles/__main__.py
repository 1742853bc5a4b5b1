"""``python -m benches.ensembles``: the three sweeps by all contestants, each in a process of its own, into the page of the docs.

A sweep that was measured before is not measured again unless it is named by ``--again``; so an interrupted run goes on.
"""

from __future__ import annotations

import argparse
import ast
import json
import re
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from ..compare import machine
from . import truth
from .work import SHARES, SIZES, members, smaller

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
PAGE = ROOT / "docs" / "benchmarks" / "ensembles.md"
PLACE = re.compile(r"(<!-- measured: ensembles -->\n).*?(<!-- end measured -->)", re.DOTALL)
CONTESTANTS = {"stepwell": "stepwell", "numba": "numba + joblib", "heyoka": "heyoka's ensemble"}
TITLES = {
    "bifurcation": "A driven spring: {members:,} drives",
    "basins": "A magnetic pendulum: {members:,} starts",
    "figure_eight": "Near the figure-eight: {members:,} starts",
}
QUICK = ", a quick run: times of so few members tell little"
#: No sweep takes longer, in seconds.
MAX_SECONDS = 1800


def lines(contestant: str, name: str) -> int:
    """Lines of code of a contestant: without blank ones, comments and docstrings, and without ``work.py``, which all share."""
    text = (HERE / f"{contestant}_{name}.py").read_text(encoding="utf-8")
    told: set[int] = set()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str):
            told |= set(range(node.lineno, (node.end_lineno or node.lineno) + 1))
    rows = enumerate(text.splitlines(), 1)
    return sum(1 for number, row in rows if row.strip() and not row.strip().startswith("#") and number not in told)


def measured(contestant: str, name: str, size: int, small: int, times: int = 1) -> dict[str, Any]:
    """Time and peak memory of a process, and its share of right outcomes; or why there is none."""
    whole, size = members(name, size), smaller(name, size, times)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "found.npy"
        asked = [sys.executable, "-m", "benches.ensembles.single", contestant, name, str(size), str(small), str(path)]
        try:
            done = subprocess.run(asked, cwd=ROOT, capture_output=True, text=True, timeout=MAX_SECONDS)
        except subprocess.TimeoutExpired:
            return {"missing": f"more than {MAX_SECONDS} s"}
        if done.returncode != 0:
            return {"missing": done.stderr.strip().splitlines()[-1][:120]}
        told: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
        told |= {"times": times, "seconds": told["seconds"] * whole / members(name, size)}
        found = np.load(path, mmap_mode="r")[truth.sampled(name, size)]
    return told | {"right": truth.right(name, np.asarray(found), *truths(name, size))}


def truths(name: str, size: int, _known: dict[Any, Any] = {}) -> Any:  # noqa: B006 (remembered)
    """What is right, found once."""
    if (name, size) not in _known:
        _known[name, size] = truth.outcomes(name, size)
    return _known[name, size]


def shown(seconds: float) -> str:
    """Three digits."""
    return f"{seconds:.3g}"


def table(name: str, told: dict[str, Any]) -> str:
    """The rows of a sweep, as Markdown."""
    size = told["size"]
    head = ["", "seconds", "ready after", "lines", "peak memory", "right"]
    rows = []
    for contestant, title in CONTESTANTS.items():
        each = told["contestants"].get(contestant, {"missing": "not measured"})
        if "missing" in each:
            rows.append([title, *4 * ["—"], each["missing"]])
            continue
        memory = f"{each['peak'] / 2**20:.0f} MiB"
        title += f", a {each['times']}th of them, × {each['times']}" if each.get("times", 1) > 1 else ""
        rows.append([title, shown(each["seconds"]), f"{shown(each['ready'])} s", str(lines(contestant, name)), memory])
        rows[-1].append(f"{each['right']:.1%}")
    text = [head, ["---"] + ["---:"] * 5, *rows]
    title = TITLES[name].format(members=members(name, size)).replace(",", " ")
    return "\n".join([f"## {title}", "", *(f"| {' | '.join(row)} |" for row in text), ""])


def write(known: dict[str, Any], page: Path) -> None:
    """Put the tables into the page."""
    parts = [known["machine"], "", *(table(name, known[name]) for name in SIZES if name in known)]
    text = page.read_text(encoding="utf-8")
    page.write_text(PLACE.sub(lambda found: found[1] + "\n".join(parts) + found[2], text), encoding="utf-8")


def main(given: list[str] | None = None) -> None:
    """Measure what is missing, and write."""
    parser = argparse.ArgumentParser(prog="python -m benches.ensembles", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="few members, to see that it works")
    parser.add_argument("--again", default="", help="measure these once more: sweeps or contestants, with commas between, or all")
    parser.add_argument("--only", default="", help="only these sweeps, with commas between")
    parser.add_argument("--numbers", type=Path, default=HERE / "numbers.json", help="the numbers, which are kept")
    parser.add_argument("--page", type=Path, default=PAGE, help="the page")
    asked = parser.parse_args(given)
    known: dict[str, Any] = json.loads(asked.numbers.read_text(encoding="utf-8")) if asked.numbers.exists() else {}
    about = dict(machine.describe())
    packages = [machine.version(each) for each in ("stepwell", "numba", "joblib", "heyoka")]
    known["machine"] = f"{about['CPU']}, {about['date']}, {', '.join(packages)}{QUICK if asked.quick else ''}."
    again = set(filter(None, asked.again.split(",")))
    for name, (full, quick) in SIZES.items():
        if asked.only and name not in asked.only.split(","):
            continue
        size = quick if asked.quick else full
        if known.get(name, {}).get("size") != size:
            known[name] = {"size": size, "contestants": {}}
        for contestant in CONTESTANTS:
            times = 1 if asked.quick else SHARES.get((contestant, name), 1)
            there = known[name]["contestants"].get(contestant, {"missing": ""})
            if "missing" in there or again & {"all", name, contestant}:
                known[name]["contestants"][contestant] = measured(contestant, name, size, min(quick, 24), times)
                print(name, contestant, known[name]["contestants"][contestant], flush=True)
                asked.numbers.write_text(json.dumps(known, indent=1) + "\n", encoding="utf-8")
                write(known, asked.page)
    write(known, asked.page)


if __name__ == "__main__":
    main()
