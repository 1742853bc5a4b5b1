"""Derivatives of the operations of a tape, and of the functions that are marked on it.

A rule gives, for each operand, the factor by which a change of it is multiplied: a symbol, 1.0 or -1.0, or None for no change.
Operations that round to whole numbers or work on bits have no rule: a derivative through them would be wrong, or zero by mistake.
Functions that consist of such operations are marked (``reference/marks.py``) and have rules of their own, in terms of functions.
"""

from __future__ import annotations

import inspect
import struct
from collections.abc import Callable
from functools import cache
from typing import Any

from ...errors import UnsupportedError
from .. import marks

LN2, LN10 = 0.6931471805599453, 2.302585092994046

#: Adding a constant of at least this size and subtracting it again rounds: x + 1.5·2⁵² − 1.5·2⁵² is x as a whole number. Then the
#: same in float32.
MIN_ROUNDING_CONSTANT, MIN_SINGLE_ROUNDING_CONSTANT = 2.0**32, 2.0**20

#: Comparisons: their results are constant except at jumps.
COMPARISONS = ("less", "at most", "equal")

#: Operations without a derivative, and what to do about it.
NO_RULE = (
    "and",
    "or",
    "exclusive or",
    "add bits",
    "shift up",
    "shift down",
    "sample",
    "multiply add",
    "multiply subtract",
    "subtract multiply",
)

Factor = Any
Partial = Callable[..., Factor]


def operation(name: str, operands: list[Any], value: Any) -> tuple[Factor, ...]:
    """The factors of an operation of the tape, one for each operand. A choice is not among them: it has no factors.

    Raises:
        UnsupportedError: if it has no derivative.
    """
    match name:
        case "add":
            return 1.0, 1.0
        case "subtract":
            return 1.0, -1.0
        case "multiply":
            return operands[1], operands[0]
        case "divide":
            by = 1.0 / operands[1]
            return by, -(value * by)
        case "square root":
            return (0.5 / value,)
        case "negate":
            return (-1.0,)
        case "floor":
            return (None,)
        case _ if name in COMPARISONS:
            return None, None
    raise no_derivative(name)


def no_derivative(name: str) -> UnsupportedError:
    """The error for an operation without a derivative."""
    if name == "sample":
        return UnsupportedError("derivative: a sampled input changes by jumps, so it has none by its time")
    if name.startswith(("multiply", "subtract ")):
        return UnsupportedError(f"derivative: expected a tape that is not fused yet, got one with {name!r}")
    return UnsupportedError(
        f"derivative: the operation {name!r} of what is differentiated has none. Write it with the functions of "
        f"stepwell.reference, which tell their derivatives, or decorate the function that it is a part of with "
        f"reference.marks.differentiable"
    )


def number(bits: int, *, single: bool = False) -> float:
    """The number of float64, or of float32, that has these bits."""
    value: float = struct.unpack(*(("<f", struct.pack("<I", bits)) if single else ("<d", struct.pack("<Q", bits))))[0]
    return value


# ---- functions


def function(name: str, near: Callable[..., Any] | None = None) -> Callable[..., Any]:
    """The marked function of that name: the one in the same file as another, else that of ``reference.functions``, else any.

    Raises:
        UnsupportedError: if there is none.
    """
    beside = getattr(inspect.unwrap(near), "__globals__", {}).get(name) if near is not None else None
    if callable(beside) and hasattr(beside, "__wrapped__"):
        return beside  # type: ignore[no-any-return]
    found: Callable[..., Any] | None = getattr(_elementary(), name, None) or marks.FUNCTIONS.get(name)
    if found is None:
        raise UnsupportedError(f"derivative: there is no function {name!r} here, of which it is made")
    return found


@cache
def _elementary() -> Any:
    """The elementary functions, which are imported when a derivative first asks for one."""
    from .. import functions

    return functions


def of_function(mark: marks.Mark, value: Any, wanted: list[bool]) -> tuple[Factor, ...]:
    """The factors of a marked function, one for each argument; those that are not wanted are None.

    Raises:
        UnsupportedError: if there is no rule for it.
    """
    rules = PARTIALS.get(mark.name)
    if rules is None or len(rules) != len(mark.arguments):
        raise UnsupportedError(
            f"derivative: there is no rule for {mark.name!r} of {len(mark.arguments)} argument(s); known: {', '.join(PARTIALS)}"
        )

    def call(name: str) -> Callable[..., Any]:
        return function(name, mark.function)

    return tuple(
        rule(call, value, *mark.arguments) if want and rule is not None else None
        for rule, want in zip(rules, wanted, strict=True)
    )


