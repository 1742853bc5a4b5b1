"""A step that was exported: its text, and how to keep it."""

from __future__ import annotations

from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

from .. import _checks
from .._checks import Shape
from .._value import Value
from ..methods import Method
from ..systems import System


@dataclass(frozen=True, eq=False)
class ExportedStep(Value):
    """A step in the source code of another language. ``print`` it, or ``save`` it.

    Attributes:
        source: the text of the file.
        name: what its functions and types are called, or begin with.
        language: the language's name.
        endings: how a file of it may end.
        system: what is stepped, with its control.
        method: by what.
        member: which trajectory of the system's batch.
        fused: whether with fused multiply-adds.
        operations: how many operations are written out, those before the steps included.
    """

    source: str
    name: str
    language: str
    endings: tuple[str, ...]
    system: System
    method: Method
    member: Shape
    fused: bool
    operations: int

    def save(self, path: str | PathLike[str]) -> Path:
        """Write the file.

        Args:
            path: where; it ends as files of the language do.

        Returns:
            The path.

        Raises:
            ArgumentError: if it has another ending or cannot be written.
        """
        place = _checks.file("path", path, self.endings)
        place.write_text(self.source, encoding="utf-8", newline="\n")
        return place

    def as_dict(self) -> dict[str, Any]:
        """All of it as numbers and texts."""
        held = {name: getattr(self, name) for name in self.__dataclass_fields__}
        return held | {"system": repr(self.system), "method": self.method.name}

    def __str__(self) -> str:
        return self.source

    def __repr__(self) -> str:
        return f"<{self.name} in {self.language}: {self.method.title}, {self.system!r}, {self.operations} operations>"
