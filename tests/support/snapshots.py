"""Texts that tests expect, each in a file of ``tests/snapshots``, so that a review shows what changed in them.

A test takes the fixture ``snapshot`` and calls ``snapshot("name.txt", text)``. ``pytest --update-snapshots`` writes the files.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest

SNAPSHOTS = Path(__file__).parents[1] / "snapshots"
DESELECTED = pytest.StashKey[set[Path]]()


class Snapshots:
    """The snapshots of one test file, which are a folder. A newline at the end of a text does not count."""

    def __init__(self, folder: Path, *, update: bool) -> None:
        self.folder, self.update = folder, update
        self.compared: set[str] = set()
        self.tests = 0  # that took them

    def __call__(self, name: str, text: str) -> None:
        """Compare a text with the file of that name, or write it."""
        path = self.folder / name
        if self.update and name not in self.compared:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(text.removesuffix("\n").encode() + b"\n")
        self.compared.add(name)
        expected = path.read_bytes().decode() if path.exists() else ""
        if expected.removesuffix("\n") != text.removesuffix("\n"):
            difference = difflib.unified_diff(expected.splitlines(), text.splitlines(), str(path), "this run", lineterm="", n=1)
            shown = "\n".join(difference) or "a character at which lines end"
            pytest.fail(f"not what the snapshot says (pytest --update-snapshots writes it again):\n{shown}", pytrace=False)

    def unused(self) -> list[str]:
        """Files that no test has compared; none if they are to be written again, for then they are deleted."""
        files = {str(path.relative_to(self.folder)): path for path in self.folder.rglob("*") if path.is_file()}
        names = sorted(files.keys() - self.compared)
        if self.update:
            for name in names:
                files[name].unlink()
            return []
        return names


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--update-snapshots", action="store_true", help="write the texts that tests expect, and delete unused ones")


def pytest_deselected(items: Sequence[pytest.Item]) -> None:
    for item in items:
        item.config.stash.setdefault(DESELECTED, set()).add(item.path)


@pytest.fixture(scope="module")
def _snapshots(request: pytest.FixtureRequest) -> Iterator[Snapshots]:
    """Those of a file, of which none may be unused if all tests of the file were run."""
    update, path = request.config.getoption("--update-snapshots"), request.path
    snapshots = Snapshots(SNAPSHOTS / path.stem, update=update)
    yield snapshots
    takers = [item for item in request.session.items if item.path == path and "snapshot" in getattr(item, "fixturenames", ())]
    chosen = path in request.config.stash.get(DESELECTED, set()) or any("::" in arg for arg in request.config.args)
    if not chosen and snapshots.tests == len(takers) and (names := snapshots.unused()):
        pytest.fail(
            f"no test compares {', '.join(names)} of {snapshots.folder}: pytest --update-snapshots deletes it", pytrace=False
        )


@pytest.fixture
def snapshot(_snapshots: Snapshots) -> Snapshots:
    _snapshots.tests += 1
    return _snapshots
