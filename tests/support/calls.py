"""Calls as tests make them: of one step, without a warning, and those that are refused, each with its error and words of it."""

from __future__ import annotations

import warnings
from typing import Any

import pytest
import stepwell as sw


def a_step(system: Any, method: Any = "rk4", **options: Any) -> sw.Run:
    """One step from v = 0 and y = 1, or as the options say."""
    return sw.integrate(system, method, **{"v": 0.0, "y": 1.0, "dt": 0.1, "steps": 1} | options)


def quiet(*arguments: Any, **options: Any) -> sw.Run:
    """A run of which it is known what the package has to say of it."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        return sw.integrate(*arguments, **options)


def assert_raises(*cases: tuple[Any, ...], kind: type[Exception] = Exception) -> None:
    """Each call is an error whose message these words match; its kind stands between, or is that of all."""
    for number, (call, *own, words) in enumerate(cases):
        try:
            with pytest.raises(own[0] if own else kind, match=words):
                call()
        except BaseException as error:
            error.add_note(f"case {number}: {words}")
            raise
