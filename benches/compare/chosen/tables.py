"""From contestants and orbits to tables."""

from __future__ import annotations

import itertools
import math
import statistics
import time
import warnings
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from ...budget import Budget, StoppedError
from ..report import Table, number
from ..runner import counted, heard
from . import solar
from .contestants import Contestant, contestants
from .orbits import Orbits, arenstorf, kepler

#: Errors at the end, the median of all orbits, at which contestants are compared. Axes are about 1.
ERRORS = (1e-3, 1e-6, 1e-9)
TOLERANCES = tuple(10.0 ** -np.arange(1.0, 14.5, 0.5))
#: Seconds after which a contestant gets no finer tolerance, and its least time of a sample.
PATIENCE, SAMPLE = 3.0, 0.02
#: Seconds that the repeats of one tolerance may take together; there are two at least.
REPEATS_TIME = 0.5
#: Contestants take turns this often with some of the repeats; one whose solution takes longer than so many seconds comes once.
TURNS, LONGEST_IN_TURNS = 3, 0.05
#: A quick run has one tolerance in so many, takes one turn, and its least time of a sample is this part of the other.
QUICK_STRIDE, QUICK_SAMPLE = 4, 0.1

READING = """\
Microseconds an orbit for a median error at the end of so much, between the two tolerances that enclose it; the median
of up to {repeats} repeats in three turns of all contestants, fewer where a solution takes long. *Spread* is the most
over the least time of the repeats, of the worst tolerance. One thread. — says that it did not get there, or not in
time. Findings are warnings of stepwell, in one call at each tolerance. What numba and heyoka compile is not timed. SciPy
does 5 of many orbits.

The outer solar system is another question: all go at a tolerance of a rounding, and what is compared is how the roundings of
the energy add up, and the time of a single run. Each goes in a process of its own, which is ended after {budget:.0f} s at
the latest.
"""


class Sample(NamedTuple):
    """One tolerance: the error, and seconds an orbit in each repeat."""

    error: float
    times: list[float]

    @property
    def seconds(self) -> float:
        """The median."""
        return statistics.median(self.times)


class Measured:
    """What is measured of a contestant: tolerance after tolerance, until the least error is undercut or patience ends.

    ``stopped`` says why there is no more of it, ``findings`` what stepwell found in the first call at each tolerance.
    """

    def __init__(self, contestant: Contestant, orbits: Orbits, least_error: float, quick: bool) -> None:
        """Nothing is measured yet."""
        self.contestant, self.least_error, self.stopped = contestant, least_error, contestant.missing
        self.lasts = QUICK_SAMPLE * SAMPLE if quick else SAMPLE
        self.tolerances = TOLERANCES[:: QUICK_STRIDE if quick else 1]
        self.orbits = orbits.cut(contestant.some or orbits.members)
        self.samples, self.findings = dict[float, Sample](), list[warnings.WarningMessage]()

    def within(self, budget: Budget, repeats: int) -> None:
        """A turn, or before the first one whatever is compiled; none once it was stopped."""
        if self.stopped:
            return
        try:
            with budget.limit(), heard() as findings:
                if repeats:
                    self.turn(repeats, findings)
                else:
                    self.solve = self.contestant.make(self.orbits)
                    self.solve(TOLERANCES[0])
        except StoppedError as why:
            self.stopped = str(why)

    def turn(self, repeats: int, findings: list[warnings.WarningMessage]) -> None:
        """So many repeats of each tolerance."""
        again = bool(self.samples)
        for tolerance in list(self.samples) or self.tolerances:
            findings.clear()
            begin = time.perf_counter()
            end = self.solve(tolerance)
            first = time.perf_counter() - begin
            if again and first > LONGEST_IN_TURNS:
                return
            self.findings += [] if again else findings
            error = float(np.median(self.orbits.errors(end)))
            sample = self.samples.setdefault(tolerance, Sample(error, []))
            calls = max(1, round(self.lasts / max(first, 1e-7)))
            for _ in range(calls if calls > 1 else 0):  # kernels of all contestants together are more than are kept
                self.solve(tolerance)
            for _ in range(max(1, min(repeats, int(REPEATS_TIME / TURNS / first)))):
                begin = time.perf_counter()
                for _ in range(calls):
                    self.solve(tolerance)
                sample.times.append((time.perf_counter() - begin) / calls / self.orbits.members)
            if error < self.least_error or first > PATIENCE:
                return


def at_error(samples: list[Sample], wanted: float) -> float:
    """Seconds for that error, between the two samples that enclose it; NaN if none do."""
    for a, b in itertools.pairwise(samples):
        if a.error >= wanted > b.error > 0.0:
            share = math.log(wanted / a.error) / math.log(b.error / a.error)
            return math.exp(math.log(a.seconds) + share * (math.log(b.seconds) - math.log(a.seconds)))
    return math.nan


def table(orbits: Orbits, repeats: int, errors: tuple[float, ...], quick: bool, budget: Budget) -> Table:
    """One table, the fastest at the error in the middle first."""
    measured = [Measured(contestant, orbits, min(errors), quick) for contestant in contestants()]
    budget = budget.part(2 * len(measured) + 1)
    for repeats_of_turn in (0, -(-repeats // TURNS)):
        for each in measured:
            each.within(budget.part(), repeats_of_turn)
    later = budget.part()
    for _, each in itertools.product(range(0 if quick else TURNS - 1), measured):
        each.within(later, -(-repeats // TURNS))
    rows = []
    for each in measured:
        samples = [sample for sample in each.samples.values() if sample.times]
        seconds = [at_error(samples, error) for error in errors]
        spread = max((max(sample.times) / min(sample.times) for sample in samples), default=math.nan)
        rows.append((each.contestant.name, seconds, spread, "; ".join(filter(None, [counted(each.findings), each.stopped]))))
    rows.sort(key=lambda row: (math.isnan(row[1][1]), row[1][1]))
    lines = []
    for name, seconds, spread, remarks in rows:
        cells = ["—" if math.isnan(s) else number(1e6 * s) for s in seconds]
        lines.append([name, *cells, "—" if math.isnan(spread) else f"{spread:.2f}", remarks])
    many = "one orbit" if orbits.members == 1 else f"{orbits.members:,} orbits"
    head = ["contestant", *(f"{error:.0e}" for error in errors), "spread", "remarks"]
    return f"Adaptive steps: {orbits.name}, {many}", head, lines


def tables(repeats: int, quick: bool, members: int, budget: Budget) -> Iterator[Table]:
    """Single orbits and many. Along Arenstorf's orbit starts are known to 1e-9 at best: errors grow."""
    members, errors = (16, ERRORS[:2]) if quick else (members, ERRORS)
    yield table(kepler(1, 1 if quick else 10), repeats, errors, quick, budget)
    yield table(arenstorf(1), repeats, errors, quick, budget)
    yield table(kepler(members, 1 if quick else 10), repeats, errors, quick, budget)
    yield table(arenstorf(members), repeats, errors[:2], quick, budget)
    yield solar.table((100.0,) if quick else (1e3, 1e4, 1e5), budget)
