"""Writing files: the old file stays until the new one is complete."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TextIO
from uuid import uuid4

from ..errors import ArgumentError
from .checks import short
from .paths import PATH


def put(beside: Path, place: Path, argument: str = "path") -> None:
    """Move a complete file or folder to its place, instead of the old file.

    Raises:
        ArgumentError: if the system refuses. Windows does while any program has the old file open.
    """
    try:
        os.replace(beside, place)
    except PermissionError as error:
        raise ArgumentError(
            f"{argument}: {short(str(place), PATH)} cannot be replaced: {error.strerror}; close the program that has it open, or "
            f"give another path"
        ) from error


@contextmanager
def replaced(place: Path) -> Iterator[TextIO]:
    """A text file that replaces the old one when it is complete; if writing fails, as on a full disk, the old one stays.

    Ends of lines are written unchanged. A pipe, a terminal, /dev/null, and a file in a folder that is not writable are written
    directly.
    """
    target = place.resolve() if place.is_symlink() else place
    if place.exists() and not (place.is_file() and os.access(target.parent, os.W_OK)):
        with place.open("w", encoding="utf-8", newline="") as file:
            yield file
        return
    beside = target.with_name(f".{target.stem[:50]}.{uuid4().hex}.new")
    try:
        with beside.open("x", encoding="utf-8", newline="") as file:
            yield file
        if target.exists():
            shutil.copymode(target, beside)
        put(beside, target)
    except BaseException:
        beside.unlink(missing_ok=True)
        raise


def write_text(place: Path, text: str) -> None:
    """Write a text file, which replaces the old one when it is complete."""
    with replaced(place) as file:
        file.write(text)
