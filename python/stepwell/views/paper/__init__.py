"""The statements of Hoffmann (2002), each with its place in stepwell and a check that runs it.

A module here is a part of Hoffmann (2002), and a function is the check of one statement: an algorithm, a formula, a program, a
figure, a piece of advice. It compares the numbers computed here with those of Hoffmann (2002). ``docs/theory/paper.md`` and the
command ``stepwell paper`` are generated from these entries, and the tests run them all.
"""

from __future__ import annotations

import importlib
import re
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from ...base import checks, paths
from ...base.reprs import MAX_LINE, facts, shortened
from ...errors import ArgumentError

#: The modules, in the order of Hoffmann (2002).
MODULES = ("introduction", "transform", "methods", "constraints", "series", "programs", "bodies", "aircraft")

#: The kinds of statement.
KINDS = ("requirement", "formula", "algorithm", "program", "figure", "advice", "warning")


class Finding(NamedTuple):
    """The result of the check of a statement.

    Attributes:
        holds: whether stepwell confirms the statement, or its correction where Hoffmann is wrong.
        numbers: the numbers that show it, as a short text.
    """

    holds: bool
    numbers: str

    def _repr_html_(self) -> str:
        return facts("Checked", [("holds", "yes" if self.holds else "no"), ("numbers", self.numbers)])


class Entry(NamedTuple):
    """A statement of Hoffmann (2002).

    Attributes:
        section: as Hoffmann numbers it: ``§7``, ``App. C``.
        kind: one of ``KINDS``.
        says: the statement, in our words.
        here: the functions and commands of stepwell that it concerns.
        corrected: the correction, where Hoffmann is wrong or claims too much; empty where the statement holds.
        check: the function that checks it.
        picture: the file name of its picture; empty without one.
        draw: draws the picture into a file; None without one.
    """

    section: str
    kind: str
    says: str
    here: str
    corrected: str
    check: Callable[[], Finding]
    picture: str
    draw: Callable[[Path], object] | None

    def __repr__(self) -> str:
        return shortened(f"<Hoffmann (2002), {self.section}, {self.kind}: {self.says}>", MAX_LINE)

    def _repr_html_(self) -> str:
        pairs = [("kind", self.kind), ("statement", self.says), ("correction", self.corrected), ("in stepwell", self.here)]
        return facts(f"Hoffmann (2002), {self.section}", [*pairs, ("picture", self.picture)])

    @property
    def name(self) -> str:
        """The name of its check."""
        return self.check.__name__

    def run(self) -> Finding:
        """Run its check."""
        return self.check()


class Section:
    """A decorator of checks: each becomes an entry of one section.

    Args:
        section: as Hoffmann numbers it: ``§7``, ``App. C``.
    """

    def __init__(self, section: str) -> None:
        self.section = section

    def __call__(
        self, kind: str, says: str, here: str, corrected: str = "", draw: Callable[[Path], object] | None = None
    ) -> Callable[[Callable[[], Finding]], Callable[[], Finding]]:
        """The decorator of one check. The arguments are the attributes of ``Entry``."""
        assert kind in KINDS, kind

        def add(check: Callable[[], Finding]) -> Callable[[], Finding]:
            place = re.sub(r"[^0-9A-Z]", "", self.section.replace("App.", "")).rjust(2, "0")
            picture = "" if draw is None else f"{place}-{check.__name__.replace('_', '-')}.png"
            _ENTRIES.append(Entry(self.section, kind, says, here, corrected, check, picture, draw))
            return check

        return add


_ENTRIES: list[Entry] = []


def entries(section: str | None = None) -> tuple[Entry, ...]:
    """Hoffmann's statements, in its order.

    Args:
        section: ``"§7"`` or ``"App. C"`` for those of one section; all if None.

    Returns:
        An ``Entry`` for each.

    Example:
        >>> [entry.kind for entry in sw.paper.entries("§5")]
        ['algorithm', 'formula', 'figure']
    """
    for module in MODULES:
        importlib.import_module(f"{__name__}.{module}")
    ordered = sorted(_ENTRIES, key=lambda entry: _order(entry.section))  # sorting keeps the order within a section
    if section is None:
        return tuple(ordered)
    known = list(dict.fromkeys(entry.section for entry in ordered))
    section = checks.known("section", section, known)
    return tuple(entry for entry in ordered if entry.section == section)


def _order(section: str) -> tuple[int, str]:
    if section.startswith("§"):
        return int(section[1:]), ""
    return 100, section


def draw(folder: str | Path, section: str | None = None) -> list[Path]:
    """Draw every figure of Hoffmann (2002), or those of a section, into a folder.

    Args:
        folder: the folder; it is created if it does not exist.
        section: as in ``entries``.

    Returns:
        The paths, in the order of Hoffmann (2002).
    """
    from ...base.pictures import new_figure

    chosen = [entry for entry in entries(section) if entry.draw is not None]
    if not chosen:
        raise ArgumentError(f"section: {section} has no figure")
    place = paths.folder("folder", folder, [entry.picture for entry in chosen])
    new_figure(1.0, 1.0)  # raises an error without matplotlib, before the folder is created
    place.mkdir(parents=True, exist_ok=True)
    for entry in chosen:
        assert entry.draw is not None
        entry.draw(place / entry.picture)
    return [place / entry.picture for entry in chosen]
