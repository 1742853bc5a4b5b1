"""How many tests each file has and how long they take: the longest files begin first, and .ci/budget.py looks at both.

``--durations-to FILE`` writes them; the order is that of the last ``make test``, or of the file in .ci where there was none.
"""

from __future__ import annotations

import json
from collections import defaultdict
from pathlib import Path

import pytest

from . import ROOT

LAST, KNOWN = ROOT / ".venv" / "durations.json", ROOT / ".ci" / "durations.json"


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--durations-to", type=Path, help="a file for the number of tests of each file, and their seconds")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """The longest files first: with one of them last, one core would run it while others wait. Within a file nothing moves."""
    source = LAST if LAST.exists() else KNOWN
    seconds = {name: taken for name, (_, taken) in json.loads(source.read_text(encoding="utf-8")).items()}
    items.sort(key=lambda item: -seconds.get(item.path.name, 0.0))


class Durations:
    """Of a run, as its reports arrive."""

    def __init__(self, path: Path) -> None:
        self.path, self.of_file = path, defaultdict[str, list[float]](lambda: [0, 0.0])

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Each phase of each test."""
        numbers = self.of_file[Path(report.location[0]).name]
        numbers[0] += report.when == "setup"
        numbers[1] += report.duration

    def pytest_sessionfinish(self) -> None:
        rows = {name: [tests, round(seconds, 1)] for name, (tests, seconds) in sorted(self.of_file.items())}
        text = ",\n".join(f"{json.dumps(name)}: {json.dumps(row)}" for name, row in rows.items())
        self.path.write_text(f"{{\n{text}\n}}\n", encoding="utf-8")


def pytest_configure(config: pytest.Config) -> None:
    if (path := config.getoption("--durations-to")) and not hasattr(config, "workerinput"):
        config.pluginmanager.register(Durations(path.resolve()))
