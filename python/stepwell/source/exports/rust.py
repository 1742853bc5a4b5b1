"""A step as Rust."""

from __future__ import annotations

from typing import Any, ClassVar

from ...base.arrays import Shape
from ..explanation.formula import Formula
from .language import functions_on_bits
from .lines import indented
from .names import camel
from .program import FORCE
from .skeleton import Skeleton
from .written import Written

TYPES = {"number": "f64", "truth": "bool", "bits": "u64", "wide": "f64", "index": "usize"}
SINGLE_TYPES = TYPES | {"number": "f32", "bits": "u32"}

TURN_SIGN = """/// `x`, its sign turned if the last bit of `y` is set.
#[inline(always)]
fn turn_sign(x: f64, y: f64) -> f64 {
    f64::from_bits(x.to_bits() ^ (y.to_bits() << 63))
}"""

SAMPLE = """/// The sample that holds at a time: the last that is not after it; before all the first.
fn sample(samples: &[f64], start: f64, interval: f64, t: f64) -> f64 {
    let i = ((t - start) / interval * 1.0000000000000568).floor(); // t may miss a sample's time by rounding
    let last = samples.len() - 1;
    if i > 0.0 { samples[(i as usize).min(last)] } else { samples[0] }
}"""


def _on_bits(name: str, arguments: str, expression: str) -> str:
    return f"#[inline(always)]\nfn {name}({arguments}) -> u64 {{\n    {expression}\n}}"


TWO, SHIFT = "a: u64, b: u64", "a: u64, n: u32"

HELPERS = {
    "bits_of": _on_bits("bits_of", "x: f64", "x.to_bits()"),
    "number_of": "#[inline(always)]\nfn number_of(b: u64) -> f64 {\n    f64::from_bits(b)\n}",
    "turn_sign": TURN_SIGN,
    "mask_of": _on_bits("mask_of", "truth: bool", "if truth { u64::MAX } else { 0 }"),
    "choose_bits": _on_bits("choose_bits", "mask: u64, a: u64, b: u64", "(mask & a) | (!mask & b)"),
    **functions_on_bits(_on_bits, TWO, SHIFT, add_bits="a.wrapping_add(b)", sub_bits="a.wrapping_sub(b)"),
}


def _narrow(text: str) -> str:
    return text.replace("f64", "f32").replace("u64", "u32").replace("<< 63", "<< 31")


