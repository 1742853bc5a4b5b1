"""A step as a JavaScript module."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

from ..explanation.formula import Formula
from .language import FORCE, Assignment, Language, indented, listed
from .names import camel
from .written import Written

VIEWS = """// The bits of a number, by views of the same memory.
const number = new Float64Array(1);
const halves = new Uint32Array(number.buffer);
const whole = new BigUint64Array(number.buffer);
halves[0] = 1;
const low = whole[0] === 1n ? 0 : 1; // which half has the last bit"""

BITS_OF = """function bits_of(x) {
  number[0] = x;
  return whole[0];
}"""

NUMBER_OF = """function number_of(b) {
  whole[0] = b;
  return number[0];
}"""

TURN_SIGN = """// x, its sign turned if the last bit of y is set.
function turn_sign(x, y) {
  number[0] = y;
  return halves[low] & 1 ? -x : x;
}"""

SINGLE_VIEWS = """// The bits of a number of float32, by views of the same memory.
const number = new Float32Array(1);
const whole = new Uint32Array(number.buffer);"""

FROUND = """// The nearest number of float32. Of a sum, product, quotient or root of such numbers that was rounded to 53 bits,
// it is the one that a single rounding gives.
const fround = Math.fround;"""

SINGLE = """// Numbers rounded to float32.
function single(x) {
  return Array.isArray(x) ? x.map(single) : fround(x);
}"""

SINGLE_TURN_SIGN = """// x, its sign turned if the last bit of y is set.
function turn_sign(x, y) {
  return bits_of(y) & 1 ? -x : x;
}"""

SAMPLE = """// The sample that holds at a time: the last that is not after it; before all the first.
function sample(samples, start, interval, t) {
  let i = Math.floor((t - start) / interval * 1.0000000000000568); // t may miss a sample's time by rounding
  if (!(i > 0)) i = 0;
  return samples[Math.min(i, samples.length - 1)];
}"""


def _on_bits(name: str, arguments: str, made: str) -> str:
    return f"function {name}({arguments}) {{\n  return {made};\n}}"


#: Operations whose result is rounded.
ROUNDED = ("add", "subtract", "multiply", "divide", "square root")


