"""The operations of a step as lines, each with a name and a formula.

A value that is used once is written in the formula that uses it, as long as the line stays short. A value keeps its name in the
text of the method: ``dv1``, ``dy1`` are the first increments of a step, ``v2``, ``y2`` the state of the second evaluation,
``v'``, ``y'`` the next state. Other values are numbered: ``c1`` is computed before the steps, ``s1`` once a step, ``a1`` for each
member in each step.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from ... import _core
from ...reference.tape.operations import OPERATIONS, of_tape
from ...runs.engine import Plan
from ...runs.engine.counted import traced
from .formula import ATOM, PRODUCT, SUM, Formula, Notation, formula, number
from .naming import Named, coefficients, increments_last, parameters, states

#: A formula of a named value that is longer than this has a line of its own; a shorter one is written where it is used.
SHORT = 12

#: A body: the operations, each with its name, the indices of its operands and its extra argument; and the indices of the results.
Body = tuple[list[tuple[str, list[int], int]], list[int]]


class Line(NamedTuple):
    """A value of a step.

    Attributes:
        name: its name.
        formula: its formula, read as in Python, with · − √ ≤ for multiplication, subtraction, square root and comparison; =
            compares.
        operations: the number of operations of each kind, as in ``Explanation.computed``.
        note: its meaning in the method, where its name does not say so.
    """

    name: str
    formula: str
    operations: dict[str, int]
    note: str = ""


class Section(NamedTuple):
    """The values that are computed equally often.

    Attributes:
        when: ``"run"``, ``"member"``, ``"step"`` or ``"member step"``: once a run for all members, once a run for each member,
            once a step for all members, in each step for each member.
        lines: the values, each after those that it reads.
    """

    when: str
    lines: tuple[Line, ...]


class Leaf(NamedTuple):
    """A value that exists before a section: its text, its symbol or None, and a rank by how often it changes, 0 for never."""

    text: Formula
    symbol: Any
    rank: int


class _Value(NamedTuple):
    """A value of a section."""

    text: Formula
    symbol: Any
    rank: int
    bits: int | None = None
    operations: Mapping[str, int] = MappingProxyType({})
    waits: bool = False  # it has no line of its own so far


class Writer:
    """Writes sections, one after the other, and names their values."""

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
        self._traced = len(tape)

    def symbol(self, name: str, of: Sequence[Any], extra: int) -> Any:
        """The symbol of an operation, by which its name is known; None if an operand has no symbol."""
        if any(each is None for each in of):
            return None
        if name in self.notation.called:
            return self.notation.called[name](of[0])
        symbol = of_tape(self.tape, name, of, extra)
        if name == "multiply" and symbol.id >= self._traced:
            # The core moved a sign from the product to a constant in it; the method has it before the product.
            for a, b in (of, reversed(of)):
                if (product := (-a) * b).id < self._traced:
                    return -product
        return symbol

    def source(self, name: str, extra: int) -> Any:
        """The symbol of a value without operands."""
        return of_tape(self.tape, name, (), extra)

    def called(self, symbol: Any) -> str:
        """The name of a value in the method's text, which is then taken; "" if it has none or the name is taken already."""
        known = "" if symbol is None else self.names.get(symbol.id, "")
        if not known or known.startswith("−") or known in self._used:
            return ""
        self._used.add(known)
        return known

    def unused(self, letter: str) -> str:
        """The next name that begins with a letter."""
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
        """A body as a section, and its results as leaves.

        Args:
            when: how often it is computed, as in ``Section``.
            body: the operations and the places of the results.
            leaf: the leaf of an operation without operands, by its name and extra argument.
            rank: how often the results change.
            letter: the beginning of names.
            results: the names of the results; "" for those that get the next name by the letter, as all do for None.
        """
        operations, places = body
        reads = Counter(place for _, of, _ in operations for place in of)
        wanted = {place: name or None for place, name in zip(places, results or [""] * len(places), strict=True)}
        lines: list[Line] = []
        values: list[_Value] = []

        def name_of(place: int, value: _Value) -> tuple[str, str]:
            known = "" if value.symbol is None else self.names.get(value.symbol.id, "")
            if (name := wanted.get(place)) is not None:
                return name, known if known.lstrip("−").startswith("d") else ""
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

        def operation(name: str, of: list[int], extra: int) -> _Value:
            parts = [values[place] for place in of]
            symbol = self.symbol(name, [each.symbol for each in parts], extra)
            if name.startswith("multiply") or name == "subtract multiply":  # the factor that changes least comes first
                parts[:2] = sorted(parts[:2], key=lambda each: (each.rank, each.text.holds != PRODUCT))
            elif name == "add" and all(each.text.holds == ATOM for each in parts):  # the summand that changes least comes last
                parts.sort(key=lambda each: -each.rank)
            elif name == "add" and (parts[0].text.holds != ATOM or parts[0].rank < 4):  # but v + (…), as methods are written
                parts.sort(key=lambda each: each.text.holds != SUM)
            if name == "sample" and self.tables:
                text = Formula(f"{self.tables[extra]}({parts[0].text.text})")
            else:
                text = self.notation.formula(name, [each.text for each in parts], extra, [each.bits for each in parts])
            count: dict[str, int] = {}
            for each in parts:
                for counted, n in each.operations.items():
                    count[counted] = count.get(counted, 0) + n
            if name in OPERATIONS and (counted := OPERATIONS[name].counted):
                count[counted] = count.get(counted, 0) + 1
            return _Value(text, symbol, max(each.rank for each in parts), None, count, True)

        for place, (name, of, extra) in enumerate(operations):
            if name == "constant":
                values.append(_Value(self.notation.number(extra), self.source(name, extra), 0, extra))
                continue
            if not of:
                text, symbol, rank_of_leaf = leaf(name, extra)
                values.append(_Value(text, symbol, rank_of_leaf))
                continue
            value = operation(name, of, extra)
            while len(value.text.text) > self.notation.longest:
                waiting = [each for each in of if values[each].waits]
                if not waiting:
                    break
                write(max(waiting, key=lambda each: len(values[each].text.text)))
                value = operation(name, of, extra)
            values.append(value)
            known = "" if value.symbol is None else self.names.get(value.symbol.id, "")
            is_alias = name == "copy" and results is None
            if not is_alias and (place in wanted or reads[place] > 1 or (known and len(value.text.text) > SHORT)):
                write(place)
        out = []
        for place in places:
            value = values[place]
            if results is not None and operations[place][0] in ("state", "constant"):  # a line without an operation
                lines.append(Line(str(wanted[place]), value.text.text, {}))
            out.append(Leaf(value.text, value.symbol, rank if value.rank else 0))
        return Section(when, tuple(lines)), out


