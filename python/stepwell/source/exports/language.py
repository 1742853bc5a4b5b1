"""Operations as a language writes them: the part that all languages share.

A value is a number, a truth, or bits (a 64-bit integer). Functions in the file convert numbers to bits and bits to numbers. Bits
are never kept as a number, since not every language would preserve the bits of a NaN.
"""

from __future__ import annotations

import re
import struct
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

from ... import _core
from ...base.arrays import Shape
from ...errors import UnsupportedError
from ..explanation import formula as plain
from ..explanation.formula import ATOM, BOTH, CHOICE, COMPARISON, EITHER, NOT, SIGN, SUM, Formula, Notation
from ..explanation.listing import Leaf, Line, Writer
from .functions import FUNCTIONS, operations_of
from .names import Field, Names

if TYPE_CHECKING:
    from .written import Table, Written

#: The block of a force from outside, and the argument.
FORCE = "force"

#: Characters of a line of numbers.
WIDTH = 100

#: Operations whose result is a number.
ARITHMETIC = ("add", "subtract", "multiply", "divide", "negate")

#: Operations that become calls of functions on bits.
BIT_FUNCTIONS = {"and": "and_bits", "or": "or_bits", "exclusive or": "xor_bits", "add bits": "add_bits"}
BIT_FUNCTIONS |= {"shift up": "shift_up", "shift down": "shift_down"}

#: Values that are named after a rate evaluation: the state at which it is made, and the increments.
EVALUATION = re.compile(r"−?d?[vy](\d+)")

#: The shift that moves the last bit of a number to its sign, by as many places: it sets the sign of a sine.
LAST_BIT = re.compile(r"\w*shift_up\(\w*bits_of\(((?:\w|\.|->)+)\), (\d+)\)")


class Assignment(NamedTuple):
    """A value and how it is made.

    Attributes:
        name: as it is used.
        kind: "number", "truth" or "bits".
        text: its formula.
        note: its meaning in the method, if the name does not say it.
        evaluation: the rate evaluation to which it belongs, counted from 1; 0 if that is not known.
        role: "new"; "variable" if it is set again in a branch, without a text if in both; "set" there.
    """

    name: str
    kind: str
    text: str
    note: str = ""
    evaluation: int = 0
    role: str = "new"


class Conditional(NamedTuple):
    """What is computed if something holds, and if not."""

    condition: str
    then: list[Statement]
    other: list[Statement]


class Loop(NamedTuple):
    """So many equal operations: what element i of an array is.

    Of the state, ``@y[i]`` is an element before the step, ``#y[i]`` one after it.
    """

    times: int
    target: str
    text: str


Statement = Assignment | Conditional | Loop


class Place(NamedTuple):
    """A number of a state, and what it is called in a function; ``at`` is −1 if its block is one number."""

    block: str
    at: int
    name: str


class Function(NamedTuple):
    """The contents of a function.

    Attributes:
        reads: the numbers of the state that it needs.
        needs_time: whether it needs the time.
        needs_fields: whether it reads parameters or values computed from them.
        of_time: the values that depend on the time alone.
        lines: the values that depend on the state.
        writes: the numbers that it writes.
        work: the length of the array in which loops compute; 0 without loops.
    """

    reads: list[Place]
    needs_time: bool
    needs_fields: bool
    of_time: list[Assignment]
    lines: list[Statement]
    writes: list[Place]
    work: int = 0