def _sign(x: Any) -> Any:
    """−1 below zero, else 1."""
    return (x < 0.0).choose(-1.0, 1.0)


def _one_if(truth: Any) -> Any:
    """1 where it is true, else 0."""
    return truth.choose(1.0, 0.0)


def _inside(x: Any, low: Any, high: Any) -> Any:
    return (x < low).choose(0.0, (high < x).choose(0.0, 1.0))


def _by_base(call: Any, y: Any, x: Any, p: Any) -> Any:
    """p·x^(p−1)."""
    if isinstance(p, (int, float)):
        if p == 0:
            return None
        if p in (1, 2):
            return 1.0 if p == 1 else 2.0 * x
    return p * call("power")(x, p - 1.0 if not isinstance(p, int) else p - 1)


def _by_exponent(call: Any, y: Any, x: Any, p: Any) -> Any:
    """x^p·ln x, which is 0 where x^p is: there ln x may be infinite."""
    return y.equals(0.0).choose(0.0, y * call("log")(x))


#: For each argument of each function, how to compute its factor from a lookup of functions by name, the value and the arguments;
#: None where the function is constant in that argument except at jumps.
PARTIALS: dict[str, tuple[Partial | None, ...]] = {
    "sin": (lambda f, y, x: f("cos")(x),),
    "cos": (lambda f, y, x: -f("sin")(x),),
    "tan": (lambda f, y, x: 1.0 + y * y,),
    "arcsin": (lambda f, y, x: 1.0 / ((1.0 - x) * (1.0 + x)).sqrt(),),
    "arccos": (lambda f, y, x: -1.0 / ((1.0 - x) * (1.0 + x)).sqrt(),),
    "arctan": (lambda f, y, x: 1.0 / (1.0 + x * x),),
    "arctan2": (lambda f, y, a, b: b / (a * a + b * b), lambda f, y, a, b: -(a / (a * a + b * b))),
    "sinh": (lambda f, y, x: f("cosh")(x),),
    "cosh": (lambda f, y, x: f("sinh")(x),),
    "tanh": (lambda f, y, x: (1.0 / f("cosh")(x)) / f("cosh")(x),),
    "exp": (lambda f, y, x: y,),
    "exp2": (lambda f, y, x: LN2 * y,),
    "expm1": (lambda f, y, x: f("exp")(x),),
    "log": (lambda f, y, x: 1.0 / x,),
    "log2": (lambda f, y, x: (1.0 / LN2) / x,),
    "log10": (lambda f, y, x: (1.0 / LN10) / x,),
    "log1p": (lambda f, y, x: 1.0 / (1.0 + x),),
    "sqrt": (lambda f, y, x: 0.5 / y,),
    "cbrt": (lambda f, y, x: (1.0 / 3.0) / (y * y),),
    "square": (lambda f, y, x: 2.0 * x,),
    "hypot": (lambda f, y, a, b: a / y, lambda f, y, a, b: b / y),
    "power": (_by_base, _by_exponent),
    "abs": (lambda f, y, x: _sign(x),),
    "copysign": (lambda f, y, a, b: _sign(y) * _sign(a), None),
    "sign": (None,),
    "floor": (None,),
    "ceil": (None,),
    "trunc": (None,),
    "round": (None,),
    # The quotient (y − a)/b is a whole number, up to rounding, whichever way it was rounded.
    "mod": (lambda f, y, a, b: 1.0, lambda f, y, a, b: (y - a) / b),
    "remainder": (lambda f, y, a, b: 1.0, lambda f, y, a, b: (y - a) / b),
    "minimum": (lambda f, y, a, b: _one_if(a <= b), lambda f, y, a, b: (a <= b).choose(0.0, 1.0)),
    "maximum": (lambda f, y, a, b: _one_if(b <= a), lambda f, y, a, b: (b <= a).choose(0.0, 1.0)),
    "clip": (
        lambda f, y, x, low, high: _inside(x, low, high),
        lambda f, y, x, low, high: _one_if(x < low),
        lambda f, y, x, low, high: _one_if(high < x),
    ),
}
