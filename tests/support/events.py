"""What tests of events share."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.runs.events import by_core

from support.cases import number

U = 2.0**-53
GRAVITY = 9.81

#: Methods that choose their steps.
ABLE = [method.name for method in sw.methods() if method.error_order is not None]


def structure(method: sw.Method) -> tuple[bool, ...]:
    """In what a step of a method differs, for what is done with steps."""
    flags = method.has_series, method.is_implicit, method.needs_acceleration, method.splits
    return *flags, bool(method.kept), method.error_order is not None


#: A method of each structure, drawn by their names.
FEW = list({structure(m): m.name for m in sorted(sw.methods(), key=lambda m: number(m.name, "events"))}.values())


def crossing(t: Any, v: Any, y: Any) -> Any:
    return y - 0.1 * v - 0.05 * t


def passing(system: sw.System, level: Any) -> sw.Event:
    """An event of as many arguments as the system has: its first number is at the level, a number or a function of the time."""

    def above(t: Any, *state: Any) -> Any:
        # Of the coordinates the first, or else of the velocities.
        y = state[-1] if np.shape(state[-1]) != (0,) else state[0]
        return (y.ravel()[0] if np.ndim(y) else y) - (level(t) if callable(level) else level)

    if system.v_shape == (0,):
        return sw.Event(lambda t, y: above(t, y), name="passage")
    return sw.Event(lambda t, v, y: above(t, v, y), name="passage")


def assert_same_events(a: sw.Run, b: sw.Run) -> None:
    """All that was found is the same, to the last bit."""
    assert a.events.keys() == b.events.keys()
    for name, mine in a.events.items():
        assert mine == b.events[name], name
    if a.stopped_at is None or b.stopped_at is None:
        assert a.stopped_at is b.stopped_at
    else:
        np.testing.assert_array_equal(a.stopped_at, b.stopped_at)
    np.testing.assert_array_equal(a.status, b.status)


@pytest.fixture
def without_core(monkeypatch: pytest.MonkeyPatch) -> None:
    """Events are looked for in Python, as where the core cannot: mistakes that are made there count."""
    monkeypatch.setattr(by_core, "sought", lambda *_: None)
