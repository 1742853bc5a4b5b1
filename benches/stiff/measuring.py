"""The cheapest setting of each contestant for each error, and its time in a batch and alone.

Times are processor time, which does not count what other programs take; the process keeps to one core.
"""

from __future__ import annotations

import contextlib
import functools
import itertools
import math
import os
import sys
import time
import warnings
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np

from ..budget import Budget, StoppedError
from ..compare.peers import MissingPeerError
from .contestants import OURS, PEERS, Contestant, Setting, Solve
from .problems import Problem

#: Errors that are asked for.
AIMS = (1e-3, 1e-6, 1e-9)
#: Relative tolerances that are tried, from coarse to fine.
TOLERANCES = tuple(10.0 ** -np.arange(1.5, 13.5, 0.5))
#: Seconds of a trial after which no finer tolerance is tried, and of a trial that is made again for its time, so often.
PATIENCE, SHORT, AGAIN = 1.0, 0.1, 3
#: Seconds of all trials of a contestant together, after which no setting is tried; the second in a quick run.
BUDGET, QUICK = 10.0, 1.0
#: Nor is one tried where a member takes so many times as long as by a setting that is exact enough for all.
HOPELESS = 2.0
#: Contestants take turns so often; a peer that takes longer than so many seconds in one has only one.
TURNS, LONGEST_IN_TURNS = 4, 0.5
#: Seconds that calls for one member last together, at least.
SAMPLE = 0.01
#: What a solver raises that does not come to the end.
FAILURES = (ArithmeticError, RuntimeError, IndexError, ValueError)
#: The tolerance of the first call.
FIRST = 1e-4
#: A first problem, for what is loaded and made once for all problems.
WARM_UP = Problem("warm up", lambda t, y, k=1.0: (-k * y[0], k * y[0]), (1.0, 0.0), 1.0, (1e-2, 1e-2))


class Point(NamedTuple):
    """A setting, the error that it achieves, and seconds a member."""

    setting: Setting
    error: float
    seconds: float


class Row(NamedTuple):
    """What was measured of a contestant with a problem.

    Attributes:
        missing: why there is nothing.
        first: seconds from the equations to the end of the first call, less those of a later call.
        members: of the batch that was timed.
        points: of all settings that were tried.
        chosen: for each error the setting, or None.
        batch: for each error seconds a member, of each turn.
        one: for each error seconds of a call for one member, likewise.
    """

    missing: str = ""
    first: float = math.nan
    members: int = 0
    points: tuple[Point, ...] = ()
    chosen: tuple[Setting | None, ...] = ()
    batch: tuple[list[float], ...] = ()
    one: tuple[list[float], ...] = ()


def seconds(call: Callable[[], object], calls: int = 1) -> float:
    """Of processor time, a call."""
    begin = time.process_time()
    for _ in range(calls):
        call()
    return (time.process_time() - begin) / calls


def points(contestant: Contestant, solve: Solve, problem: Problem, least: float, most: float = BUDGET) -> Iterator[Point]:
    """All settings, from coarse to fine, until an error is undercut, or patience or so many seconds end."""
    parameters = problem.parameters(contestant.trial)
    cheapest, begun = math.inf, time.process_time()
    for method, share in itertools.product(contestant.methods, contestant.shares):
        for tolerance in TOLERANCES:
            if time.process_time() - begun > most:
                return
            setting = Setting(method, float(tolerance), share)
            ends: Any = None
            try:
                with silent():
                    begin = time.process_time()
                    ends = solve(parameters, setting)
                    spent = time.process_time() - begin
                    again = AGAIN if spent < SHORT else 0
                    spent = min([seconds(lambda setting=setting: solve(parameters, setting)) for _ in range(again)] or [spent])  # type: ignore[misc]
            except FAILURES:  # it did not come to the end
                continue
            error = problem.error(ends)
            each = spent / contestant.trial
            yield Point(setting, error, each)
            if error <= least:
                cheapest = min(cheapest, each)
            if error <= least or spent > PATIENCE or each > HOPELESS * cheapest:
                break


def cheapest(all_points: tuple[Point, ...], aim: float) -> Setting | None:
    """The setting that achieves an error in the least time."""
    able = [point for point in all_points if point.error <= aim]
    return min(able, key=lambda point: point.seconds).setting if able else None


