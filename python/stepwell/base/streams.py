"""Terminals and pipes, where systems differ."""

from __future__ import annotations

import errno
import os
import sys
from io import TextIOWrapper
from typing import TextIO

#: ENABLE_VIRTUAL_TERMINAL_PROCESSING: the console of Windows obeys escape sequences.
OBEYS_ESCAPES = 4


def reader_is_gone(error: OSError) -> bool:
    """True if writing to a pipe failed because its reader has gone; Windows calls that an invalid argument."""
    windows_says = sys.platform == "win32" and error.errno == errno.EINVAL and error.filename is None
    return isinstance(error, BrokenPipeError) or windows_says


def write_utf8() -> None:
    """Make files and pipes of standard output and error UTF-8, unless the user chose something else.

    Windows gives them a code page of some 200 characters, in which most formulas cannot be written. Terminals know their own.
    """
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper) and not stream.isatty() and not os.environ.get("PYTHONIOENCODING"):
            stream.reconfigure(encoding="utf-8")


def shows_escapes(stream: TextIO) -> bool:
    """True if a stream is a terminal that obeys escape sequences. The console of Windows does once it was asked to."""
    if not stream.isatty():
        return False
    if sys.platform != "win32":
        return True
    import ctypes
    import msvcrt

    kernel, mode = ctypes.windll.kernel32, ctypes.c_uint32()
    try:
        handle = ctypes.c_void_p(msvcrt.get_osfhandle(stream.fileno()))
    except OSError:  # a stream of an editor or a notebook, which says itself that it is a terminal
        return True
    known = kernel.GetConsoleMode(handle, ctypes.byref(mode))
    return bool(known and (mode.value & OBEYS_ESCAPES or kernel.SetConsoleMode(handle, mode.value | OBEYS_ESCAPES)))
