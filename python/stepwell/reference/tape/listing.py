"""A tape read back: its operations, the symbols that they make, and which of them are marked functions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ..._core import Symbol, Tape
from ...errors import UnsupportedError
from ..bits import DOUBLE, SINGLE
from ..marks import Mark, Marks
from .lines import Operation, listed
from .operations import OPERATIONS, no_derivative, of_tape

#: Adding a constant of at least this size and subtracting it again rounds: x + 1.5·2⁵² − 1.5·2⁵² is x as a whole number. Of
#: float64, and of float32.
MIN_ROUNDING_CONSTANT = 2.0**32, 2.0**20


class Listing:
    """The operations that some values need, in order.

    Attributes:
        operations: the lines.
        symbols: of each line, the symbol that it makes.
        roots: the lines of the values.
        marks: of each line that is a marked function, its mark.
        place: of each symbol's number, its line.
        passed: of each line, whether derivatives go through it: not inside marked functions, nor where it only decides a choice.
    """

    def __init__(self, tape: Tape, roots: Sequence[Symbol], marks: Marks) -> None:
        self.tape, self._precision = tape, SINGLE if tape.single else DOUBLE
        needed = list(roots)
        while True:  # the argument of a function may be on the tape without being needed for its value
            self.operations, places = listed(tape, needed)
            self.symbols: list[Symbol] = []
            for each in self.operations:
                self.symbols.append(self._again(each))
            self.place = {symbol.id: k for k, symbol in enumerate(self.symbols)}
            self.marks = {k: marks[symbol.id] for k, symbol in enumerate(self.symbols) if symbol.id in marks}
            missing = [each for mark in self.marks.values() for each in mark.arguments if self._unknown(each)]
            if not missing:
                break
            needed += missing
        self.roots = places[: len(roots)]
        self.passed = [False] * len(self.operations)
        for root in self.roots:
            self.passed[root] = True
        for line in range(len(self.operations) - 1, -1, -1):
            if self.passed[line]:
                for each in self.reads(line)[0][self.is_choice(line) :]:
                    if isinstance(each, Symbol):
                        self.passed[self.place[each.id]] = True

    def is_choice(self, line: int) -> bool:
        """True if a line is a choice between two others by a mask, its first operand."""
        return self.operations[line].name == "choose" and line not in self.marks

    def _unknown(self, argument: Any) -> bool:
        return isinstance(argument, Symbol) and argument.id not in self.place

    def _again(self, operation: Operation) -> Symbol:
        """The symbol that an operation makes, by writing it once more."""
        name, of, extra = operation
        kind = OPERATIONS.get(name)
        if kind is not None and kind.counted == "fused":
            raise no_derivative(name)
        symbol: Symbol | None = of_tape(self.tape, name, [self.symbols[line] for line in of], extra)
        if symbol is None:
            raise no_derivative(name)
        return symbol

    def reads(self, line: int) -> tuple[tuple[Any, ...], Mark | None]:
        """The lines from which the derivative of a line is computed: the arguments of a marked function, or else the operands."""
        mark = self.marks.get(line)
        if mark is not None:
            return mark.arguments, mark
        return tuple(self.symbols[each] for each in self.operations[line].of), None

    def check(self, line: int) -> None:
        """Raise if a line that is no marked function has an operation without a derivative, and an operand that changes."""
        name = self.operations[line].name
        if name == "sample" or (name in OPERATIONS and OPERATIONS[name].factors is None):
            raise no_derivative(name)
        added = self._offset(line)
        if added is None or abs(added[1]) < MIN_ROUNDING_CONSTANT[self.tape.single]:
            return
        before = self._offset(added[0])
        if before is not None and added[1] == -before[1]:
            raise UnsupportedError(
                f"derivative: adding {abs(added[1]):g} and taking it away again rounds a number, which has none. Decorate the "
                f"function that this is a part of with reference.marks.differentiable"
            )

    def _offset(self, line: int) -> tuple[int, float] | None:
        """For a line that adds a constant to another line: that line and the constant; else None."""
        name, of, _ = self.operations[line]
        if name not in ("add", "subtract"):
            return None
        a, b = of
        if self.operations[b].name == "constant":
            constant = self._precision.constant(self.operations[b].extra)
            return a, constant if name == "add" else -constant
        if name == "add" and self.operations[a].name == "constant":
            return b, self._precision.constant(self.operations[a].extra)
        return None
