"""The operations of a tape: one table, which everything in Python reads that has to do with them.

Evaluation, replay on symbols or series, derivatives, listings and exports take from here what an operation means, how it is
written and how its derivatives are made. The core has a table of its own, ``rust/core/src/tape/op.rs``; a test compares the two.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Sequence
from functools import cache, partial
from typing import Any, NamedTuple

import numpy as np

from ...errors import UnsupportedError
from ..bits import DOUBLE, SINGLE, Precision
from ..fma import fma

#: The factor by which a change of an operand is multiplied: a symbol, 1.0 or −1.0, or None where it changes nothing.
Factor = Any


class Kind(NamedTuple):
    """The properties of an operation.

    Attributes:
        numbers: its meaning for NumPy's numbers; of an operation ``on_bits``, for whole numbers of as many bits.
        symbols: how symbols write it; fused operations are written as two.
        counted: among which operations ``Explanation.computed`` counts it; "" if it is no arithmetic.
        sign: its operator or its name in formulas.
        result: "number", "truth" (all bits are set, or none) or "bits".
        on_bits: whether its meaning is one of bits.
        commutes: whether its operands may change places.
        has_extra: whether it takes a whole number behind its operands, such as by how many places bits are moved.
        factors: from its value and its operands, the factors of its derivative; None if it has no derivative.
        cycles: about so many does it take.
    """

    numbers: Callable[..., Any]
    symbols: Callable[..., Any]
    counted: str
    sign: str
    result: str = "number"
    on_bits: bool = False
    commutes: bool = False
    has_extra: bool = False
    factors: Callable[..., tuple[Factor, ...]] | None = None
    cycles: int = 1


def _of_divide(value: Any, a: Any, b: Any) -> tuple[Factor, ...]:
    over = 1.0 / b
    return over, -(value * over)


_comparison = partial(Kind, counted="choices", result="truth", factors=lambda value, a, b: (None, None))
_of_bits = partial(Kind, counted="bits", result="bits", on_bits=True)

#: All of them, by the names that the core gives them.
OPERATIONS: dict[str, Kind] = {
    "add": Kind(operator.add, operator.add, "additions", "+", commutes=True, factors=lambda value, a, b: (1.0, 1.0)),
    "subtract": Kind(operator.sub, operator.sub, "additions", "−", factors=lambda value, a, b: (1.0, -1.0)),
    "multiply": Kind(operator.mul, operator.mul, "multiplications", "·", commutes=True, factors=lambda value, a, b: (b, a)),
    "divide": Kind(operator.truediv, operator.truediv, "divisions", "/", factors=_of_divide, cycles=8),
    "multiply add": Kind(fma, lambda a, b, c: a * b + c, "fused", "fma"),
    "multiply subtract": Kind(lambda a, b, c: fma(a, b, -c), lambda a, b, c: a * b - c, "fused", "fma"),
    "subtract multiply": Kind(lambda a, b, c: fma(-a, b, c), lambda a, b, c: c - a * b, "fused", "fma"),
    "square root": Kind(np.sqrt, lambda a: a.sqrt(), "square_roots", "√", factors=lambda value, a: (0.5 / value,), cycles=12),
    "negate": Kind(operator.neg, operator.neg, "", "−", factors=lambda value, a: (-1.0,)),
    "floor": Kind(np.floor, lambda a: a.floor(), "bits", "floor", factors=lambda value, a: (None,)),
    "less": _comparison(operator.lt, operator.lt, sign="<"),
    "at most": _comparison(operator.le, operator.le, sign="≤"),
    "equal": _comparison(operator.eq, lambda a, b: a.equals(b), sign="=", commutes=True),
    "choose": Kind(lambda m, a, b: (m & a) | (~m & b), lambda m, a, b: m.choose(a, b), "choices", "if", on_bits=True),
    "and": _of_bits(operator.and_, operator.and_, sign="and_bits", commutes=True),
    "or": _of_bits(operator.or_, operator.or_, sign="or_bits", commutes=True),
    "exclusive or": _of_bits(operator.xor, lambda a, b: a.xor_bits(b), sign="xor_bits", commutes=True),
    "add bits": _of_bits(operator.add, lambda a, b: a.add_bits(b), sign="add_bits", commutes=True),
    "subtract bits": _of_bits(operator.sub, lambda a, b: b.sub_bits_from(a), sign="sub_bits"),
    "shift up": _of_bits(operator.lshift, lambda a, places: a.shift_up(places), sign="shift_up", has_extra=True),
    "shift down": _of_bits(operator.rshift, lambda a, places: a.shift_down(places), sign="shift_down", has_extra=True),
}


def names(**attributes: Any) -> tuple[str, ...]:
    """The operations with these attributes."""
    return tuple(
        name for name, kind in OPERATIONS.items() if all(getattr(kind, each) == value for each, value in attributes.items())
    )


#: Operations whose two operands may change places; comparisons; operations of which the bits are the result.
COMMUTE, COMPARISONS, ON_BITS = names(commutes=True), names(result="truth"), names(result="bits")


@cache
def meaning(name: str, single: bool = False) -> Callable[..., Any]:
    """An operation of numbers and of what it takes behind them."""
    kind, precision = OPERATIONS[name], SINGLE if single else DOUBLE
    if kind.result == "truth":
        return lambda a, b: precision.mask(kind.numbers(a, b))
    return _on_bits(kind, precision) if kind.on_bits else kind.numbers


def _on_bits(kind: Kind, precision: Precision) -> Callable[..., Any]:
    if kind.has_extra:
        return lambda a, extra: precision.number_of(kind.numbers(precision.bits_of(a), precision.bits(extra)))
    return lambda *of: precision.number_of(kind.numbers(*map(precision.bits_of, of)))


def of_numbers(name: str, operands: Sequence[Any], extra: int, single: bool = False) -> Any:
    """An operation or a constant, carried out."""
    if name == "constant":
        return (SINGLE if single else DOUBLE).number_of(extra)
    return meaning(name, single)(*operands, *[extra] * OPERATIONS[name].has_extra)


def of_symbols(name: str, operands: Sequence[Any], extra: int) -> Any:
    """An operation, written once more; equal ones are on a tape once, so on its own tape it is the symbol that was there."""
    kind = OPERATIONS[name]
    return kind.symbols(*operands, *[extra] * kind.has_extra)


def of_tape(tape: Any, name: str, operands: Sequence[Any], extra: int) -> Any:
    """An operation or what a tape has without operands, written to a tape; None if there is no such operation."""
    match name:
        case "state":
            return tape.state(extra)
        case "parameter" | "force":
            return tape.param(extra)
        case "step":
            return tape.step()
        case "time":
            return tape.time()
        case "constant":
            return tape.constant(extra)
        case "sample":
            return tape.sample(extra, *operands)
        case "copy" | "same":
            return operands[0]
    return of_symbols(name, operands, extra) if name in OPERATIONS else None


def factors(name: str, operands: Sequence[Any], value: Any) -> tuple[Factor, ...]:
    """The factors of the derivative of an operation, one for each operand. A choice is not among them: it has no factors.

    Raises:
        UnsupportedError: if it has no derivative.
    """
    kind = OPERATIONS.get(name)
    if kind is None or kind.factors is None:
        raise no_derivative(name)
    return kind.factors(value, *operands)


def no_derivative(name: str) -> UnsupportedError:
    """The error for an operation without a derivative."""
    if name == "sample":
        return UnsupportedError("derivative: a sampled input changes by jumps, so it has none by its time")
    if name in names(counted="fused"):
        return UnsupportedError(f"derivative: expected a tape that is not fused yet, got one with {name!r}")
    return UnsupportedError(
        f"derivative: the operation {name!r} of what is differentiated has none. Write it with the functions of "
        f"stepwell.reference, which tell their derivatives, or decorate the function that it is a part of with "
        f"reference.marks.differentiable"
    )
