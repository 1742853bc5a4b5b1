"""A module with one mistake, made on purpose, which tests must notice."""

from __future__ import annotations

import types
from typing import Any


def mistaken(module: Any, old: str, new: str) -> Any:
    """The module with other text in one place."""
    with open(module.__file__, encoding="utf-8") as file:
        text = file.read()
    assert text.count(old) == 1, f"the mistake no longer fits: {old}"
    wrong = types.ModuleType("mutant")
    wrong.__package__ = module.__package__
    exec(compile(text.replace(old, new), "mutant", "exec"), wrong.__dict__)
    return wrong
