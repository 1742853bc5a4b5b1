"""Symbols: numbers that are not known yet. What is done with them is written on a tape, equal operations once.

In Python, to see what a step of the reference does; the core has its own, of the same names.
"""

from __future__ import annotations

import operator
import struct
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np
from stepwell.reference.fma import fma

Operation = tuple[Any, ...]


class Tape:
    """A list of operations, each a name with numbers of earlier ones or with what it stands for."""

    def __init__(self) -> None:
        self.operations: list[Operation] = []
        self._seen: dict[Operation, int] = {}

    def write(self, name: str, *operands: Any) -> Symbol:
        """An operation's value."""
        operation = (name, *operands)
        number = self._seen.setdefault(operation, len(self.operations))
        if number == len(self.operations):
            self.operations.append(operation)
        return Symbol(self, number)

    def number(self, x: float) -> Symbol:
        """A number that is known beforehand, by its bits."""
        return self.write("const", struct.pack("<d", x))

    def state(self, i: int) -> Symbol:
        """A number of the state: v first, then y, then what a control adds up or a pace."""
        return self.write("state", i)

    def param(self, i: int) -> Symbol:
        """A parameter, by its row among all."""
        return self.write("param", i)

    def step(self) -> Symbol:
        """The step h."""
        return self.write("step")

    def time(self) -> Symbol:
        """The time at which the step begins."""
        return self.write("time")

    def budget(self) -> Symbol:
        """The most attempts of a member."""
        return self.write("budget")

    def sample(self, table: int, t: Symbol) -> Symbol:
        """A sampled input at a time."""
        return self.write("sample", table, t.id)


class Symbol:
    """A value on a tape. It has no truth value and no order: what depends on a comparison is chosen by ``choose``."""

    __slots__ = ("id", "tape")

    def __init__(self, tape: Tape, number: int) -> None:
        self.tape = tape
        self.id = number

    def _id(self, number: Any) -> int:
        """The number of an operand; constants are written by their bits."""
        if isinstance(number, Symbol):
            assert number.tape is self.tape
            return number.id
        return self.tape.number(number).id

    def _write(self, name: str, *operands: Any) -> Any:
        # Arrays apply the operation to each of their elements, which then come here by themselves.
        if not all(isinstance(each, (Symbol, float, int)) for each in operands):
            return NotImplemented
        return self.tape.write(name, *(self._id(each) for each in operands))

    def __add__(self, other: Any) -> Any:
        return self._write("add", self, other)

    def __radd__(self, other: Any) -> Any:
        return self._write("add", other, self)

    def __sub__(self, other: Any) -> Any:
        return self._write("sub", self, other)

    def __rsub__(self, other: Any) -> Any:
        return self._write("sub", other, self)

    def __mul__(self, other: Any) -> Any:
        return self._write("mul", self, other)

    def __rmul__(self, other: Any) -> Any:
        return self._write("mul", other, self)

    def __truediv__(self, other: Any) -> Any:
        return self._write("div", self, other)

    def __rtruediv__(self, other: Any) -> Any:
        return self._write("div", other, self)

    def __neg__(self) -> Any:
        return self._write("neg", self)

    def sqrt(self) -> Any:
        """The square root; NumPy calls it."""
        return self._write("sqrt", self)

    def __lt__(self, other: Any) -> Any:
        return self._write("less", self, other)

    def __gt__(self, other: Any) -> Any:
        return self._write("less", other, self)

    def __le__(self, other: Any) -> Any:
        return self._write("at_most", self, other)

    def __ge__(self, other: Any) -> Any:
        return self._write("at_most", other, self)

    def __and__(self, other: Any) -> Any:
        return self._write("both", self, other)

    def __or__(self, other: Any) -> Any:
        return self._write("either", self, other)

    def __invert__(self) -> Any:
        return self._write("not", self)

    def floor(self) -> Any:
        """The largest whole number not above it."""
        return self._write("floor", self)

    def equals(self, other: Any) -> Any:
        """Whether it is another number."""
        return self._write("equal", self, other)

    def number(self, x: float) -> Any:
        """A number that is known beforehand."""
        return self.tape.number(x)

    def choose(self, yes: Any, no: Any) -> Any:
        """One of two numbers, by this truth."""
        return self._write("select", self, yes, no)

    def __bool__(self) -> bool:
        raise TypeError("a symbol has no truth value: choose between two numbers")

    __float__ = __int__ = __bool__  # type: ignore[assignment]
    __hash__ = None  # type: ignore[assignment]

    def __eq__(self, other: object) -> bool:
        raise TypeError("a symbol has no truth value: choose between two numbers")

    def constant(self, bits: int) -> Any:
        """A number that is known beforehand, by its bits."""
        return self.tape.write("const", struct.pack("<Q", bits))

    def and_bits(self, bits: int) -> Any:
        """Its bits and those of a constant."""
        return self.tape.write("and_bits", self.id, bits)

    def or_bits(self, bits: int) -> Any:
        """Its bits or those of a constant."""
        return self.tape.write("or_bits", self.id, bits)

    def add_bits(self, whole: Any) -> Any:
        """Its bits as a whole number, and another."""
        if isinstance(whole, Symbol):
            return self._write("add_both", self, whole)
        return self.tape.write("add_bits", self.id, whole)

    def sub_bits_from(self, whole: Any) -> Any:
        """A whole number less its bits."""
        return self.tape.write("sub_bits_from", self.id, whole)

    def mul_add(self, y: Any, z: Any) -> Any:
        """Its product and a sum, rounded once."""
        return self._write("mul_add", self, y, z)

    def mul_sub_from(self, y: Any, z: Any) -> Any:
        """A number less its product, rounded once."""
        return self._write("mul_sub_from", self, y, z)

    def shift_up(self, places: int) -> Any:
        """Its bits, moved up."""
        return self.tape.write("shift_up", self.id, places)

    def shift_down(self, places: int) -> Any:
        """Its bits, moved down."""
        return self.tape.write("shift_down", self.id, places)

    def xor_bits(self, other: Symbol) -> Any:
        """The bits that one of both has."""
        return self._write("xor_bits", self, other)


