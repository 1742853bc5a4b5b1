"""The number of cores, and long computations by NumPy that Ctrl-C interrupts."""

from __future__ import annotations

import atexit
import os
import signal
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from contextvars import copy_context
from typing import Any, TypeVar

Result = TypeVar("Result")

#: A computation of fewer operations takes some hundredths of a second, which is not worth another thread.
FEW_OPERATIONS = 1e7

#: The interval between checks whether the computation has ended, in seconds.
POLL = 0.02


#: The ends of computations that were interrupted, and of the one that is being waited for.
_unfinished: list[threading.Event] = []


def _wait_for(end: threading.Event) -> None:
    """Wait until the event is set, or raise on Ctrl-C.

    No thread is joined here: before Python 3.13 a join that Ctrl-C interrupts takes the thread for dead (CPython gh-90882).
    """
    while not end.wait(POLL):
        pass
    with suppress(ValueError):  # another thread waited for it, too
        _unfinished.remove(end)


def _end() -> None:
    """End at once if Ctrl-C ended the program, else wait for what goes on.

    A process that ends in the usual way while a function of LAPACK runs may hang, or end with a segmentation fault, so that such
    a thread is a daemon that is waited for. After an uncaught Ctrl-C the signal itself is the end, as of Python's own choice.
    """
    try:
        interrupted = getattr(sys, "last_type", None) is KeyboardInterrupt and not hasattr(sys, "ps1")
        if not interrupted:
            for before in tuple(_unfinished):
                _wait_for(before)
    except KeyboardInterrupt:
        interrupted = True
    if not interrupted or not _unfinished:
        return
    for stream in (sys.stdout, sys.stderr):
        with suppress(Exception):
            stream.flush()
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    os.kill(os.getpid(), signal.SIGINT)


# Where Ctrl-C is no signal, the process ends when its threads have ended.
if HAS_SIGNALS := os.name != "nt":
    atexit.register(_end)


def available() -> int:
    """The number of cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def heard(operations: float, function: Callable[..., Result], *arguments: Any) -> Result:
    """The result of a function of NumPy that makes about so many operations and does not check for signals.

    Another thread computes a long one, while this one waits and hears Ctrl-C. The other thread then goes on until the function
    ends, since nothing can stop it. The next computation waits for that, since two at once would compete for the cores and take
    a hundred times as long, and so does the end of the process, unless Ctrl-C ends it.
    """
    for before in tuple(_unfinished):
        _wait_for(before)
    if operations < FEW_OPERATIONS or threading.current_thread() is not threading.main_thread():
        return function(*arguments)
    results: list[Result] = []
    errors: list[BaseException] = []

    def compute() -> None:
        try:
            results.append(copied.run(function, *arguments))
        except BaseException as error:
            errors.append(error)
        finally:
            end.set()

    copied = copy_context()  # with NumPy's treatment of errors
    end = threading.Event()
    threading.Thread(target=compute, daemon=HAS_SIGNALS).start()
    _unfinished.append(end)
    _wait_for(end)
    if errors:
        raise errors[0]
    return results[0]
