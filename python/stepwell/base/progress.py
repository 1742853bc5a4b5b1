"""The progress of a long run: in a terminal a bar of rich, or a line of text without rich; in a notebook an element of the page.

A pipe shows nothing.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from html import escape
from typing import Any

from .streams import shows_escapes

#: The least time between two updates of a notebook or of a line of text, in seconds.
MIN_SECONDS_BETWEEN = 0.1

#: The length of a bar of text, in characters.
BAR_LENGTH = 30

#: The least time, and the least share, after which the rest of the time is told.
SURE_SECONDS, SURE_SHARE = 1.0, 0.02


@contextmanager
def bar(title: str) -> Iterator[Callable[[float], object]]:
    """Show a bar; yields the function that takes the share of the work that is done, from 0 to 1."""
    if in_notebook():
        yield from _in_a_page(title)
        return
    try:
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn
    except ImportError:
        yield from _in_a_line(title)
        return
    columns = TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TextColumn("{task.fields[left]}")
    left = _time_left()
    # On stderr and removed at the end, so that the output of a program is not changed.
    console = Console(stderr=True)
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as progress:
        task = progress.add_task(title, total=1.0, left="")
        yield lambda share: progress.update(task, completed=share, left=left(share))
        progress.update(task, completed=1.0)


def _time_left() -> Callable[[float], str]:
    """A function of the share that is done: how long the rest will take at the pace so far; empty where that is a guess."""
    begun = time.monotonic()

    def left(share: float) -> str:
        elapsed = time.monotonic() - begun
        if elapsed < SURE_SECONDS or not SURE_SHARE <= share < 1.0:
            return ""
        seconds = elapsed * (1.0 - share) / share
        return f"{seconds:.0f} s left" if seconds < 100.0 else f"{seconds / 60.0:.0f} min left"

    return left


def in_notebook() -> bool:
    """Whether this process is the kernel of a notebook; IPython in a terminal is not."""
    shell = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    return hasattr(shell, "kernel")


def _in_a_page(title: str) -> Iterator[Callable[[float], object]]:
    """An element that the kernel changes; needs no widgets."""
    from IPython.display import HTML, display

    def element(share: float) -> Any:
        return HTML(f'{escape(title)} <progress value="{share:.3f}" max="1"></progress> {100 * share:.0f} %')

    handle = display(element(0.0), display_id=True)
    yield _at_intervals(lambda share: handle.update(element(share)))
    handle.update(HTML(""))


def _in_a_line(title: str) -> Iterator[Callable[[float], object]]:
    """A line of a terminal that is written over, and removed at the end."""
    if not shows_escapes(sys.stderr):
        yield lambda share: None
        return

    left = _time_left()

    def line(share: float) -> None:
        full = round(BAR_LENGTH * share)
        bar = "━" * full + "·" * (BAR_LENGTH - full)
        print(f"\r\033[K{title} {bar} {left(share)} {100 * share:3.0f} %", end="", file=sys.stderr, flush=True)

    line(0.0)
    try:
        yield _at_intervals(line)
    finally:
        print("\r\033[K", end="", file=sys.stderr, flush=True)


def _at_intervals(show: Callable[[float], object]) -> Callable[[float], object]:
    """A function that passes a share on to ``show`` if the last one was passed on long enough ago."""
    last = time.monotonic()

    def show_if_due(share: float) -> None:
        nonlocal last
        if (now := time.monotonic()) - last >= MIN_SECONDS_BETWEEN:
            last = now
            show(min(1.0, max(0.0, share)))

    return show_if_due
