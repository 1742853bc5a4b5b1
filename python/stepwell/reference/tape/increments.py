"""The first half of what ``fused=True`` does to a tape: increments are not rounded before they are added.

Methods compute with increments, a factor that depends on the step h times something of the state: h·v̇. Here an increment is kept
as c·factor·x, a number, what is known before the step, and a value. So v + ½(h·a₁ + h·a₂) becomes v + (½h)·(a₁ + a₂).
"""

from collections.abc import Sequence
from math import isfinite
from typing import NamedTuple

from ..bits import DOUBLE, SINGLE
from .lines import Operation, needed, of_any, ranks


class Increment(NamedTuple):
    """c · factor · x; the factor and x are lines of the new tape."""

    c: float
    factor: int
    x: int


class Rewriting:
    """Rewrites a tape line by line."""

    def __init__(self, tape: Sequence[Operation], roots: Sequence[int], single: bool = False) -> None:
        self.tape = tape
        self.precision = SINGLE if single else DOUBLE
        self.rank = ranks(tape)
        self.reads = [0] * len(tape)
        for line in [*roots, *(line for operation in tape for line in operation.of)]:
            self.reads[line] += 1
        self.of_state, self.of_step = of_any(tape, "state"), of_any(tape, "step")
        self.lines: list[Operation] = []
        self.known: dict[Operation, int] = {}
        #: Of each line of the old tape its line on the new one, or the increment that it is.
        self.values: list[int | Increment] = []

    def write(self, name: str, *of: int, extra: int = 0) -> int:
        """The line of an operation on the new tape, which is appended unless it is there."""
        operation = Operation(name, tuple(sorted(of)) if name in ("add", "multiply") else of, extra)
        if operation not in self.known:
            self.known[operation] = len(self.lines)
            self.lines.append(operation)
        return self.known[operation]

    def number(self, x: float) -> int:
        """The line of a number."""
        return self.write("constant", extra=self.precision.pattern(x))

    def signed(self, line: int) -> tuple[bool, int]:
        """The sign of a value of the old tape (whether it is negated), and the line of (|c|·factor)·x."""
        value = self.values[line]
        if not isinstance(value, Increment):
            return False, value
        factor = value.factor if abs(value.c) == 1.0 else self.write("multiply", self.number(abs(value.c)), value.factor)
        return value.c < 0.0, self.write("multiply", factor, value.x)

    def plain(self, line: int) -> int:
        """The line on the new tape of a value of the old tape."""
        is_minus, rest = self.signed(line)
        return self.write("negate", rest) if is_minus else rest

    def weighted(self, line: int) -> tuple[int, int] | None:
        """The factor of a product that is known before the step, and the factor that depends on the state."""
        name, of, _ = self.tape[line]
        if name != "multiply" or self.of_state[of[0]] == self.of_state[of[1]]:
            return None
        return (of[1], of[0]) if self.of_state[of[0]] else (of[0], of[1])

    def times(self, increment: Increment, p: int) -> Increment:
        """An increment times a value known before the step: numbers multiply c, other values the factor."""
        name, _, extra = self.tape[p]
        if name == "constant":
            return increment._replace(c=increment.c * self.precision.constant(extra))
        return increment._replace(factor=self.write("multiply", self.plain(p), increment.factor))

    def product(self, line: int) -> int | Increment:
        """A product, which is an increment if one factor depends on the step and not on the state, and the other on the state."""
        split = self.weighted(line)
        if split:
            p, x = split
            value = self.values[x]
            if isinstance(value, Increment):
                return self.times(value, p)
            if self.of_step[p]:
                increment = Increment(1.0, self.plain(p), 0)
                # A part of x that is known before the step and read by nothing else goes to the factor.
                while self.reads[x] == 1 and (split := self.weighted(x)):
                    increment, x = self.times(increment, split[0]), split[1]
                return increment._replace(x=self.plain(x))
        return self.same(line)

    def addition(self, line: int) -> int | Increment:
        """A sum or a difference: an increment if both terms are increments of one factor."""
        name, (a, b), _ = self.tape[line]
        is_difference = name == "subtract"
        x, y = self.values[a], self.values[b]
        if isinstance(x, Increment) and isinstance(y, Increment) and x.factor == y.factor and a != b:
            # c₁·f·x + c₂·f·y = c₁·f·(x + (c₂/c₁)·y), where x is the one of the lower rank.
            turned = self.rank[b] < self.rank[a]
            low, high = (y, x) if turned else (x, y)
            ratio = high.c / low.c if low.c else 0.0
            ratio = -ratio if is_difference else ratio
            if isfinite(ratio) and ratio:
                size = self.number(abs(ratio))
                scaled = high.x if abs(ratio) == 1.0 else self.write("multiply", size, high.x)
                total = self.write("add" if ratio > 0.0 else "subtract", low.x, scaled)
                return Increment(-low.c if is_difference and turned else low.c, low.factor, total)
        (minus_a, left), (minus_b, right) = self.signed(a), self.signed(b)
        if minus_a == (minus_b != is_difference):
            total = self.write("add", left, right)
            return self.write("negate", total) if minus_a else total
        return self.write("subtract", right, left) if minus_a else self.write("subtract", left, right)

    def same(self, line: int) -> int:
        """Write an operation unchanged on the new tape."""
        name, of, extra = self.tape[line]
        return self.write(name, *(self.plain(each) for each in of), extra=extra)

    def value(self, line: int) -> int | Increment:
        """The line on the new tape, or the increment, that replaces a line of the old tape."""
        name, of, _ = self.tape[line]
        match name:
            case "multiply":
                return self.product(line)
            case "negate" if isinstance(value := self.values[of[0]], Increment):
                return value._replace(c=-value.c)
            case "add" | "subtract":
                return self.addition(line)
            case _:
                return self.same(line)

    def run(self) -> None:
        """Rewrite all lines."""
        self.values = []
        for line in range(len(self.tape)):
            self.values.append(self.value(line))


