"""Steps of float32: the specification of the core's, as ``fused`` is that of steps with fused multiply-adds.

The tape of a step is traced by the reference itself; its constants are rounded to float32. Every operation on it is NumPy's on
float32, rounded once. Only which sample holds at a time, and what is made of the times of samples, is float64, rounded where
another operation reads it: a time divided by an interval takes more digits than float32 has.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Any

import numpy as np

from .fused import Evaluated, fused, listed, odd_sum
from .operations import Operation, needed


def fma(a: Any, b: Any, c: Any) -> Any:
    """a·b + c, rounded once.

    The product of two numbers of 24 bits has 48, so in float64 it is exact. The sum is rounded to odd there, which keeps what the
    second rounding has to know: 53 bits are more than the 24 + 2 that this takes (Boldo and Melquiond 2008).
    """
    product, c = np.broadcast_arrays(np.multiply(a, b, dtype=np.float64), np.asarray(c, dtype=np.float64))
    plain = product + c
    return np.where(np.isfinite(plain) & (plain != 0.0), odd_sum(product, c), plain).astype(np.float32)


def _bits(x: Any) -> Any:
    return np.asarray(x, dtype=np.float32).view(np.uint32)


def _number(bits: Any) -> Any:
    return np.asarray(bits, dtype=np.uint32).view(np.float32)


def _mask(truth: Any) -> Any:
    """All bits where it is true, none elsewhere."""
    return _number(np.where(truth, np.uint32(0xFFFF_FFFF), np.uint32(0)))


#: The meaning of each operation: a function of its operands and its other argument.
MEANING: dict[str, Callable[..., Any]] = {
    "add": lambda a, b, _: np.add(a, b),
    "subtract": lambda a, b, _: np.subtract(a, b),
    "multiply": lambda a, b, _: np.multiply(a, b),
    "divide": lambda a, b, _: np.divide(a, b),
    "multiply add": lambda a, b, c, _: fma(a, b, c),
    "multiply subtract": lambda a, b, c, _: fma(a, b, -c),
    "subtract multiply": lambda a, b, c, _: fma(-a, b, c),
    "square root": lambda a, _: np.sqrt(a),
    "negate": lambda a, _: -a,
    "floor": lambda a, _: np.floor(a),
    "less": lambda a, b, _: _mask(np.less(a, b)),
    "at most": lambda a, b, _: _mask(np.less_equal(a, b)),
    "equal": lambda a, b, _: _mask(np.equal(a, b)),
    "choose": lambda m, a, b, _: _number((_bits(m) & _bits(a)) | (~_bits(m) & _bits(b))),
    "and": lambda a, b, _: _number(_bits(a) & _bits(b)),
    "or": lambda a, b, _: _number(_bits(a) | _bits(b)),
    "exclusive or": lambda a, b, _: _number(_bits(a) ^ _bits(b)),
    "add bits": lambda a, b, _: _number(_bits(a) + _bits(b)),
    "shift up": lambda a, n: _number(_bits(a) << np.uint32(n)),
    "shift down": lambda a, n: _number(_bits(a) >> np.uint32(n)),
    "constant": lambda bits: _number(bits),
}


class Clock:
    """What of a step is float64: the lines of samples, and those that the times of samples are made of.

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
        self._samples = [(line, each.given) for line, each in enumerate(tape) if each.name == "sample" and not of_time[line]]
        self._lines = [line for line, is_of_samples in enumerate(of_samples) if is_of_samples]
        wide = [
            each._replace(given=int(np.float64(_number(each.given)).view(np.uint64))) if each.name == "constant" else each
            for each in tape
        ]
        self._evaluated = Evaluated(*needed(wide, [*(tape[line].of[0] for line, _ in self._samples), *self._lines]), {}, tables)

    @property
    def lines(self) -> list[int]:
        """Their numbers on the tape."""
        return [*(line for line, _ in self._samples), *self._lines]

    def __call__(self, t: Any, h: Any, tables: Sequence[Any] | None = None) -> list[Any]:
        """The values of these lines, rounded to float32; with tables of other members if they are given."""
        self._evaluated.tables = self._tables if tables is None else tables
        values = self._evaluated((), np.float64(t), np.float64(h))
        for i, (_, table) in enumerate(self._samples):
            values[i] = self._evaluated.tables[table].sample(values[i])
        return [np.asarray(value, dtype=np.float32) for value in values]


class Steps:
    """Steps by a tape of float32.

    Args:
        tape: a tape that lists its operations.
        symbols: what is asked for.
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
        self._lines = Evaluated(operations, roots, self.numbers, (), MEANING)

    def __call__(
        self, state: Sequence[Any], t: Any, h: Any, numbers: Mapping[int, Any] | None = None, tables: Sequence[Any] | None = None
    ) -> list[Any]:
        """The values for rows of a state, a time and a step; with numbers and tables of other members if they are given."""
        numbers = self.numbers if numbers is None else numbers
        if self._clock is not None:
            numbers = dict(numbers) | {self._first + i: value for i, value in enumerate(self._clock(t, h, tables))}
        self._lines.numbers = numbers
        rows = [np.asarray(row, dtype=np.float32) for row in state]
        return self._lines(rows, np.float32(t), np.float32(h))  # type: ignore[arg-type]
