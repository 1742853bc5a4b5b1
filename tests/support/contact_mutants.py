"""What tests of contact mutants share."""

from __future__ import annotations

from pathlib import Path
from types import ModuleType

from stepwell.reference import contact

SOURCE = Path(contact.__file__).read_text(encoding="utf-8")


def changed(old: str, new: str) -> ModuleType:
    """The reference's contact with a change in its text."""
    assert SOURCE.count(old) == 1, f"the text is not there, or more than once: {old}"
    module = ModuleType("stepwell.reference.contact")
    module.__package__ = "stepwell.reference"
    exec(compile(SOURCE.replace(old, new), "contact with a mistake", "exec"), vars(module))
    return module
