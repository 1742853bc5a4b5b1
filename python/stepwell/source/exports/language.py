"""Operations in a programming language: the part that all languages share.

A value is a number, a truth, or bits (a 64-bit integer). Functions in the file convert numbers to bits and bits to numbers. Bits
are never stored as a number, since not every language would preserve the bits of a NaN.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from typing import Any, ClassVar

from ...errors import UnsupportedError
from ...reference.tape.operations import COMPARISONS, ON_BITS, OPERATIONS
from ..explanation import formula as plain
from ..explanation.formula import ATOM, BOTH, CHOICE, COMPARISON, EITHER, NOT, SIGN, SUM, Formula, Notation
from ..explanation.listing import Line
from .functions import FUNCTIONS
from .names import Field, Names
from .program import Assignment, Table

#: Comparisons whose sign differs from that in a formula.
SIGNS = {"at most": "<=", "equal": "=="}

#: Names with the number of a rate evaluation: those of its state and of its increments.
EVALUATION = re.compile(r"−?d?[vy](\d+)")

#: The shift that moves the last bit of a number to its sign, with the number of places; it sets the sign of a sine.
LAST_BIT = re.compile(r"\w*shift_up\(\w*bits_of\(((?:\w|\.|->)+)\), (\d+)\)")


def functions_on_bits(written: Callable[[str, str, str], str], two: str, shift: str, **ways: str) -> dict[str, str]:
    """The functions on bits that most languages have alike, by name; ``ways`` are the expressions that differ.

    A function is ``written`` by its name, its arguments (``two`` operands, or one and the number of places) and its expression.
    """
    alike = {"and_bits": "a & b", "or_bits": "a | b", "xor_bits": "a ^ b", "add_bits": "a + b", "sub_bits": "a - b"}
    alike |= {"shift_up": "a << n", "shift_down": "a >> n"} | ways
    return {name: written(name, shift if name.startswith("shift") else two, text) for name, text in alike.items()}


class Language(Notation):
    """How a language writes values; one object for each file.

    Attributes:
        title: the language's name.
        helpers: the text of each function that a file may need.
        types: the types of values, by "number", "truth" and "bits", where a language has types; and "wide", of t0.
        of_single: the attributes that differ in float32.
        truths: false and true in the language.
        words: "not", "and" and "or" in the language.
        writes: the texts of operations that are no sums, products, comparisons or operations on bits; {} is the operand.
        me: the prefix of a field and a parameter.
        samples: how a table of samples is passed to a function; {name} is the table, {count} its length.
        kinds: the kind of each value with a name of its own, by that name: "number", "truth" or "bits".
    """

    title: ClassVar[str]
    helpers: ClassVar[dict[str, str]]
    truths: ClassVar[tuple[str, str]] = ("false", "true")
    words: ClassVar[tuple[str, str, str]] = ("!", "&&", "||")
    infinity: ClassVar[str]
    magnitude: ClassVar[str]
    writes: ClassVar[dict[str, str]]
    fma: ClassVar[str | None]
    types: ClassVar[dict[str, str]] = {}
    of_single: ClassVar[dict[str, Any]]
    bits_literal: ClassVar[str]
    me: ClassVar[str]
    samples: ClassVar[str] = "{name}"
    tables: list[Table]
    longest = 88
    called = FUNCTIONS

    def __init__(self, prefix: str, fields: Names, single: bool = False) -> None:
        super().__init__(single)
        if single:
            vars(self).update(self.of_single)
        self.prefix, self.fields = prefix, fields
        self.names = Names()
        self.kinds: dict[str, str] = {}
        self.before = False  # whether values are computed before the steps and stored in fields

    # ---- values

    def number(self, bits: int) -> Formula:
        """A constant; one that is not finite is made from its bits."""
        x = self.precision.constant(bits)
        if x != x:
            return Formula(self.call("number_of", self.whole(bits)))
        text = self.infinity if abs(x) == float("inf") else self.literal(abs(x))
        return Formula(f"−{text}", SIGN) if bits >> self.precision.sign_place else Formula(text)

    def literal(self, x: float) -> str:
        """A finite number: the shortest text that is read as this number."""
        return plain.shortest(x, self.single)

    def whole(self, bits: int) -> str:
        """A constant that is bits."""
        return self.bits_literal.format(hex(bits))

    def named(self, name: str, value: Formula) -> Formula:
        """The formula of a value that has a name of its own: that name in the file."""
        word = self.me + self.fields(name, f"made {name}") if self.before else self.names(name)
        self.kinds[word] = "truth" if value.is_truth else "bits" if value.is_bits else "number"
        return Formula(word, is_truth=value.is_truth, is_bits=value.is_bits)

    def call(self, helper: str, *of: str) -> str:
        """A call of a function in the file."""
        return f"{self.helper(helper)}({', '.join(of)})"

    def helper(self, name: str) -> str:
        """The name of a function in the file."""
        return name

    def as_number(self, value: Formula) -> Formula:
        """The value as a number, if it is bits or a truth."""
        if value.is_truth:
            value = self.as_bits(value, None)
        return Formula(self.call("number_of", value.text)) if value.is_bits else value

    def as_bits(self, value: Formula, known: int | None) -> Formula:
        """The value as bits; ``known`` are those of a constant."""
        if known is not None:
            return Formula(self.whole(known), is_bits=True)
        if value.is_bits:
            return value
        return Formula(self.call("mask_of" if value.is_truth else "bits_of", value.text), is_bits=True)

    # ---- operations

    def formula(self, name: str, of: Sequence[Formula], extra: int, bits: Sequence[int | None]) -> Formula:
        """An operation on these; ``bits`` are those of the operands that are constants."""
        if name in ON_BITS:
            return self._on_bits(name, of, extra, bits)
        if name == "choose":
            return self._choice(of, bits)
        numbers = [self.as_number(each) for each in of]
        match name:
            case "copy":
                return numbers[0]
            case "same":
                return of[0]
            case _ if name in COMPARISONS:
                a, b = numbers
                sign = SIGNS.get(name, OPERATIONS[name].sign)
                return Formula(f"{a.within(SUM)} {sign} {b.within(SUM)}", COMPARISON, is_truth=True)
            case "divide":
                return self.quotient(numbers[0], numbers[1], bits[1])
            case "sample":
                return self._sample(self.tables[extra], numbers[0].text)
            case "multiply add" | "multiply subtract" | "subtract multiply":
                return Formula(f"{self.fma}{plain.formula(name, numbers, extra, bits).text.removeprefix('fma')}")
            case _ if name in FUNCTIONS:
                return Formula(self.call(name, numbers[0].text))
            case "add" | "subtract" | "multiply" | "negate":
                return plain.formula(name, numbers, extra, bits)
            case _ if name in self.writes:
                return Formula(self.writes[name].format(*(each.text for each in numbers)))
            case _:
                raise UnsupportedError(f"language: there is nothing in {self.title} for the operation {name!r} of this step")

    def quotient(self, a: Formula, b: Formula, divisor: int | None) -> Formula:
        """A quotient; ``divisor`` are the bits of the divisor if it is a constant."""
        return plain.formula("divide", (a, b), 0, (None, divisor))

    def _choice(self, of: Sequence[Formula], bits: Sequence[int | None]) -> Formula:
        truth, a, b = of
        if not truth.is_truth:
            mask, a, b = (self.as_bits(each, known) for each, known in zip(of, bits, strict=True))
            return Formula(self.call("choose_bits", mask.text, a.text, b.text), is_bits=True)
        if a.is_truth != b.is_truth:  # one may be a truth that is known
            a, b = (
                Formula(self.truths[known == self.all_bits], is_truth=True) if known in (0, self.all_bits) else each
                for each, known in zip((a, b), bits[1:], strict=True)
            )
        if a.is_bits or b.is_bits or a.is_truth != b.is_truth:
            a, b = (self.as_bits(each, known) for each, known in zip((a, b), bits[1:], strict=True))
        return Formula(self.choice(truth, a, b), CHOICE, a.is_truth, a.is_bits)

    def _sample(self, table: Table, t: str) -> Formula:
        """The sample of a table that holds at time ``t``; for a table of times, the time of that sample."""
        samples = self.samples.format(name=self.table_name(f"{table.name}_samples"), count=len(table.values))
        start, interval = self.me + table.start, self.me + table.interval
        number = self.call("sample", samples, start, interval, t)
        return Formula(f"{start} + {interval} * {number}", SUM) if table.times else Formula(number)

    def table_name(self, name: str) -> str:
        """The name of a table in the file."""
        return self.helper(name)

    def choice(self, truth: Formula, a: Formula, b: Formula) -> str:
        """The expression that chooses one of two values."""
        return f"{truth.within(EITHER)} ? {a.within(EITHER)} : {b.within(EITHER)}"

    def _on_bits(self, name: str, of: Sequence[Formula], extra: int, bits: Sequence[int | None]) -> Formula:
        alike = all(each.is_truth or known in (0, self.all_bits) for each, known in zip(of, bits, strict=True))
        if name in ("and", "or", "exclusive or") and alike and any(each.is_truth for each in of):
            return self._of_truths(name, of, bits)
        if name == "exclusive or":
            for x, turning in (of, of[::-1]):
                if (last := LAST_BIT.fullmatch(turning.text)) and int(last[2]) == self.precision.sign_place and not x.is_truth:
                    return Formula(self.call("turn_sign", self.as_number(x).text, last[1]))
        if name == "and":
            for value, known in zip(of, reversed(bits), strict=True):
                if known == self.all_bits >> 1 and not (value.is_bits or value.is_truth):
                    return Formula(f"{self.magnitude}({value.text})")
        operands = [self.as_bits(each, known).text for each, known in zip(of, bits, strict=True)]
        kind = OPERATIONS[name]
        return Formula(self.call(kind.sign, *operands, *[str(extra)] * kind.has_extra), is_bits=True)

    def _of_truths(self, name: str, of: Sequence[Formula], bits: Sequence[int | None]) -> Formula:
        negation, both, either = self.words
        a, b = (
            each if known is None else Formula(self.truths[known == self.all_bits], is_truth=True)
            for each, known in zip(of, bits, strict=True)
        )
        if name == "and":
            return Formula(f"{a.within(NOT)} {both} {b.within(NOT)}", BOTH, True)
        if name == "or":  # compilers warn unless an `and` inside an `or` has parentheses
            return Formula(f"{a.within(NOT)} {either} {b.within(NOT)}", EITHER, True)
        if self.all_bits in bits:
            text = f"{negation}{(b if bits[0] is not None else a).within(ATOM)}"
            return Formula(f"({text})" if negation.isalpha() else text, ATOM, True)
        return Formula(f"{a.within(SIGN)} != {b.within(SIGN)}", COMPARISON, True)

    # ---- texts

    def assignment(self, line: Line, role: str = "new") -> Assignment:
        """The assignment of a line of a section."""
        word = self.me + self.fields(line.name, f"made {line.name}") if self.before else self.names(line.name)
        evaluation = EVALUATION.match(line.note or line.name)
        return Assignment(
            word,
            self.kinds.get(word, "number"),
            self.text(line.formula),
            line.note.replace("−", "-"),
            int(evaluation[1]) if evaluation else 0,
            role,
        )

    def text(self, formula: str) -> str:
        """A formula with the operators of the language."""
        return formula.replace("·", " * ").replace("/", " / ").replace("−", "-")

    def signed(self, x: float) -> str:
        """A finite number, of either sign."""
        return self.text(self.number(self.precision.pattern(x)).text)

    def value(self, field: Field) -> str:
        """The text of the number of a field without a shape."""
        return repr(float(field.values[0])) if field.wide and self.single else self.signed(field.values[0])

    def type_of(self, field: Field) -> str:
        """The type of the numbers of a field."""
        return self.types["wide" if field.wide else "number"]
