"""The second exact arithmetic: sums with a product in them are fused multiply-adds, a·b + c rounded once.

Which products are fused is decided on the tape of a step, so it is the same on every machine. This file says how, evaluates a
fused tape operation by operation, and has a fused multiply-add of its own, since NumPy has none.
"""

from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from typing import Any

import numpy as np

from ...base.arrays import Array
from .increments import increments_last
from .operations import Operation, of_any, ranks

# ---- where


def fused(tape: Sequence[Operation], roots: Sequence[int], *, single: bool = False) -> tuple[list[Operation], list[int]]:
    """The same tape with fused multiply-adds, and the lines of the roots on it.

    ``roots`` are the lines of the next state, and all others are needed for them. First increments are multiplied last. Then a
    product is fused into the sum or the difference of which it is a term if nothing else reads it and it depends on the state.
    Of two such products the one of the higher rank is fused.
    """
    tape, roots = increments_last(tape, roots, single=single)
    rank = ranks(tape)
    reads = [0] * len(tape)
    for line in [*roots, *(line for operation in tape for line in operation.of)]:
        reads[line] += 1
    of_state = of_any(tape, "state")

    def can(line: int) -> bool:
        return tape[line].name == "multiply" and reads[line] == 1 and of_state[line]

    out = []
    for operation in tape:
        if operation.name in ("add", "subtract"):
            a, b = operation.of
            product = max((line for line in {a, b} if can(line)), key=rank.__getitem__, default=None)
            if product is not None:
                other = b if product == a else a
                name = "multiply add" if operation.name == "add" else "multiply subtract" if product == a else "subtract multiply"
                operation = Operation(name, (*tape[product].of, other), 0)
        out.append(operation)
    return out, roots


# ---- a·b + c, rounded once

#: Half of a number's bits and one more: what splits it into two halves (Veltkamp).
SPLIT = 2.0**27 + 1.0
#: Between these sizes no part of a product or of a sum overflows or is too small to be exact.
SMALL, LARGE = 2.0**-900, 2.0**900


def two_sum(a: Array, b: Array) -> tuple[Array, Array]:
    """The sum rounded, and what was rounded away (Knuth)."""
    s = a + b
    t = s - a
    return s, (a - (s - t)) + (b - t)


def halves(a: Array) -> tuple[Array, Array]:
    """Two numbers of half the bits whose sum is a (Veltkamp)."""
    c = SPLIT * a
    high = c - (c - a)
    return high, a - high


def two_product(a: Array, b: Array) -> tuple[Array, Array]:
    """The product rounded, and what was rounded away (Dekker)."""
    p = a * b
    (a1, a2), (b1, b2) = halves(a), halves(b)
    return p, a2 * b2 - (((p - a1 * b1) - a2 * b1) - a1 * b2)


def odd_sum(a: Array, b: Array) -> Array:
    """The sum rounded to odd: where it is not exact, to the neighbour whose last bit is set."""
    s, rest = two_sum(a, b)
    even = (s.view(np.uint64) & np.uint64(1)) == 0
    beside = np.nextafter(s, np.where(rest > 0, np.inf, -np.inf))
    return np.where((rest != 0) & even, beside, s)


def exact_fma(a: float, b: float, c: float) -> float:
    """a·b + c of finite numbers, by rational arithmetic."""
    exact = Fraction(a) * Fraction(b) + Fraction(c)
    try:
        return float(exact) if exact else a * b + c  # what cancels has the sign that the sum has
    except OverflowError:
        return np.inf if exact > 0 else -np.inf


def fma(a: Any, b: Any, c: Any) -> Array:
    """a·b + c, rounded once (Boldo and Melquiond 2008), of arrays that broadcast."""
    a, b, c = (np.array(x) for x in np.broadcast_arrays(*(np.asarray(x, dtype=np.float64) for x in (a, b, c))))
    with np.errstate(all="ignore"):
        p, p_rest = two_product(a, b)
        s, s_rest = two_sum(c, p_rest)
        t, t_rest = two_sum(p, s)
        out = t + odd_sum(s_rest, t_rest)
        plain = a * b + c
        # A product of a zero is exact. What is not finite goes its own way, but a finite product added to an infinity is that.
        finite = np.isfinite(a) & np.isfinite(b)
        zero = finite & ((a == 0) | (b == 0))
        out = np.where(zero | ~finite | np.isnan(c), plain, out)
        out = np.where(finite & np.isinf(c), c, out)
        inside = (np.abs(p) >= SMALL) & (np.abs(p) <= LARGE) & (np.abs(a) <= LARGE) & (np.abs(b) <= LARGE) & (np.abs(c) <= LARGE)
        for at in np.argwhere(finite & np.isfinite(c) & ~zero & ~inside):
            i = tuple(at)
            out[i] = exact_fma(float(a[i]), float(b[i]), float(c[i]))
    return out


