"""Cases within one test, where each takes less than the item that pytest would make of it; and samples of products of cases."""

from __future__ import annotations

import functools
import inspect
import itertools
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import pytest

from support.families import family

Test = Callable[..., None]


def looped(names: str, cases: Iterable[Any], long: Iterable[Any] = ()) -> Callable[[Test], Test]:
    """As ``pytest.mark.parametrize``, but in one item, and another for ``long`` cases. A failure says of which case it is."""
    labels, groups = names.split(", "), {"every day": list(cases), "long": list(long)}

    def decorate(test: Test) -> Test:
        @functools.wraps(test)
        def of_all(**fixtures: Any) -> None:
            for case in groups[fixtures.pop("which", "every day")]:
                values = dict(zip(labels, case if len(labels) > 1 else (case,), strict=True))
                try:
                    test(**fixtures, **values)
                except BaseException as error:
                    error.add_note(f"{names}: {case!r}")
                    raise

        which = [inspect.Parameter("which", inspect.Parameter.KEYWORD_ONLY)] * bool(groups["long"])
        rest = [each for name, each in inspect.signature(test).parameters.items() if name not in labels]
        vars(of_all)["__signature__"] = inspect.Signature([*rest, *which])
        if not which:
            return of_all
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
