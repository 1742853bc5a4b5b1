"""The contents of a file in a language, before they are put in order: fields, values computed before the steps, functions."""

from __future__ import annotations

import re
from collections import Counter, defaultdict
from collections.abc import Callable, Hashable
from functools import cached_property, partial
from math import prod

import numpy as np

from ...runs.engine import pushes
from ..explanation.formula import Formula
from ..explanation.listing import Leaf, Line, Writer
from .branches import Branched
from .lane_writer import LaneWriter
from .lanes import SHARED, Lanes
from .language import Language
from .loops import MADE, WORK, NoLoopError
from .loops import Place as LoopPlace
from .loops import Writer as LoopWriter
from .names import Field, Names, fields
from .program import FORCE, Assignment, Function, Loop, Place, Statement, Table, texts
from .statements import Statements
from .tapes import MAX_OPERATIONS, MAX_SHORT, STATE, STEP, Operations, Part, Traced, elements, placed, too_long

#: Names that are taken in a function: its arguments and the time.
LOCALS = ("m", "s", "t", "self", "coordinates", "velocities", FORCE)

#: Loops have at least this many operations for each line of text: fewer are as well written out.
LANES = 4

#: Names that fields cannot have, since other members of the object have them.
MEMBERS = ("defaults", "finish", "new", "prepare", "start", "step", "work", "constructor", "prototype")


