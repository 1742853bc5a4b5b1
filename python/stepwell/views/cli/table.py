"""Text tables that keep names, numbers and paths whole at any width.

A table that is too wide for the terminal has its prose wrapped between words. If that is not enough, its least columns are left
out, and a note says which and where they are. Only a table whose other columns are still too wide is split into several, each
with the first column. Output to a file or a pipe is not wrapped, and has all columns.
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

#: The width that a column of prose should have if its text is longer, and the least.
PROSE, MIN_PROSE = 44, 28

#: Codes of a terminal for titles and answers, for the recommended row, for what is bad and doubtful, and for notes.
STRONG, GOOD, BAD, DOUBTFUL, FAINT = "1", "1;32", "1;31", "33", "2"

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
    answer: Sequence[str] = (),
    least: Sequence[str] = (),
    marked: int | None = None,
    width: int = UNLIMITED,
    bold: bool = False,
) -> list[str]:
    """The lines of a table.

    Args:
        title: the line above the table.
        columns: the names of the columns; those that end in ``>`` are flush right, and their cells are never wrapped.
        rows: the cells of each row.
        notes: sentences below the table.
        answer: sentences above it, the first of which is the answer.
        least: the names of columns that are left out where the table is too wide, the first one first.
        marked: the number of the recommended row.
        width: the most characters of a line; a longer word stays whole.
        bold: whether to use colours and bold letters, by escape codes of terminals.
    """
    names = [name.removesuffix(">") for name in columns]
    right = [name.endswith(">") for name in columns]
    cells = [[str(cell) for cell in row] for row in rows]
    whole = [flush or i == 0 for i, flush in enumerate(right)]
    wide = [max(map(length, column)) for column in zip(names, *cells, strict=True)]
    prose = max(MIN_PROSE, min(PROSE, width - wide[0] - len(GAP)))
    narrow = [_least(name, [row[i] for row in cells], None if whole[i] else prose) for i, name in enumerate(names)]
    shown, left_out = _shown(names, narrow, width, least)

    lines = [styled(line, GOOD if i == 0 else "", bold) for i, text in enumerate(answer) for line in wrapped(text, width)]
    lines += [""] * bool(answer)
    lines += [styled(line, STRONG, bold) for line in wrapped(title, width)]
    for part in _parts(shown, narrow, width):
        widths = _widths([wide[i] for i in part], [narrow[i] for i in part], width)
        lines.append("")
        head = _row([names[i] for i in part], widths, [right[i] for i in part], bottom=True)
        lines += [styled(line, STRONG, bold) for line in head]
        lines.append("─" * min(width, sum(widths) + len(GAP) * (len(widths) - 1)))
        for number, row in enumerate(cells):
            texts = _row([row[i] for i in part], widths, [right[i] for i in part])
            lines += [styled(line, GOOD if number == marked else "", bold) for line in texts]
    if left_out:
        notes = [f"Left out, as the terminal is narrow: {', '.join(left_out)}; a pipe and --json have all.", *notes]
    if notes:
        lines.append("")
    for note in notes:
        lines += [styled(line, FAINT, bold) for line in wrapped(note, width)]
    return lines


def _shown(names: Sequence[str], narrow: Sequence[int], width: int, least: Sequence[str]) -> tuple[list[int], list[str]]:
    """The indices of the columns that are shown, and the names of those that are left out: as few of ``least`` as need be."""
    shown = list(range(len(names)))
    for name in least:
        if sum(narrow[i] for i in shown) + len(GAP) * (len(shown) - 1) <= width:
            break
        shown.remove(names.index(name))
    return shown, [name for i, name in enumerate(names) if i not in shown]


def length(text: str) -> int:
    """The number of places that a text takes on a terminal."""
    return sum(0 if combining(c) else 2 if east_asian_width(c) in "WF" else 1 for c in text)


def _least(name: str, cells: Sequence[str], prose: int | None) -> int:
    """The least width of a column: its longest word, and for prose at least that width; None for cells that stay whole."""
    words = [length(word) for word in name.split()]
    if prose is None:
        return max([*words, *map(length, cells)], default=0)
    longest = max([length(word) for cell in cells for word in cell.split()], default=0)
    return max([*words, longest, min(prose, max(map(length, cells), default=0))], default=0)


def _parts(shown: Sequence[int], narrow: Sequence[int], width: int) -> list[list[int]]:
    """The indices of the columns of each table: as many as fit, the first column in each."""
    first = shown[0]
    parts, room = [[first]], width - narrow[first]
    for i in shown[1:]:
        needed = narrow[i] + len(GAP)
        if needed > room and len(parts[-1]) > 1:
            parts.append([first])
            room = width - narrow[first]
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
    columns = [wrapped(cell, width) or [""] for cell, width in zip(cells, widths, strict=True)]
    height = max(map(len, columns))
    padded = [[""] * (height - len(c)) + c if bottom else c + [""] * (height - len(c)) for c in columns]
    lines = []
    for parts in zip(*padded, strict=True):
        spaces = [" " * max(0, width - length(part)) for part, width in zip(parts, widths, strict=True)]
        texts = [space + part if flush else part + space for part, space, flush in zip(parts, spaces, right, strict=True)]
        lines.append(GAP.join(texts).rstrip())
    return lines


def wrapped(text: str, width: int, indent: str = "") -> list[str]:
    """The lines of a text, wrapped between words only; those after the first are indented."""
    if length(text) <= width:
        return [text]
    return textwrap.wrap(text, width, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False)


def styled(text: str, code: str, bold: bool) -> str:
    """The text in the colour or weight of a code, if that is used at all."""
    return f"\033[{code}m{text}\033[0m" if bold and text and code else text
