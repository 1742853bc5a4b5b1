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
import stepwell as sw

from ..report import Table, number
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
QUICK_STRIDE, QUICK_TURNS, QUICK_SAMPLE = 4, 1, 0.1

READING = """\
Microseconds an orbit for a median error at the end of so much, between the two tolerances that enclose it; the median
of up to {repeats} repeats in three turns of all contestants, fewer where a solution takes long. *Spread* is the most
over the least time of the repeats, of the worst tolerance. One thread. — says that it did not get there, or not in
time. What numba and heyoka compile is not timed. SciPy does 5 of many orbits.

The outer solar system is another question: all go at a tolerance of a rounding, and what is compared is how the roundings of
the energy add up, and the time of a single run. Each goes in a process of its own, which is ended after {budget:.0f} s.
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
    """What is measured of a contestant: tolerance after tolerance, until the least error is undercut or patience ends."""

    def __init__(self, contestant: Contestant, orbits: Orbits, least_error: float, quick: bool) -> None:
        """Whatever it compiles is compiled here."""
        self.name, self.least_error = contestant.name, least_error
        self.lasts = QUICK_SAMPLE * SAMPLE if quick else SAMPLE
        self.tolerances = TOLERANCES[:: QUICK_STRIDE if quick else 1]
        self.orbits = orbits.cut(contestant.some or orbits.members)
        self.solve, self.samples = contestant.make(self.orbits), dict[float, Sample]()
        self.solve(TOLERANCES[0])

    def turn(self, repeats: int) -> None:
        """So many repeats of each tolerance."""
        again = bool(self.samples)
        for tolerance in list(self.samples) or self.tolerances:
            begin = time.perf_counter()
            end = self.solve(tolerance)
            first = time.perf_counter() - begin
            if again and first > LONGEST_IN_TURNS:
                return
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


def table(orbits: Orbits, repeats: int, errors: tuple[float, ...], quick: bool) -> Table:
    """One table, the fastest at the error in the middle first."""
    rows = []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", sw.ToleranceWarning)
        warnings.simplefilter("ignore", sw.AccuracyWarning)
        all_measured = [Measured(contestant, orbits, min(errors), quick) for contestant in contestants()]
        turns = QUICK_TURNS if quick else TURNS
        for _, each in itertools.product(range(turns), all_measured):
            each.turn(-(-repeats // TURNS))
    for each in all_measured:
        samples = list(each.samples.values())
        seconds = [at_error(samples, error) for error in errors]
        rows.append((each.name, seconds, max(max(sample.times) / min(sample.times) for sample in samples)))
    rows.sort(key=lambda row: (math.isnan(row[1][1]), row[1][1]))
    lines = []
    for name, seconds, spread in rows:
        cells = ["—" if math.isnan(s) else number(1e6 * s) for s in seconds]
        lines.append([name, *cells, f"{spread:.2f}"])
    many = "one orbit" if orbits.members == 1 else f"{orbits.members:,} orbits"
    return f"Adaptive steps: {orbits.name}, {many}", ["contestant", *(f"{e:.0e}" for e in errors), "spread"], lines


def tables(repeats: int, quick: bool, members: int = 10_000) -> Iterator[Table]:
    """Single orbits and many. Along Arenstorf's orbit starts are known to 1e-9 at best: errors grow."""
    members, errors = (16, ERRORS[:2]) if quick else (members, ERRORS)
    yield table(kepler(1, 1 if quick else 10), repeats, errors, quick)
    yield table(arenstorf(1), repeats, errors, quick)
    yield table(kepler(members, 1 if quick else 10), repeats, errors, quick)
    yield table(arenstorf(members), repeats, errors[:2], quick)
    yield solar.table((100.0,) if quick else (1e3, 1e4, 1e5))
