"""What every test begins with."""

from __future__ import annotations

import pytest


@pytest.fixture(autouse=True)
def _as_in_a_pipe(monkeypatch: pytest.MonkeyPatch) -> None:
    """Tables have the width that they have in a pipe, though a shell, or a worker of xdist, may tell the width of a terminal."""
    monkeypatch.delenv("COLUMNS", raising=False)