class Rust(Skeleton):
    """A structure and its functions, without ``unsafe`` and without other crates."""

    title = "Rust"
    endings = (".rs",)
    doc = "///"
    infinity, magnitude, fma = "f64::INFINITY", "f64::abs", "f64::mul_add"
    writes: ClassVar[dict[str, str]] = {"square root": "f64::sqrt({})", "floor": "f64::floor({})"}
    bits_literal = "{}u64"
    samples = "&{name}"
    me = "self."
    time = "self.t0 + s.step as f64 * self.dt"
    types: ClassVar[dict[str, str]] = TYPES
    helpers: ClassVar[dict[str, str]] = HELPERS | {"sample": SAMPLE}
    declaration, variable = "let $name = $text;", ("let mut $name = $text;", "let $name;")
    branch = ("if $condition {", "} else {", "}")
    loop_of_lines = ("for i in 0..$count {", "}")
    loop, work_array = "for i in 0..$count { $line }", "let mut w = [0.0; $size];"
    table, array = "static $name: [$of; $count] = [", "let $name = ["
    force, passed_force = f", {FORCE}: &[$number; $n]", f", &{FORCE}"
    about_function = "The $name of `x`."
    heads: ClassVar[dict[str, str]] = {
        "function": "#[allow(clippy::all)]\nfn $name(x: $number) -> $number",
        "prepare": "pub fn prepare(&mut self)",
        "start": "pub fn start(&self$parameters$force) -> ${type}State",
        "step": "pub fn step(&self, s: &mut ${type}State$force)",
        "finish": "pub fn finish(&self, s: &${type}State$force) -> [$number; $n]",
        "work": "pub fn work(&self, s: &${type}State) -> f64",
    }
    carried: ClassVar[list[str]] = []
    velocities = "let mut velocities = [0.0; $n];"
    returned: ClassVar[dict[str, str]] = {"start": "s", "finish": "velocities"}
    work = "s.tally / ($evaluations.0 * self.dt)"
    usage = (
        "Needs no other crate.",
        "let mut m = $type::new() sets the parameters; change any of them and call m.prepare().",
        "let mut s = m.start($blocks$start_force) is the state at step 0, m.step(&mut s$step_force) makes one step.",
    )
    calls: ClassVar[dict[str, str]] = {"finish": "m.finish(&s$finish_force)", "work": "m.work(&s)"}
    program = """mod $prefix;
use $prefix::$type;

fn main() {
    $arrays
    let m = $type::new();
    let mut s = m.start($blocks$start_force);
    for _ in 0..$steps {
        m.step(&mut s$step_force);
    }
    println!("{:?}", s.$shown[0]);
}"""
    of_single: ClassVar[dict[str, Any]] = {
        "infinity": "f32::INFINITY",
        "writes": {"square root": "f32::sqrt({})", "floor": "f32::floor({})"},
        "magnitude": "f32::abs",
        "fma": "f32::mul_add",
        "bits_literal": "{}u32",
        "time": "(self.t0 + s.step as f64 * self.dt as f64) as f32",
        "types": SINGLE_TYPES,
        "helpers": {name: _narrow(text) for name, text in HELPERS.items()},
        "work": "s.tally as f64 / ($evaluations.0 * self.dt as f64)",
    }

    def choice(self, truth: Formula, a: Formula, b: Formula) -> str:
        """The expression that chooses one of two values."""
        return f"if {truth.text} {{ {a.text} }} else {{ {b.text} }}"

    def table_name(self, name: str) -> str:
        """The name of a table in the file."""
        return name.upper()

    def file(self, w: Written, head: list[str]) -> str:
        """The whole text; ``head`` is the comment at its head."""
        p = camel(self.prefix)
        inside = "\n\n".join("\n".join(indented(each)) for each in self._functions(w))
        step = f"#[allow(clippy::all, dead_code)]\nimpl {p} {{\n{inside}\n}}"
        default = f"impl Default for {p} {{\n    fn default() -> Self {{\n        Self::new()\n    }}\n}}"
        parts = [*self._tables(w), "\n".join(self._structures(w)), step, default]
        return "\n".join(head) + "\n\n" + "\n\n".join([*self._helpers("\n".join(parts)), *parts]) + "\n"

    def _parameter(self, name: str, n: int) -> str:
        return f", {name}: [{self.types['number']}; {n}]"

    def _structures(self, w: Written) -> list[str]:
        p, number = camel(self.prefix), self.types["number"]
        hoisted = [(each.name.removeprefix(self.me), self.types[each.kind]) for each in w.hoisted]
        capitals = any(name != name.lower() for name in [*(each.name for each in w.parameters), *(name for name, _ in hoisted)])
        lines = ["/// The description of a step."]
        lines.append("#[allow(dead_code, non_snake_case)]" if capitals else "#[allow(dead_code)]")
        lines += ["#[derive(Clone, Debug)]", f"pub struct {p} {{"]
        for each in w.parameters:
            lines += [f"    /// {each.about}."] if each.about != each.name else []
            lines.append(f"    pub {each.name}: {_type(self.type_of(each), each.shape)},")
        hoisted += [(w.array, f"[{number}; {w.hoisted_size}]")] * bool(w.hoisted_size)
        lines += ["", "    // Made of these by `prepare`.", *(f"    {name}: {of}," for name, of in hoisted)] if hoisted else []
        lines += ["}", "", "/// A state.", "#[allow(dead_code)]", "#[derive(Clone, Debug)]", f"pub struct {p}State {{"]
        lines += [f"    pub {name}: [{number}; {n}]," for name, _, n in w.blocks]
        lines += ["    /// What the control has added up.", f"    pub tally: {number},"] * bool(w.evaluations)
        remembers = [f"    /// {w.of_memory.capitalize()}.", f"    pub memory: [{number}; {len(w.memory)}],"]
        lines += remembers * bool(w.memory)
        return [*lines, "    /// k; the time is t0 + k*dt.", "    pub step: u64,", "}"]

    def _create(self, w: Written) -> list[str]:
        lines = self._set(w, "$name: ", ",", remarks=False)
        zero = {"number": "0.0", "truth": "false", "bits": "0"}
        lines += [f"{each.name.removeprefix(self.me)}: {zero[each.kind]}," for each in w.hoisted]
        lines += [f"{w.array}: [0.0; {w.hoisted_size}],"] * bool(w.hoisted_size)
        inside = ["let mut m = Self {", *indented(lines), "};", "m.prepare();", "m"]
        return self._function("With the parameters with which it was exported.", "pub fn new() -> Self", inside)

    def _initial(self, w: Written) -> list[str]:
        carried = w.slot if w.carries else ""
        fields = [f"{name}: [0.0; {n}]" if name == carried else f"{name}: {of}" for name, of, n in w.blocks]
        fields += ["tally: 0.0"] * bool(w.evaluations)
        fields += [f"memory: [{', '.join(w.memory)}]"] * bool(w.memory) + ["step: 0"]
        state = f"{camel(self.prefix)}State {{ {', '.join(fields)} }}"
        return [f"let mut s = {state};"] if "start" in w.functions else [state]

    def _returned(self, w: Written, name: str) -> list[str]:
        # Without a carry the state itself is the last expression.
        return super()._returned(w, name) if name in w.functions else []


def _type(text: str, shape: Shape) -> str:
    for n in reversed(shape):
        text = f"[{text}; {n}]"
    return text
