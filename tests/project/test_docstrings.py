"""Everything public has an example in its docstring, and every example runs and prints what it says."""

from __future__ import annotations

import doctest
import inspect
import types
import warnings
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.analysis import stability
from stepwell.model import quaternion
from stepwell.runs.options import Options
from stepwell.views import charts

#: Options of every example: arrays may be printed with other spaces by another NumPy.
OPTIONS = doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS


def is_ours(thing: Any) -> bool:
    return getattr(thing, "__module__", "").startswith("stepwell") and (inspect.isfunction(thing) or isinstance(thing, type))


def public() -> Iterator[tuple[str, Any]]:
    """Functions and classes by name: those of ``dir(sw)``, and the functions of the public modules that have a list."""
    for name in dir(sw):
        thing = getattr(sw, name)
        if is_ours(thing):
            yield name, thing
    for module in (charts, stability, quaternion, sw.orbits, sw.scenes):
        for name in getattr(module, "__all__", dir(module)):
            thing = getattr(module, name)
            own = "__all__" in vars(module) or getattr(thing, "__module__", "") == module.__name__
            if inspect.isfunction(thing) and own and not name.startswith("_") and not hasattr(thing, "__wrapped__"):
                yield f"{module.__name__.rsplit('.', 1)[-1]}.{name}", thing


PUBLIC = dict(public())


def test_there_is_something_public() -> None:
    assert len(PUBLIC) > 60
    assert {"integrate", "Oscillator", "advise", "charts.work_precision", "stability.series"} <= set(PUBLIC)


def test_everything_public_has_an_example_that_prints_what_it_says(tmp_path: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    output: list[str] = []
    for name, thing in PUBLIC.items():
        text = inspect.getdoc(thing) or ""
        assert ">>> " in text.partition("Example:")[2], name
        examples = doctest.DocTestParser().get_doctest(thing.__doc__, names(), name, None, None)
        assert examples.examples, name
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            doctest.DocTestRunner(optionflags=OPTIONS, verbose=False).run(examples, out=output.append)
    assert not output, "".join(output)


def names() -> dict[str, Any]:
    """What an example may use without importing it."""
    return {"sw": sw, "np": np, "warnings": warnings, **{name: getattr(sw, name) for name in dir(sw)}}


@pytest.mark.mutant
def test_a_wrong_example_is_noticed() -> None:
    wrong = types.SimpleNamespace(__doc__=">>> 1 + 1\n3\n")
    runner = doctest.DocTestRunner(optionflags=OPTIONS, verbose=False)
    runner.run(doctest.DocTestParser().get_doctest(wrong.__doc__, {}, "wrong", None, None), out=lambda _: None)
    assert runner.failures == 1


def test_what_is_used_daily_comes_first() -> None:
    """And what only a run that goes on needs comes last."""
    order = list(inspect.signature(sw.integrate).parameters)
    assert order[:9] == ["system", "method", "v", "y", "dt", "steps", "every", "tolerance", "at"]
    assert order[-2:] == ["start_step", "resume"]
    assert tuple(order[2:]) == Options._fields  # ``integrate`` gives them by their places
    text = inspect.getdoc(sw.integrate) or ""
    arguments = text.partition("Args:")[2].partition("Returns:")[0]
    places = [arguments.index(f"\n    {name}: ") for name in order]
    assert places == sorted(places)
