"""The measurement: all is checked first, then timed in turns, so that what disturbs the machine disturbs all alike."""

from __future__ import annotations

import gc
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from statistics import median

from stepwell import errors

from ..budget import Budget, StoppedError
from .peers import Contestant, MissingPeerError, Ready, WrongResultError
from .workloads import Workload

#: Seconds that a sample lasts at least, by as many calls as that takes, and that one call of a slow peer may last.
SAMPLE, PATIENCE = 0.02, 0.5
#: Warnings of stepwell: findings, which are counted. All others are errors.
FINDINGS = tuple(each for each in vars(errors).values() if isinstance(each, type) and issubclass(each, Warning))


@contextmanager
def heard() -> Iterator[list[warnings.WarningMessage]]:
    """The findings inside, which end nothing. Were they ignored, stepwell would not look for them, as it does for users."""
    with warnings.catch_warnings(record=True) as findings:
        warnings.simplefilter("error")
        for kind in FINDINGS:
            warnings.simplefilter("always", kind)
        yield findings


def counted(findings: list[warnings.WarningMessage]) -> str:
    """How many there are, and of what, for the remarks."""
    kinds = sorted({each.category.__name__.removesuffix("Warning").lower() for each in findings})
    return f"{len(findings)} finding{'s' * (len(findings) != 1)}: {', '.join(kinds)}" if findings else ""


@dataclass
class Row:
    """What came out for one contestant; ``missing`` says why nothing did."""

    name: str
    note: str = ""
    missing: str = ""
    error: float = float("nan")
    amount: float = 0.0  # of work in a call
    calls: int = 1
    seconds: list[float] = field(default_factory=list)  # per call

    @property
    def rates(self) -> tuple[float, float, float]:
        """Lowest, median and highest speed, in pieces of work a second."""
        return tuple(self.amount / statistic(self.seconds) for statistic in (max, median, min))


def sample(call: Callable[[], object], calls: int) -> float:
    """Seconds per call."""
    gc.disable()
    try:
        start = time.perf_counter()
        for _ in range(calls):
            call()
        return (time.perf_counter() - start) / calls
    finally:
        gc.enable()


def share(contestant: Contestant, work: Workload, quick: bool) -> Workload:
    """The part of the work that a slow contestant does in good time, judged by a little of it."""
    if contestant.slow is None:
        return work
    members, steps, seconds = 1 if contestant.slow == "members" else work.members, 1, 0.0
    while seconds < SAMPLE / 2:
        trial = work.cut(members=members, steps=steps)
        seconds = sample(contestant.kernels[work.kind](trial, quick).call, 1)
        if trial.steps == work.steps:
            break
        steps *= 10
    patience = PATIENCE / 10 if quick else PATIENCE
    affordable = max(1, int(patience / seconds * trial.members * trial.steps))  # member-steps
    if contestant.slow == "members":
        work = work.cut(members=max(1, affordable // work.steps))
    return work.cut(steps=max(1, affordable // work.members))


def prepare(contestant: Contestant, work: Workload, quick: bool) -> tuple[Row, Ready | None]:
    """One contestant made ready and checked against the exact solution; only then may it be timed."""
    row = Row(contestant.name)
    try:
        part = share(contestant, work, quick)
        ready = contestant.kernels[work.kind](part, quick)
        with heard() as findings:
            row.error = part.error(*ready.call())
        if not row.error <= part.bound():
            raise WrongResultError(f"error {row.error:.1e}, but the method's is at most {part.bound():.1e}")
    except MissingPeerError as why:
        row.missing = str(why)
    except WrongResultError as why:
        row.missing = f"not timed: {why}"
    if row.missing:
        return row, None
    row.amount = part.amount(part.steps + ready.more)
    less = "" if part.members == work.members else f"{part.members:,} member{'s' * (part.members != 1)}"
    less += "" if part.steps == work.steps else f"{', ' * bool(less)}{part.steps:,} steps"
    row.note = "; ".join(filter(None, [ready.note, less and f"did {less} only", counted(findings)]))
    return row, ready


def measure(contestants: list[Contestant], work: Workload, repeats: int, quick: bool, budget: Budget) -> list[Row]:
    """All contestants on one workload, round by round; one that runs away is a row that says so."""
    able = [c for c in contestants if work.kind in c.kernels]
    budget = budget.part(len(able) + 1)
    work.bound()  # what is true is found once for all, and none of them waits for it
    rows, timed = [], []
    for contestant in able:
        row, ready = Row(contestant.name), None
        try:
            with budget.part().limit(), heard():
                row, ready = prepare(contestant, work, quick)
                if ready is not None:
                    row.calls = max(1, round((SAMPLE / 10 if quick else SAMPLE) / sample(ready.call, 1)))
                    timed.append((row, ready))
        except StoppedError as why:
            row.missing = str(why)
        rows.append(row)
    try:
        with budget.part().limit(), heard():
            for _ in range(repeats):
                for row, ready in timed:
                    row.seconds.append(sample(ready.call, row.calls))
    except StoppedError as why:
        for row, _ in timed:
            if row.seconds:
                row.note = "; ".join(filter(None, [row.note, f"{len(row.seconds)} repeats, then {why}"]))
            else:
                row.missing = str(why)
    return rows
