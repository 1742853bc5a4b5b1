"""Steps of float32: the specification of the core's, as ``fused`` is that of steps with fused multiply-adds.

The tape of a step is traced by the reference itself; its constants are rounded to float32. Every operation on it is NumPy's on
float32, rounded once. Only which sample holds at a time, and what is computed from the times of samples, is float64, rounded
where another operation reads it: a time divided by an interval takes more digits than float32 has.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any

import numpy as np

from ..bits import DOUBLE, SINGLE
from .evaluate import compiled
from .fused import fused
from .lines import Operation, listed, needed


class Clock:
    """The lines of a step that are float64: those of samples, and those that the times of samples are computed by.

    Args:
        tape: the operations of the step.
        tables: the sampled inputs.
        times: the numbers of those whose values are the times at which samples begin.
    """

    def __init__(self, tape: Sequence[Operation], tables: Sequence[Any], times: Collection[int]) -> None:
        of_time: list[bool] = []
        of_samples: list[bool] = []
        for name, of, number in tape:
            is_time = name == "sample" and number in times
            of_time.append(name in ("time", "step", "constant") or (name == "sample" and is_time) or (
                bool(of) and name != "sample" and all(of_time[line] for line in of)
            ))  # fmt: skip
            of_samples.append(of_time[-1] and (is_time or any(of_samples[line] for line in of)))
        self._tables = tables
        self._samples = [(line, each.extra) for line, each in enumerate(tape) if each.name == "sample" and not of_time[line]]
        self._lines = [line for line, is_of_samples in enumerate(of_samples) if is_of_samples]
        wide = [
            each._replace(extra=DOUBLE.pattern(SINGLE.constant(each.extra))) if each.name == "constant" else each for each in tape
        ]
        lines, roots = needed(wide, [*(tape[line].of[0] for line, _ in self._samples), *self._lines])
        self._run = compiled(lines, roots, single=False)

    @property
    def lines(self) -> list[int]:
        """Their numbers on the tape."""
        return [*(line for line, _ in self._samples), *self._lines]

    def __call__(self, t: Any, h: Any, tables: Sequence[Any] | None = None) -> list[Any]:
        """The values of these lines, rounded to float32; with tables of other members if they are given."""
        tables = self._tables if tables is None else tables
        with np.errstate(all="ignore"):
            values = self._run((), np.float64(t), np.float64(h), {}, tables)
        for i, (_, table) in enumerate(self._samples):
            values[i] = tables[table].sample(values[i])
        return [np.asarray(value, dtype=np.float32) for value in values]


class Steps:
    """Steps by a tape of float32.

    Args:
        tape: a tape that lists its operations.
        symbols: the values to compute.
        numbers: of each parameter, by its number on the tape, what it is for every member; it is rounded here.
        fuse: whether sums with a product in them are fused multiply-adds.
        tables: the sampled inputs.
        times: the numbers of those whose values are the times at which samples begin.
    """

    def __init__(
        self,
        tape: Any,
        symbols: Sequence[Any],
        numbers: Mapping[int, Any],
        fuse: bool,
        tables: Sequence[Any] = (),
        times: Collection[int] = (),
    ) -> None:
        operations, roots = listed(tape, symbols)
        if fuse:
            operations, roots = fused(operations, roots, single=True)
        self.numbers = {i: np.asarray(number, dtype=np.float32) for i, number in numbers.items()}
        self.tables, self._first = tables, 1 + max(self.numbers, default=-1)
        self._clock = Clock(operations, tables, times) if tables else None
        if self._clock is not None:  # its values are parameters of the other operations
            for i, line in enumerate(self._clock.lines):
                operations[line] = Operation("parameter", (), self._first + i)
            operations, roots = needed(operations, roots)
        self._lines, self._roots = operations, roots
        self._run = compiled(operations, roots, single=True)

    def fuse_products_of(self, parameters: int) -> None:
        """Let products with one of so many first parameters be added by fused multiply-adds, as the matrix form does."""
        lines = list(self._lines)
        factors = {i for i, each in enumerate(lines) if each.name == "parameter" and each.extra < parameters}
        products = {i for i, each in enumerate(lines) if each.name == "multiply" and not factors.isdisjoint(each.of)}
        for i, each in enumerate(lines):
            if each.name == "add" and (of_sum := products.intersection(each.of)):
                product = max(of_sum)  # of two the later one is added
                lines[i] = Operation("multiply add", (*lines[product].of, *(other for other in each.of if other != product)), 0)
        self._run = compiled(lines, self._roots, single=True)

    def __call__(
        self, state: Sequence[Any], t: Any, h: Any, numbers: Mapping[int, Any] | None = None, tables: Sequence[Any] | None = None
    ) -> list[Any]:
        """The values for rows of a state, a time and a step; with numbers and tables of other members if they are given."""
        numbers = self.numbers if numbers is None else numbers
        if self._clock is not None:
            numbers = dict(numbers) | {self._first + i: value for i, value in enumerate(self._clock(t, h, tables))}
        rows = [np.asarray(row, dtype=np.float32) for row in state]
        with np.errstate(all="ignore"):
            values: list[Any] = self._run(rows, np.float32(t), np.float32(h), numbers, ())
        return values
