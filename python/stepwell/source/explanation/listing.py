"""The operations of a step as lines, with a name and a formula each.

A value that is used once is written in the formula that uses it, as long as the line stays short. A value that has a name in the
text of the method has it here: ``dv1``, ``dy1`` the first increments of a step, ``v2``, ``y2`` the state of the second
evaluation, ``v'``, ``y'`` the next state. Others are numbered: ``c1`` is computed before the steps, ``s1`` once a step, ``a1`` by
every member in every step.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from math import prod
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from ... import _core
from ...base.arrays import Shape
from ...reference import adaptive
from ...reference.acceptance import Acceptance
from ...reference.signal import COMPOSED, Held
from ...reference.tape import increments
from ...reference.tape.lines import in_order, listed, needed
from ...reference.tape.operations import OPERATIONS, of_tape
from ...reference.traced import Tracer
from ...runs import engine
from ...runs.engine import Plan
from ...runs.engine.counted import traced
from .formula import ATOM, PRODUCT, SUM, Formula, Notation, formula, number

#: Characters of an increment of its own line; shorter ones stand where they are used.
SHORT = 12

#: A body: names of operations, their operands and other arguments; and the indices of the results.
Body = tuple[list[tuple[str, list[int], int]], list[int]]


class Line(NamedTuple):
    """A value of a step.

    Attributes:
        name: what it is called.
        formula: what it is, read as in Python, with · − √ ≤ for its multiplication, subtraction, square root and comparison; =
            compares.
        operations: how many of each kind it takes, as in ``Explanation.computed``.
        note: what it is in the method, where its name does not say so.
    """

    name: str
    formula: str
    operations: dict[str, int]
    note: str = ""


class Section(NamedTuple):
    """What is computed equally often.

    Attributes:
        when: ``"run"``, ``"member"``, ``"step"`` or ``"member step"``: once a run for all members, once a run for each member,
            once a step for all members, in each step for each member.
        lines: the values, each after what it reads.
    """

    when: str
    lines: tuple[Line, ...]


# ---- names


class Named(Tracer):
    """Traces a step and notes what its values are called, by their numbers on the tape."""

    def __init__(self, system: Any, tape: Any, force: Any = None) -> None:
        super().__init__(system, tape, force)
        self.names: dict[int, str] = {}
        self.called: list[tuple[Any, str]] = []
        self._taken: set[str] = set()
        self._length: Any = None

    def scaled(self, h: Any) -> Any:
        """The system, which records its evaluations."""
        s, counts = super().scaled(h), Counter[str]()

        def noting(which: str, rate: Callable[[Any, Any, Any], Any]) -> Callable[[Any, Any, Any], Any]:
            def increment(t: Any, v: Any, y: Any) -> Any:
                counts[which] += 1
                made = rate(t, v, y)
                for name, block in (("v", v), ("y", y)):
                    self._note(f"{name}{counts[which]}", block)
                self._note(f"d{which}{counts[which]}", made if self._length is None else self._length * made)
                return made

            return increment

        s.dv, s.dy = noting("v", s.dv), noting("y", s.dy)
        return s

    def attempt(self, method: Any, order: int = 0, acceptance: Acceptance = Acceptance(), *, backward: bool = False) -> list[Any]:  # noqa: B008
        """The state and the pace after an attempt, whose increments are as long as its step."""
        _, _, more = self.state()
        self._length = self.pace(acceptance, more).outlook(self.tape.budget()).step
        return super().attempt(method, order, acceptance, backward=backward)

    def _note(self, name: str, block: Any) -> None:
        block = np.asarray(block, dtype=object)
        if name in self._taken:
            return
        for index in np.ndindex(block.shape):
            if isinstance(block[index], _core.Symbol):
                called = indexed(name, index)
                self.names.setdefault(block[index].id, called)
                self.called.append((block[index], called))
                self.names.setdefault((-block[index]).id, f"−{called}")
        self._taken.add(name)


def indexed(name: str, index: Shape) -> str:
    """An element of a block."""
    return f"{name}[{','.join(map(str, index))}]" if index else name


def parameters(plan: Plan) -> tuple[list[str], list[str]]:
    """What the numbers are called that describe a system, in the core's order, and its sampled inputs."""
    system = plan.system
    if plan.form == "matrix":
        inputs = system.given_inputs()
        given = matrix_of(plan) | {name: each.signal() for name, each in inputs.items()}
    else:
        given = system.all_parameters(plan.batch)
    return named_numbers(plan, given)


