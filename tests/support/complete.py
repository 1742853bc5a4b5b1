"""Where everything must be there, as in CI, a test that is skipped for want of a tool or a package fails.

``STEPWELL_TESTS=complete`` asks for that. Other skips are combinations that do not exist, and stay.
"""

from __future__ import annotations

import os
import re
from collections.abc import Generator
from typing import Any

import pytest

#: What skips say of what is missing. Packages that are too large even for CI say so.
MISSING = re.compile(r"could not import '|there is no .* here|is not installed$|does not start here|make wheel builds one")
TOO_LARGE = "torch is large"


def _complete(report: Any) -> Any:
    """The report, failed if it tells of something that is missing."""
    reason = report.longrepr[2] if isinstance(report.longrepr, tuple) else str(report.longrepr)
    counts = os.environ.get("STEPWELL_TESTS") == "complete" and report.skipped and not hasattr(report, "wasxfail")
    if counts and MISSING.search(reason) and TOO_LARGE not in reason:
        report.outcome, report.longrepr = "failed", f"{reason}; with STEPWELL_TESTS=complete nothing may be missing"
    return report


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport() -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Of a test."""
    return _complete((yield))  # type: ignore[no-any-return]


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report() -> Generator[None, pytest.CollectReport, pytest.CollectReport]:
    """Of a file."""
    return _complete((yield))  # type: ignore[no-any-return]
