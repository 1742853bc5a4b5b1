"""The order of a file, which all languages share. A language fills in its syntax, mostly as texts with ``$words``.

``$prefix`` is the beginning of names, ``$type`` the type of the parameters, ``$number`` the type of numbers, ``$slot`` the first
block of a state. A call has ``$force`` after its arguments if the function reads a force.
"""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from string import Template
from typing import ClassVar

from ... import _core
from ...base.arrays import Shape
from ..explanation.formula import Formula
from ..explanation.listing import Leaf, Writer
from .functions import FUNCTIONS, operations_of
from .language import Language
from .lines import indented, listed, printable
from .names import Field, Names, camel
from .program import FORCE, Assignment, Conditional, Function, Lanes, Loop, Statement
from .written import Written

#: The comments of the functions of a file.
ABOUT = {
    "prepare": "What does not change from step to step. To be called after a change of a parameter.",
    "start": "The state at step 0, of velocities and coordinates.",
    "step": "One step.",
    "finish": "The velocities at a state.",
    "work": "The energy that the control has given since the start.",
}


def filled(text: str, words: Mapping[str, object]) -> str:
    """A template with these words filled in."""
    return Template(text).substitute(words)


class Skeleton(Language, ABC):
    """How a language writes a file.

    Attributes:
        endings: endings of its files.
        comment: the beginning of a comment.
        doc: the beginning of a comment that says what a function does.
        gap: what stands between a statement and a comment behind it.
        end: the end of a statement.
        step_in: the indentation of a block.
        time: the expression for the time of the present step.
        state: the prefix of a field of the state.
        declaration: the declaration of a value.
        variable: the declaration of a variable that a branch sets: with a first value, and without.
        branch: the lines around both sides of a branch; the last is omitted if empty.
        loop: a line for each i from 0 on.
        loop_of_lines: the lines around several lines for each i; the last is omitted if empty.
        work_array: the array in which values of loops wait for other loops; empty where it is made once.
        table: the first line of a table of numbers.
        table_end: its last line.
        array: the first line of an array in the example.
        rounding: the expression that rounds a number to the precision of the file; ``single`` in the file rounds a list.
        heads: the first line of each function, without the brace.
        about_function: the comment of a function of one number.
        force: the parameter of a function for a force from outside.
        passed_force: the argument for it in a call.
        carried: the lines before the computation of a method's carry.
        returned: the last statement of "start" and of "finish", if there is one.
        velocities: the statement that declares the velocities that "finish" computes, if there is one.
        work: the statement that computes the energy which the control has given.
        order: the functions of a file in their order.
        usage: the description of how to make a step.
        calls: the calls of "finish" and "work".
        program: an example that makes some steps and prints a number of the state; its arrays take the place of ``$arrays``.
    """

    endings: ClassVar[tuple[str, ...]]
    comment: ClassVar[str] = "//"
    doc: ClassVar[str] = "//"
    gap: ClassVar[str] = " "
    end: ClassVar[str] = ";"
    step_in: ClassVar[str] = "    "
    time: ClassVar[str]
    state: ClassVar[str] = "s."
    declaration: ClassVar[str]
    variable: ClassVar[tuple[str, str]]
    branch: ClassVar[tuple[str, str, str]] = ("if ($condition) {", "} else {", "}")
    loop: ClassVar[str]
    loop_of_lines: ClassVar[tuple[str, str]]
    work_array: ClassVar[str]
    table: ClassVar[str]
    table_end: ClassVar[str] = "];"
    array: ClassVar[str]
    rounding: ClassVar[str] = "$text"
    heads: ClassVar[dict[str, str]]
    about_function: ClassVar[str] = "The $name of x."
    force: ClassVar[str] = f", {FORCE}"
    passed_force: ClassVar[str] = f", {FORCE}"
    carried: ClassVar[list[str]] = [""]
    returned: ClassVar[dict[str, str]] = {}
    velocities: ClassVar[str] = ""
    work: ClassVar[str]
    order: ClassVar[tuple[str, ...]] = ("create", "prepare", "start", "step", "finish", "work")
    usage: ClassVar[tuple[str, ...]]
    calls: ClassVar[dict[str, str]] = {"finish": "m.finish(s$finish_force)", "work": "m.work(s)"}
    program: ClassVar[str]

    # ---- texts about the file

    def remark(self, lines: Iterable[str]) -> list[str]:
        """Lines as a comment."""
        return [f"{self.comment} {printable(line)}".rstrip() for line in lines]

    def usage_of(self, w: Written) -> list[str]:
        """The description of how to compile and call a file."""
        lines = [*self.usage]
        if w.carries:
            lines.append(f"{self.calls['finish']} finds the velocities; in the state $slot stands in their place.")
        if w.evaluations:
            lines.append(f"{self.calls['work']} is the energy that the control has given since the start.")
        words = self._words(w)
        return [filled(line, words) for line in lines]

    def example(self, w: Written, v: list[float], y: list[float], steps: int) -> list[str]:
        """A program that makes some steps and prints a number of the state."""
        arrays = {name: block for name, block in (("v", v), ("y", y)) if block}
        words = self._words(w) | {"blocks": ", ".join(arrays), "steps": steps}
        if w.traced.force:
            arrays[FORCE] = w.traced.force
        lines: list[str] = []
        for line in self.program.splitlines():
            if line.strip() != "$arrays":
                lines.append(filled(line, words))
                continue
            for name, numbers in arrays.items():
                begin = filled(self.array, words | {"name": name, "count": len(numbers)})
                lines += listed(begin, [self._shown(x) for x in numbers], self.table_end, line.removesuffix("$arrays"))
        return lines

    def _shown(self, x: float) -> str:
        """A number of the example."""
        return self.signed(x)

    def _words(self, w: Written) -> dict[str, object]:
        words: dict[str, object] = {
            "prefix": self.prefix,
            "type": camel(self.prefix),
            "number": self.types.get("number", ""),
            "slot": w.slot,
            "n": w.n_v,
            "shown": w.shown,
            "evaluations": w.evaluations,
            "blocks": ", ".join(argument for _, argument, _ in w.blocks),
        }
        return words | {f"{name}_force": self.passed_force * w.forced(name) for name in ("start", "step", "finish")}

    # ---- the file

    @abstractmethod
    def file(self, w: Written, head: list[str]) -> str:
        """The whole text; ``head`` is the comment at its head."""

    @abstractmethod
    def _create(self, w: Written) -> list[str]:
        """The function that sets the parameters with which the step was exported."""

    @abstractmethod
    def _initial(self, w: Written) -> list[str]:
        """Statements that set the state at step 0; the carry of a method is computed after them."""

    def _functions(self, w: Written) -> list[list[str]]:
        written = {
            "create": self._create,
            "prepare": self._prepare,
            "start": self._start,
            "step": self._step,
            "finish": self._finish,
            "work": self._work,
        }
        absent = ["finish"] * (not w.carries) + ["work"] * (not w.evaluations)
        return [written[name](w) for name in self.order if name not in absent]

    def _function(self, about: str, head: str, lines: Iterable[str]) -> list[str]:
        return [f"{self.doc} {about}", *f"{head} {{".splitlines(), *indented(lines, self.step_in), "}"]

    def _with_head(self, w: Written, name: str, lines: Iterable[str]) -> list[str]:
        words = self._words(w)
        words["force"] = filled(self.force, words) * w.forced(name)
        words["parameters"] = "".join(self._parameter(argument, n) for _, argument, n in w.blocks)
        return self._function(ABOUT[name], filled(self.heads[name], words), lines)

    def _parameter(self, name: str, n: int) -> str:
        """The declaration of a block as an argument, in languages with types."""
        return ""

    def _prepare(self, w: Written) -> list[str]:
        lines: list[str] = []
        if self.rounding != "$text":
            names = [self.me + each.name for each in w.parameters if not each.wide]
            lines += [f"{name} = single({name}){self.end}" for name in names]
        lines += [f"{each.name} = {each.text}{self.end}" for each in w.hoisted]
        lines += [line for each in w.loops for line in self._statement(each)]
        return self._with_head(w, "prepare", lines)

    def _start(self, w: Written) -> list[str]:
        lines = self._initial(w)
        if (start := w.functions.get("start")) is not None:
            to = {name: f"{self.state}{name}" for name in (w.slot, "memory")}
            of = {"v": "velocities", "y": "coordinates", "memory": f"{self.state}memory"}
            about = "The carry, in place of v." if w.carries else "What the method keeps."
            lines += [*self.carried, *self._body(start, of, to, about)]
        return self._with_head(w, "start", [*lines, *self._returned(w, "start")])

    def _step(self, w: Written) -> list[str]:
        of = {name: f"{self.state}{name}" for name in (w.slot, "y", "tally", "memory")}
        return self._with_head(w, "step", [*self._body(w.functions["step"], of, of), f"{self.state}step += 1{self.end}"])

    def _finish(self, w: Written) -> list[str]:
        of = {name: f"{self.state}{name}" for name in (w.slot, "y")}
        declaration = [filled(self.velocities, self._words(w))] * bool(self.velocities)
        body = self._body(w.functions["finish"], of, {"v": "velocities"}, "The velocities.")
        return self._with_head(w, "finish", [*declaration, *body, *self._returned(w, "finish")])

    def _work(self, w: Written) -> list[str]:
        return self._with_head(w, "work", [filled(self.work, self._words(w))])

    def _returned(self, w: Written, name: str) -> list[str]:
        return [self.returned[name]] if name in self.returned else []

    # ---- numbers of the file

    def _tables(self, w: Written) -> list[str]:
        """The tables of samples, and of places in arrays."""
        tables = []
        for each in w.tables:
            begin = self._table(f"{each.name}_samples", "number", len(each.values))
            numbers = [self.signed(x) for x in each.values]
            tables.append("\n".join([f"{self.doc} The samples of {each.about}.", *listed(begin, numbers, self.table_end)]))
        places: list[str] = []
        for name, indices in w.places.items():
            places += listed(self._table(name, "index", len(indices)), list(map(str, indices)), self.table_end)
        return [*tables, "\n".join(places)] if places else tables

    def _table(self, name: str, kind: str, count: int) -> str:
        return filled(self.table, {"name": self.table_name(name), "of": self.types.get(kind, ""), "count": count})

    def _set(self, w: Written, begin: str, end: str, *, remarks: bool) -> list[str]:
        """Statements that set the parameters, each with ``begin``, in which ``$name`` is its name, its numbers, and ``end``."""
        lines: list[str] = []
        for each in w.parameters:
            assigned = filled(begin, {"name": each.name})
            if each.shape:
                lines += self._nested(assigned, each.values, each.shape, end)
            else:
                lines.append(f"{assigned}{self.value(each)}{end}{self._about(each) if remarks else ''}")
        return lines

    def _about(self, field: Field) -> str:
        """A comment after a parameter, if its name does not say all."""
        return f"{self.gap}{self.comment} {field.about}" * (field.about != field.name)

    def _nested(self, begin: str, values: Sequence[float], shape: Shape, end: str, indent: str = "") -> list[str]:
        """An array of arrays of numbers, between two texts."""
        if len(shape) == 1:
            return listed(f"{begin}[", [self.signed(x) for x in values], f"]{end}", indent)
        size = len(values) // shape[0]
        lines = [f"{indent}{begin}["]
        for i in range(shape[0]):
            lines += self._nested("", values[i * size : (i + 1) * size], shape[1:], ",", indent + "    ")
        return [*lines, f"{indent}]{end}"]

    # ---- functions that a file needs

    def _helpers(self, text: str) -> list[str]:
        """The helper functions that this text of a file needs, in order; each may need those before it."""
        needed: list[str] = []
        for name in reversed([*self.helpers, *FUNCTIONS]):
            word = self.helper(name)
            if word in text and re.search(rf"\b{word}\b", text):  # the first is a hundred times as fast
                function = self.helpers[name] if name in self.helpers else self._of_one_number(name)
                needed.insert(0, function.replace("PREFIX", self.prefix))
                text += needed[0]
        return needed

    def _of_one_number(self, name: str) -> str:
        """The text of a function of one number, from its operations."""
        operations, (root,) = operations_of(name, self.single)
        self.names = Names(("x",))
        body = [*operations, ("copy", [root], 0)], [len(operations)]
        section, _ = Writer(_core.Tape(single=self.single), {}, self).section(
            "member step", body, lambda *_: Leaf(Formula("x"), None, 4), 4, "a", ["result"]
        )
        *lines, result = [(self.names(line.name), self.text(line.formula)) for line in section.lines]
        inside = [
            line for word, text in lines for line in self._statement(Assignment(word, self.kinds.get(word, "number"), text))
        ]
        words = {"name": name, "number": self.types.get("number", "")}
        about, head = filled(self.about_function, words), filled(self.heads["function"], words)
        return "\n".join(self._function(about, head, [*inside, f"return {result[1]}{self.end}"]))

    # ---- statements

    def _body(
        self, f: Function, read: Mapping[str, str], write: Mapping[str, str], after: str = "The state after the step."
    ) -> list[str]:
        """The body of a function, not indented.

        ``read`` and ``write`` have the array of each block before and after; ``after`` is the comment before the results.
        """

        def place(block: str, index: int, of: Mapping[str, str]) -> str:
            return of[block] if index < 0 else f"{of[block]}[{index}]"

        groups: list[tuple[str, Sequence[Statement]]] = [
            ("The state.", [Assignment(p.name, "number", place(p.block, p.at, read)) for p in f.reads if p.block != FORCE]),
            (
                "The force.",
                [Assignment(p.name, "number", self._rounded(f"{FORCE}[{p.at}]")) for p in f.reads if p.block == FORCE],
            ),
            ("What depends on the time alone.", f.of_time),
            ("What depends on the state.", f.lines),
        ]
        out = self._statement(Assignment("t", "number", self.time)) if f.needs_time else []
        if f.work and self.work_array:
            words = {"size": f.work, "number": self.types.get("number", ""), "zero": self.literal(0.0)}
            out.append(filled(self.work_array, words))
        for title, statements in groups:
            if statements:
                out += ["", f"{self.comment} {title}"]
            evaluation = 1
            for each in statements:
                if isinstance(each, Assignment) and each.evaluation > evaluation:
                    evaluation = each.evaluation
                    out += ["", f"{self.comment} Evaluation {evaluation} of the rates."]
                out += [self._placed(line, read, write) for line in self._statement(each)]
        if f.work is not None:
            return out if not out or out[0] else out[1:]
        out += ["", f"{self.comment} {after}"]
        out += [f"{place(p.block, p.at, write)} = {p.name}{self.end}" for p in f.writes]
        return out if out[0] else out[1:]

    def _rounded(self, text: str) -> str:
        return filled(self.rounding, {"text": text})

    def _placed(self, line: str, read: Mapping[str, str], write: Mapping[str, str]) -> str:
        """A line with the names of the blocks that are read and written."""
        line = re.sub(rf"@{FORCE}(\[.*?\]+)", lambda match: self._rounded(FORCE + match[1]), line)
        line = re.sub(r"@(\w+)", lambda match: read[match[1]], line)
        return re.sub(r"#(\w+)(?=[\[ ])", lambda match: write.get(match[1], match[0]), line)

    def _statement(self, each: Statement) -> list[str]:
        """The lines of a statement."""
        if isinstance(each, Loop):
            line = f"{each.target} = {each.text}{self.end}"
            return [line if each.times == 1 else filled(self.loop, {"count": each.times, "line": line})]
        if isinstance(each, Lanes):
            inside = [line for inner in each.lines for line in self._statement(inner)]
            begin, end = self.loop_of_lines
            return [filled(begin, {"count": each.times}), *indented(inside, self.step_in), *[end] * bool(end)]
        if isinstance(each, Conditional):
            then, other = ([line for inner in side for line in self._statement(inner)] for side in (each.then, each.other))
            if then:
                return self._conditional(each.condition, then, other)
            return self._conditional(f"{self.words[0]}{each.condition}", other, [])
        if each.role == "set":
            return [f"{each.name} = {each.text}{self.end}"]
        text = self.declaration if each.role == "new" else self.variable[not each.text]
        line = filled(text, {"type": self.types.get(each.kind, ""), "name": each.name, "text": each.text})
        return [line + (f"{self.gap}{self.comment} {each.note}" if each.note else "")] if line else []

    def _conditional(self, condition: str, then: list[str], other: list[str]) -> list[str]:
        begin, between, end = self.branch
        behind = [between, *indented(other, self.step_in)] if other else []
        return [filled(begin, {"condition": condition}), *indented(then, self.step_in), *behind, *[end] * bool(end)]
