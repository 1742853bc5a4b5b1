"""Branches of an exported step: values that only one side of a choice reads, such as the forces of a contact.

A tape has no branches: it computes both sides of a choice. In a file the expensive side is in an ``if``. A choice by ``p and q``
becomes a choice by q within one by p, so that q is only computed where p holds. All values that are used have the same bits.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from ...reference.tape.operations import COMPARISONS, ON_BITS, OPERATIONS

#: The cycles that a mispredicted branch costs: a side that takes fewer is always computed.
WORTH = 16

#: About the cycles of functions, and of constants.
CYCLES = {"sine": 20, "cosine": 20, "logarithm": 30, "constant": 0}

#: Operations on bits that are operations on truths, too.
ON_TRUTHS = ("and", "or", "exclusive or")

#: Operations that may be a choice: ``p and q`` is q where p holds, else p.
CHOICES = ("choose", "and", "or")

#: The name, the operands and the extra argument of each operation.
Operations = Sequence[tuple[str, tuple[int, ...], int]]

#: Conditions, each with the side on which a value is read, the outermost first.
Path = tuple[tuple[int, bool], ...]


class Node(NamedTuple):
    """An operation: its name, its operands, and its extra argument."""

    name: str
    of: tuple[int, ...]
    extra: int


@dataclass(eq=False)
class Branch:
    """An ``if``: the number of its condition, what is computed if it holds and if not, and the choices that it makes.

    ``keeps`` are values of a side that are read after the branch.
    """

    condition: int
    sides: tuple[list[Item], list[Item]]
    sets: list[int]
    keeps: list[int] = field(default_factory=list)


Item = int | Branch


class Branched:
    """The operations of a function, arranged in branches.

    Attributes:
        operations: all operations of the file.
        order: the numbers of the operations that the function needs, each after its operands.
        nodes: these operations, by their numbers; those that were split off from choices have numbers of their own.
        items: values and branches in the order in which they are computed.
        expensive: for each choice that a branch makes, whether its sides are computed within the branch.
        same: for a choice that is a side of another one, the outer one: one variable serves both.
    """

    def __init__(self, operations: Operations, roots: Iterable[int], leaves: Iterable[int], all_bits: int) -> None:
        self._roots, self._leaves, self.all_bits = list(roots), set(leaves), all_bits
        self.operations = [Node(*each) for each in operations]
        self.nodes: dict[int, Node] = {}
        self.order: list[int] = []
        self._paths: dict[int, Path] = {}
        self._joint: set[int] = set()  # choices with two expensive sides, whose condition is not split
        self._cheap: set[Path] = set()  # sides that are always computed
        self._kinds: dict[int, str] = {}
        self._take()
        self._split()
        self._simplify()
        self._split()
        self.expensive = {line: expensive for line in self._choices() if any(expensive := self._are_dear(line))}
        self.same: dict[int, int] = {}
        #: Values without operands, which are read where they are needed.
        self._done = self._leaves | {line for line in self.order if not self.nodes[line].of}
        self.items = self._arranged((), self.order)
        self._keep()
        self._share()

    @property
    def is_straight(self) -> bool:
        """True if the function has no branches, or none that can be written."""
        read_later = [each for branch in branches(self.items) for each in branch.keeps]
        return not self.expensive or any(self.kind(each) == "bits" for each in read_later)

    def kind(self, line: int) -> str:
        """The kind of a value: "truth", "bits" or "number"; "any" for a constant that may be each."""
        if line not in self._kinds:
            node = self.nodes[line] if line in self.nodes else self.operations[line]
            self._kinds[line] = kind_of(node, self.kind, self.constant, self.all_bits)
        return self._kinds[line]

    def constant(self, line: int) -> int | None:
        """The bits of a constant, else None."""
        name, _, bits = self.nodes[line] if line in self.nodes else self.operations[line]
        return bits if name == "constant" else None

    def _take(self) -> None:
        """Collect the operations that the roots need."""
        waiting = list(self._roots)
        while waiting:
            line = waiting.pop()
            if line not in self.nodes and line not in self._leaves:
                self.nodes[line] = self.operations[line]
                waiting += self.nodes[line].of
        self.order = sorted(self.nodes)

    # ---- which values are read on one side alone

    def _find_dear_paths(self) -> None:
        """Find the paths of all values, such that each side costs at least as much as a branch."""
        while True:
            self._find_paths()
            costs: dict[Path, int] = defaultdict(int)
            for line, path in self._paths.items():
                name = self.nodes[line].name
                cycles = OPERATIONS[name].cycles if name in OPERATIONS else CYCLES.get(name, 1)
                for depth in range(1, len(path) + 1):
                    costs[path[:depth]] += cycles
            cheap = {path for path, cost in costs.items() if cost < WORTH}
            both = {line for line in self._choices() if line not in self._joint and all(self._are_dear(line))}
            if not cheap and not both:
                return
            self._cheap |= cheap
            if not cheap:
                self._joint |= both
                self._cheap.clear()

    def _find_paths(self) -> None:
        """Find the path of each value: the sides of conditions that all its readers have in common."""
        paths: dict[int, Path] = dict.fromkeys(self._roots, ())
        self._paths.clear()
        for line in reversed(self.order):
            if line not in paths:
                continue  # nothing reads it
            path = self._paths[line] = paths[line]
            if (sides := self._sides(line)) is None:
                for of in self.nodes[line].of:
                    paths[of] = _common(paths[of], path) if of in paths else path
                continue
            for of, side in self._reads(line, sides):
                longer = path
                for each in side:
                    if (*longer, each) in self._cheap:
                        break
                    longer = (*longer, each)
                paths[of] = _common(paths[of], longer) if of in paths else longer
        self.order = [line for line in self.order if line in self._paths]

    def _reads(self, line: int, sides: tuple[int, int | None, int | None]) -> list[tuple[int, Path]]:
        """The operands of a choice, each with the sides of the conditions on which it reads them."""
        condition, *values = sides
        read = [(of, self._side(line, side)) for of, side in zip(values, (True, False), strict=True) if of is not None]
        return [(condition, ()), *read]

    def _choices(self) -> list[int]:
        return [line for line in self.order if self.nodes[line].name in CHOICES and self._sides(line) is not None]

    def _side(self, line: int, side: bool) -> Path:
        """A side of a choice as a path: p and then q for the side where ``p and q`` holds, likewise where ``p or q`` does not."""
        condition = self._sides(line)[0]  # type: ignore[index]
        return ((condition, side),) if line in self._joint else self._parts(condition, side)

    def _parts(self, condition: int, side: bool) -> Path:
        name, of, _ = self.operations[condition]
        if condition in self._leaves or name not in ("and", "or") or not all(self.kind(each) == "truth" for each in of):
            return ((condition, side),)
        if name != ("and" if side else "or"):
            return ((condition, side),) if side else ()  # usually not all of several hold: that side is always computed
        parts = [self._parts(each, side) for each in sorted(of)]
        return tuple(part for each in parts for part in each) if all(parts) else ()

    def _sides(self, line: int) -> tuple[int, int | None, int | None] | None:
        """The condition of a choice, and its values if it holds and if not; None stands for the truth of the condition."""
        node = self.nodes[line]
        if node.name == "choose":
            condition, a, b = node.of
            return (condition, a, b) if self.kind(line) in ("truth", "number") else None
        if node.name in CHOICES and self.kind(line) == "truth" and all(self.constant(each) is None for each in node.of):
            p, q = sorted(node.of)
            return (p, q, None) if node.name == "and" else (p, None, q)
        return None

    def _are_dear(self, line: int) -> tuple[bool, bool]:
        """True if each side of a choice is computed on that side only."""
        if (sides := self._sides(line)) is None:
            return False, False
        path = self._paths[line]
        sides_expensive = []
        for of, side in zip(sides[1:], (True, False), strict=True):
            begin = (*path, *self._side(line, side)[:1])
            sides_expensive.append(len(begin) > len(path) and of in self._paths and self._paths[of][: len(begin)] == begin)
        return sides_expensive[0], sides_expensive[1]

    def _split(self) -> None:
        """Replace each choice that a branch makes by choices within each other, each by a single condition."""
        while True:
            self._find_dear_paths()
            order, choices = list[int](), set(self._choices())
            for line in self.order:
                expensive = self._are_dear(line) if line in choices else (False, False)
                if any(expensive) and not (self.nodes[line].name == "choose" and len(self._side(line, expensive[0])) == 1):
                    order += self._in_parts(line, expensive[0])
                order.append(line)
            if order == self.order:
                return
            self.order = order
            self._kinds.clear()

    def _in_parts(self, line: int, side: bool) -> list[int]:
        """Replace a choice by choices within each other, the innermost with that side; returns the new operations, in order."""
        _, *values = self._sides(line)  # type: ignore[misc]
        new: list[int] = []

        def add(node: Node) -> int:
            new.append(max(len(self.operations), *self.nodes) + 1)
            self.nodes[new[-1]] = node
            return new[-1]

        truths = 0, self.all_bits
        a, b = (add(Node("constant", (), truths[i])) if of is None else of for of, i in zip(values, (True, False), strict=True))
        *outer, (last, _) = self._side(line, side)
        choice = Node("choose", (last, a, b), 0)
        for condition, _ in reversed(outer):
            inner = add(choice)
            choice = Node("choose", (condition, inner, b) if side else (condition, a, inner), 0)
        self.nodes[line] = choice
        return new

    def _simplify(self) -> None:
        """Replace choices whose condition is known where they are read by one of their sides."""
        instead: dict[int, int] = {}
        for line in self.order:
            node, known = self.nodes[line], dict(self._paths[line])
            self.nodes[line] = node = node._replace(of=tuple(instead.get(each, each) for each in node.of))
            if node.name == "choose" and (truth := self._truth(node.of[0], known)) is not None:
                instead[line] = node.of[1 if truth else 2]

    def _truth(self, condition: int, known: dict[int, bool]) -> bool | None:
        """True or False if a condition follows from known ones; else None."""
        if condition in known:
            return known[condition]
        name, of, _ = self.nodes[condition] if condition in self.nodes else self.operations[condition]
        if name not in ("and", "or"):
            return None
        truths = [self._truth(each, known) for each in of]
        decisive = name == "or"
        return decisive if decisive in truths else None if None in truths else not decisive

    def _share(self) -> None:
        """Find choices that are a side of another choice and whose cheap side is also that of the other."""
        readers: dict[int, set[int]] = defaultdict(set)
        for line in self.order:
            for of in self.nodes[line].of:
                readers[of].add(line)
        for line, expensive in self.expensive.items():
            for inner, other, is_expensive in zip(self.nodes[line].of[1:], self.nodes[line].of[:0:-1], expensive, strict=True):
                if is_expensive and not all(expensive) and inner in self.expensive and readers[inner] == {line}:
                    own = [
                        of
                        for of, is_expensive in zip(self.nodes[inner].of[1:], self.expensive[inner], strict=True)
                        if not is_expensive
                    ]
                    if own == [other]:
                        self.same[inner] = line

    # ---- in which order

    def _arranged(self, path: Path, lines: Sequence[int]) -> list[Item]:
        """Write values in order: those on this path by themselves, others in branches."""
        here = [line for line in lines if self._paths[line] == path and line not in self._done]
        items: list[Item] = []
        for line in here:
            if line in self._done:
                continue
            if line not in self.expensive:
                items.append(line)
                self._done.add(line)
                continue
            condition = self.nodes[line].of[0]
            group = [line]
            for other in here[here.index(line) + 1 :]:
                if other in self.expensive and other not in self._done and self.nodes[other].of[0] == condition:
                    ahead = self._ahead(other)
                    if not any(each in self.expensive for each in ahead):
                        items += ahead
                        self._done.update(ahead)
                        group.append(other)
            sides = tuple(self._of_side(path, condition, side, group) for side in (True, False))
            self._done.update(group)
            items.append(Branch(condition, sides, group))  # type: ignore[arg-type]
        return items

    def _ahead(self, line: int) -> list[int]:
        """The values outside of the sides of a choice that must be computed before it, in order."""
        path = self._paths[line]
        ahead: set[int] = set()
        waiting = list(self.nodes[line].of)
        while waiting:
            each = waiting.pop()
            if each not in self._done and each not in ahead:
                ahead.add(each)
                waiting += self.nodes[each].of
        return [each for each in self.order if each in ahead and self._paths[each] == path]

    def _of_side(self, path: Path, condition: int, side: bool, group: Sequence[int]) -> list[Item]:
        inner = (*path, (condition, side))
        inside: set[int] = set()
        waiting = [self.nodes[line].of[2 - side] for line in group if self.expensive[line][not side]]
        while waiting:
            each = waiting.pop()
            if each not in self._done and each not in inside and self._paths[each][: len(inner)] == inner:
                inside.add(each)
                waiting += self.nodes[each].of
        return self._arranged(inner, [each for each in self.order if each in inside])

    # ---- what is read behind a branch

    def _keep(self) -> None:
        """Record for each branch the values of its sides that are read after it."""
        places: dict[int, tuple[Branch, ...]] = {}

        def note(items: Sequence[Item], within: tuple[Branch, ...]) -> None:
            for item in items:
                if isinstance(item, Branch):
                    places.update(dict.fromkeys(item.sets, within))
                    for side in item.sides:
                        note(side, (*within, item))
                else:
                    places[item] = within

        note(self.items, ())
        for line in self.order:
            for of in self.nodes[line].of:
                for i, branch in enumerate(places.get(of, ())):
                    if branch not in places[line][i : i + 1] and line not in branch.sets and of not in branch.keeps:
                        branch.keeps.append(of)


def kind_of(
    node: tuple[str, tuple[int, ...], int], kind: Callable[[int], str], constant: Callable[[int], int | None], all_bits: int
) -> str:
    """The kind of an operation: "truth", "bits" or "number"; "any" for a constant that may be each."""
    name, of, extra = node
    if name == "constant":
        return "any" if extra in (0, all_bits) else "number"
    if name in COMPARISONS:
        return "truth"
    if name in ON_TRUTHS:
        kinds = {kind(each) for each in of}
        is_magnitude = name == "and" and any(constant(each) == all_bits >> 1 for each in of)
        return "truth" if kinds <= {"truth", "any"} else "number" if is_magnitude and kinds == {"number"} else "bits"
    if name in ON_BITS:
        return "bits"
    if name == "choose":
        kinds = {kind(each) for each in of[1:]}
        if kind(of[0]) != "truth" or "bits" in kinds or {"truth", "number"} <= kinds:
            return "bits"
        return "truth" if "truth" in kinds else "number"
    return "number"


def _common(a: Path, b: Path) -> Path:
    if a == b:
        return a
    n = 0
    while n < min(len(a), len(b)) and a[n] == b[n]:
        n += 1
    return a[:n]


def branches(items: Sequence[Item]) -> list[Branch]:
    """All branches among these items, and those within them."""
    every: list[Branch] = []
    for item in items:
        if isinstance(item, Branch):
            every += [item, *(inner for side in item.sides for inner in branches(side))]
    return every
