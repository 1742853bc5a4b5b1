"""What every test begins with."""

from __future__ import annotations

import hypothesis
import pytest

# How long a case takes depends on what else the machine does.
hypothesis.settings.register_profile("stepwell", deadline=None)
hypothesis.settings.load_profile("stepwell")

pytest_plugins = ["pytester", "support.browser", "support.complete", "support.families", "support.snapshots"]

#: Files that take longest, the longest first: with one of them last, one core would run it while the others wait.
LONGEST = (
    "test_benches.py",
    "test_bits.py",
    "test_charts.py",
    "test_export.py",
    "test_export_files.py",
    "test_export_loops.py",
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


@pytest.fixture(autouse=True)
def _as_in_a_pipe(monkeypatch: pytest.MonkeyPatch) -> None:
    """Tables have the width that they have in a pipe, though a shell, or a worker of xdist, may tell the width of a terminal."""
    monkeypatch.delenv("COLUMNS", raising=False)
