"""A method of a user: the operations of its step on both blocks, executed over numbers, arrays or symbols.

An operation is a name, the places of the blocks that it reads, and a number: the factor of a product, the time of a rate as a
share of the step, or the place of a block among those that the method keeps between steps.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from ..base.arrays import Array, Scaled

#: A name, operands, and a number.
Operation = tuple[str, tuple[int, ...], float]


class Program(NamedTuple):
    """The operations of a method on blocks, each after those that it reads, and the places of the results."""

    operations: tuple[Operation, ...]
    results: tuple[int, ...]

    def run(self, s: Scaled, t: Any, h: Any, v: Array, y: Array, kept: Sequence[Array] = ()) -> list[Any]:
        """The results, from a state and what the method keeps beside it."""
        blocks: list[Any] = []
        for name, operands, number in self.operations:
            of = [blocks[place] for place in operands]
            match name:
                case "v":
                    block: Any = v
                case "y":
                    block = y
                case "kept v" | "kept y":
                    block = kept[int(number)]
                case "dv" | "dy":
                    at = t + number * h if number not in (0.0, 1.0) else t + h if number else t
                    block = getattr(s, name)(at, *of)
                case "velocity":
                    block = s.velocity(*of)
                case "add":
                    block = of[0] + of[1]
                case "subtract":
                    block = of[0] - of[1]
                case _:
                    block = number * of[0]
            blocks.append(block)
        return [blocks[place] for place in self.results]

    def first(self, results: int) -> Program:
        """The program of these results alone, without the operations that only others need; the state stays."""
        used = {0, 1, *self.results[:results]}
        for place in range(len(self.operations) - 1, -1, -1):
            if place in used:
                used.update(self.operations[place][1])
        places = {place: i for i, place in enumerate(sorted(used))}
        operations = (self.operations[place] for place in places)
        kept = tuple((name, tuple(places[each] for each in of), number) for name, of, number in operations)
        return Program(kept, tuple(places[each] for each in self.results[:results]))


class Programs(NamedTuple):
    """All programs of a method: what a file of ``steppers/`` holds of one that is built in.

    Attributes:
        whole: from the state, and what is kept, to the new state and what is kept then; or to the new state and the estimates of
            the errors of v and y.
        begin: from the state to the blocks that are kept, or None.
        kept: the names of these blocks.
    """

    whole: Program
    begin: Program | None = None
    kept: tuple[str, ...] = ()

    @property
    def estimates(self) -> bool:
        """True if it estimates the error of a step."""
        return not self.kept and len(self.whole.results) > 2

    def step(self, s: Scaled, t: float, h: float, v: Array, y: Array, *kept: Array) -> Any:
        """The new v and y, and what is kept beside them."""
        program = self.whole.first(2) if self.estimates else self.whole
        return tuple(program.run(s, t, h, v, y, kept))

    def start(self, s: Scaled, choice: int, t: float, h: float, v: Array, y: Array) -> list[Array]:
        """The blocks that are kept, at the start of a run."""
        return self.begin.run(s, t, h, v, y) if self.begin is not None else []

    def attempt(self, s: Scaled, t: float, h: float, v: Array, y: Array) -> list[Array]:
        """The new v and y, and the estimates of their errors."""
        return self.whole.run(s, t, h, v, y)
