"""What every test begins with."""

from __future__ import annotations

import hypothesis
import pytest

# How long a case takes depends on what else the machine does.
hypothesis.settings.register_profile("stepwell", deadline=None)
hypothesis.settings.load_profile("stepwell")

pytest_plugins = ["pytester", "support.browser", "support.complete", "support.covering", "support.families", "support.snapshots"]

#: Files that take longest, the longest first: with one of them last, one core would run it while the others wait.
LONGEST = (
    "test_site.py",
    "test_device_bodies.py",
    "test_benches.py",
    "test_bits.py",
    "test_device_adaptive.py",
    "test_advise.py",
    "test_device_fixed.py",
    "test_device_proof.py",
    "test_export.py",
    "test_device_reductions.py",
    "test_export_loops.py",
    "test_charts.py",
    "test_device_reader.py",
    "test_force.py",
    "test_explorer_browser.py",
    "test_looks.py",
    "test_eigenvalues_that_meet.py",
    "test_docs.py",
    "test_fused_bodies.py",
    "test_events_then_adaptive.py",
    "test_control_everywhere.py",
    "test_adaptive.py",
    "test_events_adaptive.py",
    "test_advise_unseen.py",
    "test_fused.py",
    "test_zplane_charts.py",
    "test_going_on.py",
    "test_sweep_stores.py",
    "test_explorer_look.py",
    "test_campaign.py",
    "test_advise_told.py",
    "test_explain.py",
    "test_device_world.py",
    "test_sweep_engines.py",
    "test_stiff.py",
    "test_explorer.py",
    "test_charts_files.py",
    "test_maps.py",
    "test_own_times.py",
    "test_tracing.py",
    "test_cli.py",
    "test_events.py",
    "test_export_files.py",
    "test_rods_on_floors.py",
    "test_mutants.py",
    "test_contact_mutants.py",
    "test_run_pictures.py",
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