def _on_bits(f: Callable[..., Any]) -> Callable[..., Any]:
    """A function of bits as one of numbers; what is a whole number already stays one."""

    def of_numbers(*operands: Any) -> Any:
        return f(*(np.asarray(x).view(np.uint64) if isinstance(x, np.ndarray) else np.uint64(x) for x in operands)).view(
            np.float64
        )

    return of_numbers


def _either(a: Any, b: Any) -> Any:
    """Of truths whether one is, of numbers the bits of both."""
    return a | b if a.dtype == bool else _on_bits(operator.or_)(a, b)


DONE: dict[str, Callable[..., Any]] = {
    "add": operator.add,
    "sub": operator.sub,
    "mul": operator.mul,
    "div": operator.truediv,
    "neg": operator.neg,
    "sqrt": np.sqrt,
    "less": operator.lt,
    "at_most": operator.le,
    "both": lambda a, b: a & b if a.dtype == bool else _on_bits(operator.and_)(a, b),
    "either": _either,
    "floor": np.floor,
    "equal": operator.eq,
    "not": operator.invert,
    "select": np.where,
    "and_bits": _on_bits(operator.and_),
    "or_bits": _on_bits(operator.or_),
    "add_bits": _on_bits(operator.add),
    "add_both": _on_bits(operator.add),
    "sub_bits_from": _on_bits(lambda x, whole: whole - x),
    "mul_add": fma,
    "mul_sub_from": lambda x, y, z: fma(-x, y, z),
    "shift_up": _on_bits(operator.lshift),
    "shift_down": _on_bits(operator.rshift),
    "xor_bits": _on_bits(operator.xor),
}

#: How many of an operation's operands are values on the tape; all, if not said.
VALUES = {"and_bits": 1, "or_bits": 1, "add_bits": 1, "sub_bits_from": 1, "shift_up": 1, "shift_down": 1}


def evaluate(
    tape: Tape, wanted: Iterable[Symbol], leaves: Mapping[Operation, Any], sample: Callable[[int, Any], Any]
) -> list[Any]:
    """The numbers of symbols: arrays over the members, if the leaves are."""
    values: list[Any] = []
    with np.errstate(all="ignore"):
        for operation in tape.operations:
            name, *operands = operation
            if name == "const":
                value = np.array([struct.unpack("<d", operands[0])[0]])
            elif name == "sample":
                value = sample(operands[0], values[operands[1]])
            elif name in DONE:
                of = VALUES.get(name, len(operands))
                value = DONE[name](*(values[i] for i in operands[:of]), *operands[of:])
            else:
                value = leaves[operation]
            values.append(np.atleast_1d(value))
    return [values[each.id] for each in wanted]
