"""A browser for pages that tests open."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from typing import Any

import pytest

try:
    from playwright.sync_api import Error, sync_playwright
except ImportError:  # what is skipped then needs no names
    sync_playwright = None  # type: ignore[assignment]

CHROMIUM = next((path for name in ("chromium", "chromium-browser", "google-chrome") if (path := shutil.which(name))), None)
needs_browser = pytest.mark.skipif(
    CHROMIUM is None or sync_playwright is None, reason="there is no Chromium or no playwright here"
)


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    """Of one file: while Playwright runs, nothing else may have an event loop."""
    with sync_playwright() as started:
        try:
            chromium = started.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        except Error as error:
            pytest.skip(f"Chromium does not start here: {str(error)[:200]}")
        yield chromium
        chromium.close()
