"""Values that hold while something is computed."""

from __future__ import annotations

from collections.abc import Callable
from contextvars import ContextVar, copy_context
from typing import Any


def within(values: dict[ContextVar[Any], Any], compute: Callable[..., Any], /, *arguments: Any, **named: Any) -> Any:
    """``compute(*arguments, **named)``, during which these variables have these values.

    It runs in a context of its own, which is dropped however it ends. Where a variable is set and reset instead, Ctrl-C between
    the two lines leaves it set, and whatever is computed later is wrong without a word.
    """
    context = copy_context()
    for variable, value in values.items():
        context.run(variable.set, value)
    return context.run(compute, *arguments, **named)