# ---- a tape, line by line


def _bits(x: Any) -> Any:
    return np.asarray(x, dtype=np.float64).view(np.uint64)


def _number(bits: Any) -> Array:
    return np.asarray(bits, dtype=np.uint64).view(np.float64)


def _mask(truth: Any) -> Array:
    """All bits where it is true, none elsewhere."""
    return _number(np.where(truth, np.uint64(0xFFFF_FFFF_FFFF_FFFF), np.uint64(0)))


#: The meaning of each operation: a function of its operands and its other argument.
MEANING: dict[str, Callable[..., Any]] = {
    "add": lambda a, b, _: a + b,
    "subtract": lambda a, b, _: a - b,
    "multiply": lambda a, b, _: a * b,
    "divide": lambda a, b, _: a / b,
    "multiply add": lambda a, b, c, _: fma(a, b, c),
    "multiply subtract": lambda a, b, c, _: fma(a, b, -c),
    "subtract multiply": lambda a, b, c, _: fma(-a, b, c),
    "square root": lambda a, _: np.sqrt(a),
    "negate": lambda a, _: -a,
    "floor": lambda a, _: np.floor(a),
    "less": lambda a, b, _: _mask(np.less(a, b)),
    "at most": lambda a, b, _: _mask(np.less_equal(a, b)),
    "equal": lambda a, b, _: _mask(np.equal(a, b)),
    "choose": lambda m, a, b, _: _number((_bits(m) & _bits(a)) | (~_bits(m) & _bits(b))),
    "and": lambda a, b, _: _number(_bits(a) & _bits(b)),
    "or": lambda a, b, _: _number(_bits(a) | _bits(b)),
    "exclusive or": lambda a, b, _: _number(_bits(a) ^ _bits(b)),
    "add bits": lambda a, b, _: _number(_bits(a) + _bits(b)),
    "shift up": lambda a, n: _number(_bits(a) << np.uint64(n)),
    "shift down": lambda a, n: _number(_bits(a) >> np.uint64(n)),
    "constant": lambda bits: _number(np.uint64(bits)),
}


def listed(tape: Any, symbols: Sequence[Any]) -> tuple[list[Operation], list[int]]:
    """What these symbols are made of on a tape that lists its operations, and their lines."""
    operations, roots = tape.operations(symbols)
    return [Operation(name, tuple(of), given) for name, of, given in operations], roots


class Evaluated:
    """A tape, to be evaluated for many members at once.

    Args:
        tape: its operations, fused where they are to be.
        roots: the lines whose values are returned.
        numbers: of each parameter, by its number on the tape, what it is for every member.
        tables: the sampled inputs.
        meaning: of each operation.
    """

    def __init__(
        self,
        tape: Sequence[Operation],
        roots: Sequence[int],
        numbers: Mapping[int, Any],
        tables: Sequence[Any],
        meaning: Mapping[str, Callable[..., Any]] = MEANING,
    ) -> None:
        self.tape, self.roots, self.numbers, self.tables, self.meaning = tape, roots, numbers, tables, meaning

    @classmethod
    def traced(
        cls, tape: Any, symbols: Sequence[Any], numbers: Mapping[int, Any], tables: Sequence[Any], *, fuse: bool
    ) -> "Evaluated":
        """For symbols on a tape that lists its operations, with fused multiply-adds if that is wanted."""
        operations, roots = listed(tape, symbols)
        if fuse:
            operations, roots = fused(operations, roots)
        return cls(operations, roots, numbers, tables)

    def __call__(self, state: Sequence[Array], t: Any, h: float) -> list[Any]:
        """The values of the roots for these rows of the state, at time t with the step h."""
        values: list[Any] = []
        for name, of, given in self.tape:
            operands = [values[line] for line in of]
            made: Any
            match name:
                case "state":
                    made = state[given]
                case "parameter":
                    made = self.numbers[given]
                case "step":
                    made = np.asarray(h)  # by which Python's numbers would refuse to divide if it is zero
                case "time":
                    made = np.asarray(t)
                case "sample":
                    made = self.tables[given].sample(*operands)
                case _:
                    made = self.meaning[name](*operands, given)
            values.append(made)
        return [values[line] for line in self.roots]
