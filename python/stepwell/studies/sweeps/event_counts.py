"""Sweeps with events: how often each occurs in a member, the first time, and the time at which one stopped the member."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from ...base.immutable import changed
from ...errors import ArgumentError, UnsupportedError
from ...model.systems import System
from ...runs.events import Event
from ...runs.events.event import several
from ...runs.result import Run, Status
from .exponents import Exponents
from .outcomes import Function, OfEnd, Outcome, Results, Variable

#: The status of a member that an event stopped.
EVENTS = (int(Status.EVENT), int(Status.REST))


def events_of(events: Any, outcomes: Iterable[Outcome], transient: Any) -> tuple[Event, ...]:
    """The events, checked; only one occurrence of each is stored unless a function needs more."""
    located = several(events)
    for event in located:
        if not event.name.isidentifier():
            raise ArgumentError(
                f"events: expected names that results can have, got {event.name!r}; give sw.Event(…, name=…) or a named function"
            )
    if transient is not None:
        raise UnsupportedError(
            "transient: goes without events=, since a member that an event stops in it has nothing that could be observed; make "
            "them steps, and choose what is later in a function of the run"
        )
    if any(isinstance(each, Exponents) for each in outcomes):
        raise UnsupportedError(
            "outcomes: 'lyapunov' goes without events=: exponents are of the smooth motion, and a change of state is none"
        )
    if any(isinstance(each, Function) for each in outcomes):
        return tuple(located)
    return tuple(changed(event, most=1) for event in located)


class EventCounts(OfEnd):
    """The outcome of the events of a sweep."""

    def __init__(self, events: tuple[Event, ...]) -> None:
        self.events = events
        self.numbers = 3 * len(events) + 1

    def check(self, system: System) -> None:
        """The run itself raises if they cannot be found."""

    def of_end(self, run: Run) -> Results:
        """Numbers and first times of the events."""
        results = {}
        for name, each in run.events.items():
            first = np.full(run.status.size, np.nan)
            first[each.member[::-1]] = each.t[::-1]
            results[f"{name}_count"] = Variable((), np.array(each.count), f"how often {name} happened")
            results[f"{name}_t"] = Variable((), first, f"time at which {name} first happened", "t")
        times = np.nan if run.stopped_at is None else run.stopped_at
        stopped = np.where(np.isin(run.status, EVENTS), times, np.nan)
        return results | {"stopped_at": Variable((), stopped, "time at which an event stopped the member", "t")}