def negated_sums(tape: Sequence[Operation]) -> tuple[list[Operation], list[int]]:
    """Rewrite a tape with −(x + y) in place of (−x) − y; also the place of each line.

    Of −x and −y a tape writes (−x) − y or (−y) − x, whichever comes first. The result must not depend on that.
    """
    lines: list[Operation] = []
    known: dict[Operation, int] = {}
    place: list[int] = []

    def write(name: str, of: tuple[int, ...], extra: int = 0) -> int:
        operation = Operation(name, tuple(sorted(of)) if name in ("add", "multiply") else of, extra)
        if operation not in known:
            known[operation] = len(lines)
            lines.append(operation)
        return known[operation]

    for name, of, extra in tape:
        if name == "subtract" and tape[of[0]].name == "negate":
            x, y = place[tape[of[0]].of[0]], place[of[1]]
            place.append(write("negate", (write("add", (x, y)),)))
        else:
            place.append(write(name, tuple(place[line] for line in of), extra))
    return lines, place


def increments_last(
    tape: Sequence[Operation], roots: Sequence[int], *, single: bool = False
) -> tuple[list[Operation], list[int]]:
    """Rewrite a tape with increments multiplied last; also the lines of the roots on it; all lines are needed for the roots.

    ``single`` is whether numbers have 32 bits.

    A product of what depends on the step but not on the state, and of what depends on the state, is an increment. A change of
    sign, a product with a number, and a product with something else that is known before the step change c and the factor. The
    sum of two increments of one factor is one too. Everything else takes the product (c·factor)·x, whose first half is computed
    before the steps.
    """
    tape, place = negated_sums(tape)
    tape, roots = needed(tape, [place[root] for root in roots])
    work = Rewriting(tape, roots, single)
    work.run()
    places = [work.plain(root) for root in roots]
    return needed(work.lines, places)
