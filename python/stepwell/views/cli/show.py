"""The output of commands: tables, JSON and files."""

from __future__ import annotations

import argparse
import math
import os
import sys
import textwrap
from collections.abc import Callable, Iterable, Sequence
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import Any

from ...base.tables import json_text, write_csv, write_json
from . import options
from .table import lines_of, width_of_terminal


def print_json(value: Any) -> None:
    """Print a value as JSON; numbers that are not finite become null."""
    print(json_text(value))


#: The endings of files to which a list is written.
TABLE_FILES = (".csv", ".json", ".md")
TABLE_TEXT = f"write the table: {', '.join(TABLE_FILES)}"


def table(title: str, columns: Sequence[str], rows: Iterable[Sequence[str]], notes: Sequence[str] = ()) -> None:
    """Print a table; columns whose name ends in ``>`` are flush right."""
    bold = sys.stdout.isatty() and "NO_COLOR" not in os.environ and os.environ.get("TERM") != "dumb"
    print("\n".join(lines_of(title, columns, rows, notes, width=width_of_terminal(), bold=bold)))


def paragraphs(lines: Iterable[str]) -> None:
    """Print sentences, wrapped between words to the width of the terminal."""
    width = width_of_terminal()
    for line in lines:
        print("\n".join(textwrap.wrap(line, width, break_long_words=False, break_on_hyphens=False)) if line else "")


def listing(
    args: argparse.Namespace,
    title: str,
    columns: Sequence[str],
    rows: Sequence[Sequence[str]],
    data: list[dict[str, Any]],
    notes: Sequence[str] = (),
) -> None:
    """Print a list as a table, or ``data`` as JSON (``--json``), and write it to the file of ``-o``."""
    options.check_file(args, TABLE_FILES)
    written = Written()
    written.write(args.output, lambda path: _write(path, columns, rows, data))
    if args.json:
        print_json(data)
    else:
        table(title, columns, rows, [*notes, *written.notes()])
    written.close()


def _write(path: Path, columns: Sequence[str], rows: Sequence[Sequence[str]], data: list[dict[str, Any]]) -> None:
    if path.suffix == ".json":
        write_json(data, path)
    elif path.suffix == ".csv":
        write_csv({name: [_cell(row[name]) for row in data] for name in data[0]}, path)
    else:
        names = [name.removesuffix(">") for name in columns]
        sides = ["--:" if name.endswith(">") else "---" for name in columns]
        cells = [[cell.replace("|", "\\|") for cell in row] for row in rows]
        path.write_text("".join(f"| {' | '.join(line)} |\n" for line in [names, sides, *cells]), encoding="utf-8")


def _cell(value: Any) -> Any:
    """A value in a CSV file: lists are joined by semicolons."""
    return "; ".join(map(str, value)) if isinstance(value, (list, tuple)) else value


class Written:
    """The files that a command writes. Errors are raised by ``close``, after all other output, so that no result is lost."""

    def __init__(self) -> None:
        self.files: list[str] = []
        self.error: Exception | None = None

    def write(self, path: Path | None, writer: Callable[[Path], Any]) -> Any:
        """Call ``writer`` with the path and return its result; store its error for ``close``. Without a path, do nothing."""
        if path is None:
            return None
        try:
            result = writer(path)
        except Exception as error:  # close() raises it
            self.error = self.error or error
            return None
        self.files.append(str(path))
        return result

    def notes(self) -> list[str]:
        """The note on written files, for the end of a table."""
        return [f"written: {', '.join(self.files)}"] if self.files else []

    def close(self) -> None:
        """Raise the first error of ``write``, if there was one."""
        if self.error is not None:
            raise self.error


def progress(title: str, args: argparse.Namespace) -> AbstractContextManager[Callable[[float], object] | None]:
    """A progress bar, as a function that takes the share of the work that is done; no bar with ``--json``."""
    from ...base.progress import bar

    return nullcontext() if args.json else bar(title)


def number(value: float) -> str:
    """A number in three digits; a dash if it is not finite."""
    return f"{value:.3g}" if math.isfinite(value) else "–"
