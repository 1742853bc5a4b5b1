"""What the commands print: tables by rich, or JSON, which needs nothing."""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Callable, Iterable, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

from ..charts.data import finite
from ..errors import UnsupportedError

#: Width of a table that goes into a file or a pipe, where there is no terminal to ask.
WIDTH = 120


def json_option(parser: argparse.ArgumentParser) -> None:
    """Let a command print JSON instead of a table."""
    parser.add_argument("--json", action="store_true", help="print JSON instead of a table")


def print_json(value: Any) -> None:
    """Print a value for other programs; what is not finite is null."""
    print(json.dumps(finite(value), ensure_ascii=False, indent=1))


def need_rich() -> None:
    """Raise if a table cannot be printed, before any work is done."""
    try:
        import rich  # noqa: F401
    except ImportError:
        raise UnsupportedError("a table needs rich; pip install 'stepwell[chart]', or ask for --json") from None


def table(title: str, columns: Sequence[str], rows: Iterable[Sequence[str]], notes: Sequence[str] = ()) -> None:
    """Print a table; columns whose name ends in ``>`` are flush right."""
    need_rich()
    from rich import box
    from rich.console import Console
    from rich.table import Table

    piped = not sys.stdout.isatty() and "COLUMNS" not in os.environ
    console = Console(width=WIDTH if piped else None, highlight=False)
    printed = Table(title=title, title_justify="left", title_style="bold", box=box.SIMPLE_HEAD, pad_edge=False)
    for column in columns:
        printed.add_column(column.removesuffix(">"), justify="right" if column.endswith(">") else "left")
    for row in rows:
        printed.add_row(*row)
    console.print(printed)
    for note in notes:
        console.print(note, style="dim", markup=False)


class Written:
    """Files that a command writes. What cannot be written is said when all else has been, so that no result is lost with it."""

    def __init__(self) -> None:
        self.files: list[str] = []
        self.error: Exception | None = None

    def write(self, path: Path, how: Callable[[Path], Any]) -> Any:
        """Write a file and return what ``how`` returns, or keep the error for ``close``."""
        try:
            what = how(path)
        except Exception as error:  # whatever it is, it is raised in the end
            self.error = self.error or error
            return None
        self.files.append(str(path))
        return what

    def notes(self) -> list[str]:
        """What a table says below."""
        return [f"written: {', '.join(self.files)}"] if self.files else []

    def close(self) -> None:
        """Raise what was kept."""
        if self.error is not None:
            raise self.error


def progress(title: str) -> AbstractContextManager[Callable[[float], object]]:
    """A progress bar; gives the function that takes the share that is done."""
    need_rich()
    from .._progress import bar

    return bar(title)
