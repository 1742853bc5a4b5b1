"""A step as a C# class, for .NET, Unity and Godot."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from typing import Any, ClassVar

from ...base.arrays import Shape
from ..explanation import formula as plain
from ..explanation.formula import Formula
from .language import functions_on_bits
from .lines import indented, listed
from .names import camel
from .program import FORCE
from .skeleton import Skeleton
from .written import Written

TYPES = {"number": "double", "truth": "bool", "bits": "ulong", "wide": "double", "index": "int"}
SINGLE_TYPES = TYPES | {"number": "float", "bits": "uint"}

#: Frameworks before .NET Core 2 have no function for the bits of a float; two fields in one place do without ``unsafe``.
SINGLE_BITS = """[StructLayout(LayoutKind.Explicit)]
struct _Bits {
    [FieldOffset(0)] public float number;
    [FieldOffset(0)] public uint whole;
}"""

SAMPLE = """// The sample that holds at a time: the last that is not after it; before all the first.
static double _sample(double[] samples, double start, double interval, double t) {
    double i = Math.Floor((t - start) / interval * 1.0000000000000568); // t may miss a sample's time by rounding
    return samples[i > 0.0 ? (int)Math.Min(i, samples.Length - 1.0) : 0];
}"""


def _on_bits(name: str, arguments: str, expression: str) -> str:
    return f"static ulong _{name}({arguments}) {{ return {expression}; }}"


TWO, SHIFT = "ulong a, ulong b", "ulong a, int n"

TURN_SIGN = """// x, its sign turned if the last bit of y is set.
static double _turn_sign(double x, double y) { return _number_of(_bits_of(x) ^ _bits_of(y) << 63); }"""

ON_BITS = {
    "turn_sign": TURN_SIGN,
    "mask_of": _on_bits("mask_of", "bool truth", "truth ? ulong.MaxValue : 0"),
    "choose_bits": _on_bits("choose_bits", "ulong mask, ulong a, ulong b", "(mask & a) | (~mask & b)"),
    **functions_on_bits(_on_bits, TWO, SHIFT, add_bits="unchecked(a + b)", sub_bits="unchecked(a - b)"),
}

HELPERS = {
    "bits_of": _on_bits("bits_of", "double x", "unchecked((ulong)BitConverter.DoubleToInt64Bits(x))"),
    "number_of": "static double _number_of(ulong b) { return BitConverter.Int64BitsToDouble(unchecked((long)b)); }",
}

SINGLE_HELPERS = {
    "Bits": SINGLE_BITS,
    "bits_of": "static uint _bits_of(float x) { return new _Bits { number = x }.whole; }",
    "number_of": "static float _number_of(uint b) { return new _Bits { whole = b }.number; }",
}

#: Operations whose result C# may compute in more digits than those of float, until it is converted.
ROUNDED = ("add", "subtract", "multiply", "divide", "square root")


def _narrow(text: str) -> str:
    return text.replace("double", "float").replace("ulong", "uint").replace("<< 63", "<< 31")


class CSharp(Skeleton):
    """Two classes, without ``unsafe`` and without packages, for every framework from .NET 4.6 and Unity 2018 on."""

    title = "C#"
    endings = (".cs",)
    infinity, magnitude, fma = "double.PositiveInfinity", "Math.Abs", None
    writes: ClassVar[dict[str, str]] = {"square root": "Math.Sqrt({})", "floor": "Math.Floor({})"}
    bits_literal = "{}UL"
    me = "this."
    time = "this.t0 + s.step * this.dt"
    types: ClassVar[dict[str, str]] = TYPES
    helpers: ClassVar[dict[str, str]] = HELPERS | ON_BITS | {"sample": SAMPLE}
    declaration, variable = "$type $name = $text;", ("$type $name = $text;", "$type $name;")
    loop_of_lines = ("for (int i = 0; i < $count; i++) {", "}")
    loop, work_array = "for (int i = 0; i < $count; i++) $line", "$number[] w = _waiting;"
    table, table_end, array = "static readonly $of[] $name = {", "};", "$number[] $name = {"
    force = f", $number[] {FORCE}"
    heads: ClassVar[dict[str, str]] = {
        "function": "static $number _$name($number x)",
        "prepare": "public void Prepare()",
        "start": "public ${type}State Start($parameters$force)",
        "step": "public void Step(${type}State s$force)",
        "finish": "public $number[] Finish(${type}State s$force)",
        "work": "public double Work(${type}State s)",
    }
    velocities = "$number[] velocities = new $number[$n];"
    returned: ClassVar[dict[str, str]] = {"start": "return s;", "finish": "return velocities;"}
    work = "return s.tally / ($evaluations.0 * this.dt);"
    usage = (
        "A part of a project of .NET, Unity or Godot; or compiled with a program such as the example: csc example.cs $prefix.cs",
        "var m = new $type() sets the parameters; change any of them and call m.Prepare().",
        "var s = m.Start($blocks$start_force) is the state at step 0, m.Step(s$step_force) makes one step.",
    )
    calls: ClassVar[dict[str, str]] = {"finish": "m.Finish(s$finish_force)", "work": "m.Work(s)"}
    program = """using System;
using System.Globalization;

