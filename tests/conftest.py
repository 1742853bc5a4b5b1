"""What every test begins with."""

from __future__ import annotations

import gc

import pytest
from support.complete import pytest_make_collect_report, pytest_runtest_makereport  # noqa: F401  hooks
from support.snapshots import _snapshots, pytest_addoption, pytest_deselected, snapshot  # noqa: F401  hooks, fixtures

pytest_plugins = ["pytester"]

#: Files that take longest, the longest first: with one of them last, one core would run it while the others wait.
LONGEST = (
    "test_benches.py",
    "test_bits.py",
    "test_charts.py",
    "test_export.py",
    "test_site.py",
    "test_docs.py",
    "test_adaptive.py",
    "test_explain.py",
    "test_eigenvalues_that_meet.py",
    "test_rods_on_floors.py",
    "test_mutants.py",
    "test_campaign.py",
    "test_advise.py",
    "test_contact_mutants.py",
    "test_zplane_charts.py",
    "test_sweep_engines.py",
    "test_tracing.py",
    "test_run_pictures.py",
    "test_cli.py",
    "test_fused.py",
    "test_typed.py",
    "test_scenes.py",
)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """The longest files first, the others as they come; the order within a file stays."""
    place = {name: i for i, name in enumerate(LONGEST)}
    items.sort(key=lambda item: place.get(item.path.name, len(place)))


def pytest_sessionstart() -> None:
    """The million objects of the tests themselves stay until the end, so that nothing is gained by looking through them.

    A collection of garbage does so, which takes 0.4 s, and over a second beside a busy neighbour: longer than a call may take.
    """
    gc.disable()


def pytest_collection_finish() -> None:
    gc.collect()
    gc.freeze()
    gc.enable()


@pytest.fixture(autouse=True)
def _as_in_a_pipe(monkeypatch: pytest.MonkeyPatch) -> None:
    """Tables have the width that they have in a pipe, though a shell, or a worker of xdist, may tell the width of a terminal."""
    monkeypatch.delenv("COLUMNS", raising=False)
