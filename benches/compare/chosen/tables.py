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

READING = """\
Microseconds an orbit for a median error at the end of so much, between the two tolerances that enclose it; the median
of up to {repeats} repeats, fewer where a solution takes long. *Spread* is the most over the least time of the repeats, of
the worst tolerance. One thread. — says that it did not get there, or not in time. What numba and heyoka compile is not
timed. SciPy does 5 of many orbits.

The outer solar system is another question: all go at a tolerance of a rounding, and what is compared is how the roundings of
the energy add up, and the time of a single run.
"""


class Sample(NamedTuple):
    """One tolerance: the error, seconds an orbit, and the spread."""

    error: float
    seconds: float
    spread: float


def measured(contestant: Contestant, orbits: Orbits, repeats: int, errors: tuple[float, ...], lasts: float) -> list[Sample]:
    """Tolerance after tolerance, until the least error is undercut or patience ends; a sample ``lasts`` so many seconds."""
    orbits = orbits.cut(contestant.some or orbits.members)
    solve, samples = contestant.make(orbits), []
    solve(TOLERANCES[0])  # whatever it compiles
    for tolerance in TOLERANCES:
        end = solve(tolerance)
        error = float(np.median(orbits.errors(end)))
        begin = time.perf_counter()
        solve(tolerance)
        first = time.perf_counter() - begin
        calls, times = max(1, round(lasts / max(first, 1e-7))), [first]
        for _ in range(max(2, min(repeats, int(REPEATS_TIME / first)))):
            begin = time.perf_counter()
            for _ in range(calls):
                solve(tolerance)
            times.append((time.perf_counter() - begin) / calls)
        samples.append(Sample(error, statistics.median(times) / orbits.members, max(times) / min(times)))
        if error < min(errors) or first > PATIENCE:
            break
    return samples


def at_error(samples: list[Sample], wanted: float) -> float:
    """Seconds for that error, between the two samples that enclose it; NaN if none do."""
    for a, b in itertools.pairwise(samples):
        if a.error >= wanted > b.error > 0.0:
            share = math.log(wanted / a.error) / math.log(b.error / a.error)
            return math.exp(math.log(a.seconds) + share * (math.log(b.seconds) - math.log(a.seconds)))
    return math.nan


def table(orbits: Orbits, repeats: int, errors: tuple[float, ...], lasts: float) -> Table:
    """One table, the fastest at the error in the middle first."""
    rows = []
    for contestant in contestants():
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", sw.ToleranceWarning)
            warnings.simplefilter("ignore", sw.AccuracyWarning)
            samples = measured(contestant, orbits, repeats, errors, lasts)
        seconds = [at_error(samples, error) for error in errors]
        rows.append((contestant.name, seconds, max(sample.spread for sample in samples)))
    rows.sort(key=lambda row: (math.isnan(row[1][1]), row[1][1]))
    lines = []
    for name, seconds, spread in rows:
        cells = ["—" if math.isnan(s) else number(1e6 * s) for s in seconds]
        lines.append([name, *cells, f"{spread:.2f}"])
    many = "one orbit" if orbits.members == 1 else f"{orbits.members:,} orbits"
    return f"Chosen steps: {orbits.name}, {many}", ["contestant", *(f"{e:.0e}" for e in errors), "spread"], lines


def tables(repeats: int, quick: bool, members: int = 10_000) -> Iterator[Table]:
    """Single orbits and many. Along Arenstorf's orbit starts are known to 1e-9 at best: errors grow."""
    members, errors, lasts = (16, ERRORS[:2], SAMPLE / 10) if quick else (members, ERRORS, SAMPLE)
    yield table(kepler(1, 1 if quick else 10), repeats, errors, lasts)
    yield table(kepler(members, 1 if quick else 10), repeats, errors, lasts)
    yield table(arenstorf(1), repeats, errors, lasts)
    yield table(arenstorf(members), repeats, errors[:2], lasts)
    yield solar.table((100.0,) if quick else (1e3, 1e4, 1e5))
