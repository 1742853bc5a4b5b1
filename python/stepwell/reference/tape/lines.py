"""A tape in Python: a list of lines, each an operation of earlier ones."""

from collections.abc import Sequence
from typing import Any, NamedTuple

from ..bits import Precision
from .operations import COMMUTE


class Operation(NamedTuple):
    """A line of a tape.

    Attributes:
        name: of the operation, or "state", "parameter", "step", "time", "constant" or "sample".
        of: the numbers of the lines whose values it takes.
        extra: what else it takes: the number of a state, a parameter or an input, the bits of a constant, places to shift by.
    """

    name: str
    of: tuple[int, ...]
    extra: int


class Lines:
    """A tape that is written line by line, each once.

    Attributes:
        precision: of its numbers.
        lines: those written so far.
    """

    def __init__(self, precision: Precision) -> None:
        self.precision = precision
        self.lines: list[Operation] = []
        self._known: dict[Operation, int] = {}

    def write(self, name: str, *of: int, extra: int = 0) -> int:
        """The line of an operation, which is appended unless it is there."""
        operation = Operation(name, tuple(sorted(of)) if name in ("add", "multiply") else of, extra)
        if operation not in self._known:
            self._known[operation] = len(self.lines)
            self.lines.append(operation)
        return self._known[operation]

    def number(self, x: float) -> int:
        """The line of a number."""
        return self.write("constant", extra=self.precision.pattern(x))


def listed(tape: Any, symbols: Sequence[Any]) -> tuple[list[Operation], list[int]]:
    """The lines that these symbols of a tape need, and the symbols' places among them."""
    lines, places = tape.operations(list(symbols))
    return [Operation(name, tuple(of), extra) for name, of, extra in lines], places


def ranks(tape: Sequence[Operation]) -> list[int]:
    """A number for each line that does not depend on the order in which the tape was written.

    Values of fewer operations one after the other come before those of more; equally deep ones are sorted by the name of the
    operation, by what else it takes, and by the ranks of its operands, the lower one first where they may change places.
    """
    depths: list[int] = []
    levels: list[list[int]] = []
    for line, operation in enumerate(tape):
        depths.append(max((depths[each] + 1 for each in operation.of), default=0))
        if depths[line] == len(levels):
            levels.append([])
        levels[depths[line]].append(line)
    rank, next_rank = [0] * len(tape), 0

    def key(line: int) -> tuple[str, int, list[int]]:
        name, of, extra = tape[line]
        operands = [rank[each] for each in of]
        return name, extra, sorted(operands) if name in COMMUTE else operands

    for level in levels:
        for line in sorted(level, key=key):
            rank[line] = next_rank
            next_rank += 1
    return rank


def of_any(tape: Sequence[Operation], leaf: str) -> list[bool]:
    """For each line whether it depends on a leaf of that name."""
    depends: list[bool] = []
    for operation in tape:
        depends.append(operation.name == leaf or any(depends[line] for line in operation.of))
    return depends


def in_order(tape: Sequence[Operation], roots: Sequence[int]) -> dict[int, int]:
    """The lines that the roots need, and their places among these."""
    keep = set(roots)
    for line in range(len(tape) - 1, -1, -1):
        if line in keep:
            keep.update(tape[line].of)
    return {line: i for i, line in enumerate(sorted(keep))}


def needed(tape: Sequence[Operation], roots: Sequence[int]) -> tuple[list[Operation], list[int]]:
    """The lines that the roots need, and nothing else."""
    place = in_order(tape, roots)
    lines = [tape[line]._replace(of=tuple(place[each] for each in tape[line].of)) for line in place]
    return lines, [place[root] for root in roots]
