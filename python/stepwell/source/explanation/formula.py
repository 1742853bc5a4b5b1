"""Operations as formulas, with as few parentheses as the exact order of operations needs.

A formula is read as in Python: · − √ ≤ are its multiplication, subtraction, square root and comparison, ``=`` compares.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, ClassVar, NamedTuple

import numpy as np

from ...reference.bits import DOUBLE, SINGLE, Precision
from ...reference.tape.operations import ON_BITS, OPERATIONS

#: How strongly a formula holds together, by its last operation.
CHOICE, EITHER, BOTH, NOT, COMPARISON, SUM, PRODUCT, SIGN, ATOM = range(9)


class Formula(NamedTuple):
    """A text, its last operation, whether it is the truth of a comparison, and whether it is bits and not a number."""

    text: str
    holds: int = ATOM
    is_truth: bool = False
    is_bits: bool = False

    @property
    def is_negative(self) -> bool:
        """True if it begins with a sign that belongs to all of it."""
        return self.text.startswith("−") and self.holds in (PRODUCT, SIGN)

    def within(self, holds: int) -> str:
        """The text for a place where a formula must hold together this strongly."""
        return self.text if self.holds >= holds else f"({self.text})"

    def behind(self, holds: int) -> str:
        """The text for a place after an operator, where a sign needs parentheses, too."""
        return f"({self.text})" if self.text.startswith("−") else self.within(holds)


def number(bits: int, single: bool = False) -> Formula:
    """A constant: the shortest text that is this number, of float64 or of float32."""
    precision = SINGLE if single else DOUBLE
    x = precision.constant(bits)
    if x != x:
        return bit_pattern(bits)
    text = shortest(abs(x), single).removesuffix(".0").replace("inf", "∞")
    return Formula(f"−{text}", SIGN) if bits >> precision.sign_place else Formula(text)


def shortest(x: float, single: bool) -> str:
    """The shortest text that is read as this number, of float64 or of float32."""
    return repr(float(str(np.float32(x)))) if single else repr(float(x))


def bit_pattern(bits: int) -> Formula:
    """A constant that is bits, not a number."""
    return Formula(hex(bits))


def formula(name: str, of: Sequence[Formula], extra: int, bits: Sequence[int | None], all_bits: int = DOUBLE.all_bits) -> Formula:
    """An operation on these; ``bits`` are those of the operands that are constants, ``all_bits`` those of the truth."""
    if name in ON_BITS:
        if all(each.is_truth or known in (0, all_bits) for each, known in zip(of, bits, strict=True)):
            return _of_truths(name, of, bits, all_bits)
        if name == "and" and all_bits >> 1 in bits and "|" not in (text := of[bits[0] is not None].text):  # all but the sign
            return Formula(f"|{text}|")
        of = [each if known is None else bit_pattern(known) for each, known in zip(of, bits, strict=True)]
    match name:
        case "add":
            a, b = of
            if a.is_negative and not b.is_negative:
                a, b = b, a
            return _sum(a, b, "+", "−")
        case "subtract":
            a, b = of
            return _sum(a, b, "−", "+")
        case "multiply":
            a, b = of
            return Formula(f"{a.within(PRODUCT)}·{b.behind(SIGN)}", PRODUCT)
        case "divide":
            a, b = of
            return Formula(f"{a.within(PRODUCT)}/{b.behind(SIGN)}", PRODUCT)
        case "negate":
            return _minus(of[0])
        case "multiply add":
            a, b, c = of
            return Formula(f"fma({a.text}, {b.text}, {c.text})")
        case "multiply subtract":
            a, b, c = of
            return Formula(f"fma({a.text}, {b.text}, {_minus(c).text})")
        case "subtract multiply":
            a, b, c = of
            return Formula(f"fma({_minus(a).text}, {b.text}, {c.text})")
        case "choose":
            truth, a, b = of
            return Formula(
                f"{a.within(EITHER)} if {truth.within(EITHER)} else {b.within(CHOICE)}", CHOICE, a.is_truth and b.is_truth
            )
        case "gather":
            return Formula(f"sample({of[0].text})")
        case "copy":
            return of[0]
    kind = OPERATIONS.get(name)
    if kind is None:  # a function that is written by its name
        return Formula(f"{name}({', '.join(each.text for each in of)})")
    if kind.result == "truth":
        return Formula(f"{of[0].within(SUM)} {kind.sign} {of[1].within(SUM)}", COMPARISON, True)
    return Formula(f"{kind.sign}({', '.join([*(each.text for each in of), *[str(extra)] * kind.has_extra])})")


class Notation:
    """How values are written: here for people, in subclasses in a programming language.

    Attributes:
        longest: the most characters of a formula; a longer one is split into several lines.
        called: functions of one number that are written by name in place of their operations.
        single: whether numbers are float32.
    """

    longest = 72
    called: ClassVar[Mapping[str, Callable[[Any], Any]]] = {}

    def __init__(self, single: bool = False) -> None:
        self.single = single

    @property
    def precision(self) -> Precision:
        """The precision of the numbers."""
        return SINGLE if self.single else DOUBLE

    @property
    def all_bits(self) -> int:
        """The bits of the truth."""
        return self.precision.all_bits

    def number(self, bits: int) -> Formula:
        """A constant."""
        return number(bits, self.single)

    def formula(self, name: str, of: Sequence[Formula], extra: int, bits: Sequence[int | None]) -> Formula:
        """An operation on these; ``bits`` are those of the operands that are constants."""
        return formula(name, of, extra, bits, self.all_bits)

    def named(self, name: str, value: Formula) -> Formula:
        """The formula of a value that has a line of its own: its name."""
        return Formula(name, is_truth=value.is_truth)


def _sum(a: Formula, b: Formula, sign: str, other: str) -> Formula:
    """Both with a sign between them; a sign of b is merged with it, which changes no bit."""
    if b.is_negative:
        return Formula(f"{a.within(SUM)} {other} {b.text[1:]}", SUM)
    return Formula(f"{a.within(SUM)} {sign} {b.behind(PRODUCT)}", SUM)


def _minus(x: Formula) -> Formula:
    if x.is_negative:
        return Formula(x.text[1:], PRODUCT if x.holds == PRODUCT else ATOM)
    return Formula(f"−{x.behind(PRODUCT)}", PRODUCT if x.holds == PRODUCT else SIGN)


def _of_truths(name: str, of: Sequence[Formula], bits: Sequence[int | None], all_bits: int) -> Formula:
    """An operation on truths, whose bits are all equal."""
    a, b = of
    if name == "exclusive or" and all_bits in bits:
        return Formula(f"not {(b if bits[0] is not None else a).within(COMPARISON)}", NOT, True)
    if name == "and":
        return Formula(f"{a.within(BOTH)} and {b.within(NOT)}", BOTH, True)
    if name == "or":
        return Formula(f"{a.within(EITHER)} or {b.within(BOTH)}", EITHER, True)
    return Formula(f"xor_bits({a.text}, {b.text})", ATOM, True)