def matrix_of(plan: Plan) -> dict[str, Any]:
    """Matrices of a step, P of shape (n, n, *batch) and Q of shape (nodes, inputs, n, *batch), in shape alone."""
    n = prod(plan.system.v_shape) + prod(plan.system.y_shape)
    inputs = len(plan.system.given_inputs())
    return {"P": np.zeros((n, n, *plan.batch)), "Q": np.zeros((len(plan.method.nodes), inputs, n, *plan.batch))}


def named_numbers(plan: Plan, given: Mapping[str, Any]) -> tuple[list[str], list[str]]:
    """Names of the numbers in what is given, and of the sampled inputs."""
    numbers: list[str] = []
    tables: list[str] = []
    named = indexed if plan.form == "matrix" else plan.system.named

    def add(name: str, value: Any, own: int | None = None) -> None:
        match value:
            case list():
                for i, each in enumerate(value):
                    add(f"{name}[{i}]", each)
            case Held():
                tables.append(named(name, ()))
            case _ if isinstance(value, COMPOSED):
                for behind, part in value.parts().items():
                    add(name + behind, part)
            case np.ndarray():
                axes = max(0, value.ndim - len(plan.batch))
                numbers.extend(named(name, index) for index in np.ndindex(value.shape[:axes]))

    for name, value in given.items():
        add(name, value)
    return numbers, tables


def states(plan: Plan, attempts: bool, mark: str = "") -> list[str]:
    """What the numbers of a state are called, with a mark behind the names."""
    blocks = [(plan.method.carry or "v", plan.system.v_shape), ("y", plan.system.y_shape)]
    names = [indexed(name + mark, index) for name, shape in blocks for index in np.ndindex(shape)]
    beside: list[str] = [] if plan.system.control is None else ["work"]
    if attempts:
        each = ("longest", "relative", "absolute") if plan.acceptance.own else ("longest",)
        groups = range(engine.groups_of(plan))
        beside = [*adaptive.Pace._fields[: engine.PACE_NUMBERS], *(indexed(name, (group,)) for name in each for group in groups)]
    return names + [name + mark for name in beside]


def coefficients(plan: Plan) -> list[str]:
    """What the coefficients are called that an attempt by a series returns behind the state: ``y_3[0]`` is of order 3."""
    if not plan.method.has_series or plan.fused:
        return []
    blocks = [("v", plan.system.v_shape), ("y", plan.system.y_shape)]
    orders = range(1, (plan.order or plan.method.order) + 1)
    return [indexed(f"{name}_{k}", index) for k in orders for name, shape in blocks for index in np.ndindex(shape)]


# ---- values on a tape


def increments_last(tracer: Named, roots: Sequence[Any], single: bool = False) -> tuple[Any, dict[int, str], dict[int, str]]:
    """The tape of a step in which increments are multiplied last; names of its values, and which increments they are left of."""
    lines, places = listed(tracer.tape, [*roots, *(symbol for symbol, _ in tracer.called)])
    lines, place = increments.negated_sums(lines)
    places = [place[each] for each in places]
    order = in_order(lines, places[: len(roots)])
    kept, moved = needed(lines, places[: len(roots)])
    work = increments.Rewriting(kept, moved, single)
    work.run()
    tape = _core.Tape(single=single)
    symbols: list[Any] = []
    for name, of, extra in work.made:
        symbols.append(of_tape(tape, name, [symbols[each] for each in of], extra))
    names: dict[int, str] = {}
    left: dict[int, str] = {}
    for (_, name), at in zip(tracer.called, places[len(roots) :], strict=True):
        value = work.values[order[at]] if at in order else None
        if isinstance(value, increments.Increment):
            left.setdefault(symbols[value.x].id, f"{name} but for its factor")
        elif value is not None:
            names.setdefault(symbols[value].id, name)
    return tape, names, left


# ---- lines


class Leaf(NamedTuple):
    """A value that is there before: its text, its symbol or None, and how often it changes, the rarest first."""

    text: Formula
    symbol: Any
    rank: int


class _Value(NamedTuple):
    """A value that has been met."""

    text: Formula
    symbol: Any
    rank: int
    bits: int | None = None
    operations: Mapping[str, int] = MappingProxyType({})
    waits: bool = False  # it has no line of its own so far


