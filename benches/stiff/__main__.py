"""``python -m benches.stiff``: stiff systems by all contestants on one core, into the page of the docs, with its picture."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

from ..compare import machine
from . import measuring, page
from .contestants import OURS, PEERS
from .problems import PROBLEMS

HERE = Path(__file__).resolve().parent


def main(given: list[str] | None = None) -> None:
    """Measure, and write."""
    parser = argparse.ArgumentParser(prog="python -m benches.stiff", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="few members and one error, to see that it works")
    parser.add_argument("--only", default="", help="only these problems, with commas between; the others keep their numbers")
    parser.add_argument("--peers", default="", help="only these peers, with commas between; the others keep their numbers")
    parser.add_argument("--draw", action="store_true", help="only write and draw what was measured before")
    parser.add_argument("--numbers", type=Path, default=HERE / "numbers.json", help="the numbers, which are kept")
    parser.add_argument("--page", type=Path, default=page.PAGE, help="the page")
    parser.add_argument("--picture", type=Path, default=page.PICTURE, help="the picture")
    asked = parser.parse_args(given)
    aims, turns, most = (measuring.AIMS[:1], 1, 8) if asked.quick else (measuring.AIMS, measuring.TURNS, None)
    known: dict[str, Any] = json.loads(asked.numbers.read_text(encoding="utf-8")) if asked.numbers.exists() else {}
    if known.get("aims") != list(aims):
        known = {"aims": list(aims), "problems": {}}
    if not asked.draw:
        about = dict(machine.describe())
        packages = [machine.version(each.package) for each in (OURS, *PEERS)]
        known["machine"] = f"{about['CPU']}, {about['CPU level of stepwell'].split()[0]}, {about['date']}, {', '.join(packages)}"
        known["machine"] += ", a quick run: times of so few members tell little." if asked.quick else "."
        for problem in PROBLEMS:
            if asked.only and problem.name not in asked.only.split(","):
                continue
            rows = measuring.measure(problem, aims, turns, most, tuple(filter(None, asked.peers.split(","))))
            before = known["problems"].get(problem.name, {}) if asked.peers else {}
            known["problems"][problem.name] = before | {name: row._asdict() for name, row in rows.items()}
            known = json.loads(json.dumps(known))  # tuples are lists, as in what was kept
            asked.numbers.write_text(json.dumps(known) + "\n", encoding="utf-8")
            print(f"{problem.name}\n{page.details(known, known['problems'][problem.name])}", flush=True)
        print(page.summary(known))
    page.write(known, asked.page)
    page.draw(known, asked.picture)


if __name__ == "__main__":
    main()
