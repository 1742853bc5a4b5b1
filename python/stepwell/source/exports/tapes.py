"""The operations of a step, and of a method's start and finish, split by how often their values change."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from math import prod
from typing import Any, NamedTuple

import numpy as np

from ... import _core
from ...base import checks
from ...base.arrays import Shape
from ...errors import UnsupportedError
from ...model.parameters import aligned
from ...reference.signal import Held
from ...reference.tape.operations import COMPARISONS, ON_BITS
from ...runs import engine
from ..explanation.listing import Body
from ..explanation.naming import Named, increments_last, indexed, parameters
from .functions import named

#: Steps of more operations are loops over lanes, where these are alike: short to read, and quick to compile.
MAX_SHORT = 2_000

#: The most operations that are written out one by one; a longer text is too long for compilers and for people.
MAX_OPERATIONS = 20_000

#: The most operations that are written as loops: a few arrays of some megabytes.
MAX_IN_LOOPS = 3_000_000

#: How often a value changes: never, once a run, once a step with the time, with the state.
NEVER, RUN, STEP, STATE = range(4)

#: Operations whose value is bits or a truth and not a number, so that it cannot be a number of a state or a field.
NO_NUMBER = (*COMPARISONS, *ON_BITS)


class Part(NamedTuple):
    """A function of the state, on its tape: the step, or a method's start or finish.

    ``names`` are those of values by their numbers on the tape, ``roots`` the values that it computes by their numbers among all
    operations, ``inputs`` the names of the numbers of the state before, ``results`` those of what it computes.
    """

    tape: Any
    names: dict[int, str]
    roots: list[int]
    inputs: list[str]
    results: list[str]


class Table(NamedTuple):
    """A sampled input of one member."""

    name: str
    values: list[float]
    interval: float
    start: float


class Operations:
    """The operations of several functions in one list, each once.

    Attributes:
        first_of_force: the first parameter that is a number of the force, which may change with every step; None without one.
        all: the name, the operands and the extra argument of each; operands come before the operations that use them.
        rank: how often the value of each changes.
    """

    def __init__(self) -> None:
        self.first_of_force: int | None = None
        self.all: list[tuple[str, tuple[int, ...], int]] = []
        self.rank: list[int] = []
        self._places: dict[tuple[str, tuple[int, ...], int], int] = {}

    def add(self, operations: Sequence[tuple[str, Sequence[int], int]], roots: Sequence[int]) -> list[int]:
        """Add operations, and return the numbers of the roots in ``all``."""
        place: list[int] = []
        for name, of, extra in operations:
            if name == "parameter" and self.first_of_force is not None and extra >= self.first_of_force:
                name = "force"
            key = name, tuple(place[each] for each in of), extra
            if key not in self._places:
                self._places[key] = len(self.all)
                self.all.append(key)
                own = {
                    "constant": NEVER,
                    "step": RUN,
                    "parameter": RUN,
                    "sample": STEP,
                    "time": STEP,
                    "state": STATE,
                    "force": STATE,
                }
                self.rank.append(max([own.get(name, NEVER), *(self.rank[each] for each in key[1])]))
            place.append(self._places[key])
        return [place[each] for each in roots]

    def needed(self, roots: Sequence[int], stop: Callable[[int], bool]) -> list[int]:
        """The operations that these values depend on, in order, down to and including those for which ``stop`` is true."""
        needed: set[int] = set()
        waiting = list(roots)
        while waiting:
            line = waiting.pop()
            if line not in needed:
                needed.add(line)
                if not stop(line):
                    waiting += self.all[line][1]
        return sorted(needed)

    def hoisted(self, parts: Sequence[Part]) -> list[int]:
        """The values that are computed before the steps and read in them."""
        roots = [each for part in parts for each in part.roots]
        above = [each for each in self.needed(roots, lambda line: self.rank[line] <= RUN) if self.rank[each] > RUN]
        read = {each for line in above for each in self.all[line][1]} | set(roots)
        return sorted(each for each in read if self.rank[each] == RUN and self.all[each][1])

    def body(self, roots: Sequence[int], leaves: dict[int, tuple[str, int]], *, separate: bool) -> Body:
        """The body that computes these values from leaves, which are by line.

        If ``separate``, each value has a place of its own and is a number.
        """
        needed = self.needed(roots, leaves.__contains__)
        place = {line: i for i, line in enumerate(needed)}
        operations: list[tuple[str, list[int], int]] = []
        for line in needed:
            name, of, extra = self.all[line]
            leaf = leaves.get(line)
            operations.append((leaf[0], [], leaf[1]) if leaf else (name, [place[each] for each in of], extra))
        places: list[int] = []
        for root in roots:
            at = place[root]
            if separate and (at in places or not operations[at][1] or operations[at][0] in NO_NUMBER):
                operations.append(("copy", [at], 0))
                at = len(operations) - 1
            places.append(at)
        return operations, places


class Traced:
    """A step by a method, for one member of a batch.

    Attributes:
        alone: whether the state stays as it is, and only what a sampled controller remembers is computed.
        operations: the operations of all its functions.
        parts: its functions, by name: "step"; "start" for a method that carries something other than v or keeps blocks between
            steps, and "finish" for one that carries.
        numbers: the name and the value of each parameter, in the tape's order.
        tables: the sampled inputs.
        force: the numbers of a force from outside; empty without one.
        memory: room for what the method keeps between steps, and what a sampled controller remembers at the start.
        count: the number of arithmetic operations of a step, including those before the steps.
    """

    def __init__(self, plan: engine.Plan, member: Shape, *, alone: bool = False) -> None:
        self.plan, self.alone = plan, alone
        model = engine.model(plan)
        _core.check(model)
        count = about(plan)
        if count > 4 * MAX_IN_LOOPS:
            raise too_long(plan, f"about {count}")
        names, tables = parameters(plan)
        self.operations = Operations()
        self.operations.first_of_force = None if plan.force is None else len(names)
        self.parts: dict[str, Part] = {}
        self.kept = plan.method.kept_numbers(prod(plan.system.v_shape), prod(plan.system.y_shape))
        for which in ("step", "start", "finish") if plan.method.carry else ("step", "start")[: 1 + bool(self.kept)]:
            self.parts[which], tracer = self._part(which)
            if which == "step":
                of_step = tracer
        self.count = sum(bool(of) for _, of, _ in self.operations.all)
        if self.count > MAX_IN_LOOPS:
            raise too_long(plan, str(self.count))
        if not plan.fuses:  # with fused multiply-adds, products of a function may be fused with sums around it
            named(self.operations.all, plan.single)

        def own(values: Any, before: int = 0) -> Any:
            values = np.asarray(values)
            wide = aligned(values, before, plan.batch)
            return np.broadcast_to(wide, (*values.shape[:before], *plan.batch))[(slice(None),) * before + member]

        kind = np.float32 if plan.single else np.float64
        numbers = [float(kind(own(value))) for value in of_step.numbers]
        self.numbers = list(zip(names, numbers, strict=False))
        self.force = numbers[len(names) :]
        remembered = [] if plan.memory is None else [float(kind(own(row))) for row in plan.memory]
        self.memory = self.kept * [0.0] + remembered
        samples: list[Held] = of_step.tables
        self.tables = [
            Table(name, [float(each) for each in own(table.values, 1)], float(table.interval), float(table.start))
            for name, table in zip(tables, samples, strict=True)
        ]

    def _part(self, which: str) -> tuple[Part, Named]:
        plan, tape = self.plan, _core.Tape(single=self.plan.single)
        tracer = Named(plan.stepped, tape, plan.force)
        method, v_shape, y_shape = plan.method, plan.system.v_shape, plan.system.y_shape
        if which == "step":
            symbols = tracer.step(method, plan.choice)
            if self.alone:
                n = prod(v_shape) + prod(y_shape)
                symbols[:n] = map(tape.state, range(n))
        else:
            state = prod(v_shape) + prod(y_shape)
            made = slice(state, state + self.kept) if self.kept else slice(prod(v_shape))
            symbols = tracer.slot(method, which, plan.choice)[made]
        operations, roots = _fused(tape, symbols) if plan.fuses else tape.operations(symbols)
        names = tracer.names
        if plan.fuses:
            tape, names, _ = increments_last(tracer, symbols, plan.single)
        slot = method.carry or "v"
        before, after = {"step": (slot, slot), "start": ("v", slot), "finish": (slot, "v")}[which]
        inputs = elements(before, v_shape) + elements("y", y_shape)
        results = elements(f"{after}'", v_shape) if which == "step" or method.carry else elements(f"{MEMORY}'", (self.kept,))
        memory = (self.kept + (plan.memory_numbers if plan.system.controller is not None else 0),)
        if which == "step" or not method.carry:
            inputs += elements(MEMORY, memory)
        if which == "step":
            results += elements("y'", y_shape) + elements(f"{MEMORY}'", memory)
            if plan.system.control is not None:
                inputs, results = [*inputs, TALLY], [*results, f"{TALLY}'"]
        return Part(tape, names, self.operations.add(operations, roots), inputs, results), tracer


def about(plan: engine.Plan) -> int:
    """Approximately how many operations a step has, known before it is traced; too many for short methods, 0 for a short step."""
    parts = _core.in_parts(engine.model(plan._replace(fused=False)), 1)
    return 0 if parts is None else parts[1]


#: The sum that a control or a projection accumulates.
TALLY = "tally"


#: What a method keeps between steps, and what a sampled controller remembers.
MEMORY = "memory"


def placed(names: Sequence[str]) -> list[tuple[str, int]]:
    """For each of these numbers its block and its place there; −1 of the sum of a control, which is one number."""
    counts: Counter[str] = Counter()
    places = []
    for name in names:
        block = name.partition("[")[0].rstrip("'")
        places.append((block, -1 if block == TALLY else counts[block]))
        counts[block] += 1
    return places


def elements(name: str, shape: Shape) -> list[str]:
    """The names of a block's numbers, in C order."""
    return [indexed(name, index) for index in np.ndindex(shape)]


def _fused(tape: Any, symbols: list[Any]) -> Any:
    fused, roots = tape.fused(symbols)
    return fused.operations(roots)


def too_long(plan: engine.Plan, count: str, most: int = MAX_IN_LOOPS) -> UnsupportedError:
    """The error for a step that is too long to export."""
    return UnsupportedError(
        f"system: a step of {checks.short(plan.system)} by {plan.method.name} has {count} operations, and at most "
        f"{most} are written{' out one by one' * (most < MAX_IN_LOOPS)}; export a smaller system"
    )
