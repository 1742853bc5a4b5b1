"""Long families of tests: by default a sample of the cases is made, with ``pytest --long`` the others, and nothing else.

So cases that are not run are not made either. A single test that takes long is marked ``long``. What tests the tests, by a
mistake that is made on purpose, is marked ``mutant``: the long run makes them all, and its summary says how many were noticed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import pytest

#: Whether this is the long run. Read it when parameters are made, which is after pytest has read its options.
LONG = False


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--long", action="store_true", help="run what takes long, in place of what is run without it")


@pytest.hookimpl(tryfirst=True)
def pytest_configure(config: pytest.Config) -> None:
    global LONG
    LONG = config.getoption("--long")
    config.option.markexpr = config.option.markexpr or ("long or mutant" if LONG else "not (long or mutant)")


def pytest_terminal_summary(terminalreporter: Any) -> None:
    noticed, missed = (
        sum(1 for report in terminalreporter.getreports(outcome) if "mutant" in report.keywords)
        for outcome in ("passed", "failed")
    )
    if noticed or missed:
        terminalreporter.write_line(f"mistakes made on purpose: {noticed} noticed, {missed} not noticed")


def family(values: Iterable[Any], sampled: Callable[..., bool], ids: Callable[[Any], str] | None = None) -> list[Any]:
    """Parameters of a test, of which the sample is for every run and the others are for the long one.

    Tuples are several parameters, of which ``sampled`` takes each.
    """
    marks = [pytest.mark.long] if LONG else []
    several = [value if isinstance(value, tuple) else (value,) for value in values]
    return [
        pytest.param(*value, marks=marks, id=ids(*value) if ids else None) for value in several if sampled(*value) is not LONG
    ]
