"""The progress of a long run: in a terminal a bar of rich, or a line of text without rich; in a notebook an element of the page.

A pipe shows nothing.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from html import escape
from typing import Any

from .streams import shows_escapes

#: The least time between two updates of a notebook or of a line of text, in seconds.
MIN_SECONDS_BETWEEN = 0.1

#: The length of a bar of text, in characters.
BAR_LENGTH = 30

#: Callables that take the share of the work that is done, and a text beside the title.
Both = tuple[Callable[[float], object], Callable[[str], object]]

#: The least time, and the least share, after which the rest of the time is told.
SURE_SECONDS, SURE_SHARE = 1.0, 0.02


#: Display of this thread; it takes a text that stands beside the title.
_SHOWN: ContextVar[Callable[[str], object]] = ContextVar("shown", default=lambda text: None)


@contextmanager
def bar(title: str) -> Iterator[Callable[[float], object]]:
    """Show a bar; yields the function that takes the share of the work that is done, from 0 to 1."""
    shown = ""
    with _bar(title) as (share, beside):

        def changes(text: str) -> None:
            nonlocal shown
            if text != shown:
                shown = text
                beside(text)

        before = _SHOWN.set(changes)
        try:
            yield share
        finally:
            _SHOWN.reset(before)


def waits_for(text: str) -> None:
    """Tell in the bar of this thread, if there is one, what its work waits for; "" if it goes on."""
    _SHOWN.get()(text)


@contextmanager
def _bar(title: str) -> Iterator[Both]:
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
        # What is waited for may keep the thread that draws from running.
        yield (
            lambda share: progress.update(task, completed=share, left=left(share)),
            lambda text: progress.update(task, description=_beside(title, text), refresh=True),
        )
        progress.update(task, completed=1.0)


def _beside(title: str, text: str) -> str:
    """The title, and what is waited for."""
    return f"{title}, {text}" if text else title


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
    """True if this process is the kernel of a notebook; IPython in a terminal is not."""
    shell = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    return hasattr(shell, "kernel")


def _in_a_page(title: str) -> Iterator[Both]:
    """An element that the kernel changes; needs no widgets."""
    from IPython.display import HTML, display

    def element(share: float, text: str = "") -> Any:
        name = escape(_beside(title, text))
        return HTML(f'{name} <progress value="{share:.3f}" max="1"></progress> {100 * share:.0f} %')

    handle = display(element(0.0), display_id=True)
    yield _at_intervals(lambda share, text="": handle.update(element(share, text)))
    handle.update(HTML(""))


def _in_a_line(title: str) -> Iterator[Both]:
    """A line of a terminal that is written over, and removed at the end."""
    if not shows_escapes(sys.stderr):
        yield (lambda share: None), (lambda text: None)
        return

    left = _time_left()

    def line(share: float, text: str = "") -> None:
        full = round(BAR_LENGTH * share)
        bar = "━" * full + "·" * (BAR_LENGTH - full)
        print(f"\r\033[K{_beside(title, text)} {bar} {left(share)} {100 * share:3.0f} %", end="", file=sys.stderr, flush=True)

    line(0.0)
    try:
        yield _at_intervals(line)
    finally:
        print("\r\033[K", end="", file=sys.stderr, flush=True)


def _at_intervals(show: Callable[..., object]) -> Both:
    """Functions that pass on to ``show`` a share, if the last one was passed on long enough ago, and a text beside the last."""
    last, shown = time.monotonic(), 0.0

    def show_if_due(share: float) -> None:
        nonlocal last, shown
        if (now := time.monotonic()) - last >= MIN_SECONDS_BETWEEN:
            last, shown = now, min(1.0, max(0.0, share))
            show(shown)

    return show_if_due, lambda text: show(shown, text)
