"""``python -m benches.stiff``: stiff systems by all contestants on one core, into the page of the docs, with its picture."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

from ..budget import Budget
from ..compare import machine
from . import measuring, page
from .contestants import OURS, PEERS
from .problems import PROBLEMS

HERE, OUT = Path(__file__).resolve().parent, page.ROOT / "out"
#: For all problems; ``python -m benches.compare`` has the rest of half an hour.
MINUTES = 8.0


def main(given: list[str] | None = None) -> None:
    """Measure, and write."""
    parser = argparse.ArgumentParser(prog="python -m benches.stiff", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="one problem and error with few members, to see that it works")
    parser.add_argument("--only", default="", help="only these problems, with commas between; the others keep their numbers")
    parser.add_argument("--peers", default="", help="only these peers, with commas between; the others keep their numbers")
    parser.add_argument("--draw", action="store_true", help="only write and draw what was measured before")
    parser.add_argument("--minutes", type=float, default=MINUTES, help=f"for all of it (default: {MINUTES:g})")
    parser.add_argument("--numbers", type=Path, help="the numbers, which are kept (default: in benches/stiff)")
    parser.add_argument("--page", type=Path, help="the page (default: that of the docs)")
    parser.add_argument("--picture", type=Path, help="the picture (default: that of the docs)")
    asked = parser.parse_args(given)
    asked.numbers = asked.numbers or (OUT / "stiff.json" if asked.quick else HERE / "numbers.json")
    asked.page = asked.page or (OUT / "stiff.md" if asked.quick else page.PAGE)
    asked.picture = asked.picture or (OUT / "stiff.png" if asked.quick else page.PICTURE)
    asked.numbers.parent.mkdir(exist_ok=True)
    problems = [problem for problem in PROBLEMS if not asked.only or problem.name in asked.only.split(",")]
    problems = problems[:1] if asked.quick else problems
    budget = Budget(60.0 * asked.minutes, len(problems))
    aims, turns, most = (measuring.AIMS[:1], 1, 8) if asked.quick else (measuring.AIMS, measuring.TURNS, None)
    known: dict[str, Any] = json.loads(asked.numbers.read_text(encoding="utf-8")) if asked.numbers.exists() else {}
    if known.get("aims") != list(aims):
        known = {"aims": list(aims), "problems": {}}
    if not asked.draw:
        about = dict(machine.describe())
        packages = [machine.version(each.package) for each in (OURS, *PEERS)]
        known["machine"] = f"{about['CPU']}, {about['CPU level of stepwell'].split()[0]}, {about['date']}, {', '.join(packages)}"
        known["machine"] += ", a quick run: times of so few members tell little." if asked.quick else "."
        with budget.last_resort():
            for problem in problems:
                rows = measuring.measure(problem, aims, turns, budget, most, tuple(filter(None, asked.peers.split(","))))
                before = known["problems"].get(problem.name, {}) if asked.peers else {}
                known["problems"][problem.name] = before | {name: row._asdict() for name, row in rows.items()}
                known = json.loads(json.dumps(known))  # tuples are lists, as in what was kept
                asked.numbers.write_text(json.dumps(known) + "\n", encoding="utf-8")
                print(f"{problem.name}\n{page.details(known, known['problems'][problem.name])}", flush=True)
        print(page.summary(known))
        missing = [(name, row["missing"], of) for of, rows in known["problems"].items() for name, row in rows.items()]
        left_out = [f"- {name}: {why} ({of})" for name, why, of in missing if why]
        print("Left out", *(left_out or ["Nothing."]), sep="\n")
    page.write(known, asked.page)
    page.draw(known, asked.picture)


if __name__ == "__main__":
    main()
