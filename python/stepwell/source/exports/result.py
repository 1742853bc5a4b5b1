"""An exported step: its text, and how to save it."""

from __future__ import annotations

from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

from ...base import files, paths
from ...base.arrays import Shape
from ...base.immutable import ValueEquality
from ...model.methods import Method
from ...model.systems import System


@dataclass(frozen=True, eq=False)
class ExportedStep(ValueEquality):
    """A step as source code of another language. ``print`` it, or ``save`` it.

    Attributes:
        source: the text of the file.
        name: the name of its functions and types, or its beginning.
        language: the language's name.
        endings: the endings that its file may have.
        system: the system, with its control.
        method: the method; None for a sampled controller alone.
        member: which trajectory of the system's batch.
        fused: whether it uses fused multiply-adds.
        operations: the number of operations of a step, including those before the steps.
        dtype: ``"float64"`` or ``"float32"``, of its numbers.

    Example:
        >>> step = sw.export(sw.Oscillator(), "false_euler", "c")
        >>> step
        <oscillator_false_euler in C: False Euler, Oscillator(omega=1.0, form='canonical'), 5 operations>
        >>> "double" in step.source
        True
    """

    source: str
    name: str
    language: str
    endings: tuple[str, ...]
    system: System
    method: Method | None
    member: Shape
    fused: bool
    operations: int
    dtype: str = "float64"

    def save(self, path: str | PathLike[str]) -> Path:
        """Write the file.

        Args:
            path: the file; its ending must be one of ``endings``.

        Raises:
            ArgumentError: if it has another ending or cannot be written.
        """
        place = paths.file("path", path, self.endings)
        files.write_text(place, self.source)
        return place

    def as_dict(self) -> dict[str, Any]:
        """The attributes as numbers and texts."""
        values = {name: getattr(self, name) for name in self.__dataclass_fields__}
        return values | {"system": repr(self.system), "method": getattr(self.method, "name", None)}

    def __str__(self) -> str:
        return self.source

    def __repr__(self) -> str:
        single = "" if self.dtype == "float64" else f", {self.dtype}"
        of = "the controller" if self.method is None else self.method.title
        return f"<{self.name} in {self.language}: {of}, {self.system!r}, {self.operations} operations{single}>"
