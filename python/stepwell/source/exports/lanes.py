"""A long step as loops of whole formulas: one over springs, some for their sums by particles, one over particles.

A lane is what one iteration computes. Equal operations are lanes of one loop if each lane reads from its own lane, from values
that other loops have stored, or from the state; so values that only their lane reads have a name and no place in memory. Sums of
several equal terms, such as the forces of the springs at a particle, end a loop: they have as many terms as there are springs,
and are loops of their own, over all sums that have a next term. The operations are those of the tape, so the bits are the same.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, field
from graphlib import CycleError, TopologicalSorter

from .loops import NoLoopError, Place
from .tapes import Operations

#: Operations whose operands may change places; which of several NaNs comes out is not specified.
COMMUTATIVE = ("add", "multiply")

#: A value without operands that more operations read than this is one number for all, such as gravity, and no array's element.
SHARED = 16

#: How often lanes are arranged anew, when some that seemed to match do not, before there are none.
ATTEMPTS = 30


@dataclass
class Kernel:
    """A loop over lanes.

    Attributes:
        level: loops of lower levels come first.
        groups: for each operation of a lane, its number in each lane.
    """

    level: int
    groups: dict[int, list[int]] = field(default_factory=dict)

    @property
    def size(self) -> int:
        """The number of lanes."""
        return len(next(iter(self.groups.values())))

    def merge(self, other: Kernel, lanes: Sequence[int]) -> None:
        """Take in the operations of another loop, whose lane i is here ``lanes[i]``."""
        for name, lines in other.groups.items():
            ordered = [0] * len(lines)
            for lane, line in zip(lanes, lines, strict=True):
                ordered[lane] = line
            self.groups[name] = ordered


class Lanes:
    """The loops that compute some operations, in order; lanes of a loop have their operands, ``of``, in the same order."""

    def __init__(
        self,
        operations: Operations,
        lines: Sequence[int],
        source: Callable[[int], Place],
        label: Callable[[int], tuple[Hashable, Hashable]],
    ) -> None:
        self._all, self._lines = operations.all, lines
        self.of: dict[int, tuple[int, ...]] = {}
        self._sums: set[int] = set()
        self._groups = self._grouped(source, label)
        self._group = {line: i for i, group in enumerate(self._groups) for line in group}
        apart: set[tuple[int, int]] = set()
        for _ in range(ATTEMPTS):
            kernels = self._arranged(apart)
            if kernels is not None:
                self.kernels = kernels
                return
        raise NoLoopError

    def _grouped(self, source: Callable[[int], Place], label: Callable[[int], tuple[Hashable, Hashable]]) -> list[list[int]]:
        """Equal operations: of the same form, down to the state, in which all sums of equal terms are one form."""
        ids: dict[Hashable, int] = {}

        def known(key: Hashable) -> int:
            return ids.setdefault(key, len(ids))

        # The form of each value, its form with all coordinates alike, and the same of a term that is summed.
        forms: dict[int, tuple[int, int]] = {}
        terms: dict[int, tuple[int, int]] = {}
        depth: dict[int, int] = {}
        summed: set[int] = set()
        maybe: set[int] = set()
        for line in self._lines:
            name, of, extra = self._all[line]
            pairs = [forms[each] if each in forms else tuple(map(known, label(each))) for each in of]
            if name in COMMUTATIVE and pairs[0] > pairs[1]:
                of, pairs = of[::-1], pairs[::-1]
            self.of[line] = of
            depth[line] = 1 + max(depth.get(each, 0) for each in of)
            if name in ("add", "subtract") and all(each in terms for each in of) and terms[of[0]] == terms[of[1]]:
                terms[line] = terms[of[0]]
                forms[line] = known(("sum", terms[line][0])), known(("sum of any", terms[line][1]))
                maybe.add(line)
                if any(each in maybe for each in of):
                    summed.add(terms[line][0])
                continue
            forms[line] = known((name, extra, *(a for a, _ in pairs))), known((name, extra, "any", *(b for _, b in pairs)))
            terms[line] = terms[of[0]] if name == "negate" and of[0] in terms else forms[line]
        self._sums = {line for line in maybe if terms[line][0] in summed}
        groups: dict[Hashable, list[int]] = defaultdict(list)
        for line in self._lines:
            name, _, extra = self._all[line]
            if line in self._sums:
                groups["sum", terms[line][1], depth[line], name].append(line)
                continue
            spaces = [None if each in forms else self._space(each, source) for each in self.of[line]]
            groups[forms[line][0], name, extra, *spaces].append(line)
        return list(groups.values())

    def _space(self, line: int, source: Callable[[int], Place]) -> Hashable:
        return self._all[line] if self._all[line][0] == "constant" else source(line)[0]

    def _arranged(self, apart: set[tuple[int, int]]) -> list[Kernel] | None:
        """The loops in order; None if lanes do not match, whose operands are then among those of loops before theirs."""
        edges: dict[int, dict[int, list[int]]] = {}  # by group and operand, the groups that are read
        own: dict[tuple[int, int], int] = {}  # those of the same lane
        for i, group in enumerate(self._groups):
            edges[i] = {}
            for k in range(len(self.of[group[0]])):
                read = [self.of[line][k] for line in group]
                others = sorted({self._group[each] for each in read if each in self._group})
                if not others:
                    continue
                edges[i][k] = others
                (other, *more) = others
                if not (
                    more
                    or (i, k) in apart
                    or group[0] in self._sums
                    or self._groups[other][0] in self._sums
                    or len(set(read)) != len(self._groups[other])
                    or len(read) != len(self._groups[other])
                ):
                    own[i, k] = other
        try:
            order = list(
                TopologicalSorter({i: {each for of in read.values() for each in of} for i, read in edges.items()}).static_order()
            )
        except CycleError:
            raise NoLoopError from None
        level = dict.fromkeys(order, 0)
        readers: dict[int, list[tuple[int, bool]]] = defaultdict(list)
        for i in order:
            for k, others in edges[i].items():
                for each in others:
                    level[i] = max(level[i], level[each] + ((i, k) not in own))
                    readers[each].append((i, (i, k) in own))
        for i in reversed(order):  # what only later loops read is computed there
            if readers[i]:
                level[i] = max(level[i], min(level[each] - (not in_lane) for each, in_lane in readers[i]))
        kernel = {i: Kernel(level[i], {i: list(self._groups[i])}) for i in order}
        for i in order:
            for k in edges[i]:
                if (i, k) not in own or level[own[i, k]] != level[i]:
                    continue
                other = own[i, k]
                a, b = kernel[i], kernel[other]
                read = [self.of[line][k] for line in a.groups[i]]
                if a is b:
                    if read != b.groups[other]:
                        apart.add((i, k))
                        return None
                    continue
                lane = {line: at for at, line in enumerate(b.groups[other])}
                b.merge(a, [lane[each] for each in read])
                kernel |= dict.fromkeys(a.groups, b)
        unique = {id(each): each for each in kernel.values()}
        return sorted(unique.values(), key=lambda each: each.level)


def lane_order(kernel: Kernel, of: Mapping[int, Sequence[int]], place: Callable[[int], Place | None]) -> list[int]:
    """The order of lanes in which they read the state in its order, if each reads its own numbers; else that of the tape."""
    for lines in kernel.groups.values():
        for k in range(len(of[lines[0]])):
            read = [place(of[line][k]) for line in lines]
            if read[0] is not None and read[0][1] >= 0 and len(set(read)) == len(lines):
                return sorted(range(len(lines)), key=lambda i: read[i] or ("", 0))
    first = next(iter(kernel.groups.values()))
    return sorted(range(len(first)), key=first.__getitem__)