class Written:
    """The contents of a file.

    Attributes:
        parameters: the fields that users may change, dt and t0 first.
        hoisted: values computed from them before the steps.
        functions: "step"; "start" for a method that carries something other than v or keeps blocks, "finish" for the former.
        tables: the sampled inputs.
        slot: the name of the first block of a state.
        n_v: the length of the first block.
        n_y: the length of the second block.
        evaluations: how many times a step adds to the sum of a control; 0 without a control.
    """

    def __init__(self, traced: Traced, language: Language) -> None:
        plan, self.traced, self.language = traced.plan, traced, language
        self.slot = plan.method.carry or "v"
        self.n_v, self.n_y = prod(plan.system.v_shape), prod(plan.system.y_shape)
        control = plan.system.control
        self.evaluations = 0 if control is None else pushes(control, plan.method.evaluations)
        names = language.fields
        operations = traced.operations
        used = {extra for name, _, extra in operations.all if name == "parameter"}
        self.parameters = [
            Field(names("dt"), "the step", [plan.dt]),
            Field(names("t0"), "the time of step 0", [plan.t0], wide=True),
        ]
        own, self._where = fields(traced.numbers, used, names)
        self.parameters += own
        self._shapes = {each.name: each.shape for each in self.parameters}
        self.tables: list[Table] = []
        tables = Names()
        of_time: dict[str, list[Field]] = {}
        for table in traced.tables:
            called, _, part = table.name.rpartition(".")
            is_part = part == "times" or part.isdigit()
            called = called if is_part else table.name
            if called not in of_time:
                first = "one interval before the first sample" if is_part else "the time of the first sample"
                of_time[called] = [
                    Field(names(f"{called}.start"), f"{called}: {first}", [table.start]),
                    Field(names(f"{called}.interval"), f"{called}: the time to the next sample", [table.interval]),
                ]
                self.parameters += of_time[called]
            values = list(map(float, range(len(table.values)))) if part == "times" else table.values
            start, interval = (each.name for each in of_time[called])
            self.tables.append(Table(tables(table.name), table.name, values, start, interval, part == "times"))
        language.tables = self.tables
        hoisted = operations.hoisted(list(traced.parts.values()))
        #: Values computed before the steps by loops, the array that holds them, its length, and tables of places.
        self.loops: list[Loop] = []
        self.array, self.hoisted_size = language.fields(MADE, "made by loops"), 0
        self.places: dict[str, tuple[int, ...]] = {}
        self.hoisted: list[Assignment] = []
        if traced.count > MAX_SHORT:
            try:
                self.functions = self._looped(operations, hoisted)
            except NoLoopError:
                if traced.count > MAX_OPERATIONS:
                    raise too_long(plan, str(traced.count), MAX_OPERATIONS) from None
                self.loops, self.hoisted_size, self.places = [], 0, {}
            else:
                self.parameters = [each._replace(shape=each.shape and (prod(each.shape),)) for each in self.parameters]
                return
        self.hoisted, known = self._prepared(operations, hoisted)
        self.functions = {name: self._function(part, operations, hoisted, known) for name, part in traced.parts.items()}

    @property
    def memory(self) -> list[str]:
        """Room for what the method keeps, and what a sampled controller remembers at the start; empty without both."""
        return [self.language.signed(x) for x in self.traced.memory]

    @property
    def of_memory(self) -> str:
        """The contents of the memory, for a comment."""
        controller = "what the controller remembers" if len(self.traced.memory) > self.traced.kept else ""
        return ", and ".join(each for each in ("what the method keeps" if self.traced.kept else "", controller) if each)

    @property
    def carries(self) -> bool:
        """True if the method carries something other than v."""
        return self.slot != "v"

    @property
    def blocks(self) -> list[tuple[str, str, int]]:
        """For each block that is not empty: its name, the name of its velocities or coordinates, its length."""
        both = [(self.slot, "velocities", self.n_v), ("y", "coordinates", self.n_y)]
        return [each for each in both if each[2]]

    def forced(self, function: str) -> bool:
        """True if a function has an argument for a force from outside: the step if there is one, others if they read it."""
        return function in self._forced or (function == "step" and bool(self.traced.force))

    @cached_property
    def _forced(self) -> set[str]:
        """The functions that read a force."""
        return {
            name
            for name, of in self.functions.items()
            if any(each.block == FORCE for each in of.reads) or any(f"@{FORCE}" in text for text in texts(of.lines))
        }

    @property
    def arguments(self) -> list[tuple[str, int]]:
        """The arguments from which the state at the start is computed, and their lengths."""
        return [(of, n) for _, of, n in self.blocks] + [(FORCE, self.n_v)] * self.forced("start")

    @property
    def shown(self) -> str:
        """The block whose first number the example prints."""
        return "y" if self.n_y else self.slot

    # ---- leaves

    def _parameter(self, tape: object, i: int) -> Leaf:
        name, place = self._where[i]
        text = f"{self.language.me}{name}{''.join(f'[{each}]' for each in place)}"
        return Leaf(Formula(text), tape.param(i), 1)  # type: ignore[attr-defined]

    def _length(self, tape: object) -> Leaf:
        return Leaf(Formula(f"{self.language.me}{self.language.fields('dt')}"), tape.step(), 1)  # type: ignore[attr-defined]

    # ---- parts

    def _prepared(self, operations: Operations, hoisted: list[int]) -> tuple[list[Assignment], list[Leaf]]:
        """The assignments of the values that are computed before the steps, and the leaves by which the steps read them."""
        tape, names = next((part.tape, dict(part.names)) for part in self.traced.parts.values())
        numbers = [name for name, _ in self.traced.numbers]
        for i, name in enumerate(numbers):
            if name == "omega":
                names[(tape.step() * tape.param(i)).id] = "Φ"
        self.language.before = True
        writer = Writer(tape, names, self.language)

        def leaf(name: str, index: int) -> Leaf:
            return self._length(tape) if name == "step" else self._parameter(tape, index)

        section, known = writer.section("run", operations.body(hoisted, {}, separate=False), leaf, 1, "c")
        assignments = [self._assignment(line) for line in section.lines]
        self.language.before = False
        return assignments, known

    def _looped(self, operations: Operations, hoisted: list[int]) -> dict[str, Function]:
        """The functions as loops."""
        language = self.language
        shapes = {each.name: each.shape for each in self.parameters}
        loops = LoopWriter(operations, language)
        hoisted_places: dict[int, LoopPlace] = {}

        def before(line: int) -> LoopPlace:
            name, _, extra = operations.all[line]
            if name == "step":
                return f"{language.me}{language.fields('dt')}", -1
            field, place = self._where[extra]
            at = int(np.ravel_multi_index(place, self._shapes[field])) if shapes[field] else -1
            return f"{language.me}{field}", at

        def source(places: list[tuple[str, int]], line: int) -> LoopPlace:
            name, _, extra = operations.all[line]
            if line in hoisted_places:
                return hoisted_places[line]
            if name == "constant":
                return language.text(language.number(extra).text), -1
            if name == "time":
                return "t", -1
            if name == "force":
                return f"@{FORCE}", extra - len(self.traced.numbers)
            if name != "state":
                return before(line)
            block, at = places[extra]
            return f"@{block}", at

        inner = [line for line in operations.needed(hoisted, lambda line: False) if operations.all[line][1]]
        first = loops.looped(inner, hoisted, before, keep=True)
        hoisted_places |= dict(zip(hoisted, [(f"{language.me}{self.array}", at) for _, at in first.places], strict=True))
        self.loops = [
            each._replace(
                target=language.me + each.target.replace(MADE, self.array, 1),
                text=re.sub(rf"\b{MADE}\[", f"{language.me}{self.array}[", each.text),
            )
            for each in first.loops
        ]
        self.hoisted_size = first.size
        functions = {
            name: self._loops(name, part, operations, loops, hoisted_places, partial(source, placed(part.inputs)))
            for name, part in self.traced.parts.items()
        }
        self.places = {name: places for places, name in loops.tables.items()}
        return functions

    def _loops(
        self,
        name: str,
        part: Part,
        operations: Operations,
        loops: LoopWriter,
        hoisted_places: dict[int, LoopPlace],
        source: Callable[[int], LoopPlace],
    ) -> Function:
        needed = [
            line
            for line in operations.needed(part.roots, hoisted_places.__contains__)
            if operations.all[line][1] and line not in hoisted_places
        ]
        try:
            return self._lanes(name, part, operations, loops, needed, source)
        except NoLoopError:  # lanes are not alike
            if self.traced.count <= MAX_OPERATIONS:
                raise
            body = loops.looped(needed, part.roots, source, keep=False)
        # Results that are no computed values, such as a number of the state, are read before anything is written.
        own = [i for i, (array, _) in enumerate(body.places) if array != WORK]
        aside = [(WORK, body.size + k) for k in range(len(own))]
        values = list(body.places)
        for i, place in zip(own, aside, strict=True):
            values[i] = place
        to = [(f"#{block}", at) for block, at in placed(part.results)]
        lines = [*body.loops, *loops.moved([body.places[i] for i in own], aside), *loops.moved(values, to)]
        needs_time = any(re.search(r"\bt\b", text) for text in texts(lines))
        return Function([], needs_time, [], list(lines), [], body.size + len(own))

    def _lanes(
        self,
        name: str,
        part: Part,
        operations: Operations,
        loops: LoopWriter,
        needed: list[int],
        source: Callable[[int], LoopPlace],
    ) -> Function:
        """A function as loops over lanes."""
        language = self.language
        reads = Counter(each for line in needed for each in set(operations.all[line][1]))
        axes = prod(self.traced.plan.system.v_shape[1:]) or 1

        def label(line: int) -> tuple[Hashable, Hashable]:
            if operations.all[line][0] == "constant":
                return operations.all[line], operations.all[line]
            array, at = source(line)
            if array.startswith("@"):
                return (array, at % axes), array
            return (array, at if reads[line] > SHARED else None), array

        lanes = Lanes(operations, needed, source, label)
        to: dict[int, list[LoopPlace]] = defaultdict(list)  # where results are written, by their line
        aside: list[tuple[LoopPlace, LoopPlace]] = []
        for line, (block, at) in zip(part.roots, placed(part.results), strict=True):
            place = f"#{block}", at
            if line in lanes.of:
                to[line].append(place)
            elif (source(line)[0][1:], source(line)[1]) != (block, at) or name != "step":
                aside.append((source(line), place))
        language.names = Names((*LOCALS, "i", WORK))
        written = LaneWriter(operations, loops, lanes, source, to, {place for place, _ in aside})
        lines = written.lines
        # Results that are no computed values, such as a number of the state, are read before anything is written.
        own = [(WORK, written.size + k) for k in range(len(aside))]
        before, after = loops.moved([each for each, _ in aside], own), loops.moved(own, [each for _, each in aside])
        every = [*before, *lines, *after]
        if len(texts(every)) * LANES > len(needed):
            raise NoLoopError
        needs_time = any(re.search(r"\bt\b", text) for text in texts(every))
        return Function([], needs_time, [], every, [], written.size + len(own))

    def _function(self, part: Part, operations: Operations, hoisted: list[int], known: list[Leaf]) -> Function:
        language, tape = self.language, part.tape
        language.names = Names(LOCALS)
        reads: dict[int, Place] = {}
        leaf_names: set[str] = set()

        def places(names: list[str]) -> list[Place]:
            return [Place(block, at, language.names(name)) for (block, at), name in zip(placed(names), names, strict=True)]

        inputs = places(part.inputs)

        def state(i: int) -> Leaf:
            reads[i] = inputs[i]
            return Leaf(Formula(reads[i].name), tape.state(i), 4)

        entries: list[Leaf] = []

        def leaf(name: str, index: int) -> Leaf:
            leaf_names.add(name)
            match name:
                case "made":  # a symbol names a value on the tape of the step only
                    return known[index] if tape is self.traced.parts["step"].tape else known[index]._replace(symbol=None)
                case "entry":
                    return entries[index]
                case "step":
                    return self._length(tape)
                case "parameter":
                    return self._parameter(tape, index)
                case "time":
                    return Leaf(Formula("t"), tape.time(), 3)
                case "force":
                    at = index - len(self.traced.numbers)
                    called = elements(FORCE, self.traced.plan.system.v_shape)[at]
                    reads[len(part.inputs) + at] = Place(FORCE, at, language.names(called, f"given {called}"))
                    return Leaf(Formula(reads[len(part.inputs) + at].name), tape.param(index), 4)
                case _:
                    return state(index)

        leaves_before = {line: ("made", i) for i, line in enumerate(hoisted)}
        rank = operations.rank
        needed = operations.needed(part.roots, lambda line: rank[line] <= STEP)
        read = {each for line in needed if rank[line] == STATE for each in operations.all[line][1]} | set(part.roots)
        of_time = sorted(each for each in read if rank[each] == STEP and operations.all[each][1])
        writer = Writer(tape, part.names, language)
        before, entries = writer.section("step", operations.body(of_time, leaves_before, separate=False), leaf, 3, "s")
        of_time_lines = [self._assignment(line) for line in before.lines]
        leaves = leaves_before | {line: ("entry", i) for i, line in enumerate(of_time)}
        branched = Branched(operations.all, part.roots, leaves, language.all_bits)
        lines: list[Statement]
        if branched.is_straight:
            body = operations.body(part.roots, leaves, separate=True)
            after, _ = writer.section("member step", body, leaf, 4, "a", part.results)
            lines = [self._assignment(line) for line in after.lines]
        else:
            lines = Statements(branched, writer, leaf, leaves, part.roots, part.results).lines
        writes = places(part.results)
        return Function([reads[i] for i in sorted(reads)], "time" in leaf_names, of_time_lines, lines, writes)

    def _assignment(self, line: Line) -> Assignment:
        return self.language.assignment(line)