def lines_of_tape(plan: Plan, split: dict[str, Any], attempts: bool) -> tuple[Section, ...]:
    """The sections of a step that is one tape, split as in the core."""
    tape = _core.Tape(single=plan.single)
    tracer = Named(plan.stepped, tape)
    roots = traced(tracer, plan, attempts)
    names, notes = tracer.names, dict[int, str]()
    if plan.fuses:
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

    def uniform(i: int) -> Leaf:
        kind, which = split["given"][i]
        if kind == "step":
            return Leaf(Formula("h"), tape.step(), 1)
        if kind == "parameter":
            return parameter(which, 1)
        return Leaf(Formula("lanes" if kind == "lanes" else f"{tables[which]}.{kind}"), None, 1)

    def before(name: str, i: int) -> Leaf:
        return uniform(i) if name == "uniform" else parameter(split["params"][i], 2)

    def in_step(name: str, i: int) -> Leaf:
        return uniform(i) if name == "uniform" else Leaf(Formula("t"), tape.time(), 3)

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
    """A step by matrices that are too large for one tape: s is v followed by y, x the inputs at each node of the method."""
    return (Section("member step", (Line("s'", "P·s + Q·x" if plan.system.given_inputs() else "P·s", {}),)),)


def lines_of_program(plan: Plan, attempts: bool) -> tuple[Section, ...]:
    """The operations of a method on blocks."""
    entries, results = _core.program(plan.method.key, attempts=attempts)
    carry = plan.method.carry or "v"
    called = dict(zip(results, [f"{carry}'", "y'", "error_v", "error_y", "coarse_v", "coarse_y"], strict=False))
    counts: Counter[str] = Counter()
    for place, (name, of, _) in enumerate(entries):
        if name in ("dv", "dy", "kick"):
            name = "dv" if name == "kick" else name
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
            case "dv" | "dy" | "kick":  # a step by Kepler motions is one tape: here a kick is h·v̇
                name = "dv" if name == "kick" else name
                t = "t" if share == 0.0 else "t + h" if share == 1.0 else f"t + {share!r}·h"
                text = Formula(f"{name}({t}, {parts[0].text}, {parts[1].text})")
            case "implicit v" | "implicit y":
                text = Formula(f"solve_{name[-1]}({parts[0].text}, {parts[1].text})")
            case "v by time" | "y by time":
                text = Formula(f"d{name[0]}_by_t")
            case "drift of v":
                text = parts[0]
            case "drift of y":  # and a drift is free flight
                flight = Formula(f"dy(t, {parts[0].text}, {parts[1].text})")
                flight = flight if share == 1.0 else formula("multiply", [number(_bits(share)), flight], 0, [None, None])
                text = formula("add", [parts[1], flight], 0, [None, None])
            case "square for v" | "square for y":
                text = Formula(f"square({parts[0].text}, {parts[1].text})")
            case "if at most":
                is_at_most = formula("at most", parts[:2], 0, [None, None])
                text = formula("choose", [is_at_most, *parts[2:]], 0, 3 * [None])
            case "mass":
                text = parts[0]  # a step with a mass matrix is one tape
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