class JavaScript(Language):
    """A class in an ES module, for browsers and Node; bits by views of a typed array, whole numbers of 64 bits as BigInt."""

    title = "JavaScript"
    array_type = "Float64Array"
    endings = (".js", ".mjs")
    infinity, root, floor, magnitude, fma = "Infinity", "Math.sqrt", "Math.floor", "Math.abs", None
    bits_literal = "{}n"
    me = "this."
    step_in = "  "
    time = "this.t0 + s.step * this.dt"
    helpers: ClassVar[dict[str, str]] = {
        "number": VIEWS,
        "bits_of": BITS_OF,
        "number_of": NUMBER_OF,
        "turn_sign": TURN_SIGN,
        "mask_of": _on_bits("mask_of", "truth", "truth ? 0xffffffffffffffffn : 0n"),
        "choose_bits": _on_bits("choose_bits", "mask, a, b", "(mask & a) | (BigInt.asUintN(64, ~mask) & b)"),
        "and_bits": _on_bits("and_bits", "a, b", "a & b"),
        "or_bits": _on_bits("or_bits", "a, b", "a | b"),
        "xor_bits": _on_bits("xor_bits", "a, b", "a ^ b"),
        "add_bits": _on_bits("add_bits", "a, b", "BigInt.asUintN(64, a + b)"),
        "shift_up": _on_bits("shift_up", "a, n", "BigInt.asUintN(64, a << BigInt(n))"),
        "shift_down": _on_bits("shift_down", "a, n", "a >> BigInt(n)"),
        "sample": SAMPLE,
    }
    of_single: ClassVar[dict[str, Any]] = {
        "array_type": "Float32Array",
        "bits_literal": "{}",
        "time": "fround(this.t0 + s.step * this.dt)",
        "helpers": {
            "fround": FROUND,
            "single": SINGLE,
            "number": SINGLE_VIEWS,
            "bits_of": BITS_OF,
            "number_of": NUMBER_OF,
            "turn_sign": SINGLE_TURN_SIGN,
            "mask_of": _on_bits("mask_of", "truth", "truth ? 0xffffffff : 0"),
            "choose_bits": _on_bits("choose_bits", "mask, a, b", "((mask & a) | (~mask & b)) >>> 0"),
            "and_bits": _on_bits("and_bits", "a, b", "(a & b) >>> 0"),
            "or_bits": _on_bits("or_bits", "a, b", "(a | b) >>> 0"),
            "xor_bits": _on_bits("xor_bits", "a, b", "(a ^ b) >>> 0"),
            "add_bits": _on_bits("add_bits", "a, b", "(a + b) >>> 0"),
            "shift_up": _on_bits("shift_up", "a, n", "(a << n) >>> 0"),
            "shift_down": _on_bits("shift_down", "a, n", "a >>> n"),
        },
    }

    def literal(self, x: float) -> str:
        """A finite number: the shortest text that is read as it, by a language whose numbers are all float64."""
        return repr(float(x)).removesuffix(".0")

    def formula(self, name: str, of: Sequence[Formula], given: int, bits: Sequence[int | None]) -> Formula:
        """An operation of these, in float32 rounded at once."""
        made = super().formula(name, of, given, bits)
        return Formula(f"fround({made.text})") if self.single and name in ROUNDED else made

    def declare(self, line: Assignment, note: str) -> str:
        """A value that gets a name."""
        return f"const {line.name} = {line.text};{note}"

    def array(self, size: int) -> str:
        """The array in which loops compute."""
        return f"const w = new {self.array_type}({size});"

    def loop(self, count: int, line: str) -> str:
        """A line for each i from 0 on."""
        return f"for (let i = 0; i < {count}; i++) {line}"

    def table(self, name: str, places: Sequence[int]) -> list[str]:
        """A table of places in arrays."""
        return listed(f"const {self.table_name(name)} = [", list(map(str, places)), "];", "")

    def variable(self, line: Assignment, note: str) -> list[str]:
        """A value that is set again in a branch; with no text if it is set in both."""
        return [f"let {line.name}{' = ' * bool(line.text)}{line.text};{note}"]

    def given(self, text: str) -> str:
        """A number of an argument in the precision of the file."""
        return f"fround({text})" if self.single else text

    def sample(self, table: int, t: str) -> str:
        """The sample of a table that holds at a time."""
        of = self.tables[table]
        number = f"sample({of.name}_samples, this.{of.start}, this.{of.interval}, {t})"
        return of.time("this.", number)

    def function(self, name: str, lines: list[str]) -> str:
        """A function of one number x."""
        return "\n".join([f"// The {name} of x.", f"function {name}(x) {{", *indented(lines, "  "), "}"])

    def how(self, w: Written) -> list[str]:
        """How to call it."""
        p, blocks, force = camel(self.prefix), ", ".join(of for of, _ in w.given), ", force" * w.forced("step")
        lines = [
            "A module for browsers and Node.",
            f"const m = new {p}({{ dt: ... }}) sets the parameters that are given; call m.prepare() after a change of one.",
            f"const s = m.start({blocks}) is the state at step 0, m.step(s{force}) makes one step.",
        ]
        if w.carries:
            lines.append(
                f"m.finish(s{', force' * w.forced('finish')}) finds the velocities; in the state {w.slot} stands in their place."
            )
        if w.evaluations:
            lines.append("m.work(s) is the energy that the control has given since the start.")
        return lines

    def example(self, w: Written, v: list[float], y: list[float], steps: int) -> list[str]:
        """A program that makes some steps and prints a number of the state."""
        p = camel(self.prefix)
        blocks = [(name, each) for name, each in (("v", v), ("y", y)) if each]
        arrays = [*blocks, (FORCE, w.traced.force)] if w.traced.force else blocks
        start = [name for name, _ in blocks] + [FORCE] * w.forced("start")
        return [
            f'import {{ {p} }} from "./{self.prefix}.mjs";',
            "",
            *(line for name, each in arrays for line in self.listed(f"const {name} = [", each, "];")),
            f"const m = new {p}();",
            f"const s = m.start({', '.join(start)});",
            f"for (let k = 0; k < {steps}; k++) m.step(s{', force' * w.forced('step')});",
            f"console.log(s.{w.shown}[0]);",
        ]

    def file(self, w: Written, head: list[str]) -> str:
        """The whole text after the comment at the head."""
        parts = [self._prepare(w), self._start(w), self._step(w)]
        if w.carries:
            parts.append(self._finish(w))
        if w.evaluations:
            parts.append(self._work(w))
        tables = [
            "\n".join([f"// The samples of {each.about}.", *self.listed(f"const {each.name}_samples = [", each.values, "];")])
            for each in w.tables
        ]
        tables += ["\n".join(line for name, places in w.places.items() for line in self.table(name, places))] * bool(w.places)
        inside = "\n\n".join("\n".join(indented(each, "  ")) for each in [self._constructor(w), *parts])
        whole = f"export class {camel(self.prefix)} {{\n{inside}\n}}"
        return "\n".join(head) + "\n\n" + "\n\n".join([*self.functions(whole), *tables, whole]) + "\n"

    # ---- parts of it

    def _constructor(self, w: Written) -> list[str]:
        lines: list[str] = []
        for each in w.parameters:
            about = f" // {each.about}" if each.about != each.name else ""
            if each.shape:
                lines += self.nested(f"this.{each.name} = ", each.values, each.shape, ";")
            else:
                lines.append(f"this.{each.name} = {self.value(each)};{about}")
        lines += [f"this.{w.array} = new {self.array_type}({w.made_size});"] * bool(w.made_size)
        lines += [
            "for (const name of Object.keys(given)) {",
            "  if (!Object.prototype.hasOwnProperty.call(this, name)) throw new RangeError(`there is no parameter ${name}`);",
            "}",
            "Object.assign(this, given);",
            "this.prepare();",
        ]
        return ["constructor(given = {}) {", *indented(lines, "  "), "}"]

    def _prepare(self, w: Written) -> list[str]:
        rounded = [each.name for each in w.parameters if self.single and not each.wide]
        lines = [f"this.{name} = single(this.{name});" for name in rounded]
        lines += [f"{each.name} = {each.text};" for each in w.made]
        lines += [line for each in w.loops for line in self.statement(each)]
        about = "// What does not change from step to step. To be called after a change of a parameter."
        return [about, "prepare() {", *indented(lines, "  "), "}"]

    def _start(self, w: Written) -> list[str]:
        start = w.functions.get("start")
        lines = []
        for of, n in w.given:
            numbers = f"{n} number{'s' * (n > 1)}"
            lines.append(f"if ({of}.length !== {n}) throw new RangeError(`{of}: expected {numbers}, got ${{{of}.length}}`);")
        lines.append("const s = { step: 0 };")
        lines += ["s.tally = 0; // what the control has added up"] * bool(w.evaluations)
        for name, of, n in w.blocks:
            carried = start and name == w.slot
            lines.append(f"s.{name} = new {self.array_type}({n});" if carried else f"s.{name} = {self.array_type}.from({of});")
        if start:
            lines += [
                "",
                *self.body(start, {"v": "velocities", "y": "coordinates"}, {w.slot: f"s.{w.slot}"}, "The carry, in place of v."),
            ]
        lines += ["return s;"]
        about = "// The state at step 0, of velocities and coordinates."
        return [about, f"start({', '.join(of for of, _ in w.given)}) {{", *indented(lines, "  "), "}"]

    def _step(self, w: Written) -> list[str]:
        of = {name: f"s.{name}" for name in (w.slot, "y", "tally")}
        lines = [*self.body(w.functions["step"], of, of), "s.step += 1;"]
        return ["// One step.", f"step(s{', force' * w.forced('step')}) {{", *indented(lines, "  "), "}"]

    def _finish(self, w: Written) -> list[str]:
        lines = [f"const velocities = new {self.array_type}({w.n_v});"]
        lines += self.body(
            w.functions["finish"], {name: f"s.{name}" for name in (w.slot, "y")}, {"v": "velocities"}, "The velocities."
        )
        return [
            "// The velocities at a state.",
            f"finish(s{', force' * w.forced('finish')}) {{",
            *indented([*lines, "return velocities;"], "  "),
            "}",
        ]

    def _work(self, w: Written) -> list[str]:
        about = "// The energy that the control has given since the start."
        return [about, "work(s) {", f"  return s.tally / ({w.evaluations} * this.dt);", "}"]
