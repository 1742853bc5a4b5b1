"""The text of loops over lanes: the formulas of one lane, with its branches, whose operands are elements i of arrays."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence

from ... import _core
from ..explanation.formula import Formula
from ..explanation.listing import Leaf
from ..explanation.listing import Writer as Sections
from .branches import Branched, kind_of
from .lanes import Kernel, Lanes, lane_order
from .loops import WORK, NoLoopError, Place, Writer
from .program import Assignment, Loop, Statement
from .program import Lanes as Repeated
from .statements import Statements
from .tapes import Operations


class LaneWriter:
    """Writes the loops of a function; ``size`` is the length of the array in which values wait for other loops."""

    def __init__(
        self,
        operations: Operations,
        loops: Writer,
        lanes: Lanes,
        source: Callable[[int], Place],
        to: Mapping[int, Sequence[Place]],
        late: set[Place],
    ) -> None:
        self._all, self._loops, self._source, self._to = operations.all, loops, source, to
        self._of, self._language = lanes.of, loops.language
        self._sections = Sections(_core.Tape(single=self._language.single), {}, self._language)
        self._kernels = [self._ordered(each) for each in lanes.kernels]
        self._lane: dict[int, tuple[int, int]] = {}  # the loop of each line, and its lane there
        for i, kernel in enumerate(self._kernels):
            for lines in kernel.groups.values():
                self._lane |= {line: (i, lane) for lane, line in enumerate(lines)}
        self._last: dict[int, int] = {}  # the last other loop that reads a value
        self._readers: dict[Place, list[tuple[int, int]]] = defaultdict(list)
        for line, of in lanes.of.items():
            own = self._lane[line]
            for each in of:
                if each in self._lane:
                    if self._lane[each][0] != own[0]:
                        self._last[each] = max(own[0], self._last.get(each, -1))
                elif self._all[each][0] != "constant":
                    self._readers[source(each)].append(own)
        for place in late:
            self._readers[place].append((len(self._kernels), 0))
        self._place: dict[int, int] = {}
        self._taken: list[tuple[int, int, int]] = []  # begin, end, and the loop that reads it last
        self.size = 0
        self.lines: list[Statement] = []
        after: list[Statement] = []
        for i in range(len(self._kernels)):
            self._write(i, after)
        self.lines += after

    def _ordered(self, kernel: Kernel) -> Kernel:
        def place(line: int) -> Place | None:
            if line in self._of or self._all[line][0] == "constant":
                return None
            at = self._source(line)
            return at if at[0].startswith("@") else None

        order = lane_order(kernel, self._of, place)
        return Kernel(kernel.level, {i: [lines[lane] for lane in order] for i, lines in kernel.groups.items()})

    def _is_direct(self, lines: Sequence[int]) -> bool:
        """True if the results may be written to the state at once, since nothing reads the numbers there any more."""
        if any(len(self._to.get(line, ())) != 1 for line in lines) or len({self._to[line][0][0] for line in lines}) > 1:
            return False
        for line in lines:
            own, (array, at) = self._lane[line], self._to[line][0]
            for reader in self._readers.get((f"@{array[1:]}", at), ()):
                if reader[0] >= own[0] and reader != own:
                    return False
        return True

    def _space(self, i: int, lines: Sequence[int]) -> int:
        """The first place in the array for values of loop i that are read later."""
        last = max(len(self._kernels) if line in self._to else self._last.get(line, i) for line in lines)
        begin = 0
        self._taken = [each for each in self._taken if each[2] >= i]
        for other, end, _ in sorted(self._taken):
            if begin + len(lines) <= other:
                break
            begin = max(begin, end)
        self._taken.append((begin, begin + len(lines), last))
        self.size = max(self.size, begin + len(lines))
        return begin

    def _write(self, i: int, after: list[Statement]) -> None:
        """Write a loop, and behind all loops what moves its results to the state."""
        kernel, language = self._kernels[i], self._language
        local: list[tuple[str, tuple[int, ...], int]] = []
        leaves: dict[int, tuple[str, int]] = {}
        texts: list[str] = []
        known: dict[object, int] = {}
        number: dict[int, int] = {}  # of a line of the first lane
        inside = sorted((lines[0], lines) for lines in kernel.groups.values())
        for line, lines in inside:
            name, _, extra = self._all[line]
            of = []
            for k, operand in enumerate(self._of[line]):
                if operand in number:
                    of.append(number[operand])
                    continue
                key: object
                if self._all[operand][0] == "constant":
                    key = self._all[operand]
                    if key not in known:
                        known[key] = len(local)
                        local.append(self._all[operand])
                else:
                    read = [self._of[each][k] for each in lines]
                    places = [(WORK, self._place[each]) if each in self._lane else self._source(each) for each in read]
                    key = places[0][0], tuple(at for _, at in places)
                    if key not in known:
                        known[key] = len(local)
                        leaves[len(local)] = "entry", len(texts)
                        local.append(("entry", (), len(texts)))
                        texts.append(self._loops.at(places[0][0], [at for _, at in places]))
                of.append(known[key])
            number[line] = len(local)
            local.append((name, tuple(of), extra))
        stored = [(line, lines) for line, lines in inside if any(each in self._last or each in self._to for each in lines)]
        kinds: list[str] = []
        for each in local:
            kinds.append(
                kind_of(each, kinds.__getitem__, lambda j: local[j][2] if local[j][0] == "constant" else None, language.all_bits)
            )
        if any(kinds[number[line]] != "number" for line, _ in stored):
            raise NoLoopError
        roots = [number[line] for line, _ in stored]
        names = [self._sections.unused("r") for _ in roots]
        branched = Branched(local, roots, leaves, language.all_bits)

        def leaf(_: str, at: int) -> Leaf:
            return Leaf(Formula(texts[at]), None, 4)

        written: list[Statement]
        if branched.is_straight:
            small = Operations()
            small.all = local
            section, _ = self._sections.section("member step", small.body(roots, leaves, separate=False), leaf, 4, "a", names)
            written = [language.assignment(each) for each in section.lines]
        else:
            written = Statements(branched, self._sections, leaf, leaves, roots, names).lines
        for (_, group), name in zip(stored, names, strict=True):
            value = language.names(name)
            if self._is_direct(group) and not any(each in self._last for each in group):
                array, at_end = self._to[group[0]][0][0], [self._to[line][0][1] for line in group]
                written.append(Assignment(self._loops.at(array, at_end), "number", value, role="set"))
                continue
            begin = self._space(i, group)
            self._place |= {line: begin + at for at, line in enumerate(group)}
            written.append(Assignment(self._loops.at(WORK, range(begin, begin + len(group))), "number", value, role="set"))
            results = [(self._place[line], place) for line in group for place in self._to.get(line, ())]
            after += self._loops.moved([(WORK, at) for at, _ in results], [place for _, place in results])
        self.lines += _repeated(kernel.size, written)


def _repeated(times: int, lines: list[Statement]) -> list[Statement]:
    """Statements of a lane for all lanes; a value that is only stored needs no name."""
    if times == 1:
        return lines
    match lines:
        case [Assignment(name, "number", text, "", _, "new"), Assignment(target, _, value)] if name == value:
            return [Loop(times, target, text)]
    return [Repeated(times, lines)]
