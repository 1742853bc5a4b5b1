"""A long step as loops over equal operations, on arrays.

A loop makes operations of the same kind whose operands are in the same arrays and that do not depend on each other: the forces of
all springs, for example, then their sums by particles. The operations are those of the tape, each rounded by itself, so the bits
are those of straight lines. Where operands do not follow each other at equal distances, a table has their places.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import NamedTuple

from ..explanation.formula import COMPARISON, Formula
from .branches import kind_of
from .language import Language
from .program import Loop
from .tapes import Operations

#: The array of a number and its index there; or a value that is the same for all, and −1.
Place = tuple[str, int]

#: The arrays of the values that are computed in a function, and before the steps.
WORK, MADE = "w", "made"


class NoLoopError(Exception):
    """An operation cannot be written as a loop."""


class Looped(NamedTuple):
    """The loops that compute the values of a function, in order; the length of the array of results; the places of the roots."""

    loops: list[Loop]
    size: int
    places: list[Place]


class Writer:
    """Writes loops, and collects the tables of places."""

    def __init__(self, operations: Operations, language: Language) -> None:
        self.all, self.language = operations.all, language
        self.tables: dict[tuple[int, ...], str] = {}
        self._kinds: list[str] = []
        for node in self.all:
            self._kinds.append(kind_of(node, self._kinds.__getitem__, self._constant, language.all_bits))

    def _constant(self, line: int) -> int | None:
        name, _, bits = self.all[line]
        return bits if name == "constant" else None

    def looped(self, lines: Sequence[int], roots: Sequence[int], source: Callable[[int], Place], *, keep: bool) -> Looped:
        """Operations in order, operands first; with ``keep`` each has a place of its own in the array before the steps."""
        depth: dict[int, int] = {}
        groups: dict[tuple[object, ...], list[int]] = defaultdict(list)
        array = MADE if keep else WORK

        def space(line: int) -> object:
            return (array,) if line in depth else self.all[line] if self._constant(line) is not None else source(line)[:1]

        for line in lines:
            name, of, extra = self.all[line]
            if self._kinds[line] == "bits":
                raise NoLoopError
            depth[line] = 1 + max(depth.get(each, 0) for each in of)
            groups[depth[line], name, extra, *map(space, of)].append(line)
        ordered = sorted(groups.values(), key=lambda group: (depth[group[0]], group[0]))
        begins, size = self._begins(ordered, roots, keep)
        place = {line: (array, begin + i) for group, begin in zip(ordered, begins, strict=True) for i, line in enumerate(group)}

        def where(line: int) -> Place:
            return place[line] if line in place else source(line)

        loops = [
            Loop(len(group), self.at(array, range(begin, begin + len(group))), self._text(group, where))
            for group, begin in zip(ordered, begins, strict=True)
        ]
        return Looped(loops, size, [where(each) for each in roots])

    def _begins(self, groups: Sequence[Sequence[int]], roots: Sequence[int], keep: bool) -> tuple[list[int], int]:
        """The first index of each group in the array, and the length of the array; places are reused after their last reading."""
        last = {line: i for i, group in enumerate(groups) for each in group for line in self.all[each][1]}
        last |= dict.fromkeys(roots, len(groups))
        taken: list[tuple[int, int, int]] = []  # begin, end, and the group that reads it last
        begins: list[int] = []
        for i, group in enumerate(groups):
            begin = 0
            taken = [each for each in taken if keep or each[2] >= i]
            for other, end, _ in sorted(taken):
                if begin + len(group) <= other:
                    break
                begin = max(begin, end)
            taken.append((begin, begin + len(group), max(last.get(line, i) for line in group)))
            begins.append(begin)
        return begins, max((begin + len(group) for begin, group in zip(begins, groups, strict=True)), default=0)

    def _text(self, group: Sequence[int], where: Callable[[int], Place]) -> str:
        """The formula of a group's operation."""
        name, of, extra = self.all[group[0]]
        bits = [self._constant(each) for each in of]
        operands = []
        for i, known in enumerate(bits):
            if known is not None:
                operands.append(self.language.number(known))
                continue
            places = [where(self.all[line][1][i]) for line in group]
            text = self.at(places[0][0], [at for _, at in places])
            if self._kinds[of[i]] == "truth":
                operands.append(Formula(f"{text} != {self.language.literal(0.0)}", COMPARISON, is_truth=True))
            else:
                operands.append(Formula(text))
        value = self.language.formula(name, operands, extra, bits)
        if value.is_truth:
            value = Formula(self.language.choice(value, *(Formula(self.language.literal(x)) for x in (1.0, 0.0))))
        return self.language.text(value.text)

    def at(self, array: str, places: Sequence[int]) -> str:
        """The expression of the element of an array in iteration i, from its place in each; a value for all is itself."""
        if min(places) < 0:
            return array
        step = places[1] - places[0] if len(places) > 1 else 0
        if all(b - a == step for a, b in pairwise(places)) and step >= 0:
            index = {0: "", 1: "i"}.get(step, f"{step} * i")
            begin = str(places[0]) if places[0] or not index else ""
            return f"{array}[{' + '.join(filter(None, (begin, index)))}]"
        table = self.tables.setdefault(tuple(places), f"places_{len(self.tables)}")
        return f"{array}[{self.language.table_name(table)}[i]]"

    def moved(self, begin_places: Sequence[Place], to: Sequence[Place]) -> list[Loop]:
        """Loops that write values to other arrays."""
        loops: list[Loop] = []
        begin = 0
        for i in range(1, len(begin_places) + 1):
            if i == len(begin_places) or (begin_places[i][0], to[i][0]) != (begin_places[begin][0], to[begin][0]):
                ((array, _), *_), ((target, _), *_) = begin_places[begin:i], to[begin:i]
                text = self.at(array, [at for _, at in begin_places[begin:i]])
                loops.append(Loop(i - begin, self.at(target, [at for _, at in to[begin:i]]), text))
                begin = i
        return loops
