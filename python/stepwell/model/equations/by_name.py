"""Definitions are pickled by the names of their functions, as functions are."""

from __future__ import annotations

import importlib
import sys
from functools import reduce
from typing import Any

from ...errors import ArgumentError


def reduced(definition: Any, what: str) -> tuple[Any, tuple[str, str]]:
    """The value of ``__reduce__`` of a definition. Raises if it is not found by its name; ``what`` it is, for the message."""
    module, name = definition.__module__, definition.__qualname__
    known: Any = sys.modules.get(module)
    for each in name.split("."):
        known = getattr(known, each, None)
    if known is not definition:
        raise ArgumentError(
            f"{definition.name}: {what} is pickled by the name of its function, so expected one at the top of a module, got "
            f"{module}.{name}"
        )
    return restored, (module, name)


def restored(module: str, name: str) -> Any:
    """The definition of that name."""
    return reduce(getattr, name.split("."), importlib.import_module(module))
