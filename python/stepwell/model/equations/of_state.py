"""Functions of a state that belong to a system, and take its parameters by name."""

from __future__ import annotations

import inspect
from collections.abc import Collection
from typing import Any

from ...base import checks
from ...errors import ArgumentError


def arguments_in_place(function: Any) -> list[inspect.Parameter]:
    """The arguments of a function that can be given without their names."""
    arguments = inspect.signature(function).parameters.values()
    return [each for each in arguments if each.kind in (each.POSITIONAL_ONLY, each.POSITIONAL_OR_KEYWORD)]


def parameters_of(
    system: str, state: tuple[str, ...], parameters: Collection[str], function: Any, expected: str
) -> tuple[str, ...]:
    """The names of the parameters that a function takes behind the time and the blocks of a state.

    Raises:
        ArgumentError: if its arguments are others; ``expected`` says which they should be.
    """
    name, n = f"{system}: {function.__name__}", len(state)
    arguments, in_place = list(inspect.signature(function).parameters.values()), arguments_in_place(function)
    if in_place[:n] != arguments[:n] or len(in_place) < n:
        raise ArgumentError(f"{name}: expected a function {expected}, got ({', '.join(map(str, arguments))})")
    checks.argument_order(name, function, state)
    for each in arguments[n:]:
        if each.name not in parameters:
            known = ", ".join(parameters) or "none"
            raise ArgumentError(
                f"{name}: expected a function {expected} whose further arguments are parameters of the system, got "
                f"{each.name!r}. Known: {known}."
            )
    return tuple(each.name for each in arguments[n:])
