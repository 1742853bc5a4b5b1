"""Events that the core looks for while it makes the steps."""

from __future__ import annotations

from collections.abc import Sequence
from math import prod
from typing import Any, NamedTuple

import numpy as np

from ... import _core
from ...base.arrays import Array
from .. import engine
from .collected import Collected
from .evaluated import Evaluated
from .parts import Changes, Located
from .timed import Timed
from .traced import NewState


class Values(NamedTuple):
    """Values of a tape, the parameters that it reads, each one number for all members or one for each, and its sampled inputs.

    Of these the start, the interval, and a row for each sample.
    """

    of: _core.Evaluation
    parameters: list[Array]
    tables: list[tuple[float, float, Array]]


class TimesOfCore(NamedTuple):
    """Known times of an event, negated if the motion goes back, ascending, the last infinite; signs of its quantity before them.

    Both are of shape (times, members), or (times, 1).
    """

    keys: Array
    signs: Array


class OfCore(NamedTuple):
    """An event as values: its quantity, the slope of that, None without a derivative, and the new state, None without one.

    ``times`` are its times, if they are known.
    """

    times: TimesOfCore | None
    quantity: Values
    slope: Values | None
    then: Values | None
    direction: float
    terminal: int
    most: int


class NoBeginningError(Exception):
    """The core cannot begin a part of a run by itself."""


class Sought(NamedTuple):
    """All events of a run, and the motion of its members.

    Attributes:
        events: the events.
        step: a step, of a time, a length and a state.
        repeats: whether the steps of the run are such steps, to the last bit.
        rates: by how much a state changes in a step, likewise.
        numbers: how many numbers a state has.
        groups: of how many groups of them adaptive steps know the largest size.
        begin: the times of step 0, one for all or one of each member.
        sign: −1 where the time of the run is negated.
        way: −1 where the time of the run falls.
        jumps: the jumps of adaptive steps, as known times, both of whose arrays are the same; None without any.
    """

    events: list[OfCore]
    step: Values
    repeats: bool
    rates: Values
    numbers: int
    groups: int
    begin: Array
    sign: float
    way: float
    jumps: TimesOfCore | None


def sought(search: Collected, new_states: dict[int, NewState] | None = None, jumps: Array | None = None) -> Sought | None:
    """The events as the core takes them; None where a part is no tape for numbers of 64 bits, as of many bodies.

    ``new_states`` are those that events give members, by the numbers of these; ``jumps`` are those of adaptive steps.
    """
    plan = search.plan
    is_plain = bool(search.events) and plan.backend == "rust" and plan.device is None
    if not is_plain or plan.system.controller is not None or plan.system.mass_matrix is not None:
        return None
    step, rates = search.trials.of_core("step"), search.trials.of_core("rates")
    if step is None or rates is None:
        return None
    events = []
    for e, (event, quantity) in enumerate(zip(search.events, search.quantities, strict=True)):
        of_slope = times = None
        if isinstance(quantity, Timed):
            times, of_value = (
                TimesOfCore(*quantity.rows),
                _values(Evaluated(tape := _core.Tape(), [tape.number(1.0)], 0, by_core=True), []),
            )
        else:
            numbers = quantity.numbers(search.members.parameters)
            value, slope = quantity.evaluated
            of_slope = None if slope is None else _values(slope, numbers)
            of_value = _values(value, numbers)
        then = (new_states or {}).get(e)
        of_then = None if then is None else _values(then.evaluated, then.numbers(search.members.parameters))
        if of_value is None or (then is not None and of_then is None):
            return None
        events.append(OfCore(times, of_value, of_slope, of_then, float(event.direction), int(event.terminal), event.most))
    tables = search.trials.tables
    both = [_values(*each, tables) for each in (step, rates)]
    if both[0] is None or both[1] is None:
        return None
    begin = np.ascontiguousarray(np.broadcast_to(plan.t0, plan.batch).reshape(-1) if np.ndim(plan.t0) else [plan.t0], np.float64)
    known = None
    if jumps is not None:
        rows = jumps.reshape(len(jumps), -1)
        known = TimesOfCore(*2 * [np.concatenate([rows, np.full((1, rows.shape[1]), np.inf)])])
    n = prod(plan.system.v_shape) + prod(plan.system.y_shape)
    return Sought(
        events,
        both[0],
        not (plan.fused or plan.single),
        both[1],
        n,
        engine.groups_of(plan),
        begin,
        search.sign,
        search.way,
        known,
    )


def _values(evaluated: Evaluated, numbers: list[Array], tables: Sequence[Any] = ()) -> Values | None:
    if (of := evaluated.evaluation) is None:
        return None
    return Values(of, [np.ascontiguousarray(each, dtype=np.float64).reshape(-1) for each in numbers], list(tables))


def made(search: Collected, sought: Sought, model: _core.ModelSpec, plan: engine.Plan, arrays: engine.Arrays) -> bool:
    """Make a run of fixed steps, as ``_core.run``."""
    diverged, found = _core.run_and_look(model, plan, arrays, sought)
    take(search, found)
    return diverged


def adapted(search: Collected, sought: Sought, model: _core.ModelSpec, plan: engine.Plan, pacing: Any, arrays: Any) -> bool:
    """Make a run of adaptive steps, as ``_core.adapt``."""
    done, found = _core.adapt_and_look(model, plan, pacing, arrays, sought)
    if not done and any(event.then for event in sought.events):
        raise NoBeginningError
    take(search, found)
    return done


def take(search: Collected, found: Any) -> None:
    """Take what the core found."""
    of_each, counts, stopped_at, search.other_steps, search.rested = found
    shapes = search.plan.system.v_shape, search.plan.system.y_shape
    search.count[...] = counts.reshape(search.count.shape)
    search.stopped_at[...] = stopped_at
    for entries, (member, step, share, t, states) in zip(search.entries, of_each, strict=True):
        entries.append(Located(member, step, share, t, *blocks_of(shapes, states, len(member))))


def located(search: Collected, sought: Sought, e: int, changes: Changes) -> tuple[Array, Array, Array]:
    """The shares of steps at which an event changes its sign, and the states there."""
    shapes = search.plan.system.v_shape, search.plan.system.y_shape
    rows = [*rows_of(shapes, changes.v, changes.y), *rows_of(shapes, changes.v_end, changes.y_end)]
    numbers = np.array([changes.t, changes.h, changes.low, changes.high, changes.g, changes.g_end]).T.copy()
    share, states = _core.locate(sought, search.plan.members, e, changes.member, numbers, np.array(rows).T.copy())
    v, y = blocks_of(shapes, states, len(share))
    return share, v, y


def rows_of(shapes: tuple[Any, Any], *blocks: Array) -> list[Array]:
    """The numbers of blocks of some members, each over all of these."""
    return [block[index] for block, shape in zip(blocks, shapes, strict=True) for index in np.ndindex(shape)]


def blocks_of(shapes: tuple[Any, Any], states: Array, count: int) -> tuple[Array, Array]:
    """Velocities and coordinates of so many members, whose numbers stand one after the other."""
    n_v, rows = prod(shapes[0]), states.reshape(count, prod(shapes[0]) + prod(shapes[1])).T
    return rows[:n_v].reshape(*shapes[0], count), rows[n_v:].reshape(*shapes[1], count)
