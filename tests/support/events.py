"""What tests of events share."""

from __future__ import annotations

from typing import Any

import numpy as np
import stepwell as sw


def first(*state: Any) -> Any:
    """Of the coordinates the first, or else of the velocities."""
    y = state[-1] if np.shape(state[-1]) != (0,) else state[0]
    return y.ravel()[0] if np.ndim(y) else y


def crossing(t: Any, v: Any, y: Any) -> Any:
    return y - 0.1 * v - 0.05 * t


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


def check_a_state_at_zero_counts_once_and_not_at_the_start() -> None:
    """y = k exactly: at step 3 y − 3 is 0, at step 0 y is."""

    @sw.system(order=1)
    def ascending(t: Any, y: Any) -> Any:
        return 1.0 + 0.0 * y

    events = [sw.Event(lambda t, y: y - 3.0, name="three"), sw.Event(lambda t, y: y, name="start")]
    run = sw.integrate(ascending(), "standard_euler", y=0.0, dt=1.0, steps=8, events=events)
    assert run.events["three"].t.tolist() == [3.0]
    assert run.events["start"].count == 0
