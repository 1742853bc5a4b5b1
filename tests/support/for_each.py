"""Cases of a test that take less time than an item of pytest: all in one item, and an error says of which case it is."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Iterable
from typing import Any

import pytest


def for_each(names: str | tuple[str, ...], values: Iterable[Any]) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """As ``pytest.mark.parametrize``, but the test goes through all values by itself; two such decorators are their product."""
    names = tuple(name.strip() for name in names.split(",")) if isinstance(names, str) else names
    cases = [dict(zip(names, value if len(names) > 1 else (value,), strict=True)) for value in values]
    assert cases, f"no values of {', '.join(names)}"

    def of(test: Callable[..., None]) -> Callable[..., None]:
        @functools.wraps(test)
        def all_of_them(**fixtures: Any) -> None:
            skipped = None
            for case in cases:
                try:
                    test(**fixtures, **case)
                except pytest.skip.Exception as reason:  # the other cases are tried all the same
                    skipped = reason
                except BaseException as error:
                    error.add_note(f"case: {case}")
                    raise
            if skipped:
                raise skipped

        signature = inspect.signature(test)
        others = [parameter for name, parameter in signature.parameters.items() if name not in names]
        all_of_them.__signature__ = signature.replace(parameters=others)  # type: ignore[attr-defined]
        return all_of_them

    return of