@functools.cache
def warmed_up(contestant: Contestant) -> str | None:
    """Why it is not there, or None if it is, and has loaded and made what is for all problems."""
    try:
        contestant.make(WARM_UP)(WARM_UP.parameters(2), Setting(contestant.methods[0], 1e-3))
    except ImportError as why:
        return f"{why.name} is not installed"
    except MissingPeerError as why:
        return str(why)
    return None


def tried_once(solve: Solve, contestant: Contestant, problem: Problem) -> None:
    """A call whose time tells what the first one compiles."""
    with silent(), contextlib.suppress(*FAILURES):
        solve(problem.parameters(contestant.trial), Setting(contestant.methods[-1], FIRST))


@contextlib.contextmanager
def silent() -> Iterator[None]:
    """Without what libraries of C print of a tolerance that is too coarse."""
    kept = os.dup(1), os.dup(2)
    with open(os.devnull, "w", encoding="utf-8") as nowhere:
        for stream in (1, 2):
            os.dup2(nowhere.fileno(), stream)
        try:
            yield
        finally:
            for stream, before in zip((1, 2), kept, strict=True):
                os.dup2(before, stream)
                os.close(before)


def prepared(
    contestant: Contestant, problem: Problem, aims: tuple[float, ...], most_members: int | None
) -> tuple[Row, Solve | None]:
    """A contestant, with the settings that it will be timed with."""
    if most_members is not None:
        contestant = contestant._replace(members=most_members, trial=most_members)
    if (missing := warmed_up(contestant)) is not None:
        return Row(missing), None
    begin = time.process_time()
    solve = contestant.make(problem)
    making = time.process_time() - begin
    calls = [seconds(lambda: tried_once(solve, contestant, problem)) for _ in range(2)]
    tried = tuple(points(contestant, solve, problem, min(aims), BUDGET if most_members is None else QUICK))
    chosen = tuple(cheapest(tried, aim) for aim in aims)
    times = (tuple([] for _ in aims) for _ in range(2))
    return Row("", making + calls[0] - calls[1], contestant.members, tried, chosen, *times), solve


def measure(
    problem: Problem,
    aims: tuple[float, ...],
    turns: int,
    budget: Budget,
    most_members: int | None = None,
    peers: tuple[str, ...] = (),
) -> dict[str, Row]:
    """All contestants, or stepwell and these peers, in turns, so that what disturbs the machine disturbs all alike."""
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    contestants = [OURS, *(each for each in PEERS if not peers or each.name in peers)]
    budget, rows, solves = budget.part(len(contestants) + 1), dict[str, Row](), dict[str, Solve | None]()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of tolerances that are far too coarse
        for contestant in contestants:
            print(f"{problem.name}: {contestant.name}", file=sys.stderr, flush=True)
            try:
                with budget.part().limit():
                    rows[contestant.name], solves[contestant.name] = prepared(contestant, problem, aims, most_members)
            except StoppedError as why:
                rows[contestant.name] = Row(str(why))
        single = problem.parameters(1)
        try:
            with budget.part().limit():
                for _, (name, solve) in itertools.product(range(turns), solves.items()):
                    row = rows[name]
                    for place, setting in enumerate(row.chosen):
                        late = row.batch[place] and row.batch[place][0] * row.members > LONGEST_IN_TURNS
                        if solve is not None and setting is not None and not late:
                            with contextlib.suppress(*FAILURES), silent():  # the trial had no member like the single one
                                _one_turn(solve, setting, problem, row, place, single)
        except StoppedError as why:
            print(f"{problem.name}: turns {why}", file=sys.stderr)
    return rows


def _one_turn(solve: Solve, setting: Setting, problem: Problem, row: Row, place: int, single: Any) -> None:
    batch = problem.parameters(row.members)
    row.batch[place].append(seconds(lambda: solve(batch, setting)) / row.members)
    solve(single, setting)
    once = seconds(lambda: solve(single, setting))
    row.one[place].append(seconds(lambda: solve(single, setting), math.ceil(SAMPLE / max(once, 1e-6))))