static class Example {
    static void Main() {
        $arrays
        var m = new $type();
        var s = m.Start($blocks$start_force);
        for (int k = 0; k < $steps; k++) m.Step(s$step_force);
        Console.WriteLine(s.$shown[0].ToString("R", CultureInfo.InvariantCulture));
    }
}"""
    of_single: ClassVar[dict[str, Any]] = {
        "infinity": "float.PositiveInfinity",
        "writes": {"square root": "Math.Sqrt({})", "floor": "(float)Math.Floor({})"},
        "bits_literal": "{}U",
        "time": "(float)(this.t0 + s.step * (double)this.dt)",
        "types": SINGLE_TYPES,
        "helpers": SINGLE_HELPERS | {name: _narrow(text) for name, text in ON_BITS.items()},
        "work": "return s.tally / ($evaluations.0 * (double)this.dt);",
    }

    def literal(self, x: float) -> str:
        """A finite number: the shortest text that is read as this number."""
        return plain.shortest(x, self.single) + "f" * self.single

    def formula(self, name: str, of: Sequence[Formula], extra: int, bits: Sequence[int | None]) -> Formula:
        """An operation on these; in float32 its result is rounded at once."""
        exact = super().formula(name, of, extra, bits)
        return Formula(f"(float)({exact.text})") if self.single and name in ROUNDED else exact

    def helper(self, name: str) -> str:
        """The name of a function in the file: no parameter begins so."""
        return f"_{name}"

    def file(self, w: Written, head: list[str]) -> str:
        """The whole text; ``head`` is the comment at its head."""
        p, number = camel(self.prefix), self.types["number"]
        functions = self._functions(w)
        texts = ["\n".join(each) for each in functions]
        work = max(each.work or 0 for each in w.functions.values())
        waiting = [f"// Where values of loops wait for other loops.\n{number}[] _waiting = new {number}[{work}];"] * bool(work)
        helpers = self._helpers("\n".join([*texts, *self._tables(w)]))
        parts = ["\n".join(self._parameters(w)), *texts, *waiting, *self._tables(w), *helpers]
        inside = "\n\n".join("\n".join(indented(each.splitlines())) for each in parts)
        state = "\n".join(["/// A state.", f"public sealed class {p}State {{", *indented(self._state(w)), "}"])
        using = ["using System;", "using System.Runtime.InteropServices;"] if self.single else ["using System;"]
        if re.search(r"(\b\w[\w.\[\]]*) [!=]= \1(?![\w.\[])", inside):
            using += ["", "#pragma warning disable 1718 // what differs from itself is NaN"]
        about = "/// The description of a step, and the step."
        return "\n".join([*head, "", *using, "", about, f"public sealed class {p} {{", inside, "}", "", state]) + "\n"

    def _with_head(self, w: Written, name: str, lines: Iterable[str]) -> list[str]:
        # The first argument has no comma before it.
        return [line.replace("(, ", "(", 1) if line.startswith("public") else line for line in super()._with_head(w, name, lines)]

    def _parameter(self, name: str, n: int) -> str:
        return f", {self.types['number']}[] {name}"

    def _parameters(self, w: Written) -> list[str]:
        """The fields of the parameters, with the numbers with which they were exported, and of what is made of them."""
        lines: list[str] = []
        for each in w.parameters:
            begin = f"public {self.type_of(each)}{'[]' * len(each.shape)} {each.name} = "
            if each.shape:
                lines += self._nested(begin, each.values, each.shape, ";")
            else:
                lines.append(f"{begin}{self.value(each)};{self._about(each)}")
        hoisted = [f"{self.types[each.kind]} {each.name.removeprefix(self.me)};" for each in w.hoisted]
        number = self.types["number"]
        hoisted += [f"{number}[] {w.array} = new {number}[{w.hoisted_size}];"] * bool(w.hoisted_size)
        return [*lines, "", f"{self.comment} Made of these by Prepare.", *hoisted] if hoisted else lines

    def _nested(self, begin: str, values: Sequence[float], shape: Shape, end: str, indent: str = "") -> list[str]:
        """An array of arrays of numbers, between two texts."""
        if len(shape) == 1:
            return listed(f"{begin}{{", [self.signed(x) for x in values], f"}}{end}", indent)
        size, kind = len(values) // shape[0], f"new {self.types['number']}{'[]' * (len(shape) - 1)} "
        lines = [f"{indent}{begin}{{"]
        for i in range(shape[0]):
            lines += self._nested(kind, values[i * size : (i + 1) * size], shape[1:], ",", indent + "    ")
        return [*lines, f"{indent}}}{end}"]

    def _state(self, w: Written) -> list[str]:
        number = self.types["number"]
        lines = [f"public {number}[] {name};" for name, _, _ in w.blocks]
        lines += [f"public {number} tally; // what the control has added up"] * bool(w.evaluations)
        lines += [f"public {number}[] memory; // {w.of_memory}"] * bool(w.memory)
        return [*lines, "public long step; // k; the time is t0 + k*dt"]

    def _create(self, w: Written) -> list[str]:
        about = "With the parameters with which it was exported."
        return self._function(about, f"public {camel(self.prefix)}()", ["Prepare();"])

    def _initial(self, w: Written) -> list[str]:
        carried, number = w.slot if w.carries else "", self.types["number"]
        lines = []
        for of, n in w.arguments:
            numbers = f"{n} number{'s' * (n > 1)}"
            lines.append(f"if ({of}.Length != {n})")
            lines.append(f'    throw new ArgumentException("{of}: expected {numbers}, got " + {of}.Length);')
        lines.append(f"var s = new {camel(self.prefix)}State();")
        for name, of, n in w.blocks:
            lines.append(f"s.{name} = " + (f"new {number}[{n}];" if name == carried else f"({number}[]){of}.Clone();"))
        memory = listed(f"s.memory = new {number}[] {{", w.memory, "};") if w.memory else []
        return [*lines, *memory]
