"""What every test begins with."""

from __future__ import annotations

import hypothesis
import pytest

# How long a case takes depends on what else the machine does.
hypothesis.settings.register_profile("stepwell", deadline=None)
hypothesis.settings.load_profile("stepwell")

pytest_plugins = [
    "pytester",
    *(f"support.{name}" for name in ("browser", "complete", "covering", "durations", "families", "snapshots")),
]


@pytest.fixture(autouse=True)
def _as_in_a_pipe(monkeypatch: pytest.MonkeyPatch) -> None:
    """Tables have the width that they have in a pipe, though a shell, or a worker of xdist, may tell the width of a terminal."""
    monkeypatch.delenv("COLUMNS", raising=False)
