"""A step as Rust."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

from ...base.arrays import Shape
from .language import FORCE, Assignment, Language, indented, listed
from .names import camel
from .written import Written

TYPES = {"number": "f64", "truth": "bool", "bits": "u64", "wide": "f64"}
SINGLE_TYPES = {"number": "f32", "truth": "bool", "bits": "u32", "wide": "f64"}

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


def _on_bits(name: str, arguments: str, made: str) -> str:
    return f"#[inline(always)]\nfn {name}({arguments}) -> u64 {{\n    {made}\n}}"


TWO, SHIFT = "a: u64, b: u64", "a: u64, n: u32"

HELPERS = {
    "bits_of": _on_bits("bits_of", "x: f64", "x.to_bits()"),
    "number_of": "#[inline(always)]\nfn number_of(b: u64) -> f64 {\n    f64::from_bits(b)\n}",
    "turn_sign": TURN_SIGN,
    "mask_of": _on_bits("mask_of", "truth: bool", "if truth { u64::MAX } else { 0 }"),
    "choose_bits": _on_bits("choose_bits", "mask: u64, a: u64, b: u64", "(mask & a) | (!mask & b)"),
    "and_bits": _on_bits("and_bits", TWO, "a & b"),
    "or_bits": _on_bits("or_bits", TWO, "a | b"),
    "xor_bits": _on_bits("xor_bits", TWO, "a ^ b"),
    "add_bits": _on_bits("add_bits", TWO, "a.wrapping_add(b)"),
    "shift_up": _on_bits("shift_up", SHIFT, "a << n"),
    "shift_down": _on_bits("shift_down", SHIFT, "a >> n"),
}


def _narrow(text: str) -> str:
    """The same function of numbers of 32 bits."""
    return text.replace("f64", "f32").replace("u64", "u32").replace("<< 63", "<< 31")


class Rust(Language):
    """A structure and its functions, without ``unsafe`` and without other crates."""

    title = "Rust"
    endings = (".rs",)
    infinity, root, floor, magnitude, fma = "f64::INFINITY", "f64::sqrt", "f64::floor", "f64::abs", "f64::mul_add"
    bits_literal = "{}u64"
    me = "self."
    time = "self.t0 + s.step as f64 * self.dt"
    types: ClassVar[dict[str, str]] = TYPES
    helpers: ClassVar[dict[str, str]] = HELPERS | {"sample": SAMPLE}
    of_single: ClassVar[dict[str, Any]] = {
        "infinity": "f32::INFINITY",
        "root": "f32::sqrt",
        "floor": "f32::floor",
        "magnitude": "f32::abs",
        "fma": "f32::mul_add",
        "bits_literal": "{}u32",
        "time": "(self.t0 + s.step as f64 * self.dt as f64) as f32",
        "types": SINGLE_TYPES,
        "helpers": {name: _narrow(text) for name, text in HELPERS.items()},
    }

    def declare(self, line: Assignment, note: str) -> str:
        """A value that gets a name."""
        return f"let {line.name} = {line.text};{note}"

    def choice(self, truth: object, a: object, b: object) -> str:
        """One of two values."""
        return f"if {truth.text} {{ {a.text} }} else {{ {b.text} }}"  # type: ignore[attr-defined]

    def array(self, size: int) -> str:
        """The array in which loops compute."""
        return f"let mut w = [0.0; {size}];"

    def loop(self, count: int, line: str) -> str:
        """A line for each i from 0 on."""
        return f"for i in 0..{count} {{ {line} }}"

    def table_name(self, name: str) -> str:
        """The name of such a table."""
        return name.upper()

    def table(self, name: str, places: Sequence[int]) -> list[str]:
        """A table of places in arrays."""
        return listed(f"static {self.table_name(name)}: [usize; {len(places)}] = [", list(map(str, places)), "];", "")

    def variable(self, line: Assignment, note: str) -> list[str]:
        """A value that is set again in a branch; with no text if it is set in both."""
        return [f"let mut {line.name} = {line.text};{note}" if line.text else f"let {line.name};{note}"]

    def conditional(self, condition: str, then: list[str], other: list[str]) -> list[str]:
        """What is computed if something holds, and if not."""
        return [f"if {condition} {{", *super().conditional(condition, then, other)[1:]]

    def sample(self, table: int, t: str) -> str:
        """The sample of a table that holds at a time."""
        of = self.tables[table]
        number = f"sample(&{of.name.upper()}_SAMPLES, self.{of.start}, self.{of.interval}, {t})"
        return of.time("self.", number)

    def function(self, name: str, lines: list[str]) -> str:
        """A function of one number x."""
        of = self.types["number"]
        begin = [f"/// The {name} of `x`.", "#[allow(clippy::all)]", f"fn {name}(x: {of}) -> {of} {{"]
        return "\n".join([*begin, *indented(lines), "}"])

    def how(self, w: Written) -> list[str]:
        """How to call it."""
        p, blocks, force = camel(self.prefix), ", ".join(of for _, of, _ in w.blocks), ", &force" * w.forced("step")
        blocks += ", &force" * w.forced("start")
        lines = [
            "Needs no other crate.",
            f"let mut m = {p}::new() sets the parameters; change any of them and call m.prepare().",
            f"let mut s = m.start({blocks}) is the state at step 0, m.step(&mut s{force}) makes one step.",
        ]
        if w.carries:
            force = ", &force" * w.forced("finish")
            lines.append(f"m.finish(&s{force}) finds the velocities; in the state {w.slot} stands in their place.")
        if w.evaluations:
            lines.append("m.work(&s) is the energy that the control has given since the start.")
        return lines

    def example(self, w: Written, v: list[float], y: list[float], steps: int) -> list[str]:
        """A program that makes some steps and prints a number of the state."""
        p = camel(self.prefix)
        blocks = [(name, each) for name, each in (("v", v), ("y", y)) if each]
        arrays = [*blocks, (FORCE, w.traced.force)] if w.traced.force else blocks
        start = [name for name, _ in blocks] + [f"&{FORCE}"] * w.forced("start")
        return [
            f"mod {self.prefix};",
            f"use {self.prefix}::{p};",
            "",
            "fn main() {",
            *(line for name, each in arrays for line in self.listed(f"let {name} = [", each, "];", "    ")),
            f"    let m = {p}::new();",
            f"    let mut s = m.start({', '.join(start)});",
            f"    for _ in 0..{steps} {{",
            f"        m.step(&mut s{', &force' * w.forced('step')});",
            "    }",
            f'    println!("{{:?}}", s.{w.shown}[0]);',
            "}",
        ]

    def file(self, w: Written, head: list[str]) -> str:
        """The whole text after the comment at the head."""
        p = camel(self.prefix)
        methods = [self._new(w), self._prepare(w), self._start(w), self._step(w)]
        if w.carries:
            methods.append(self._finish(w))
        if w.evaluations:
            methods.append(self._work(w))
        inside = "\n\n".join("\n".join(indented(each)) for each in methods)
        tables = []
        for each in w.tables:
            begin = f"static {each.name.upper()}_SAMPLES: [{self.types['number']}; {len(each.values)}] = ["
            tables.append("\n".join([f"/// The samples of {each.about}.", *self.listed(begin, each.values, "];")]))
        tables += ["\n".join(line for name, places in w.places.items() for line in self.table(name, places))] * bool(w.places)
        allowed = "#[allow(clippy::all, dead_code)]\n"
        default = f"impl Default for {p} {{\n    fn default() -> Self {{\n        Self::new()\n    }}\n}}"
        parts = [*tables, self._structures(w), f"{allowed}impl {p} {{\n{inside}\n}}", default]
        functions = self.functions("\n".join(parts))
        return "\n".join(head) + "\n\n" + "\n\n".join([*functions, *parts]) + "\n"

    # ---- parts of it

    def _structures(self, w: Written) -> str:
        p = camel(self.prefix)
        lines = ["/// What a step is described by."]
        names = [each.name for each in w.parameters] + [each.name.removeprefix(self.me) for each in w.made]
        capitals = any(name != name.lower() for name in names)
        lines.append("#[allow(dead_code, non_snake_case)]" if capitals else "#[allow(dead_code)]")
        lines += ["#[derive(Clone, Debug)]", f"pub struct {p} {{"]
        for each in w.parameters:
            lines += [f"    /// {each.about}."] if each.about != each.name else []
            lines.append(f"    pub {each.name}: {_type(self.type_of(each), each.shape)},")
        if w.made:
            lines += ["", "    // Made of these by `prepare`."]
            lines += [f"    {each.name.removeprefix(self.me)}: {self.types[each.kind]}," for each in w.made]
        lines += ["", "    // Made of these by `prepare`.", f"    {w.array}: [{self.types['number']}; {w.made_size}],"] * bool(
            w.made_size
        )
        lines += ["}", "", "/// A state.", "#[allow(dead_code)]", "#[derive(Clone, Debug)]", f"pub struct {p}State {{"]
        of = self.types["number"]
        lines += [f"    pub {name}: [{of}; {n}]," for name, _, n in w.blocks]
        lines += ["    /// What the control has added up.", f"    pub tally: {of},"] * bool(w.evaluations)
        return "\n".join([*lines, "    /// k; the time is t0 + k*dt.", "    pub step: u64,", "}"])

    def _new(self, w: Written) -> list[str]:
        lines: list[str] = []
        for each in w.parameters:
            if each.shape:
                lines += self.nested(f"{each.name}: ", each.values, each.shape, ",")
            else:
                lines.append(f"{each.name}: {self.value(each)},")
        zero = {"number": "0.0", "truth": "false", "bits": "0"}
        lines += [f"{each.name.removeprefix(self.me)}: {zero[each.kind]}," for each in w.made]
        lines += [f"{w.array}: [0.0; {w.made_size}],"] * bool(w.made_size)
        inside = ["let mut m = Self {", *indented(lines), "};", "m.prepare();", "m"]
        return ["/// With the parameters with which it was exported.", "pub fn new() -> Self {", *indented(inside), "}"]

    def _prepare(self, w: Written) -> list[str]:
        lines = [f"{each.name} = {each.text};" for each in w.made]
        lines += [line for each in w.loops for line in self.statement(each)]
        about = "/// What does not change from step to step. To be called after a change of a parameter."
        return [about, "pub fn prepare(&mut self) {", *indented(lines), "}"]

    def _start(self, w: Written) -> list[str]:
        p, start = camel(self.prefix), w.functions.get("start")
        number = self.types["number"]
        arguments = "".join(f", {of}: [{number}; {n}]" for _, of, n in w.blocks) + self._force(w, "start")
        given = [f"{name}: [0.0; {n}]" if start and name == w.slot else f"{name}: {of}" for name, of, n in w.blocks]
        given += ["tally: 0.0"] * bool(w.evaluations) + ["step: 0"]
        state = f"{p}State {{ {', '.join(given)} }}"
        if start:
            write = {w.slot: f"s.{w.slot}"}
            lines = [
                f"let mut s = {state};",
                *self.body(start, {"v": "velocities", "y": "coordinates"}, write, "The carry, in place of v."),
                "s",
            ]
        else:
            lines = [state]
        about = "/// The state at step 0, of velocities and coordinates."
        return [about, f"pub fn start(&self{arguments}) -> {p}State {{", *indented(lines), "}"]

    def _step(self, w: Written) -> list[str]:
        of = {name: f"s.{name}" for name in (w.slot, "y", "tally")}
        lines = [*self.body(w.functions["step"], of, of), "s.step += 1;"]
        begin = f"pub fn step(&self, s: &mut {camel(self.prefix)}State{self._force(w, 'step')}) {{"
        return ["/// One step.", begin, *indented(lines), "}"]

    def _force(self, w: Written, function: str) -> str:
        """The argument of a function for a force from outside."""
        return f", {FORCE}: &[{self.types['number']}; {w.n_v}]" * w.forced(function)

    def _finish(self, w: Written) -> list[str]:
        lines = [f"let mut velocities = [0.0; {w.n_v}];"]
        lines += self.body(
            w.functions["finish"], {name: f"s.{name}" for name in (w.slot, "y")}, {"v": "velocities"}, "The velocities."
        )
        force = self._force(w, "finish")
        begin = f"pub fn finish(&self, s: &{camel(self.prefix)}State{force}) -> [{self.types['number']}; {w.n_v}] {{"
        return ["/// The velocities at a state.", begin, *indented([*lines, "velocities"]), "}"]

    def _work(self, w: Written) -> list[str]:
        about = "/// The energy that the control has given since the start."
        begin = f"pub fn work(&self, s: &{camel(self.prefix)}State) -> f64 {{"
        wide = " as f64" * self.single
        return [about, begin, f"    s.tally{wide} / ({w.evaluations}.0 * self.dt{wide})", "}"]


def _type(text: str, shape: Shape) -> str:
    """The type of an array of numbers of that type."""
    for n in reversed(shape):
        text = f"[{text}; {n}]"
    return text
