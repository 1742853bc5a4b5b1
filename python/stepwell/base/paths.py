"""Checks of paths: files and folders that can be written."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from ..errors import ArgumentError, DTypeError
from .checks import short

if TYPE_CHECKING:
    from pathlib import Path

#: The most characters of a path in a message.
PATH = 1000

#: The most characters of the name of a file or folder on Windows.
LONGEST_NAME = 255


def file(argument: str, path: Any, endings: tuple[str, ...] = ()) -> Path:
    """Return the path of a file if it has one of the endings and can be written; a trial leaves no file behind."""
    if not isinstance(path, (str, os.PathLike)):
        raise DTypeError(f"{argument}: expected the path of a file, got {short(path)} ({type(path).__name__})")
    from pathlib import Path  # the import of stepwell does without

    place = Path(os.fsdecode(path))
    if endings and place.suffix not in endings:
        *others, last = endings
        known = f"{', '.join(others)} or {last}" if others else last
        raise ArgumentError(f"{argument}: expected a file ending in {known}, got {short(str(path), PATH)}")
    try:
        _check_name(place)
        if place.is_dir():
            from errno import EISDIR  # an error alone needs it

            raise IsADirectoryError(EISDIR, os.strerror(EISDIR))
        if place.is_file():
            with place.open("ab"):
                pass
        elif not place.exists() and not place.is_symlink():  # a pipe, or /dev/null, must not be opened twice
            with place.open("xb"):
                pass
            place.unlink()
    except (OSError, ValueError) as error:
        raise _unwritable(argument, "file", path, error) from None
    return place


def folder(argument: str, path: Any, names: Iterable[str] = ()) -> Path:
    """Return the path of a folder, which need not exist yet, if files can be written there, also those of these names."""
    if not isinstance(path, (str, os.PathLike)):
        raise DTypeError(f"{argument}: expected the path of a folder, got {short(path)} ({type(path).__name__})")
    from pathlib import Path  # the import of stepwell does without
    from tempfile import TemporaryFile  # the import of stepwell may not take its time

    place = Path(os.fsdecode(path))
    try:
        if "\0" in str(place):
            raise ValueError("embedded null byte")
        _check_name(place)
        there = next(each for each in (place.absolute(), *place.absolute().parents) if each.exists())
        with TemporaryFile(dir=there):
            pass
        if place.exists():
            for name in names:
                file(argument, place / name)
    except (OSError, ValueError) as error:
        if isinstance(error, ArgumentError):
            raise
        raise _unwritable(argument, "folder", path, error) from None
    return place


def _check_name(place: Path) -> None:
    """Raise where Windows would write into a hidden part of a file, whose name ends at a colon, or find a name too long."""
    if sys.platform != "win32":
        return
    for part in place.parts[bool(place.anchor) :]:
        if ":" in part:
            raise ValueError("a name has no colon on Windows")
        if len(part) > LONGEST_NAME:
            raise ValueError(f"a name has at most {LONGEST_NAME} characters on Windows")


def _unwritable(argument: str, what: str, path: Any, error: Exception) -> ArgumentError:
    why = getattr(error, "strerror", None) or error
    return ArgumentError(f"{argument}: expected a {what} that can be written, got {short(str(path), PATH)}: {why}")
