"""A covering array: rows in which every pair of values of any two factors occurs at least once, where the two go together.

Which rows these are follows from a seed, so that other combinations of three are met from commit to commit.
"""

from __future__ import annotations

import itertools
import os
import random
import subprocess
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from typing import Any

from . import ROOT

Row = dict[str, str]


@cache
def seed() -> str:
    """``STEPWELL_SEED``, or the commit; the header of a run of pytest says it."""
    if named := os.environ.get("STEPWELL_SEED"):
        return named
    try:
        asked = subprocess.run(["git", "rev-parse", "--short=12", "HEAD"], cwd=ROOT, capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        return "without a commit"
    return asked.stdout.strip()


def pytest_report_header() -> str:
    """Of which rows a failure is to be repeated."""
    return f"covering arrays: STEPWELL_SEED={seed()}"


def pairs(row: Row) -> set[tuple[tuple[str, str], ...]]:
    """All pairs of values in a row."""
    return set(itertools.combinations(sorted(row.items()), 2))


def covering(
    factors: Mapping[str, Sequence[str]],
    goes: Callable[[Row], bool],
    works: Callable[[Row], bool],
    salt: str = "",
    tries: int = 4,
) -> list[Row]:
    """Rows of one value for each factor, each of which works, with every pair that goes together in some row.

    ``goes`` says of a part of a row whether it may work, and is cheap; ``works`` tries a whole one. A pair for which so many rows
    were tried in vain does not go together. Greedy: a row begins with a pair that is still missing, and takes for each other
    factor the value that brings most new ones.
    """
    draw = random.Random(seed())
    missing = {
        tuple(sorted(((a, x), (b, y))))
        for a, b in itertools.combinations(factors, 2)
        for x in factors[a]
        for y in factors[b]
        if goes({a: x, b: y})
    }
    rows: list[Row] = []
    for pair in draw.sample(sorted(missing), len(missing)):
        for _ in range(tries if pair in missing else 0):
            row = _completed(dict(pair), factors, goes, missing, draw)
            if row is not None and works(row):
                rows.append(row)
                missing -= pairs(row)
                break
        missing.discard(pair)
    return rows


def _completed(
    row: Row, factors: Mapping[str, Sequence[str]], goes: Callable[[Row], bool], missing: set[Any], draw: random.Random
) -> Row | None:
    """The row with a value for each factor; None if none goes with those before."""
    names = [name for name in factors if name not in row]
    for name in draw.sample(names, len(names)):
        values = [value for value in factors[name] if goes(row | {name: value})]
        if not values:
            return None
        gains = [sum(tuple(sorted(((name, value), each))) in missing for each in row.items()) for value in values]
        row = row | {name: draw.choice([value for value, gain in zip(values, gains, strict=True) if gain == max(gains)])}
    return row