class Writer:
    """Writes sections, one after the other, and knows what values are called."""

    def __init__(
        self,
        tape: Any,
        names: dict[int, str],
        notation: Notation | None = None,
        *,
        tables: Sequence[str] = (),
        notes: Mapping[int, str] = MappingProxyType({}),
    ) -> None:
        self.tape, self.names, self.tables, self.notes = tape, names, tables, notes
        self.notation = Notation() if notation is None else notation
        self._numbers: Counter[str] = Counter()
        self._used: set[str] = set()

    def symbol(self, name: str, of: Sequence[Any], extra: int) -> Any:
        """An operation on the tape, which has a name there; None if the tape has none."""
        if any(each is None for each in of):
            return None
        return self.notation.called[name](of[0]) if name in self.notation.called else of_tape(self.tape, name, of, extra)

    def source(self, name: str, extra: int) -> Any:
        """What a tape has without an operation."""
        return of_tape(self.tape, name, (), extra)

    def called(self, symbol: Any) -> str:
        """The name of a value in the method's text if it is free, which it then no longer is; else ""."""
        known = "" if symbol is None else self.names.get(symbol.id, "")
        if not known or known.startswith("−") or known in self._used:
            return ""
        self._used.add(known)
        return known

    def unused(self, letter: str) -> str:
        """The next name by a letter."""
        self._numbers[letter] += 1
        return f"{letter}{self._numbers[letter]}"

    def section(
        self,
        when: str,
        body: Body,
        leaf: Callable[[str, int], Leaf],
        rank: int,
        letter: str,
        results: Sequence[str] | None = None,
    ) -> tuple[Section, list[Leaf]]:
        """A body as a section, with its results, which are named by ``results`` if given and not "", and else by the letter."""
        operations, places = body
        reads = Counter(place for _, of, _ in operations for place in of)
        wanted = {place: name or None for place, name in zip(places, results or [""] * len(places), strict=True)}
        lines: list[Line] = []
        values: list[_Value] = []

        def name_of(place: int, value: _Value) -> tuple[str, str]:
            known = "" if value.symbol is None else self.names.get(value.symbol.id, "")
            if (given := wanted.get(place)) is not None:
                return given, known if known.lstrip("−").startswith("d") else ""
            if known and not known.startswith("−") and known not in self._used:
                return known, ""
            note = known if known.startswith("−") else "" if value.symbol is None else self.notes.get(value.symbol.id, "")
            return self.unused(letter), note

        def write(place: int) -> None:
            value = values[place]
            name, note = name_of(place, value)
            self._used.add(name)
            lines.append(Line(name, value.text.text, dict(value.operations), note))
            values[place] = _Value(self.notation.named(name, value.text), value.symbol, value.rank)

        def made(name: str, of: list[int], given: int) -> _Value:
            parts = [values[place] for place in of]
            symbol = self.symbol(name, [each.symbol for each in parts], given)
            if name.startswith("multiply") or name == "subtract multiply":  # what changes least stands first
                parts[:2] = sorted(parts[:2], key=lambda each: (each.rank, each.text.holds != PRODUCT))
            elif name == "add" and all(each.text.holds == ATOM for each in parts):  # and here last
                parts.sort(key=lambda each: -each.rank)
            elif name == "add" and (parts[0].text.holds != ATOM or parts[0].rank < 4):  # but v + (…), as methods are written
                parts.sort(key=lambda each: each.text.holds != SUM)
            if name == "sample" and self.tables:
                text = Formula(f"{self.tables[given]}({parts[0].text.text})")
            else:
                text = self.notation.formula(name, [each.text for each in parts], given, [each.bits for each in parts])
            count = sum((Counter(each.operations) for each in parts), Counter[str]())
            if name in OPERATIONS and (counted := OPERATIONS[name].counted):
                count[counted] += 1
            return _Value(text, symbol, max(each.rank for each in parts), None, count, True)

        for place, (name, of, given) in enumerate(operations):
            if name == "constant":
                values.append(_Value(self.notation.number(given), self.source(name, given), 0, given))
                continue
            if not of:
                text, symbol, rank_of_leaf = leaf(name, given)
                values.append(_Value(text, symbol, rank_of_leaf))
                continue
            value = made(name, of, given)
            while len(value.text.text) > self.notation.longest:
                waiting = [each for each in of if values[each].waits]
                if not waiting:
                    break
                write(max(waiting, key=lambda each: len(values[each].text.text)))
                value = made(name, of, given)
            values.append(value)
            known = "" if value.symbol is None else self.names.get(value.symbol.id, "")
            is_alias = name == "copy" and results is None
            if not is_alias and (place in wanted or reads[place] > 1 or (known and len(value.text.text) > SHORT)):
                write(place)
        out = []
        for place in places:
            value = values[place]
            if results is not None and operations[place][0] in ("state", "constant"):  # it stays as it is
                lines.append(Line(str(wanted[place]), value.text.text, {}))
            out.append(Leaf(value.text, value.symbol, rank if value.rank else 0))
        return Section(when, tuple(lines)), out


