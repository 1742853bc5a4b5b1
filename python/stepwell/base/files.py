"""Files that are written: what was there stays until the new one is whole."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TextIO
from uuid import uuid4


@contextmanager
def replaced(place: Path) -> Iterator[TextIO]:
    """A text file that takes its place when all is written; if that fails, as on a full disk, the old one is as it was.

    The lines end as they are written. A pipe, a terminal or /dev/null is written to directly, and so is a file in a folder that
    takes no other.
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
        os.replace(beside, target)
    except BaseException:
        beside.unlink(missing_ok=True)
        raise


def write_text(place: Path, text: str) -> None:
    """Write a text file, which takes its place when it is whole."""
    with replaced(place) as file:
        file.write(text)