class Language(Notation, ABC):
    """How a language writes values; one object for each file.

    Attributes:
        title: the language's name.
        endings: endings of its files.
        comment: the beginning of a comment.
        helpers: the text of each function that a file may need.
        types: of the values, by "number", "truth" and "bits", where a language has types; and "wide", of t0.
        of_single: those attributes that are others in float32.
        kinds: of each value with a name of its own, as it is used: "number", "truth" or "bits".
    """

    title: ClassVar[str]
    endings: ClassVar[tuple[str, ...]]
    comment: ClassVar[str] = "//"
    helpers: ClassVar[dict[str, str]]
    truths: ClassVar[tuple[str, str]] = ("false", "true")
    words: ClassVar[tuple[str, str, str]] = ("!", "&&", "||")
    infinity: ClassVar[str]
    root: ClassVar[str]
    floor: ClassVar[str]
    magnitude: ClassVar[str]
    fma: ClassVar[str | None]
    types: ClassVar[dict[str, str]] = {}
    of_single: ClassVar[dict[str, Any]]
    bits_literal: ClassVar[str]
    #: The prefix of a field and a parameter.
    me: ClassVar[str]
    #: The end of a statement.
    end: ClassVar[str] = ";"
    #: The expression for the time of the present step.
    time: ClassVar[str]
    tables: list[Table]
    #: By how much what is within something is indented.
    step_in: ClassVar[str] = "    "
    longest = 88
    called = FUNCTIONS

    def __init__(self, prefix: str, fields: Names, single: bool = False) -> None:
        super().__init__(single)
        if single:
            vars(self).update(self.of_single)
        self.prefix, self.fields = prefix, fields
        self.names = Names()
        self.kinds: dict[str, str] = {}
        self.before = False  # whether values are computed before the steps and kept in fields

    # ---- values

    def number(self, bits: int) -> Formula:
        """A constant; one that is not finite is made from its bits."""
        x = plain.number_of(bits, self.single)
        if x != x:
            return Formula(self.call("number_of", self.whole(bits)))
        text = self.infinity if abs(x) == float("inf") else self.literal(abs(x))
        return Formula(f"−{text}", SIGN) if bits >> self.sign_place else Formula(text)

    @property
    def sign_place(self) -> int:
        """Which bit is the sign."""
        return 31 if self.single else 63

    def literal(self, x: float) -> str:
        """A finite number: the shortest text that is read as it."""
        return plain.shortest(x, self.single)

    def whole(self, bits: int) -> str:
        """Bits."""
        return self.bits_literal.format(hex(bits))

    def named(self, name: str, value: Formula) -> Formula:
        """A value that has a name of its own, where it is used."""
        word = self.me + self.fields(name, f"made {name}") if self.before else self.names(name)
        self.kinds[word] = "truth" if value.is_truth else "bits" if value.is_bits else "number"
        return Formula(word, is_truth=value.is_truth, is_bits=value.is_bits)

    def call(self, helper: str, *of: str) -> str:
        """A call of a function in the file."""
        return f"{self.helper(helper)}({', '.join(of)})"

    def helper(self, name: str) -> str:
        """The name of such a function."""
        return name

    def as_number(self, value: Formula) -> Formula:
        """The number of these bits."""
        if value.is_truth:
            value = self.as_bits(value, None)
        return Formula(self.call("number_of", value.text)) if value.is_bits else value

    def as_bits(self, value: Formula, known: int | None) -> Formula:
        """The bits of a number; ``known`` are those of a constant."""
        if known is not None:
            return Formula(self.whole(known), is_bits=True)
        if value.is_bits:
            return value
        return Formula(self.call("mask_of" if value.is_truth else "bits_of", value.text), is_bits=True)

    # ---- operations

    def formula(self, name: str, of: Sequence[Formula], given: int, bits: Sequence[int | None]) -> Formula:
        """An operation of these; ``bits`` are those of the operands that are constants."""
        if name in BIT_FUNCTIONS:
            return self._on_bits(name, of, given, bits)
        if name == "choose":
            return self._choice(of, bits)
        numbers = [self.as_number(each) for each in of]
        match name:
            case "copy":
                return numbers[0]
            case "same":
                return of[0]
            case "less" | "at most" | "equal":
                sign = {"less": "<", "at most": "<=", "equal": "=="}[name]
                a, b = numbers
                return Formula(f"{a.within(SUM)} {sign} {b.within(SUM)}", COMPARISON, is_truth=True)
            case "square root":
                return Formula(f"{self.root}({numbers[0].text})")
            case "floor":
                return Formula(f"{self.floor}({numbers[0].text})")
            case "divide":
                return self.quotient(numbers[0], numbers[1], bits[1])
            case "sample":
                return Formula(self.sample(given, numbers[0].text), SUM if self.tables[given].times else ATOM)
            case "multiply add" | "multiply subtract" | "subtract multiply":
                made = plain.formula(name, numbers, given, bits)
                return Formula(f"{self.fma}{made.text.removeprefix('fma')}")
            case _ if name in FUNCTIONS:
                return Formula(self.call(name, numbers[0].text))
            case _ if name in ARITHMETIC:
                return plain.formula(name, numbers, given, bits)
            case _:
                raise UnsupportedError(f"language: there is nothing in {self.title} for the operation {name!r} of this step")

    def quotient(self, a: Formula, b: Formula, divisor: int | None) -> Formula:
        """A quotient; ``divisor`` are the bits of one that is a constant."""
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

    def choice(self, truth: Formula, a: Formula, b: Formula) -> str:
        """One of two values."""
        return f"{truth.within(EITHER)} ? {a.within(EITHER)} : {b.within(EITHER)}"

    def _on_bits(self, name: str, of: Sequence[Formula], given: int, bits: Sequence[int | None]) -> Formula:
        alike = all(each.is_truth or known in (0, self.all_bits) for each, known in zip(of, bits, strict=True))
        if name in ("and", "or", "exclusive or") and alike and any(each.is_truth for each in of):
            return self._of_truths(name, of, bits)
        if name == "exclusive or":
            for x, turning in (of, of[::-1]):
                if (last := LAST_BIT.fullmatch(turning.text)) and int(last[2]) == self.sign_place and not x.is_truth:
                    return Formula(self.call("turn_sign", self.as_number(x).text, last[1]))
        if name == "and":
            for value, known in zip(of, reversed(bits), strict=True):
                if known == self.all_bits >> 1 and not (value.is_bits or value.is_truth):
                    return Formula(f"{self.magnitude}({value.text})")
        operands = [self.as_bits(each, known).text for each, known in zip(of, bits, strict=True)]
        more = [str(given)] if name.startswith("shift") else []
        return Formula(self.call(BIT_FUNCTIONS[name], *operands, *more), is_bits=True)

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
        """A line of a section."""
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
        """A formula with the language's signs."""
        return formula.replace("·", " * ").replace("/", " / ").replace("−", "-")

    def signed(self, x: float) -> str:
        """A finite number, of either sign."""
        kinds = ("<I", "<f") if self.single else ("<Q", "<d")
        (bits,) = struct.unpack(kinds[0], struct.pack(kinds[1], x))
        return self.text(self.number(bits).text)

    def value(self, field: Field) -> str:
        """The number of a field that is one number."""
        return repr(float(field.values[0])) if field.wide and self.single else self.signed(field.values[0])

    def type_of(self, field: Field) -> str:
        """The type of its numbers."""
        return self.types["wide" if field.wide else "number"]

    def functions(self, text: str) -> list[str]:
        """The functions that this text of a file needs, in their order; each may need those before it."""
        needed: list[str] = []
        for name in reversed([*self.helpers, *FUNCTIONS]):
            if re.search(rf"\b{self.helper(name)}\b", text):
                function = self.helpers[name] if name in self.helpers else self._of_one_number(name)
                needed.insert(0, function.replace("PREFIX", self.prefix))
                text += needed[0]
        return needed

    def _of_one_number(self, name: str) -> str:
        """A function of one number, from its operations."""
        operations, (root,) = operations_of(name, self.single)
        self.names = Names(("x",))
        body = [*operations, ("copy", [root], 0)], [len(operations)]
        section, _ = Writer(_core.Tape(single=self.single), {}, self).section(
            "member step", body, lambda *_: Leaf(Formula("x"), None, 4), 4, "a", ["result"]
        )
        *lines, result = [(self.names(line.name), self.text(line.formula)) for line in section.lines]
        inside = [self.declare(Assignment(word, self.kinds.get(word, "number"), text), "") for word, text in lines]
        return self.function(name, [*inside, f"return {result[1]}{self.end}"])

    @abstractmethod
    def function(self, name: str, lines: list[str]) -> str:
        """A function of one number x."""

    def remark(self, lines: Iterable[str]) -> list[str]:
        """Lines as a comment."""
        return [f"{self.comment} {printable(line)}".rstrip() for line in lines]

    def listed(self, begin: str, values: Sequence[float], end: str, indent: str = "") -> list[str]:
        """Numbers between two texts, in one line or in several."""
        return listed(indent + begin, [self.signed(each) for each in values], end, indent)

    def nested(self, begin: str, values: Sequence[float], shape: Shape, end: str, indent: str = "") -> list[str]:
        """An array of arrays of numbers, between two texts."""
        if len(shape) == 1:
            return self.listed(f"{begin}[", values, f"]{end}", indent)
        size = len(values) // shape[0]
        lines = [f"{indent}{begin}["]
        for i in range(shape[0]):
            lines += self.nested("", values[i * size : (i + 1) * size], shape[1:], ",", indent + "    ")
        return [*lines, f"{indent}]{end}"]

    def body(
        self, f: Function, read: Mapping[str, str], write: Mapping[str, str], after: str = "The state after the step."
    ) -> list[str]:
        """The body of a function, not indented: where each block is read and written, and a comment."""

        def place(block: str, index: int, of: Mapping[str, str]) -> str:
            return of[block] if index < 0 else f"{of[block]}[{index}]"

        groups: list[tuple[str, Sequence[Statement]]] = [
            ("The state.", [Assignment(p.name, "number", place(p.block, p.at, read)) for p in f.reads if p.block != FORCE]),
            ("The force.", [Assignment(p.name, "number", self.given(f"{FORCE}[{p.at}]")) for p in f.reads if p.block == FORCE]),
            ("What depends on the time alone.", f.of_time),
            ("What depends on the state.", f.lines),
        ]
        out = [self.declare(Assignment("t", "number", self.time), "")] if f.needs_time else []
        out += [self.array(f.work)] * bool(f.work)
        for title, lines in groups:
            if lines:
                out += ["", f"{self.comment} {title}"]
            evaluation = 1
            for each in lines:
                if isinstance(each, Assignment) and each.evaluation > evaluation:
                    evaluation = each.evaluation
                    out += ["", f"{self.comment} Evaluation {evaluation} of the rates."]
                out += [self._placed(line, read, write) for line in self.statement(each)]
        if f.work:
            return out
        out += ["", f"{self.comment} {after}"]
        out += [f"{place(p.block, p.at, write)} = {p.name}{self.end}" for p in f.writes]
        return out if out[0] else out[1:]

    def given(self, text: str) -> str:
        """A number of an argument in the precision of the file."""
        return text

    def _placed(self, line: str, read: Mapping[str, str], write: Mapping[str, str]) -> str:
        """A line with the names of the blocks that are read and written."""
        line = re.sub(rf"@{FORCE}(\[.*?\]+)", lambda found: self.given(FORCE + found[1]), line)
        line = re.sub(r"@(\w+)", lambda found: read[found[1]], line)
        return re.sub(r"#(\w+)(?=[\[ ])", lambda found: write.get(found[1], found[0]), line)

    @abstractmethod
    def array(self, size: int) -> str:
        """The array in which loops compute."""

    @abstractmethod
    def loop(self, count: int, line: str) -> str:
        """A line for each i from 0 on."""

    @abstractmethod
    def table(self, name: str, places: Sequence[int]) -> list[str]:
        """A table of places in arrays."""

    def table_name(self, name: str) -> str:
        """The name of such a table."""
        return self.helper(name)

    def statement(self, each: Statement) -> list[str]:
        """Lines of what is computed."""
        if isinstance(each, Loop):
            line = f"{each.target} = {each.text}{self.end}"
            return [line if each.times == 1 else self.loop(each.times, line)]
        if isinstance(each, Conditional):
            then = [line for inner in each.then for line in self.statement(inner)]
            other = [line for inner in each.other for line in self.statement(inner)]
            if then:
                return self.conditional(each.condition, then, other)
            return self.conditional(f"{self.words[0]}{each.condition}", other, [])
        note = f" {self.comment} {each.note}" if each.note else ""
        if each.role == "new":
            return [self.declare(each, note)]
        return self.variable(each, note) if each.role == "variable" else [f"{each.name} = {each.text}{self.end}"]

    def conditional(self, condition: str, then: list[str], other: list[str]) -> list[str]:
        """What is computed if something holds, and if not."""
        behind = ["} else {", *indented(other, self.step_in)] if other else []
        return [f"if ({condition}) {{", *indented(then, self.step_in), *behind, "}"]

    @abstractmethod
    def variable(self, line: Assignment, note: str) -> list[str]:
        """A value that is set again in a branch; with no text if it is set in both."""

    @abstractmethod
    def declare(self, line: Assignment, note: str) -> str:
        """A value that gets a name."""

    @abstractmethod
    def sample(self, table: int, t: str) -> str:
        """The sample of a table that holds at a time."""

    @abstractmethod
    def how(self, w: Written) -> list[str]:
        """How to compile and call it."""

    @abstractmethod
    def example(self, w: Written, v: list[float], y: list[float], steps: int) -> list[str]:
        """A program that makes some steps and prints a number of the state."""

    @abstractmethod
    def file(self, w: Written, head: list[str]) -> str:
        """The whole text after the comment at the head."""


def texts(statements: Iterable[Statement]) -> list[str]:
    """All formulas of these."""
    found: list[str] = []
    for each in statements:
        if isinstance(each, Conditional):
            found += [each.condition, *texts(each.then), *texts(each.other)]
        elif isinstance(each, Loop):
            found += [each.target, each.text]
        else:
            found.append(each.text)
    return found


def indented(lines: Iterable[str], by: str = "    ") -> list[str]:
    """Lines indented by at least this much."""
    return [by + line if line else "" for line in lines]


def listed(begin: str, items: Sequence[str], end: str, indent: str) -> list[str]:
    """Words between two texts, in one line or in several."""
    if len(one := begin + ", ".join(items) + end) <= WIDTH:
        return [one]
    lines, line = [begin], indent + "   "
    for item in items:
        if len(line) + len(item) > WIDTH - 2 and line.strip():
            lines.append(line)
            line = indent + "   "
        line += f" {item},"
    return [*lines, line, indent + end]


def printable(line: str) -> str:
    """A text that does not end a comment or join lines."""
    line = "".join(letter if letter.isprintable() else " " for letter in line)
    return line.replace("*/", "* /").replace("??", "? ?").rstrip("\\ ")
