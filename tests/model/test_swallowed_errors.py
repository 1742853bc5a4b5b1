"""What cannot be traced is refused even if the function itself catches the error."""

from __future__ import annotations

import contextlib
import math
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.errors import TraceError
from support.for_each import for_each


def number(y: Any) -> Any:
    try:
        return float(y)
    except Exception:
        return 1.0


def branch(y: Any) -> Any:
    try:
        return 1.0 if y > 0.0 else 2.0
    except:  # noqa: E722
        return 3.0


def unknown(y: Any) -> Any:
    with contextlib.suppress(ValueError):
        return np.sinc(y)
    return 1.0


def written(y: Any) -> Any:
    out = np.zeros(1)
    with contextlib.suppress(Exception):
        out[0] = y
    return out[0]


def summed(y: Any) -> Any:
    try:
        return math.fsum([y, y])
    except (TypeError, ValueError):
        return 1.0


def attribute(y: Any) -> Any:
    return getattr(y, "astype", lambda kind: 1.0)(float)


def with_hasattr(y: Any) -> Any:
    return y if hasattr(y, "conj") else 1.0


SWALLOWED = [number, branch, unknown, written, summed, attribute, with_hasattr]


@for_each("function", SWALLOWED)
def test_in_rates_inputs_invariants_and_events(function: Any) -> None:
    @sw.system
    def own(t: Any, v: Any, y: Any) -> Any:
        return -function(y)

    start = {"v": 0.0, "y": 1.0, "dt": 0.1, "steps": 1}
    with pytest.raises(TraceError, match=r"^own \(.*line \d+: .*\): .*(no number|no truth|own equations)"):
        sw.integrate(own, "rk4", **start)

    @sw.system
    def driven(t: Any, v: Any, y: Any, *, push: Any = 0.0) -> Any:
        return push - y

    with pytest.raises(TraceError, match="driven: push"):
        sw.integrate(driven(push=lambda t: function(t)), "rk4", **start)
    with pytest.raises(TraceError, match="events: low"):
        sw.integrate(driven, "rk4", **start, events=[sw.Event(lambda t, v, y: function(y), name="low")])

    @driven.invariant
    def energy(v: Any, y: Any) -> Any:
        return function(y)

    with pytest.raises(TraceError, match="driven: energy"):
        sw.integrate(driven, "rk4", **start, record="energy")


def test_an_error_of_ones_own_is_told_and_what_is_no_error_of_a_trace_may_be_caught() -> None:
    @sw.system
    def raising(t: Any, v: Any, y: Any) -> Any:
        try:
            return float(y)
        except ValueError as error:
            raise RuntimeError("not a number") from error

    with pytest.raises(TraceError, match="no number"):
        sw.integrate(raising, "rk4", v=0.0, y=1.0, dt=0.1, steps=1)

    @sw.system
    def looking(t: Any, v: Any, y: Any, *, table: Any = 2.0) -> Any:
        try:
            scale = {}["scale"]
        except KeyError:
            scale = table
        return -scale * y

    assert sw.integrate(looking, "standard_euler", v=0.0, y=1.0, dt=0.5, steps=1).v[-1] == -1.0
