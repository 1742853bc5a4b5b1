"""A tape run over NumPy arrays, line by line, for many members at once.

The lines become the text of a Python function, which Python compiles once; a step then consists of NumPy's operations alone.
They are those of the tape, none fused and none reordered, so the bits are those of the core and the same on every machine.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..._core import Symbol, Tape
from ...base.arrays import Array
from .fused import MEANING
from .rules import number

#: Operations that have a sign in Python.
SIGNS = {"add": "+", "subtract": "-", "multiply": "*", "divide": "/"}

#: Where the values of a tape come from.
LEAVES = {"state": "state[{}]", "parameter": "numbers[{}]", "step": "h", "time": "t"}


#: Python looks for Ctrl-C at calls, and not between operations: after so many of them there is a call.
LINES_BETWEEN_CALLS = 8


def _call() -> None:
    """Nothing, but a call."""


class Evaluation:
    """Values of a tape, to be computed for many members at once.

    Args:
        tape: the tape with the values.
        roots: the values to compute.
        numbers: the values of each parameter for all members, by its number on the tape.
        tables: the sampled inputs.
    """

    def __init__(self, tape: Tape, roots: Sequence[Symbol], numbers: Mapping[int, Any], tables: Sequence[Any] = ()) -> None:
        self._numbers, self._tables = numbers, tables
        operations, places = tape.operations(list(roots))
        self.length = len(operations)
        self._run = _compiled(operations, places)

    def __call__(self, state: Sequence[Array], t: Any = 0.0, h: Any = 1.0) -> list[Any]:
        """The values for these numbers of the state, each of a shape that broadcasts to the members, at time t and step h."""
        with np.errstate(all="ignore"):
            values: list[Any] = self._run(state, np.float64(t), np.float64(h), self._numbers, self._tables)
        return values


def _compiled(operations: Sequence[tuple[str, Sequence[int], int]], roots: Sequence[int]) -> Any:
    """A function of state, time, step, parameters and tables that returns the roots' values.

    A value's name is reused after its last use, which releases its memory.
    """
    last = list(range(len(operations)))
    for line, (_, of, _) in enumerate(operations):
        for each in of:
            last[each] = line
    for root in roots:
        last[root] = len(operations)
    names: list[str] = []
    free: list[str] = []
    known: dict[str, Any] = {"sqrt": np.sqrt, "floor": np.floor, "call": _call}
    text = ["def run(state, t, h, numbers, tables):"]
    for line, (name, of, given) in enumerate(operations):
        if line % LINES_BETWEEN_CALLS == 0:
            text.append("    call()")
        if name == "constant":
            known[own := f"c{line}"] = _constant(number(given))
            names.append(own)
            continue
        a = [names[each] for each in of]
        made = _expression(name, a, given, known)
        done = {each for each in of if last[each] == line and operations[each][0] != "constant"}
        free += sorted(names[each] for each in done)
        own = free.pop() if free else f"r{line}"
        names.append(own)
        text.append(f"    {own} = {made}")
    text.append(f"    return [{', '.join(names[root] for root in roots)}]")
    exec("\n".join(text), known)  # the text has numbered names and operations only
    return known["run"]


def _expression(name: str, a: list[str], given: int, known: dict[str, Any]) -> str:
    """An operation of these operands, in Python."""
    if name in SIGNS:
        return f"{a[0]} {SIGNS[name]} {a[1]}"
    if name in LEAVES:
        return LEAVES[name].format(given)
    match name:
        case "negate":
            return f"-{a[0]}"
        case "square root":
            return f"sqrt({a[0]})"
        case "floor":
            return f"floor({a[0]})"
        case "sample":
            return f"tables[{given}].sample({a[0]})"
    word = name.replace(" ", "_") + "_of"
    known[word] = MEANING[name]
    return f"{word}({', '.join([*a, str(given)])})"


def _constant(value: float) -> Any:
    """A constant: a Python float is fastest, but Python raises an error in operations of two such that are zero or not finite."""
    return value if math.isfinite(value) and value else np.float64(value)