def lines_of_tape(plan: Plan, split: dict[str, Any], attempts: bool) -> tuple[Section, ...]:
    """The sections of a step that is one tape, cut as the core did."""
    tape = _core.Tape(single=plan.single)
    tracer = Named(plan.system, tape)
    roots = traced(tracer, plan, attempts)
    names, notes = tracer.names, dict[int, str]()
    if plan.fused:
        tape, names, notes = increments_last(tracer, roots, plan.single)
    numbers, tables = parameters(plan)
    of_state, next_state = states(plan, attempts), states(plan, attempts, "'")
    params = [tape.param(i) for i in range(len(numbers))]
    for each, symbol in zip(numbers, params, strict=True):
        if each == "omega":
            names[(tape.step() * symbol).id] = "Φ"

    def parameter(i: int, rank: int) -> Leaf:
        if i >= len(numbers):
            return Leaf(Formula("max_steps"), tape.budget(), rank)
        return Leaf(Formula(numbers[i]), params[i], rank)

    def given(i: int) -> Leaf:
        kind, which = split["given"][i]
        if kind == "step":
            return Leaf(Formula("h"), tape.step(), 1)
        if kind == "parameter":
            return parameter(which, 1)
        return Leaf(Formula("lanes" if kind == "lanes" else f"{tables[which]}.{kind}"), None, 1)

    def before(name: str, i: int) -> Leaf:
        return given(i) if name == "uniform" else parameter(split["params"][i], 2)

    def in_step(name: str, i: int) -> Leaf:
        return given(i) if name == "uniform" else Leaf(Formula("t"), tape.time(), 3)

    writer = Writer(tape, names, Notation(plan.single), notes=notes)
    run, uniforms = writer.section("run", split["run"], before, 1, "c")
    member, rows = writer.section("member", split["member"], before, 2, "c")
    step, entries = writer.section("step", split["step"], in_step, 3, "s")

    def entry(i: int) -> Leaf:
        kind, table = split["entries"][i]
        if kind == "value":
            return entries[i]
        return Leaf(Formula(f"{tables[table]}[{entries[i].text.text}]"), None, 3 if kind == "sample" else 4)

    def hot(name: str, i: int) -> Leaf:
        match name:
            case "state":
                return Leaf(Formula(of_state[i]), tape.state(i), 4)
            case "uniform":
                return uniforms[i]
            case "row":
                return rows[i]
            case _:
                return entry(i)

    next_state += coefficients(plan) if attempts else []
    body, _ = writer.section("member step", split["body"], hot, 4, "a", next_state)
    return run, member, step, body


def line_of_matrices(plan: Plan) -> tuple[Section, ...]:
    """A step by matrices that are too large for one tape: s is v and then y, x the inputs at each node of the method."""
    return (Section("member step", (Line("s'", "P·s + Q·x" if plan.system.given_inputs() else "P·s", {}),)),)


def lines_of_program(plan: Plan, attempts: bool) -> tuple[Section, ...]:
    """A method as what it does to blocks."""
    entries, results = _core.program(plan.method.name, attempts=attempts)
    carry = plan.method.carry or "v"
    called = dict(zip(results, [f"{carry}'", "y'", "error_v", "error_y", "coarse_v", "coarse_y"], strict=False))
    counts: Counter[str] = Counter()
    for place, (name, of, _) in enumerate(entries):
        if name in ("dv", "dy"):
            counts[name] += 1
            called.setdefault(place, f"{name}{counts[name]}")
            for block, operand in zip("vy", of, strict=True):
                if entries[operand][1] and f"{block}{counts[name]}" not in called.values():
                    called.setdefault(operand, f"{block}{counts[name]}")
    reads = Counter(place for _, of, _ in entries for place in of)
    lines: list[Line] = []
    texts: list[Formula] = []
    for place, (name, of, share) in enumerate(entries):
        parts = [texts[each] for each in of]
        match name:
            case "v" | "y":
                text = Formula(carry if name == "v" else "y")
            case "dv" | "dy":
                t = "t" if share == 0.0 else "t + h" if share == 1.0 else f"t + {share!r}·h"
                text = Formula(f"{name}({t}, {parts[0].text}, {parts[1].text})")
            case "scale":
                text = formula("multiply", [number(_bits(share)), *parts], 0, [None, None])
            case _:
                text = formula(name, parts, 0, [None] * len(parts))
        if of and (place in called or reads[place] > 1):
            if place not in called:
                counts["a"] += 1
            name = called.get(place, f"a{counts['a']}")
            lines.append(Line(name, text.text, {}))
            text = Formula(name)
        texts.append(text)
    lines += [Line(name, texts[place].text, {}) for place, name in called.items() if not entries[place][1]]
    return (Section("member step", tuple(lines)),)


def _bits(x: float) -> int:
    return int(np.float64(x).view(np.uint64))
