"""Samples of cases: what is looped over every day and what in the long run, products by turns; and what is refused."""

from __future__ import annotations

import functools
import inspect
import itertools
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import pytest

from support.families import family
from support.for_each import for_each

Test = Callable[..., None]


def looped(names: str, cases: Iterable[Any], long: Iterable[Any] = ()) -> Callable[[Test], Test]:
    """As ``for_each``, and of ``long`` cases another item, in the long run."""
    many = list(long)
    if not many:
        return for_each(names, cases)
    groups = {"every day": for_each(names, cases), "long": for_each(names, many)}

    def decorate(test: Test) -> Test:
        of_group = {name: loop(test) for name, loop in groups.items()}

        @functools.wraps(test)
        def of_all(which: str, **fixtures: Any) -> None:
            of_group[which](**fixtures)

        signature = inspect.signature(of_group["long"])
        which = inspect.Parameter("which", inspect.Parameter.KEYWORD_ONLY)
        vars(of_all)["__signature__"] = signature.replace(parameters=[*signature.parameters.values(), which])
        return pytest.mark.parametrize("which", family(groups, lambda group: group != "long", str))(of_all)

    return decorate


def in_turn(*factors: Sequence[Any]) -> list[Any]:
    """Of a product each value of the first factor once, with values of the others in turn; the rest is for the long run."""
    sample = {(x, *(others[i % len(others)] for others in factors[1:])) for i, x in enumerate(factors[0])}
    return family(itertools.product(*factors), lambda *case: case in sample)


def assert_refused(cases: Iterable[tuple[Callable[[], Any], type[Exception], str]]) -> None:
    """Each call is an error of its kind, and its message has these words."""
    wrong: list[tuple[str, str]] = []
    for call, kind, words in cases:
        try:
            call()
        except kind as error:
            if words not in str(error):
                wrong.append((words, str(error)))
        else:
            wrong.append((words, "no error"))
    assert wrong == []
