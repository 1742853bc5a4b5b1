"""What users give as ``events=``."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from .. import _checks
from .._value import Fixed, Value
from ..errors import ArgumentError, DTypeError

if TYPE_CHECKING:
    from .._words import Direction

#: Default of ``most``: so many occurrences of an event are kept for each member.
MOST_KEPT = 1000


class Event(Fixed, Value):
    """A quantity g(t, v, y) whose changes of sign along the motion are located.

    Args:
        function: ``g(t, v, y)``, or ``g(t, y)`` for a system without velocities, that returns one number; written for one member,
            in NumPy style, as your own equations are. Further arguments are parameters of the system, by name.
        direction: 1 or "rising" for changes from below zero to above, −1 or "falling" for those from above to below, 0 or "both".
        terminal: whether a member stops at the first such change.
        most: so many occurrences are kept for each member, the first ones; all are counted.
        name: its name in ``run.events``; if None, that of the function.

    Raises:
        ArgumentError: what is wrong with an argument.

    Example:
        >>> down = sw.Event(lambda t, v, y: y, direction=-1, name="down")
        >>> run = sw.integrate(sw.Oscillator(), "rk4", v=0.0, y=1.0, dt=0.1, steps=100, events=down)
        >>> run.events["down"].t.round(4)  # π/2, and a whole turn later
        array([1.5708, 7.854 ])
    """

    def __init__(
        self,
        function: Callable[..., Any],
        *,
        direction: int | Direction = 0,
        terminal: bool = False,
        most: int = MOST_KEPT,
        name: str | None = None,
    ) -> None:
        if not inspect.isfunction(function):
            raise DTypeError(
                f"function: expected a Python function such as g(t, v, y), got {_checks.short(function)} "
                f"({type(function).__name__})"
            )
        if name is not None and not isinstance(name, str):
            raise DTypeError(f"name: expected a name or None, got {_checks.short(name)} ({type(name).__name__})")
        self.function = function
        self.direction = _checks.direction("direction", direction)
        self.terminal = _checks.flag("terminal", terminal)
        self.most = _checks.count("most", most, 1)
        self.name = function.__name__ if name is None else name

    def __repr__(self) -> str:
        options = {"direction": self.direction, "terminal": self.terminal}
        told = "".join(f", {name}={value}" for name, value in options.items() if value)
        return f"Event({self.name}{told})"


def several(events: Any) -> list[Event]:
    """The events that were given: one or a list, of which each may be a function alone."""
    given: Sequence[Any] = [events] if isinstance(events, Event) or callable(events) else []
    made = [
        each if isinstance(each, Event) else Event(_function(each))
        for each in given or _checks.several("events", events, "events")
    ]
    names = [each.name for each in made]
    for name in names:
        if names.count(name) > 1:
            raise ArgumentError(f"events: expected a name for each, got {name!r} twice; give Event(…, name=…)")
    return made


def _function(given: Any) -> Any:
    if not inspect.isfunction(given):
        raise DTypeError(
            f"events: expected functions g(t, v, y) or stepwell.Event, got {_checks.short(given)} ({type(given).__name__})"
        )
    return given
