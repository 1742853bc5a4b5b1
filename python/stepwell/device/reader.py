"""Steps that are too long to print: their operations are a list that a kernel reads, one after the other.

A compiler takes minutes for a text of so many statements. A value of a member stands in a place of a row of numbers, by its bits,
and places are used again once what is in them is not read any more. By PoCL a step made so takes some 35 times as long as a
printed one.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..base.arrays import Whole
from .printer import Body

#: How an operation is done with the bits ``a``, ``b`` and ``c`` of its operands; ``extra`` is what else it takes.
READ = {
    "add": "bits_of(number_of(a) + number_of(b))",
    "subtract": "bits_of(number_of(a) - number_of(b))",
    "multiply": "bits_of(number_of(a) * number_of(b))",
    "divide": "bits_of(number_of(a) / number_of(b))",
    "multiply add": "bits_of(fma(number_of(a), number_of(b), number_of(c)))",
    "multiply subtract": "bits_of(fma(number_of(a), number_of(b), -number_of(c)))",
    "subtract multiply": "bits_of(fma(-number_of(a), number_of(b), number_of(c)))",
    "square root": "bits_of(sqrt(number_of(a)))",
    "negate": "bits_of(-number_of(a))",
    "floor": "bits_of(floor(number_of(a)))",
    "less": "number_of(a) < number_of(b) ? ~(bits)0 : 0",
    "at most": "number_of(a) <= number_of(b) ? ~(bits)0 : 0",
    "equal": "number_of(a) == number_of(b) ? ~(bits)0 : 0",
    "and": "a & b",
    "or": "a | b",
    "exclusive or": "a ^ b",
    "add bits": "a + b",
    "subtract bits": "a - b",
    "shift up": "extra < 8 * (int)sizeof(bits) ? a << extra : 0",
    "shift down": "extra < 8 * (int)sizeof(bits) ? a >> extra : 0",
    "choose": "(a & b) | (~a & c)",
    "copy": "a",
}
#: The numbers of a line: the operation, three operands, what else it takes, and the place of the result. An operand below zero is
#: a constant.
LINE = 6

#: Reads lines from one to before another. It is not copied to where it is called: compilers would take several times as long.
TEXT = f"""
static inline bits operand_of(const int i, __global const bits *constants, __global const bits *values, const long members,
                       const long g) {{
    return i < 0 ? constants[~i] : values[i * members + g];
}}
__attribute__((noinline)) void read_lines(const int from, const int to, __global const int *lines, __global const bits *constants,
                       __global bits *values, const long members, const long g) {{
    for (long q = from; q < to; q++) {{
        __global const int *line = lines + {LINE} * q;
        const bits a = operand_of(line[1], constants, values, members, g), b = operand_of(line[2], constants, values, members, g),
                   c = operand_of(line[3], constants, values, members, g);
        const int extra = line[4];
        bits made = 0;
        switch (line[0]) {{
CASES
        }}
        values[line[5] * members + g] = made;
    }}
}}
""".replace("CASES", "\n".join(f"        case {i}: made = {text}; break;" for i, text in enumerate(READ.values())))


class Reader:
    """The lists of some bodies: lines, constants by their bits, and how many places of a member they need."""

    def __init__(self, single: bool) -> None:
        self.lines: list[tuple[int, ...]] = []
        self.constants: list[int] = []
        self.places = 0
        self._known: dict[int, int] = {}
        self._kind = np.uint32 if single else np.uint64
        self._all = (1 << (32 if single else 64)) - 1

    def arrays(self) -> tuple[Whole, Whole]:
        """Lines and constants, for the device."""
        return np.array(self.lines or [(0,) * LINE], np.int32), np.array(self.constants or [0], self._kind)

    def body(self, body: Body, leaf: Callable[[str, int, str], str]) -> tuple[list[str], list[str]]:
        """The statements that have a body read, and the texts of its results, as ``Printer.body`` has those of a printed one."""
        operations, roots = body
        last = {each: i for i, (_, of, _) in enumerate(operations) for each in of} | dict.fromkeys(roots, len(operations))
        free: list[int] = []
        at: dict[int, int] = {}
        statements: list[str] = []
        first = len(self.lines)
        codes = {name: i for i, name in enumerate(READ)}
        used = 0

        def place() -> int:
            nonlocal used
            if free:
                return free.pop()
            used += 1
            self.places = max(self.places, used)
            return used - 1

        def text(i: int) -> str:
            value = f"constants[{~at[i]}]" if at[i] < 0 else f"values[{at[i]} * members + g]"
            return f"number_of({value})"

        def read() -> None:
            nonlocal first
            if len(self.lines) > first:
                statements.append(f"read_lines({first}, {len(self.lines)}, lines, constants, values, members, g);")
            first = len(self.lines)

        # Leaves first: what they are put into is not to be read any more.
        for i, (name, of, extra) in enumerate(operations):
            if name == "constant":
                at[i] = ~self._constant(extra & self._all)
            elif not of:
                at[i] = place()
                statements.append(f"values[{at[i]} * members + g] = bits_of({leaf(name, extra, '')});")
        for i, (name, of, extra) in enumerate(operations):
            if not of:
                continue
            operand, operands = text(of[0]), [at[each] for each in of]
            for each in set(of):
                if last[each] == i and at[each] >= 0:
                    free.append(at[each])
            at[i] = place()
            if name in codes:
                more = extra if name.startswith("shift") else 0
                self.lines.append((codes[name], *operands, *[0] * (3 - len(of)), more, at[i]))
            else:
                read()
                statements.append(f"values[{at[i]} * members + g] = bits_of({leaf(name, extra, operand)});")
        read()
        return statements, [text(root) for root in roots]

    def _constant(self, pattern: int) -> int:
        if pattern not in self._known:
            self._known[pattern] = len(self.constants)
            self.constants.append(pattern)
        return self._known[pattern]
