"""A tape read back: its operations, the symbols that they make, and which of them are marked functions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from ..._core import Symbol, Tape
from ...errors import UnsupportedError
from ..marks import Mark, Marks
from .operations import Operation
from .rules import MIN_ROUNDING_CONSTANT, MIN_SINGLE_ROUNDING_CONSTANT, NO_RULE, no_derivative, number

#: How to write each operation again. Equal operations are on a tape only once, so the result is the symbol that was there.
AGAIN: dict[str, Callable[..., Any]] = {
    "add": lambda a, b, _: a + b,
    "subtract": lambda a, b, _: a - b,
    "multiply": lambda a, b, _: a * b,
    "divide": lambda a, b, _: a / b,
    "square root": lambda a, _: a.sqrt(),
    "negate": lambda a, _: -a,
    "floor": lambda a, _: a.floor(),
    "less": lambda a, b, _: a < b,
    "at most": lambda a, b, _: a <= b,
    "equal": lambda a, b, _: a.equals(b),
    "choose": lambda m, a, b, _: m.choose(a, b),
    "and": lambda a, b, _: a & b,
    "or": lambda a, b, _: a | b,
    "exclusive or": lambda a, b, _: a.xor_bits(b),
    "shift up": lambda a, n: a.shift_up(n),
    "shift down": lambda a, n: a.shift_down(n),
}


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
        self.tape, self._single = tape, any(root.single for root in roots)
        asked = list(roots)
        while True:  # the argument of a function may be on the tape without being needed for its value
            operations, places = tape.operations(asked)
            self.operations = [Operation(name, tuple(of), given) for name, of, given in operations]
            self.symbols: list[Symbol] = []
            for each in self.operations:
                self.symbols.append(self._again(each))
            self.place = {symbol.id: k for k, symbol in enumerate(self.symbols)}
            self.marks = {k: marks[symbol.id] for k, symbol in enumerate(self.symbols) if symbol.id in marks}
            missing = [each for mark in self.marks.values() for each in mark.arguments if self._unknown(each)]
            if not missing:
                break
            asked += missing
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
        """Whether a line is one of two others, as a mask, its first operand, says."""
        return self.operations[line].name == "choose" and line not in self.marks

    def _unknown(self, argument: Any) -> bool:
        return isinstance(argument, Symbol) and argument.id not in self.place

    def _again(self, operation: Operation) -> Symbol:
        """The symbol that an operation makes, by writing it once more."""
        name, of, given = operation
        operands = [self.symbols[line] for line in of]
        made: Symbol
        match name:
            case "state":
                made = self.tape.state(given)
            case "parameter":
                made = self.tape.param(given)
            case "step":
                made = self.tape.step()
            case "time":
                made = self.tape.time()
            case "constant":
                made = self.tape.number(number(given, single=self._single))
            case "sample":
                made = self.tape.sample(given, *operands)
            case "add bits":
                made = self._sum_of_bits(of, operands)
            case _ if name in AGAIN:
                made = AGAIN[name](*operands, given)
            case _:
                raise no_derivative(name)
        return made

    def _sum_of_bits(self, of: Sequence[int], operands: list[Any]) -> Symbol:
        """An integer addition; one operand is usually a constant."""
        for k in (0, 1):
            if self.operations[of[k]].name == "constant":
                made: Symbol = operands[1 - k].add_bits(self.operations[of[k]].given)
                return made
        return operands[0].add_bits(operands[1])  # type: ignore[no-any-return]

    def reads(self, line: int) -> tuple[tuple[Any, ...], Mark | None]:
        """The lines from which the derivative of a line is computed: the arguments of a marked function, or else the operands."""
        mark = self.marks.get(line)
        if mark is not None:
            return mark.arguments, mark
        return tuple(self.symbols[each] for each in self.operations[line].of), None

    def check(self, line: int) -> None:
        """Raise if a line that is no marked function has an operation without a derivative, and an operand that changes."""
        name = self.operations[line].name
        if name in NO_RULE:
            raise no_derivative(name)
        added = self._offset(line)
        if added is None or abs(added[1]) < (MIN_SINGLE_ROUNDING_CONSTANT if self._single else MIN_ROUNDING_CONSTANT):
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
            constant = number(self.operations[b].given, single=self._single)
            return a, constant if name == "add" else -constant
        if name == "add" and self.operations[a].name == "constant":
            return b, number(self.operations[a].given, single=self._single)
        return None
