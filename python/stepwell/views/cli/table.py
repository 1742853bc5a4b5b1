"""Text tables that keep names, numbers and paths whole at any width.

A table that is too wide for the terminal has its prose wrapped between words. If that is not enough, it is split into several
tables, each with the first column. Output to a file or a pipe is not wrapped.
"""

from __future__ import annotations

import os
import shutil
import sys
import textwrap
from collections.abc import Iterable, Sequence
from typing import TextIO
from unicodedata import combining, east_asian_width

#: Between two columns.
GAP = "   "

#: The least width of a column of prose whose text is longer.
MIN_PROSE = 28

#: The width where there is no terminal: lines of any length.
UNLIMITED = 1_000_000


def width_of_terminal(stream: TextIO | None = None) -> int:
    """The most characters of a line: the width of the terminal or ``COLUMNS``; unlimited in a file or a pipe."""
    if not (stream or sys.stdout).isatty() and not os.environ.get("COLUMNS", "").isdigit():
        return UNLIMITED
    return max(20, shutil.get_terminal_size().columns)


def lines_of(
    title: str,
    columns: Sequence[str],
    rows: Iterable[Sequence[str]],
    notes: Sequence[str] = (),
    *,
    width: int = UNLIMITED,
    bold: bool = False,
) -> list[str]:
    """The lines of a table.

    Args:
        title: the line above the table.
        columns: the names of the columns; those that end in ``>`` are flush right, and their cells are never wrapped.
        rows: the cells of each row.
        notes: sentences below the table.
        width: the most characters of a line; a longer word stays whole.
        bold: whether titles are bold and notes faint, by escape codes of terminals.
    """
    names = [name.removesuffix(">") for name in columns]
    right = [name.endswith(">") for name in columns]
    cells = [[str(cell) for cell in row] for row in rows]
    whole = [flush or i == 0 for i, flush in enumerate(right)]
    wide = [max(map(length, column)) for column in zip(names, *cells, strict=True)]
    least = [_least(name, [row[i] for row in cells], whole[i]) for i, name in enumerate(names)]

    lines = [_styled(line, "1", bold) for line in _wrapped(title, width)]
    for part in _parts(least, width):
        widths = _widths([wide[i] for i in part], [least[i] for i in part], width)
        lines.append("")
        lines += _row([names[i] for i in part], widths, [right[i] for i in part], bottom=True)
        lines.append("─" * min(width, sum(widths) + len(GAP) * (len(widths) - 1)))
        for row in cells:
            lines += _row([row[i] for i in part], widths, [right[i] for i in part])
    if notes:
        lines.append("")
    for note in notes:
        lines += [_styled(line, "2", bold) for line in _wrapped(note, width)]
    return lines


def length(text: str) -> int:
    """The number of places that a text takes on a terminal."""
    return sum(0 if combining(c) else 2 if east_asian_width(c) in "WF" else 1 for c in text)


def _least(name: str, cells: Sequence[str], whole: bool) -> int:
    """The least width of a column: its longest word, and for prose at least ``MIN_PROSE``."""
    words = [length(word) for word in name.split()]
    if whole:
        return max([*words, *map(length, cells)], default=0)
    longest = max([length(word) for cell in cells for word in cell.split()], default=0)
    return max([*words, longest, min(MIN_PROSE, max(map(length, cells), default=0))], default=0)


def _parts(least: Sequence[int], width: int) -> list[list[int]]:
    """The indices of the columns of each table: as many as fit, the first column in each."""
    parts, room = [[0]], width - least[0]
    for i in range(1, len(least)):
        needed = least[i] + len(GAP)
        if needed > room and len(parts[-1]) > 1:
            parts.append([0])
            room = width - least[0]
        parts[-1].append(i)
        room -= needed
    return parts


def _widths(wide: Sequence[int], least: Sequence[int], width: int) -> list[int]:
    """The width of each column: that of its text if all fit; otherwise the widest columns shrink, not below their least."""
    widths = list(wide)
    missing = sum(widths) + len(GAP) * (len(widths) - 1) - width
    while missing > 0:
        i = max(range(len(widths)), key=lambda i: (widths[i] > least[i], widths[i]))
        if widths[i] <= least[i]:
            break
        widths[i] -= 1
        missing -= 1
    return widths


def _row(cells: Sequence[str], widths: Sequence[int], right: Sequence[bool], bottom: bool = False) -> list[str]:
    """The lines of a row; ``bottom`` aligns the names of columns with the line below them."""
    columns = [_wrapped(cell, width) or [""] for cell, width in zip(cells, widths, strict=True)]
    height = max(map(len, columns))
    padded = [[""] * (height - len(c)) + c if bottom else c + [""] * (height - len(c)) for c in columns]
    lines = []
    for parts in zip(*padded, strict=True):
        spaces = [" " * max(0, width - length(part)) for part, width in zip(parts, widths, strict=True)]
        texts = [space + part if flush else part + space for part, space, flush in zip(parts, spaces, right, strict=True)]
        lines.append(GAP.join(texts).rstrip())
    return lines


def _wrapped(text: str, width: int) -> list[str]:
    """The lines of a text, wrapped between words only."""
    if length(text) <= width:
        return [text]
    return textwrap.wrap(text, width, break_long_words=False, break_on_hyphens=False)


def _styled(text: str, code: str, styled: bool) -> str:
    return f"\033[{code}m{text}\033[0m" if styled and text else text
