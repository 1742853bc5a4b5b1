"""A step as a JavaScript module."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

from ..explanation.formula import Formula
from .language import functions_on_bits
from .lines import indented
from .names import camel
from .skeleton import Skeleton
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


def _on_bits(name: str, arguments: str, expression: str) -> str:
    return f"function {name}({arguments}) {{\n  return {expression};\n}}"


#: Operations on whole numbers of 64 bits.
WAYS = {name: f"BigInt.asUintN(64, {way})" for name, way in (("add_bits", "a + b"), ("sub_bits", "a - b"))}
WAYS |= {"shift_up": "BigInt.asUintN(64, a << BigInt(n))", "shift_down": "a >> BigInt(n)"}

#: Operations whose result is rounded.
ROUNDED = ("add", "subtract", "multiply", "divide", "square root")


class JavaScript(Skeleton):
    """A class in an ES module, for browsers and Node; bits by views of a typed array, whole numbers of 64 bits as BigInt."""

    title = "JavaScript"
    array_type = "Float64Array"
    endings = (".js", ".mjs")
    infinity, magnitude, fma = "Infinity", "Math.abs", None
    writes: ClassVar[dict[str, str]] = {"square root": "Math.sqrt({})", "floor": "Math.floor({})"}
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
        **functions_on_bits(_on_bits, "a, b", "a, n", **WAYS),
        "sample": SAMPLE,
    }
    declaration, variable = "const $name = $text;", ("let $name = $text;", "let $name;")
    loop_of_lines = ("for (let i = 0; i < $count; i++) {", "}")
    loop, work_array = "for (let i = 0; i < $count; i++) $line", ""
    table = array = "const $name = ["
    heads: ClassVar[dict[str, str]] = {
        "function": "function $name(x)",
        "prepare": "prepare()",
        "start": "start($blocks$force)",
        "step": "step(s$force)",
        "finish": "finish(s$force)",
        "work": "work(s)",
    }
    velocities = "const velocities = new Float64Array($n);"
    returned: ClassVar[dict[str, str]] = {"start": "return s;", "finish": "return velocities;"}
    work = "return s.tally / ($evaluations * this.dt);"
    usage = (
        "A module for browsers and Node.",
        "const m = new $type({ dt: ... }) sets the parameters that are given; call m.prepare() after a change of one.",
        "const s = m.start($blocks$start_force) is the state at step 0, m.step(s$step_force) makes one step.",
    )
    program = """import { $type } from "./$prefix.mjs";

$arrays
const m = new $type();
const s = m.start($blocks$start_force);
for (let k = 0; k < $steps; k++) m.step(s$step_force);
console.log(s.$shown[0]);"""
    of_single: ClassVar[dict[str, Any]] = {
        "array_type": "Float32Array",
        "bits_literal": "{}",
        "time": "fround(this.t0 + s.step * this.dt)",
        "rounding": "fround($text)",
        "velocities": "const velocities = new Float32Array($n);",
        "helpers": {
            "fround": FROUND,
            "single": SINGLE,
            "number": SINGLE_VIEWS,
            "bits_of": BITS_OF,
            "number_of": NUMBER_OF,
            "turn_sign": SINGLE_TURN_SIGN,
            "mask_of": _on_bits("mask_of", "truth", "truth ? 0xffffffff : 0"),
            "choose_bits": _on_bits("choose_bits", "mask, a, b", "((mask & a) | (~mask & b)) >>> 0"),
            **functions_on_bits(lambda name, arguments, way: _on_bits(name, arguments, f"({way}) >>> 0"), "a, b", "a, n"),
            "shift_down": _on_bits("shift_down", "a, n", "a >>> n"),
        },
    }

    def literal(self, x: float) -> str:
        """A finite number: the shortest text that is read as this number; all numbers of the language are float64."""
        return repr(float(x)).removesuffix(".0")

    def formula(self, name: str, of: Sequence[Formula], extra: int, bits: Sequence[int | None]) -> Formula:
        """An operation on these; in float32 its result is rounded at once."""
        exact = super().formula(name, of, extra, bits)
        return Formula(f"fround({exact.text})") if self.single and name in ROUNDED else exact

    def file(self, w: Written, head: list[str]) -> str:
        """The whole text; ``head`` is the comment at its head."""
        inside = "\n\n".join("\n".join(indented(each, "  ")) for each in self._functions(w))
        whole = f"export class {camel(self.prefix)} {{\n{inside}\n}}"
        work = max(each.work or 0 for each in w.functions.values())
        waiting = [f"// Where values of loops wait for other loops.\nconst w = new {self.array_type}({work});"] * bool(work)
        parts = [*self._helpers(whole), *self._tables(w), *waiting, whole]
        return "\n".join(head) + "\n\n" + "\n\n".join(parts) + "\n"

    def _create(self, w: Written) -> list[str]:
        lines = self._set(w, "this.$name = ", ";", remarks=True)
        lines += [f"this.{w.array} = new {self.array_type}({w.hoisted_size});"] * bool(w.hoisted_size)
        lines += [
            "for (const name of Object.keys(given)) {",
            "  if (!Object.prototype.hasOwnProperty.call(this, name)) throw new RangeError(`there is no parameter ${name}`);",
            "}",
            "Object.assign(this, given);",
            "this.prepare();",
        ]
        return ["constructor(given = {}) {", *indented(lines, "  "), "}"]

    def _initial(self, w: Written) -> list[str]:
        carried = w.slot if w.carries else ""
        lines = []
        for of, n in w.arguments:
            numbers = f"{n} number{'s' * (n > 1)}"
            lines.append(f"if ({of}.length !== {n}) throw new RangeError(`{of}: expected {numbers}, got ${{{of}.length}}`);")
        lines.append("const s = { step: 0 };")
        lines += ["s.tally = 0; // what the control has added up"] * bool(w.evaluations)
        remembered = f"s.memory = {self.array_type}.from([{', '.join(w.memory)}]); // {w.of_memory}"
        lines += [remembered] * bool(w.memory)
        for name, of, n in w.blocks:
            array = f"new {self.array_type}({n})" if name == carried else f"{self.array_type}.from({of})"
            lines.append(f"s.{name} = {array};")
        return lines
