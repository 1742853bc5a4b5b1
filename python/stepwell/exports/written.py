"""The contents of a file in its language, not yet in its order: fields, values computed before the steps, functions."""

from __future__ import annotations

import re
from math import prod
from typing import NamedTuple

from ..engine import pushes
from ..explanation.formula import Formula
from ..explanation.listing import Leaf, Line, Writer
from .language import Assignment, Function, Language, Place
from .names import Field, Names, fields
from .tapes import STATE, STEP, TALLY, Operations, Part, Traced

#: Names in use in a function: its arguments and the time.
LOCALS = ("m", "s", "t", "self", "coordinates", "velocities")

#: Names that fields may not have, because something else of the object has them.
MEMBERS = ("defaults", "finish", "new", "prepare", "start", "step", "work", "constructor", "prototype")


#: Values that are named after a rate evaluation: the state at which it is made, and the increments.
EVALUATION = re.compile(r"−?d?[vy](\d+)")


class Table(NamedTuple):
    """A table of a sampled input: the name of its samples, the time of the first, and the interval to the next.

    If it is one of ``times``, it has the numbers of the samples, from which their times follow.
    """

    name: str
    about: str
    values: list[float]
    start: str
    interval: str
    times: bool = False

    def time(self, me: str, number: str) -> str:
        """When the sample of a number is."""
        return f"{me}{self.start} + {me}{self.interval} * {number}" if self.times else number


class Written:
    """The contents of a file.

    Attributes:
        parameters: the fields that users may change, dt and t0 first.
        made: values computed from them before the steps.
        functions: "step", and "start" and "finish" for a method that carries something other than v.
        tables: the sampled inputs.
        slot: the name of the first block of a state.
        n_v: the number of numbers in it.
        n_y: the number of numbers in the second.
        evaluations: how many times a step adds to the sum of a control; 0 without one.
    """

    def __init__(self, traced: Traced, language: Language) -> None:
        plan, self.traced, self.language = traced.plan, traced, language
        self.slot = plan.method.carry or "v"
        self.n_v, self.n_y = prod(plan.system.v_shape), prod(plan.system.y_shape)
        control = plan.system.control
        self.evaluations = 0 if control is None else pushes(control, plan.method.evaluations)
        names = language.fields
        operations = traced.operations
        used = {given for name, _, given in operations.all if name == "parameter"}
        self.parameters = [
            Field(names("dt"), "the step", [plan.dt]),
            Field(names("t0"), "the time of step 0", [plan.t0], wide=True),
        ]
        own, self._where = fields(traced.numbers, used, names)
        self.parameters += own
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
        kept = operations.kept(list(traced.parts.values()))
        self.made, known = self._prepared(operations, kept)
        self.functions = {name: self._function(part, operations, kept, known) for name, part in traced.parts.items()}

    @property
    def carries(self) -> bool:
        """Whether the method carries something other than v."""
        return self.slot != "v"

    @property
    def blocks(self) -> list[tuple[str, str, int]]:
        """For each block that is not empty: its name, the name of its velocities or coordinates, its length."""
        both = [(self.slot, "velocities", self.n_v), ("y", "coordinates", self.n_y)]
        return [each for each in both if each[2]]

    @property
    def shown(self) -> str:
        """The block of which an example prints the first number."""
        return "y" if self.n_y else self.slot

    # ---- leaves

    def _parameter(self, tape: object, i: int) -> Leaf:
        name, place = self._where[i]
        text = f"{self.language.me}{name}{''.join(f'[{each}]' for each in place)}"
        return Leaf(Formula(text), tape.param(i), 1)  # type: ignore[attr-defined]

    def _length(self, tape: object) -> Leaf:
        return Leaf(Formula(f"{self.language.me}{self.language.fields('dt')}"), tape.step(), 1)  # type: ignore[attr-defined]

    # ---- parts

    def _prepared(self, operations: Operations, kept: list[int]) -> tuple[list[Assignment], list[Leaf]]:
        """The values computed before the steps, and how each is read in them."""
        tape, names = next((part.tape, dict(part.names)) for part in self.traced.parts.values())
        numbers = [name for name, _ in self.traced.numbers]
        for i, name in enumerate(numbers):
            if name == "omega":
                names[(tape.step() * tape.param(i)).id] = "Φ"
        self.language.before = True
        writer = Writer(tape, names, self.language)

        def leaf(name: str, given: int) -> Leaf:
            return self._length(tape) if name == "step" else self._parameter(tape, given)

        section, known = writer.section("run", operations.body(kept, {}, separate=False), leaf, 1, "c")
        made = [self._assignment(line) for line in section.lines]
        self.language.before = False
        return made, known

    def _function(self, part: Part, operations: Operations, kept: list[int], known: list[Leaf]) -> Function:
        language, tape = self.language, part.tape
        language.names = Names(LOCALS)
        reads: dict[int, Place] = {}
        asked: set[str] = set()

        def place(names: list[str], i: int) -> Place:
            """The place of a number of the state; the sum of a control comes last."""
            block = names[i].partition("[")[0].rstrip("'")
            at = -1 if block == TALLY else i if i < self.n_v else i - self.n_v
            return Place(block, at, language.names(names[i]))

        def state(i: int) -> Leaf:
            reads[i] = place(part.inputs, i)
            return Leaf(Formula(reads[i].name), tape.state(i), 4)

        entries: list[Leaf] = []

        def leaf(name: str, given: int) -> Leaf:
            asked.add(name)
            match name:
                case "made":  # names are by numbers on a tape, here that of the step
                    return known[given] if tape is self.traced.parts["step"].tape else known[given]._replace(symbol=None)
                case "entry":
                    return entries[given]
                case "step":
                    return self._length(tape)
                case "parameter":
                    return self._parameter(tape, given)
                case "time":
                    return Leaf(Formula("t"), tape.time(), 3)
                case _:
                    return state(given)

        made = {line: ("made", i) for i, line in enumerate(kept)}
        rank = operations.rank
        needed = operations.needed(part.roots, lambda line: rank[line] <= STEP)
        read = {each for line in needed if rank[line] == STATE for each in operations.all[line][1]} | set(part.roots)
        of_time = sorted(each for each in read if rank[each] == STEP and operations.all[each][1])
        writer = Writer(tape, part.names, language)
        before, entries = writer.section("step", operations.body(of_time, made, separate=False), leaf, 3, "s")
        leaves = made | {line: ("entry", i) for i, line in enumerate(of_time)}
        body = operations.body(part.roots, leaves, separate=True)
        after, _ = writer.section("member step", body, leaf, 4, "a", part.results)
        of_time_lines, lines = ([self._assignment(line) for line in section.lines] for section in (before, after))
        writes = [place(part.results, i) for i in range(len(part.results))]
        text = " ".join(each.text for each in [*of_time_lines, *lines])
        return Function(
            [reads[i] for i in sorted(reads)],
            "time" in asked,
            "time" in asked or language.me in text,
            of_time_lines,
            lines,
            writes,
        )

    def _assignment(self, line: Line) -> Assignment:
        language = self.language
        word = language.me + language.fields(line.name, f"made {line.name}") if language.before else language.names(line.name)
        note = line.note.replace("−", "-")
        found = EVALUATION.match(line.note or line.name)
        evaluation = int(found[1]) if found else 0
        return Assignment(word, language.kinds.get(word, "number"), language.text(line.formula), note, evaluation)
