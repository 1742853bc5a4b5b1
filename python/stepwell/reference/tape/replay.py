"""Lines of a tape, carried out once more, one by one: on numbers, arrays, or symbols of another tape."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from itertools import chain
from typing import Any

from ..bits import is_symbol
from .operations import OPERATIONS, meaning, of_numbers, of_symbols


class Replay:
    """Values that these lines, in this order, compute from a state and parameters.

    Args:
        lines: as ``_core.Tape.operations`` returns them: of each the name, the lines that it reads, and what else it takes.
        places: the lines of the values.
    """

    def __init__(self, lines: Sequence[tuple[str, Sequence[int], int]], places: Sequence[int]) -> None:
        self.lines, self.places = list(lines), list(places)

    @cached_property
    def _done(self) -> list[list[int]]:
        """For each line the lines that no later one reads: their memory is used again, which is still in the cache."""
        done: list[list[int]] = [[] for _ in self.lines]
        seen = set(self.places)
        for line in range(len(self.lines) - 1, -1, -1):
            for each in self.lines[line][1]:
                if each not in seen:
                    seen.add(each)
                    done[line].append(each)
        return done

    @cached_property
    def _constants(self) -> list[Any]:
        return [of_numbers(name, (), extra) if name == "constant" else None for name, _, extra in self.lines]

    @cached_property
    def _meanings(self) -> list[tuple[int, Callable[..., Any], Sequence[int], list[int], list[int]]]:
        """Of each line that is an operation: its meaning, its operands, what else it takes, and what is not read after it."""
        return [
            (line, meaning(name), of, [extra] * OPERATIONS[name].has_extra, done)
            for line, ((name, of, extra), done) in enumerate(zip(self.lines, self._done, strict=True))
            if name in OPERATIONS
        ]

    @cached_property
    def _leaves(self) -> list[tuple[int, str, int]]:
        return [(line, name, extra) for line, (name, of, extra) in enumerate(self.lines) if not of and name != "constant"]

    def __call__(self, state: Sequence[Any], numbers: Sequence[Any], t: Any = None) -> list[Any]:
        """The values, for these numbers of the state and of the parameters, arrays that broadcast, or symbols; at this time."""
        sources = {"state": state, "parameter": numbers}
        symbol = next(filter(is_symbol, chain(state, numbers)), None)
        values = list(self._constants) if symbol is None else len(self.lines) * [None]
        for line, name, extra in self._leaves:
            values[line] = t if name == "time" else sources[name][extra]
        if symbol is not None:
            on_tape = self._on_tape(values, symbol)
            return [on_tape[place] for place in self.places]
        for line, function, of, more, done in self._meanings:
            values[line] = function(*[values[each] for each in of], *more)
            for each in done:
                values[each] = None
        return [values[place] for place in self.places]

    def _on_tape(self, values: list[Any], symbol: Any) -> list[Any]:
        """The values of all lines on the tape of this symbol."""
        for line, (name, of, extra) in enumerate(self.lines):
            if name == "constant":
                values[line] = symbol.constant(extra)
            elif of:
                values[line] = of_symbols(name, [values[each] for each in of], extra)
        return values
