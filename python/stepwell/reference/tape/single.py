"""Steps of float32: the specification of the core's, as ``fused`` is that of steps with fused multiply-adds.

The tape of a step is traced by the reference itself; its constants are rounded to float32. Every operation on it is NumPy's on
float32, rounded once.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from .fused import Evaluated, fused, listed, odd_sum


def fma(a: Any, b: Any, c: Any) -> Any:
    """a·b + c, rounded once.

    The product of two numbers of 24 bits has 48, so in float64 it is exact. The sum is rounded to odd there, which keeps what the
    second rounding has to know: 53 bits are more than the 24 + 2 that this takes (Boldo and Melquiond 2008).
    """
    product, c = np.broadcast_arrays(np.multiply(a, b, dtype=np.float64), np.asarray(c, dtype=np.float64))
    plain = product + c
    return np.where(np.isfinite(plain) & (plain != 0.0), odd_sum(product, c), plain).astype(np.float32)


def _bits(x: Any) -> Any:
    return np.asarray(x, dtype=np.float32).view(np.uint32)


def _number(bits: Any) -> Any:
    return np.asarray(bits, dtype=np.uint32).view(np.float32)


def _mask(truth: Any) -> Any:
    """All bits where it is true, none elsewhere."""
    return _number(np.where(truth, np.uint32(0xFFFF_FFFF), np.uint32(0)))


#: The meaning of each operation: a function of its operands and its other argument.
MEANING: dict[str, Callable[..., Any]] = {
    "add": lambda a, b, _: np.add(a, b),
    "subtract": lambda a, b, _: np.subtract(a, b),
    "multiply": lambda a, b, _: np.multiply(a, b),
    "divide": lambda a, b, _: np.divide(a, b),
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
    "shift up": lambda a, n: _number(_bits(a) << np.uint32(n)),
    "shift down": lambda a, n: _number(_bits(a) >> np.uint32(n)),
    "constant": lambda bits: _number(bits),
}


def evaluated(tape: Any, symbols: Sequence[Any], numbers: Mapping[int, Any], fuse: bool) -> Callable[..., list[Any]]:
    """The values of symbols on a tape of float32, for rows of a state, a time and a step.

    Args:
        tape: a tape that lists its operations.
        symbols: what is asked for.
        numbers: of each parameter, by its number on the tape, what it is for every member; it is rounded here.
        fuse: whether sums with a product in them are fused multiply-adds.
    """
    operations, roots = listed(tape, symbols)
    if fuse:
        operations, roots = fused(operations, roots, single=True)
    rounded = {i: np.asarray(number, dtype=np.float32) for i, number in numbers.items()}
    lines = Evaluated(operations, roots, rounded, (), MEANING)

    def values(state: Sequence[Any], t: Any, h: Any) -> list[Any]:
        return lines(state, np.float32(t), np.float32(h))  # type: ignore[arg-type]

    return values
