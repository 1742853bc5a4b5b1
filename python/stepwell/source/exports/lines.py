"""Lines of a file: indented, filled with numbers, or as a comment."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

#: The most characters of a line of numbers.
WIDTH = 100


def indented(lines: Iterable[str], by: str = "    ") -> list[str]:
    """Lines indented by at least this much."""
    return [by + line if line else "" for line in lines]


def listed(begin: str, items: Sequence[str], end: str, indent: str = "") -> list[str]:
    """Words between two texts, in one line or in several."""
    if len(one := indent + begin + ", ".join(items) + end) <= WIDTH:
        return [one]
    lines, line = [indent + begin], indent + "   "
    for item in items:
        if len(line) + len(item) > WIDTH - 2 and line.strip():
            lines.append(line)
            line = indent + "   "
        line += f" {item},"
    return [*lines, line, indent + end]


def printable(line: str) -> str:
    """A text without characters that would end a comment or join lines."""
    line = "".join(letter if letter.isprintable() else " " for letter in line)
    return line.replace("*/", "* /").replace("??", "? ?").rstrip("\\ ")
