"""The argument ``events=``."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ...base import checks
from ...base.arrays import Array
from ...base.immutable import Immutable, ValueEquality
from ...errors import ArgumentError, DTypeError

if TYPE_CHECKING:
    from ...base.literals import Direction

#: Default of ``most``: the occurrences of an event that are kept for each member.
MOST_KEPT = 1000


class Event(Immutable, ValueEquality):
    """A quantity g(t, v, y) whose changes of sign along the motion are located.

    Args:
        function: ``g(t, v, y)``, or ``g(t, y)`` for a system without velocities, that returns one number; written for one member,
            in NumPy style, as your own equations are. Further arguments are parameters of the system, by name. Or a condition by
            ``<``, ``<=``, ``>``, ``>=``, ``&``, ``|`` and ``~``, for which g is above zero where it is true.
        times: in place of a function, the times at which it occurs, after the start: a number, several, or shape (times, *batch)
            with some for each member, where NaN is no time.
        period: after each of ``times`` it occurs again and again, so much later each time; a number, or one for each member.
        direction: 1 or "rising" for changes from below zero to above, −1 or "falling" for those from above to below, 0 or "both".
            If None, as an attribute ``direction`` of the function says, as SciPy reads it; 0 without one.
        terminal: whether a member stops at the first such change; a whole number n stops it at the n-th. If None, as an attribute
            ``terminal`` of the function says; False without one.
        then: ``then(t, v, y)``, which returns the state (v, y) from which a member goes on at each such change; for a system
            without velocities ``then(t, y)``, which returns y. It is written as ``function`` is, and may take parameters too.
        most: for each member the first ``most`` occurrences are kept; all are counted.
        name: its name in ``run.events``; if None, that of the function, and with ``times`` that of ``then``, or "times".

    Raises:
        ArgumentError: what is wrong with an argument.

    Example:
        >>> down = sw.Event(lambda t, v, y: y, direction=-1, name="down")
        >>> run = sw.integrate(sw.Oscillator(), "rk4", v=0.0, y=1.0, dt=0.1, steps=100, events=down)
        >>> run.events["down"].t.round(4)  # π/2, and a whole turn later
        array([1.5708, 7.854 ])
        >>> decay = sw.system(order=1)(lambda t, c: -0.1 * c)
        >>> dose = sw.Event(times=8.0, period=8.0, then=lambda t, c: c + 1.0, name="dose")
        >>> run = sw.integrate(decay(), "dop853", y=1.0, tolerance=1e-6, at=[24.0], events=dose)
        >>> run.events["dose"].t, float(run.y[-1].round(4))
        (array([ 8., 16., 24.]), 1.7419)
    """

    def __init__(
        self,
        function: Callable[..., Any] | None = None,
        *,
        times: Any = None,
        period: Any = None,
        direction: int | Direction | None = None,
        terminal: bool | int | None = None,
        then: Callable[..., Any] | None = None,
        most: int = MOST_KEPT,
        name: str | None = None,
    ) -> None:
        if (function is None) == (times is None):
            raise ArgumentError(
                f"function, times: expected either a function g(t, v, y) or the times of the event, got "
                f"{'both' if times is not None else 'neither'}"
            )
        self.times, self.period = None if times is None else _times(times), None
        if times is not None:
            if period is not None:
                self.period = _fixed(np.array(checks.numbers("period", period, positive=True, unit="units of time")))
            if direction is not None:
                raise ArgumentError("direction: listed times have none; leave it out")
        elif period is not None:
            raise ArgumentError("period: goes with times=; the zeros of a function repeat by themselves")
        elif not inspect.isfunction(function):
            raise DTypeError(
                f"function: expected a Python function such as g(t, v, y), got {checks.short(function)} "
                f"({type(function).__name__})"
            )
        if name is not None and not isinstance(name, str):
            raise DTypeError(f"name: expected a name or None, got {checks.short(name)} ({type(name).__name__})")
        self.function = function
        self.direction = _agreed("direction", function, direction, _sign, 0)
        self.terminal = _agreed("terminal", function, terminal, _stops, False)
        if then is not None and not inspect.isfunction(then):
            raise DTypeError(
                f"then: expected a Python function such as then(t, v, y), got {checks.short(then)} ({type(then).__name__})"
            )
        if then is not None and self.terminal:
            raise ArgumentError("then, terminal: a member that stops at an event does not go on from a new state; leave one out")
        self.then = then
        self.most = checks.count("most", most, 1)
        self.name = getattr(function or then, "__name__", "times") if name is None else name

    def __repr__(self) -> str:
        options = {"direction": self.direction, "terminal": self.terminal}
        if self.then is not None:
            options["then"] = self.then.__name__
        text = "".join(f", {name}={value}" for name, value in options.items() if value)
        return f"Event({self.name}{text})"


def _times(times: Any) -> Array:
    """Times along the first axis; NaN is none."""
    numbers = np.atleast_1d(np.array(checks.numbers("times", times, finite=False, unit="units of time")))
    if np.isinf(numbers).any() or np.isnan(numbers).all():
        raise ArgumentError(
            f"times: expected finite times, or NaN beside them where a member has fewer, got {checks.short(times)}"
        )
    return _fixed(numbers)


def _fixed(numbers: Array) -> Array:
    numbers.setflags(write=False)
    return numbers


def _agreed(name: str, function: Any, argument: Any, read: Callable[[str, Any], Any], otherwise: Any) -> Any:
    """The argument, or the function's attribute of that name; raise if they differ."""
    attribute = getattr(function, name, None)
    its_own = None if attribute is None else read(f"{function.__name__}.{name}", attribute)
    if argument is None:
        return otherwise if its_own is None else its_own
    value = checks.direction(name, argument) if name == "direction" else read(name, argument)
    if its_own is not None and its_own != value:
        raise ArgumentError(
            f"{name}: got {value!r}, but the function {function.__name__} has an attribute {name} = {attribute!r}; leave one out"
        )
    return value


def _sign(name: str, value: Any) -> int:
    """A direction as SciPy reads it: by its sign."""
    if isinstance(value, str):
        return checks.direction(name, value)
    number = checks.number(name, value)
    return (number > 0.0) - (number < 0.0)


def _stops(name: str, value: Any) -> bool | int:
    """The number of the change at which an event stops a member: True for the first, False for none."""
    if isinstance(value, (bool, np.bool_)):
        return bool(value)
    number = checks.count(name, value, 0)
    return number if number > 1 else number == 1


def names_of_changing(events: Sequence[Event]) -> tuple[str, ...]:
    """The names of events that change the state."""
    return tuple(event.name for event in events if event.then is not None)


def several(events: Any) -> list[Event]:
    """A list of events, from one event or several, each an ``Event`` or a function."""
    is_one = isinstance(events, Event) or callable(events)
    each_event: Sequence[Any] = [events] if is_one else checks.several("events", events, "events")
    all_events = [each if isinstance(each, Event) else Event(_function(each)) for each in each_event]
    names = [each.name for each in all_events]
    for name in names:
        if names.count(name) > 1:
            raise ArgumentError(f"events: expected a name for each, got {name!r} twice; give Event(…, name=…)")
    return all_events


def _function(argument: Any) -> Any:
    if not inspect.isfunction(argument):
        raise DTypeError(
            f"events: expected functions g(t, v, y) or stepwell.Event, got {checks.short(argument)} ({type(argument).__name__})"
        )
    return argument
