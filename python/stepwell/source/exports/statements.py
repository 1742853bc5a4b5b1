"""The statements of a function with branches."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from ..explanation.formula import Formula
from ..explanation.listing import Leaf, Writer
from .branches import Branch, Branched, Item, branches
from .language import Language
from .program import Assignment, Conditional, Statement


class Copy(NamedTuple):
    """The assignment of a value, by its number, to a variable; without a value, of ``truth``, or else of zero.

    ``reader`` is the choice whose variable it is; −1 if it is that of no choice.
    """

    name: str
    kind: str
    value: int | None
    reader: int = -1
    truth: bool = False


class Statements:
    """Writes the values of a function, and those of a branch within it, as ``lines``."""

    def __init__(
        self,
        branched: Branched,
        writer: Writer,
        leaf: Callable[[str, int], Leaf],
        leaves: Mapping[int, tuple[str, int]],
        roots: Sequence[int],
        results: Sequence[str],
    ) -> None:
        self._branched, self._writer, self._leaf = branched, writer, leaf
        self._language: Language = writer.notation  # type: ignore[assignment]
        self._known = {line: leaf(*of) for line, of in leaves.items()}
        whole = branches(branched.items)
        self._tested = {each.condition for each in whole}
        self._read_later = {line for each in whole for line in each.keeps}
        self._readers: dict[int, set[int]] = defaultdict(set)
        for line in branched.order:
            for of in branched.nodes[line].of:
                self._readers[of].add(line)
        self._symbols = self._of_tape(roots)
        self._names: dict[int, str] = {}
        self._declared: set[str] = set()
        self._variables: set[str] = set()
        last: list[Copy] = []
        for line, name in zip(roots, results, strict=True):
            if line in self._names or line in leaves or not branched.nodes[line].of or branched.kind(line) != "number":
                last.append(Copy(name, "number", line))
            else:
                self._names[line] = name
        self._roots = set(roots)
        self.lines = self._written(branched.items, last)

    def _of_tape(self, roots: Sequence[int]) -> dict[int, Any]:
        """The symbols of values, by which their names in the method's text are known."""
        operations, symbols = self._branched.operations, {line: leaf.symbol for line, leaf in self._known.items()}
        waiting = list(roots)
        needed: set[int] = set()
        while waiting:
            line = waiting.pop()
            if line not in needed and line not in symbols:
                needed.add(line)
                waiting += operations[line][1]
        for line in sorted(needed):
            name, of, extra = operations[line]
            if of:
                symbols[line] = self._writer.symbol(name, [symbols[each] for each in of], extra)
            else:
                symbols[line] = self._writer.source(name, extra)
        return symbols

    # ---- statements

    def _written(self, items: Sequence[Item], last: Sequence[Copy]) -> list[Statement]:
        """The statements of these values and branches, and then of the last copies."""
        out: list[Statement] = []
        run: list[int] = []
        for item in items:
            if isinstance(item, Branch):
                out += [*self._straight(run, self._before(item, out)), self._conditional(item)]
                run = []
            else:
                run.append(item)
        return out + self._straight(run, last)

    def _before(self, branch: Branch, out: list[Statement]) -> list[Copy]:
        """The declarations of the variables that a branch sets, and their values if the branch does not set them."""
        copies = []
        for line in branch.sets:
            if line in self._branched.same:
                continue
            name, kind = self._name(line), self._branched.kind(line)
            self._variables.add(name)
            expensive, sides = self._branched.expensive[line], self._branched.nodes[line].of[1:]
            if all(expensive) and name not in self._declared:
                word = self._variable(line).text.text
                out.append(Assignment(word, kind, "", role=self._role(name)))
            copies += [
                Copy(name, kind, value, line, truth)
                for is_expensive, value, truth in zip(expensive, sides, (True, False), strict=True)
                if not all(expensive) and not is_expensive
            ]
        for line in branch.keeps:
            if self._name(line) not in self._variables:
                self._variables.add(self._name(line))
                copies.append(Copy(self._name(line), self._branched.kind(line), None))
        return copies

    def _conditional(self, branch: Branch) -> Conditional:
        sides = []
        for side in (0, 1):
            copies = []
            for line in branch.sets:
                value = self._branched.nodes[line].of[1:][side]
                is_set = value is not None and self._branched.same.get(value) == line
                if self._branched.expensive[line][side] and not is_set:
                    copies.append(Copy(self._name(line), self._branched.kind(line), value, line))
            sides.append(self._written(branch.sides[side], copies))
        for line in branch.sets:
            self._known[line] = self._variable(line)
        return Conditional(self._language.text(self._known[branch.condition].text.text), *sides)

    def _name(self, line: int) -> str:
        """The name of a value; a choice that is a side of another one has the name of that."""
        while line in self._branched.same:
            line = self._branched.same[line]
        if line not in self._names:
            self._names[line] = self._writer.called(self._symbols.get(line)) or self._writer.unused("a")
        return self._names[line]

    def _role(self, name: str) -> str:
        """The role of an assignment to this name, as in ``Assignment``."""
        if name not in self._variables:
            return "new"
        role = "set" if name in self._declared else "variable"
        self._declared.add(name)
        return role

    def _variable(self, line: int) -> Leaf:
        is_truth = self._branched.kind(line) == "truth"
        return Leaf(self._language.named(self._name(line), Formula("", is_truth=is_truth)), self._symbols.get(line), 4)

    def _literal(self, of: Copy) -> Leaf | None:
        """The leaf of a copy of a known truth; None for other copies."""
        bits = None if of.value is None else self._branched.constant(of.value)
        if of.value is not None and bits is None:
            return None
        truth = of.truth if bits is None else bits == self._branched.all_bits
        return Leaf(Formula(self._language.truths[truth], is_truth=True), None, 0)

    def _straight(self, run: Sequence[int], copies: Sequence[Copy]) -> list[Statement]:
        """The statements of values without branches, and then of the copies."""
        branched = self._branched
        body: list[tuple[str, list[int], int]] = []
        places: dict[int, int] = {}
        known: list[Leaf] = []

        def place(line: int) -> int:
            if line not in places:
                if line in self._known:
                    known.append(self._known[line])
                    body.append(("known", [], len(known) - 1))
                else:
                    name, of, extra = branched.nodes[line]
                    body.append((name, [place(each) for each in of], extra))
                places[line] = len(body) - 1
            return places[line]

        inside = set(run) | {each.reader for each in copies}
        named: dict[int, str] = {}
        for line in run:
            place(line)
            if line in self._read_later:
                self._variables.add(self._name(line))
            if line in self._names:
                named[line] = self._names[line]
            elif line in self._tested or not self._readers[line] <= inside:
                named[line] = ""
        results = [(places[line], name) for line, name in named.items()]
        for each in copies:
            literal = None if each.kind == "number" else self._literal(each)
            if literal is not None:
                known.append(literal)
                at = len(body)
                body.append(("known", [], len(known) - 1))
            elif each.value is None:
                at = len(body)
                body.append(("constant", [], 0))
            else:
                at = place(each.value)
            body.append(("copy" if each.kind == "number" else "same", [at], 0))
            results.append((len(body) - 1, each.name))

        def leaf(name: str, index: int) -> Leaf:
            return known[index] if name == "known" else self._leaf(name, index)

        section, leaves = self._writer.section(
            "member step", (body, [at for at, _ in results]), leaf, 4, "a", [of for _, of in results]
        )
        self._known |= dict(zip(named, leaves, strict=False))
        return [self._language.assignment(each, self._role(each.name)) for each in section.lines]
