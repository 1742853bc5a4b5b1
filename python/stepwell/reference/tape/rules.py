"""Derivatives of the functions that are marked on a tape (``reference/marks.py``).

A rule returns, for each argument, the factor by which a change of it is multiplied: a symbol, 1.0 or −1.0, or None for no change.
The operations of a tape have theirs in ``operations.py``.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from functools import cache
from typing import Any

from ...errors import UnsupportedError
from .. import marks
from .operations import Factor

LN2, LN10 = 0.6931471805599453, 2.302585092994046

Partial = Callable[..., Factor]


def function(name: str, near: Callable[..., Any] | None = None) -> Callable[..., Any]:
    """The marked function of that name: the one in the same file as another, else that of ``reference.functions``, else any.

    Raises:
        UnsupportedError: if there is none.
    """
    beside = getattr(inspect.unwrap(near), "__globals__", {}).get(name) if near is not None else None
    if callable(beside) and hasattr(beside, "__wrapped__"):
        return beside  # type: ignore[no-any-return]
    marked: Callable[..., Any] | None = getattr(_elementary(), name, None) or marks.FUNCTIONS.get(name)
    if marked is None:
        raise UnsupportedError(f"derivative: there is no function {name!r} here, of which it is made")
    return marked


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
    "logaddexp": (lambda f, y, a, b: f("exp")(a - y), lambda f, y, a, b: f("exp")(b - y)),
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
