"""The peers, one file each. A file defines ``CONTESTANTS``, a list of them; that puts it into the report."""

from __future__ import annotations

import importlib
import os
import pkgutil
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from ..workloads import Array, Workload

Call = Callable[[], tuple[Array, Array]]

#: Seconds after which a configuration is tried no more.
ENOUGH = 0.2


class MissingPeerError(Exception):
    """The peer is not on this machine; the message says what is not."""


class WrongResultError(Exception):
    """The peer's result is further from the exact solution than its method explains."""


@dataclass(frozen=True)
class Ready:
    """A workload made ready: ``call`` does all of it, from the workload's arrays to v and y at the end.

    ``more`` is how often it evaluates the rates beyond once a step, which some ways to begin and end a method need.
    """

    call: Call
    note: str = ""
    more: int = 0


@dataclass(frozen=True)
class Contestant:
    """A peer in one configuration.

    ``kernels`` maps each kind of workload that it can do to what makes one ready, given whether the run is a quick one.
    A ``slow`` one does less: fewer "members" or fewer "steps", whichever leaves its speed as it is. One that is not ``alike``
    has another form of the method, with errors of the same order but not the same.
    """

    name: str
    kernels: Mapping[str, Callable[[Workload, bool], Ready]]
    slow: str | None = None
    alike: bool = True


def threads() -> int:
    """How many threads this process may use at once."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def catalogue() -> list[Contestant]:
    """Every contestant of every file."""
    modules = (importlib.import_module(f"{__name__}.{m.name}") for m in pkgutil.iter_modules(__path__))
    return [contestant for module in modules for contestant in module.CONTESTANTS]


def fastest(makers: list[Callable[[Workload], Ready]], work: Workload, quick: bool) -> Ready:
    """The fastest of several configurations, tried on a part of the work; a wrong result does not count."""
    enough = ENOUGH / 10 if quick else ENOUGH
    part = work.cut(members=2048)
    best, make = float("inf"), None
    for maker in makers:
        call = maker(part).call
        if not part.error(*call()) <= part.bound():
            continue
        begin = time.perf_counter()
        for _ in range(5):
            start = time.perf_counter()
            call()
            took = time.perf_counter() - start
            if took < best:
                best, make = took, maker
            if time.perf_counter() - begin > enough:
                break
    if make is None:
        raise WrongResultError(f"none of {len(makers)} configurations gives the right result")
    return make(work)
