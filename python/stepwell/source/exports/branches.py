"""What a step computes only if something holds, such as a contact: values that only one side of a choice reads.

A tape has no branches: it computes both sides of a choice.
In a file the expensive side stands in an ``if``. A choice by
``p and q`` is one by q within one by p, so that q is computed where p holds. What is computed has the same bits, and what is not
computed was not taken.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from ...reference.tape.operations import COMPARISONS, ON_BITS, OPERATIONS

#: Cycles that a branch costs where it was predicted wrongly: a side that takes fewer is computed always.
WORTH = 16

#: Cycles of functions, about, and of constants.
CYCLES = {"sine": 20, "cosine": 20, "logarithm": 30, "constant": 0}

#: Operations on bits that truths have, too.
ON_TRUTHS = ("and", "or", "exclusive or")

#: Names, operands and other arguments.
Operations = Sequence[tuple[str, tuple[int, ...], int]]

#: Conditions, each with the side on which a value is read, the outermost first.
Path = tuple[tuple[int, bool], ...]


class Node(NamedTuple):
    """An operation: its name, its operands, and its other argument."""

    name: str
    of: tuple[int, ...]
    given: int


@dataclass(eq=False)
class Branch:
    """An ``if``.

    Attributes:
        condition: of whose truth.
        sides: what is computed if it holds, and if not.
        sets: the choices that it makes.
        keeps: values of a side that are read behind the branch.
    """

    condition: int
    sides: tuple[list[Item], list[Item]]
    sets: list[int]
    keeps: list[int] = field(default_factory=list)


Item = int | Branch


class Branched:
    """The operations of a function, arranged in branches.

    Attributes:
        operations: all operations, of which the first ``nodes`` are some.
        order: the numbers of those that are needed, each after its operands.
        nodes: the operations, by their numbers; those that were split off choices have numbers of their own.
        items: values and branches in the order in which they are computed.
        expensive: of each choice that a branch makes, whether its sides are computed within it.
        same: of a choice within another one the outer one, of which it is a side: one variable serves both.
    """

    def __init__(self, operations: Operations, roots: Iterable[int], leaves: Iterable[int], all_bits: int) -> None:
        self._roots, self._leaves, self.all_bits = list(roots), set(leaves), all_bits
        self.operations = [Node(*each) for each in operations]
        self.nodes: dict[int, Node] = {}
        self.order: list[int] = []
        self._paths: dict[int, Path] = {}
        self._joint: set[int] = set()  # choices with two expensive sides, by one condition even if it is made of several
        self._cheap: set[Path] = set()  # sides that are computed always
        self._kinds: dict[int, str] = {}
        self._take()
        self._split()
        self._simplify()
        self._split()
        self.expensive = {line: expensive for line in self.order if any(expensive := self._are_dear(line))}
        self.same: dict[int, int] = {}
        #: What is there without an operation; it is read where it is needed.
        self._done = self._leaves | {line for line in self.order if not self.nodes[line].of}
        self.items = self._arranged((), self.order)
        self._keep()
        self._share()

    @property
    def is_straight(self) -> bool:
        """Whether there is no branch that can be written."""
        kept = [each for branch in branches(self.items) for each in branch.keeps]
        return not self.expensive or any(self.kind(each) == "bits" for each in kept)

    def kind(self, line: int) -> str:
        """Of a value: "truth", "bits" or "number"; "any" of a constant that may be each."""
        if line not in self._kinds:
            node = self.nodes[line] if line in self.nodes else self.operations[line]
            self._kinds[line] = kind_of(node, self.kind, self.constant, self.all_bits)
        return self._kinds[line]

    def constant(self, line: int) -> int | None:
        """The bits of a constant, else None."""
        name, _, bits = self.nodes[line] if line in self.nodes else self.operations[line]
        return bits if name == "constant" else None

    def _take(self) -> None:
        """Take the operations that are needed."""
        waiting = list(self._roots)
        while waiting:
            line = waiting.pop()
            if line not in self.nodes and line not in self._leaves:
                self.nodes[line] = self.operations[line]
                waiting += self.nodes[line].of
        self.order = sorted(self.nodes)

    # ---- which values are read on one side alone

    def _find_dear_paths(self) -> None:
        """Find paths of which each side costs what a branch does, or more."""
        while True:
            self._find_paths()
            costs: dict[Path, int] = defaultdict(int)
            for line, path in self._paths.items():
                for depth in range(1, len(path) + 1):
                    costs[path[:depth]] += _cycles(self.nodes[line].name)
            cheap = {path for path, cost in costs.items() if cost < WORTH}
            both = {line for line in self.order if line not in self._joint and all(self._are_dear(line))}
            if not cheap and not both:
                return
            self._cheap |= cheap
            if not cheap:
                self._joint |= both
                self._cheap.clear()

    def _find_paths(self) -> None:
        """On which sides of which conditions each value is read: what is common to all that read it."""
        found: dict[int, Path] = dict.fromkeys(self._roots, ())
        self._paths.clear()
        for line in reversed(self.order):
            if line not in found:
                continue  # nothing reads it
            path = self._paths[line] = found[line]
            for of, side in self._reads(line):
                longer = path
                for each in side:
                    if (*longer, each) in self._cheap:
                        break
                    longer = (*longer, each)
                found[of] = _common(found[of], longer) if of in found else longer
        self.order = [line for line in self.order if line in self._paths]

    def _reads(self, line: int) -> list[tuple[int, Path]]:
        """The operands of an operation, and on which sides of which conditions it reads them."""
        if (sides := self._sides(line)) is None:
            return [(each, ()) for each in self.nodes[line].of]
        condition, *values = sides
        read = [(of, self._side(line, side)) for of, side in zip(values, (True, False), strict=True) if of is not None]
        return [(condition, ()), *read]

    def _side(self, line: int, side: bool) -> Path:
        """A side of a choice: by ``p and q`` what holds is p, and then q, and likewise what does not hold by ``p or q``."""
        condition = self._sides(line)[0]  # type: ignore[index]
        return ((condition, side),) if line in self._joint else self._parts(condition, side)

    def _parts(self, condition: int, side: bool) -> Path:
        name, of, _ = self.operations[condition]
        if condition in self._leaves or name not in ("and", "or") or not all(self.kind(each) == "truth" for each in of):
            return ((condition, side),)
        if name != ("and" if side else "or"):
            return ((condition, side),) if side else ()  # where not all of several hold is the usual case: it is computed always
        parts = [self._parts(each, side) for each in sorted(of)]
        return tuple(part for each in parts for part in each) if all(parts) else ()

    def _sides(self, line: int) -> tuple[int, int | None, int | None] | None:
        """Of a choice its condition, and its values if that holds and if not; None is the truth of the condition itself."""
        node = self.nodes[line]
        if self.kind(line) not in ("truth", "number") or (node.name != "choose" and self.kind(line) != "truth"):
            return None
        if node.name == "choose":
            condition, a, b = node.of
            return condition, a, b
        if node.name in ("and", "or") and all(self.constant(each) is None for each in node.of):
            p, q = sorted(node.of)
            return (p, q, None) if node.name == "and" else (p, None, q)
        return None

    def _are_dear(self, line: int) -> tuple[bool, bool]:
        """Whether the sides of a choice are computed there alone."""
        if (sides := self._sides(line)) is None:
            return False, False
        path = self._paths[line]
        found = []
        for of, side in zip(sides[1:], (True, False), strict=True):
            begin = (*path, *self._side(line, side)[:1])
            found.append(len(begin) > len(path) and of in self._paths and self._paths[of][: len(begin)] == begin)
        return found[0], found[1]

    def _split(self) -> None:
        """Make each choice that a branch will make one by one condition, or several of which one is within the other."""
        while True:
            self._find_dear_paths()
            order: list[int] = []
            for line in self.order:
                expensive = self._are_dear(line)
                if any(expensive) and not (self.nodes[line].name == "choose" and len(self._side(line, expensive[0])) == 1):
                    order += self._in_parts(line, expensive[0])
                order.append(line)
            if order == self.order:
                return
            self.order = order
            self._kinds.clear()

    def _in_parts(self, line: int, side: bool) -> list[int]:
        """Make a choice one of several, of which that side is computed in the innermost; returns the others, in order."""
        _, *values = self._sides(line)  # type: ignore[misc]
        new: list[int] = []

        def add(node: Node) -> int:
            new.append(max(len(self.operations), *self.nodes) + 1)
            self.nodes[new[-1]] = node
            return new[-1]

        truths = 0, self.all_bits
        a, b = (add(Node("constant", (), truths[i])) if of is None else of for of, i in zip(values, (True, False), strict=True))
        *outer, (last, _) = self._side(line, side)
        made = Node("choose", (last, a, b), 0)
        for condition, _ in reversed(outer):
            inner = add(made)
            made = Node("choose", (condition, inner, b) if side else (condition, a, inner), 0)
        self.nodes[line] = made
        return new

    def _simplify(self) -> None:
        """A choice by a condition that is known where it is read is one of its sides."""
        instead: dict[int, int] = {}
        for line in self.order:
            node, known = self.nodes[line], dict(self._paths[line])
            self.nodes[line] = node = node._replace(of=tuple(instead.get(each, each) for each in node.of))
            if node.name == "choose" and (truth := self._truth(node.of[0], known)) is not None:
                instead[line] = node.of[1 if truth else 2]

    def _truth(self, condition: int, known: dict[int, bool]) -> bool | None:
        """Whether a condition holds, if that follows from others."""
        if condition in known:
            return known[condition]
        name, of, _ = self.nodes[condition] if condition in self.nodes else self.operations[condition]
        if name not in ("and", "or"):
            return None
        truths = [self._truth(each, known) for each in of]
        decisive = name == "or"
        return decisive if decisive in truths else None if None in truths else not decisive

    def _share(self) -> None:
        """Find choices within a choice of which they are a side, and whose other side is also the other's."""
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
        """These values, of which those on this path are computed here, and others in branches."""
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
        """Values outside of a choice's sides that have to be computed before it, in order."""
        path = self._paths[line]
        found: set[int] = set()
        waiting = list(self.nodes[line].of)
        while waiting:
            each = waiting.pop()
            if each not in self._done and each not in found:
                found.add(each)
                waiting += self.nodes[each].of
        return [each for each in self.order if each in found and self._paths[each] == path]

    def _of_side(self, path: Path, condition: int, side: bool, group: Sequence[int]) -> list[Item]:
        inner = (*path, (condition, side))
        found: set[int] = set()
        waiting = [self.nodes[line].of[2 - side] for line in group if self.expensive[line][not side]]
        while waiting:
            each = waiting.pop()
            if each not in self._done and each not in found and self._paths[each][: len(inner)] == inner:
                found.add(each)
                waiting += self.nodes[each].of
        return self._arranged(inner, [each for each in self.order if each in found])

    # ---- what is read behind a branch

    def _keep(self) -> None:
        """Note what a branch computes that something behind it reads."""
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


def _cycles(name: str) -> int:
    return OPERATIONS[name].cycles if name in OPERATIONS else CYCLES.get(name, 1)


def kind_of(
    node: tuple[str, tuple[int, ...], int], kind: Callable[[int], str], constant: Callable[[int], int | None], all_bits: int
) -> str:
    """Of an operation: "truth", "bits" or "number"; "any" of a constant that may be each."""
    name, of, given = node
    kinds = {kind(each) for each in of}
    if name == "constant":
        return "any" if given in (0, all_bits) else "number"
    if name in COMPARISONS:
        return "truth"
    if name in ON_TRUTHS:
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
    n = 0
    while n < min(len(a), len(b)) and a[n] == b[n]:
        n += 1
    return a[:n]


def branches(items: Sequence[Item]) -> list[Branch]:
    """All branches among these items, and those within them."""
    found: list[Branch] = []
    for item in items:
        if isinstance(item, Branch):
            found += [item, *(inner for side in item.sides for inner in branches(side))]
    return found
