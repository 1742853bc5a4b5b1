"""A tape run over NumPy arrays, for many members at once.

The lines become the text of a Python function, which Python compiles once; a step then consists of NumPy's operations alone.
They are those of the tape, none fused and none reordered, so the bits are those of the core and the same on every machine.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Mapping, Sequence
from copy import copy
from typing import Any

import numpy as np

from ..._core import Symbol, Tape
from ...base.arrays import Array
from ..bits import DOUBLE, SINGLE
from .fused import fused
from .lines import Operation, listed
from .operations import OPERATIONS, meaning

#: Functions in place of which there are operators.
SIGNS = {operator.add: "+", operator.sub: "-", operator.mul: "*", operator.truediv: "/"}

#: Where the values of a tape come from.
LEAVES = {"state": "state[{}]", "parameter": "numbers[{}]", "step": "h", "time": "t"}

#: Python looks for Ctrl-C at calls, and not between operations: after so many of them there is a call.
LINES_BETWEEN_CALLS = 8


def _call() -> None:
    """Nothing, but a call."""


class Evaluation:
    """Values of a tape, to be computed for many members at once, in the precision of the tape.

    Args:
        tape: the tape with the values.
        roots: the values to compute.
        numbers: the values of each parameter for all members, by its number on the tape.
        tables: the sampled inputs.
        fuse: whether sums with a product in them are fused multiply-adds.
    """

    def __init__(
        self, tape: Tape, roots: Sequence[Symbol], numbers: Mapping[int, Any], tables: Sequence[Any] = (), *, fuse: bool = False
    ) -> None:
        lines, places = listed(tape, roots)
        if fuse:
            lines, places = fused(lines, places, single=tape.single)
        self._tables = tables
        self._number = SINGLE.number if tape.single else DOUBLE.number
        self._numbers = {i: np.asarray(each, dtype=np.float32) for i, each in numbers.items()} if tape.single else numbers
        self.length = len(lines)
        self._run = compiled(lines, places, tape.single)

    def of(self, numbers: Mapping[int, Any], tables: Sequence[Any]) -> Evaluation:
        """Return this evaluation with other parameters and inputs, of a tape of float64."""
        other = copy(self)
        other._numbers, other._tables = numbers, tables
        return other

    def __call__(self, state: Sequence[Array], t: Any = 0.0, h: Any = 1.0) -> list[Any]:
        """The values for these numbers of the state, each of a shape that broadcasts to the members, at time t and step h."""
        with np.errstate(all="ignore"):
            values: list[Any] = self._run(state, self._number(t), self._number(h), self._numbers, self._tables)
        return values


def compiled(lines: Sequence[Operation], roots: Sequence[int], single: bool) -> Any:
    """A function of state, time, step, parameters and tables that returns the roots' values.

    A value's name is reused after its last use, which releases its memory.
    """
    last = list(range(len(lines)))
    for line, (_, of, _) in enumerate(lines):
        for each in of:
            last[each] = line
    for root in roots:
        last[root] = len(lines)
    names: list[str] = []
    free: list[str] = []
    known: dict[str, Any] = {"call": _call}
    text = ["def run(state, t, h, numbers, tables):"]
    for line, (name, of, extra) in enumerate(lines):
        if line % LINES_BETWEEN_CALLS == 0:
            text.append("    call()")
        if name == "constant":
            known[own := f"c{line}"] = _constant(extra, single)
            names.append(own)
            continue
        expression = _expression(name, [names[each] for each in of], extra, known, single)
        done = {each for each in of if last[each] == line and lines[each].name != "constant"}
        free += sorted(names[each] for each in done)
        own = free.pop() if free else f"r{line}"
        names.append(own)
        text.append(f"    {own} = {expression}")
    text.append(f"    return [{', '.join(names[root] for root in roots)}]")
    exec("\n".join(text), known)  # the text has numbered names and operations only
    return known["run"]


def _expression(name: str, a: list[str], extra: int, known: dict[str, Any], single: bool) -> str:
    """An operation of these operands, in Python."""
    if name in LEAVES:
        return LEAVES[name].format(extra)
    if name == "sample":
        return f"tables[{extra}].sample({a[0]})"
    function = meaning(name, single)
    if function in SIGNS:
        return f"{a[0]} {SIGNS[function]} {a[1]}"
    known[word := name.replace(" ", "_") + "_of"] = function
    return f"{word}({', '.join([*a, *[str(extra)] * OPERATIONS[name].has_extra])})"


def _constant(bits: int, single: bool) -> Any:
    """A constant: a Python float is fastest, but Python raises an error in operations of two such that are zero or not finite."""
    if single:
        return SINGLE.number_of(bits)[()]
    value = DOUBLE.constant(bits)
    return value if math.isfinite(value) and value else np.float64(value)
