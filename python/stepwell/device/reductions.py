"""Reductions of observed states by a kernel, in place of saving them: it keeps a few numbers of each member on the device.

An ``Observer`` has the reductions of a run, prints what kernels do with a state, and has the numbers in the end. Its text is
between that of the steps: in it the numbers of the observed state are ``q0``, ``q1``, …, v before y; those of recorded
quantities ``r0``, ``r1``, …; and the time is ``seen_t``.

Each operation is that of the same reduction on the host, in its order, in float64 where it adds up.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from ..base.arrays import Array

#: Last argument of a kernel that observes.
ARGUMENTS = "__global double *restrict reduced"


class Extremes(NamedTuple):
    """The least and the largest of some rows, NaN once one was NaN.

    Results are the least of each row, then the largest of each.
    """

    rows: tuple[int, ...]

    @property
    def results(self) -> int:
        """How many numbers of a member come back."""
        return 2 * len(self.rows)

    @property
    def compared(self) -> tuple[int, ...]:
        """The rows whose last values are needed."""
        return ()

    def initial(self) -> list[str]:
        """The results before the first state."""
        return ["INFINITY"] * len(self.rows) + ["-INFINITY"] * len(self.rows)

    def see(self, kept: list[str], now: Callable[[int], str], places: list[str]) -> list[str]:
        """Statements that take a state into account: the variables, the number of a row, and where results stand."""
        lines = []
        for i, row in enumerate(self.rows):
            least, largest, x = kept[i], kept[len(self.rows) + i], now(row)
            lines.append(f"if ({x} < {least} || {x} != {x}) {least} = {x};")
            lines.append(f"if ({x} > {largest} || {x} != {x}) {largest} = {x};")
        return lines


class Sums(NamedTuple):
    """The sums of some rows over the time, by the trapezoidal rule, state after state."""

    rows: tuple[int, ...]

    @property
    def results(self) -> int:
        """How many numbers of a member come back."""
        return len(self.rows)

    @property
    def compared(self) -> tuple[int, ...]:
        """The rows whose last values are needed."""
        return self.rows

    def initial(self) -> list[str]:
        """The results before the first state."""
        return ["0.0"] * len(self.rows)

    def see(self, kept: list[str], now: Callable[[int], str], places: list[str]) -> list[str]:
        """Statements that take a state into account: the variables, the number of a row, and where results stand."""
        terms = [
            f"{total} = {total} + weight * (p{row} + (double){now(row)});" for total, row in zip(kept, self.rows, strict=True)
        ]
        return ["if (is_next) {", "const double weight = 0.5 * (seen_t - before_t);", *terms, "}"]


class Passages(NamedTuple):
    """How often a row passes a level, and what is around the first passage, and around the last one if ``has_last``.

    Results are the number of passages; then for the first, and for the last, the times before and after it, the differences from
    the level then, and the ``states`` rows of the state before it, and after it.
    """

    row: int
    level: float
    direction: int
    has_last: bool
    states: int

    @property
    def around(self) -> int:
        """How many numbers there are around a passage."""
        return 4 + 2 * self.states

    @property
    def results(self) -> int:
        """How many numbers of a member come back."""
        return 1 + (2 if self.has_last else 1) * self.around

    @property
    def compared(self) -> tuple[int, ...]:
        """The rows whose last values are needed."""
        return (*range(self.states), *([] if self.row < self.states else [self.row]))

    def initial(self) -> list[str]:
        """The results before the first state: only the number of passages stays in a variable."""
        return ["0.0"]

    def see(self, kept: list[str], now: Callable[[int], str], places: list[str]) -> list[str]:
        """Statements that take a state into account: the variables, the number of a row, and where results stand."""
        rising, falling = "(a < 0.0 && b >= 0.0)", "(a > 0.0 && b <= 0.0)"
        passes = {1: rising, -1: falling, 0: f"({rising} || {falling})"}[self.direction]
        states = [[*(f"p{i}" for i in range(self.states))], [f"(double){now(i)}" for i in range(self.states)]]
        around = ["before_t", "seen_t", "a", "b", *states[0], *states[1]]
        first = [f"{place} = {text};" for place, text in zip(places[1:], around, strict=False)]
        last = [f"{place} = {text};" for place, text in zip(places[1 + self.around :], around, strict=False)]
        level = f"({self.level.hex()})"
        return [
            "{",
            f"const double a = p{self.row} - {level}, b = (double){now(self.row)} - {level};",
            f"if (is_next && {passes}) {{",
            f"if ({kept[0]} == 0.0) {{",
            *first,
            "}",
            *last,
            f"{kept[0]} += 1.0;",
            "}",
            "}",
        ]


AnyReduction = Extremes | Sums | Passages


class Observer:
    """The reductions of a run.

    Args:
        every: the interval of the observed states, in steps; the start and the last one are observed, too.
        reductions: what becomes of each.
        states: how many numbers v and y have together.

    Attributes:
        numbers: after the run, the results of each reduction, shapes (results, members).
    """

    def __init__(self, every: int, reductions: tuple[AnyReduction, ...], states: int) -> None:
        self.every, self._reductions, self._states = every, reductions, states
        self.numbers: list[Array] = []
        #: The rows whose last values are kept, each once.
        self._compared = sorted({row for each in reductions for row in each.compared})
        #: How many numbers of a member come back; those behind them do not.
        self.results = sum(each.results for each in reductions)

    @property
    def key(self) -> Any:
        """The key of its text, with the types: named tuples of different kinds are equal if their numbers are."""
        return tuple((type(each), each) for each in self._reductions)

    @property
    def size(self) -> int:
        """How many numbers of a member it keeps."""
        return self.results + len(self._compared)

    def _kept(self) -> list[tuple[str, str, int, str]]:
        """The variables of a member: the type of each, its name, its place among all numbers, and its number at first."""
        variables, place = [], 0
        for each in self._reductions:
            kind = "real" if isinstance(each, Extremes) else "double"
            variables += [(kind, f"o{place + i}", place + i, number) for i, number in enumerate(each.initial())]
            place += each.results
        return variables + [("double", f"p{row}", self.results + i, "0.0") for i, row in enumerate(self._compared)]

    def begin(self, is_next: str, before_t: str) -> list[str]:
        """Statements before the steps of a launch: whether a state was observed before, and the time of the last one."""
        return [
            f"int is_next = {is_next};",
            f"double before_t = {before_t};",
            *(
                f"{kind} {name} = is_next ? ({kind})reduced[{place} * members + g] : ({kind}){number};"
                for kind, name, place, number in self._kept()
            ),
        ]

    def see(self) -> list[str]:
        """Statements that take a state into account."""

        def now(row: int) -> str:
            return f"q{row}" if row < self._states else f"r{row - self._states}"

        lines, first = [], 0
        for each in self._reductions:
            kept = [f"o{first + i}" for i in range(len(each.initial()))]
            lines += each.see(kept, now, [f"reduced[{first + i} * members + g]" for i in range(each.results)])
            first += each.results
        lines += [f"p{row} = (double){now(row)};" for row in self._compared]
        return [*lines, "is_next = 1;", "before_t = seen_t;"]

    def end(self) -> list[str]:
        """Statements after the steps of a launch."""
        return [f"reduced[{place} * members + g] = {name};" for _, name, place, _ in self._kept()]

    def take(self, numbers: Array) -> None:
        """Take the results, shape (results, members)."""
        self.numbers = np.split(numbers, np.cumsum([each.results for each in self._reductions])[:-1])
