"""The output of commands: tables, JSON and files."""

from __future__ import annotations

import argparse
import math
import os
import sys
from collections.abc import Callable, Iterable, Sequence
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import Any

from ...base.streams import shows_escapes
from ...base.tables import json_text, write_csv, write_json
from . import options
from .table import BAD as BAD
from .table import DOUBTFUL as DOUBTFUL
from .table import GOOD as GOOD
from .table import STRONG as STRONG
from .table import lines_of, styled, width_of_terminal, wrapped


def print_json(value: Any) -> None:
    """Print a value as JSON; numbers that are not finite become null."""
    print(json_text(value))


#: The note of a command that draws only if asked to.
ASK_FOR_PICTURES = "-o DIR writes pictures and tables."

#: Places of a name before its value.
NAME = 21

#: The endings of files to which a list is written.
TABLE_FILES = (".csv", ".json", ".md")
TABLE_TEXT = f"write the table: {', '.join(TABLE_FILES)}"

#: The name of a column of sections.
HOFFMANN = "Hoffmann (2002)"


def section(name: str) -> str:
    """A section as tables show it: a dash for what is not in Hoffmann (2002)."""
    return name.replace("Appendix", "App.") if name.startswith(("§", "Appendix")) else "–"


def warn(message: str) -> None:
    """Print a message on standard error, wrapped between words."""
    print("\n".join(wrapped(message, width_of_terminal(sys.stderr))), file=sys.stderr)


def has_colours() -> bool:
    """True if standard output is a terminal that shows colours, and the user wants them."""
    return not os.environ.get("NO_COLOR") and os.environ.get("TERM") != "dumb" and shows_escapes(sys.stdout)


def table(title: str, columns: Sequence[str], rows: Iterable[Sequence[str]], notes: Sequence[str] = (), **layout: Any) -> None:
    """Print a table; columns whose name ends in ``>`` are flush right. The layout is that of ``table.lines_of``."""
    print("\n".join(lines_of(title, columns, rows, notes, width=width_of_terminal(), bold=has_colours(), **layout)))


def paragraphs(lines: Iterable[str], first: str = "") -> None:
    """Print texts, their lines wrapped between words to the width of the terminal; the first in the colour of a code."""
    width, bold = width_of_terminal(), has_colours()
    for i, line in enumerate(each for text in lines for each in text.split("\n")):
        indent = "    " if line.startswith(" ") else ""  # as of a formula in a listing
        print("\n".join(styled(part, first if i == 0 else "", bold) for part in wrapped(line, width, indent)))


def facts(rows: Iterable[tuple[str, str, str]]) -> None:
    """Print names and values, wrapped between words below each other, each value in the colour of its code."""
    width, bold = width_of_terminal(), has_colours()
    for name, value, code in rows:
        first, *rest = wrapped(f"{name:{NAME}} {value}", width, " " * (NAME + 1))
        print(styled(name, STRONG, bold) + styled(first[len(name) :], code, bold))
        for line in rest:
            print(styled(line, code, bold))


def listing(
    args: argparse.Namespace,
    title: str,
    columns: Sequence[str],
    rows: Sequence[Sequence[str]],
    data: list[dict[str, Any]],
    notes: Sequence[str] = (),
    **layout: Any,
) -> None:
    """Print a list as a table, or ``data`` as JSON (``--json``), and write it to the file of ``-o``."""
    options.check_file(args, TABLE_FILES)
    written = Written()
    written.write(args.output, lambda path: _write(path, columns, rows, data))
    if args.json:
        print_json(data)
    else:
        table(title, columns, rows, [*notes, *written.notes()], **layout)
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
    """A number in three digits, without an exponent up to a million; a dash if it is not finite."""
    if not math.isfinite(value):
        return "–"
    return f"{float(f'{value:.3g}'):.0f}" if 100.0 <= abs(value) < 1e6 else f"{value:.3g}"
