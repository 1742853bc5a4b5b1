"""Exported steps, compiled and run in their languages: many in one program, which tells the bits of every number."""

from __future__ import annotations

import math
import shutil
import struct
import subprocess
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import stepwell as sw
from stepwell.reference.fma import fma
from stepwell.source.exports.names import camel

#: Seconds that compilers and programs may take on a busy machine.
PATIENCE = 300

#: What compilers are asked to complain of.
C_FLAGS = ["-O2", "-ffp-contract=off", "-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic"]
RUST_FLAGS = ["--edition=2021", "-C", "opt-level=1", "-C", "debuginfo=0", "-D", "warnings"]

#: Without warnings of what the code of a step may leave unused.
CSHARP_FLAGS = ["-langversion:6", "-warn:0"]

TOOLS = {"c": "cc", "csharp": "mcs", "javascript": "node", "rust": "rustc", "python": "python"}


def missing(language: str) -> bool:
    """Whether this machine cannot run a language."""
    return language != "python" and (shutil.which(TOOLS[language]) is None or (language == "csharp" and not shutil.which("mono")))


@dataclass
class Journey:
    """A step that goes abroad: what is exported, the state at the start, and how many steps are made.

    ``changed`` are parameters that are set in the exported code, and have these values in ``twin``, the system by which
    ``integrate`` says what should come of it.
    """

    system: sw.System
    method: str
    v: Any
    y: Any
    steps: int = 30
    dt: float = 0.1
    t0: float = 0.37
    member: int | None = None
    options: dict[str, Any] = field(default_factory=dict)
    changed: dict[str, float] = field(default_factory=dict)
    twin: sw.System | None = None
    expected: list[float] = field(default_factory=list)

    def __post_init__(self) -> None:
        arguments = {"v": self.v, "y": self.y, "dt": self.dt, "t0": self.t0, **self.options}
        with np.errstate(all="ignore"):
            run = sw.integrate(self.twin or self.system, self.method, steps=self.steps, **arguments)
        at = (...,) if self.member is None else (..., self.member)
        blocks = [run.v[-1][at], run.y[-1][at]] + ([] if run.work is None else [run.work[at]])
        self.expected = [float(each) for block in blocks for each in np.ravel(block)]

    def export(self, language: str, name: str) -> sw.ExportedStep:
        """The step in a language."""
        options = {"dt": self.dt, "t0": self.t0, "member": self.member, **self.options}
        return sw.export(self.system, self.method, language, v=self.v, y=self.y, name=name, **options)

    @property
    def blocks(self) -> list[list[float]]:
        """The state of the member at the start."""
        at = (...,) if self.member is None else (..., self.member)
        shapes = self.system.v_shape, self.system.y_shape
        wide = [np.broadcast_to(b, s) if np.ndim(b) == 0 else b[at] for b, s in zip((self.v, self.y), shapes, strict=True)]
        return [[float(each) for each in np.ravel(block)] for block in wide]

    @property
    def force(self) -> list[float]:
        """The force from outside, if there is one."""
        return [float(each) for each in np.ravel(self.options.get("force", []))]

    def takes_force(self, source: str, begin: str) -> bool:
        """Whether a function of the exported code that begins so has a force for an argument."""
        return "force" in source[source.index(begin) :].partition("\n")[0]

    @property
    def carries(self) -> bool:
        return sw.method(self.method).carry is not None

    @property
    def works(self) -> bool:
        return "control" in self.options

    @property
    def single(self) -> bool:
        return self.options.get("dtype") == "float32"


def bits(x: float) -> int:
    (whole,) = struct.unpack("<Q", struct.pack("<d", x))
    return int(whole)


def same(a: float, b: float) -> bool:
    """To the bit, but for which NaN a NaN is."""
    return (a != a and b != b) or bits(a) == bits(b)


def run(language: str, journeys: Sequence[Journey], folder: Path, sources: Sequence[str] | None = None) -> list[list[float]]:
    """What comes of each: velocities, coordinates, what a control has given. ``sources`` stand in the place of the exports."""
    if sources is None:
        sources = [each.export(language, f"step_{i}").source for i, each in enumerate(journeys)]
    lines = {"c": _c, "csharp": _csharp, "javascript": _javascript, "rust": _rust, "python": _python}[language](
        journeys, sources, folder
    )
    return [[struct.unpack("<d", struct.pack("<Q", int(word, 16)))[0] for word in line.split()] for line in lines]


def executed(command: Iterable[Any], folder: Path) -> str:
    done = subprocess.run([str(each) for each in command], cwd=folder, capture_output=True, text=True, timeout=PATIENCE)
    assert done.returncode == 0, done.stderr[-4000:]
    assert not done.stderr, done.stderr[-4000:]
    return done.stdout


def _hex(values: Iterable[float]) -> str:
    return ", ".join(map(float.hex, values))


def _c(journeys: Sequence[Journey], sources: Sequence[str], folder: Path) -> list[str]:
    text = "".join(sources) + "\n#include <stdio.h>\n"
    text += "static void tell_one(double x) { uint64_t b; memcpy(&b, &x, 8); "
    text += 'printf("%llx ", (unsigned long long)b); }\n'
    text += "#define tell(x, n) for (int i = 0; i < n; i++) tell_one((x)[i]);\n"
    for i, (each, source) in enumerate(zip(journeys, sources, strict=True)):
        p, (v, y) = f"step_{i}", each.blocks
        force = {of: ", f" * each.takes_force(source, f"void {p}_{of}(") for of in ("start", "step")}
        force["finish"] = ", f" * (each.carries and each.takes_force(source, f"void {p}_finish("))
        number = "float" if each.single else "double"
        slot = sw.method(each.method).carry or "v"
        arrays = [(name, a) for name, a in (("v", v), ("y", y)) if a]
        text += f"static void run_{i}(void) {{\n    {p} m;\n    {p}_state s;\n"
        text += "".join(f"    const {number} {n}[] = {{{_hex(a)}}};\n" for n, a in arrays)
        text += f"    const {number} f[] = {{{_hex(each.force)}}};\n" * bool(each.force)
        text += f"    {p}_defaults(&m);\n" + "".join(f"    m.{n} = {x.hex()};\n" for n, x in each.changed.items())
        text += f"    {p}_prepare(&m);\n    {p}_start(&m, &s{''.join(f', {n}' for n, _ in arrays)}{force['start']});\n"
        text += f"    for (int k = 0; k < {each.steps}; k++) {p}_step(&m, &s{force['step']});\n"
        if each.carries:
            text += f"    {number} out[{len(v)}];\n    {p}_finish(&m, &s{force['finish']}, out);\n    tell(out, {len(v)});\n"
        elif v:
            text += f"    tell(s.{slot}, {len(v)});\n"
        text += f"    tell(s.y, {len(y)});\n" if y else ""
        text += f"    const double work = {p}_work(&m, &s);\n    tell(&work, 1);\n" if each.works else ""
        text += '    printf("\\n");\n}\n'
    text += f"int main(void) {{ {' '.join(f'run_{i}();' for i in range(len(journeys)))} return 0; }}\n"
    (folder / "all.c").write_text(text, encoding="utf-8")
    executed(["cc", *C_FLAGS, "all.c", "-lm", "-o", "all"], folder)
    return executed([folder / "all"], folder).splitlines()


def _javascript(journeys: Sequence[Journey], sources: Sequence[str], folder: Path) -> list[str]:
    text = "const view = new DataView(new ArrayBuffer(8));\n"
    text += "const word = (x) => { view.setFloat64(0, x); return view.getBigUint64(0).toString(16); };\n"
    begin = ""
    for i, (each, source) in enumerate(zip(journeys, sources, strict=True)):
        (folder / f"step_{i}.mjs").write_text(source, encoding="utf-8")
        begin += f'import {{ Step{i} }} from "./step_{i}.mjs";\n'
        v, y = (f"[{', '.join(map(repr, block))}]" for block in each.blocks)
        start = ", ".join(block for block, numbers in zip((v, y), each.blocks, strict=True) if numbers)
        force = f", {each.force!r}" * bool(each.force)  # more arguments than a function has are left out
        changed = "".join(f"m.{name} = {value!r}; " for name, value in each.changed.items())
        text += f"{{ const m = new {camel(f'step_{i}')}(); {changed}m.prepare(); const s = m.start({start}{force});\n"
        text += f"  for (let k = 0; k < {each.steps}; k++) m.step(s{force});\n"
        parts = [f"m.finish(s{force})" if each.carries else "s.v ?? []", "s.y ?? []"] + ["[m.work(s)]"] * each.works
        text += f"  console.log([{', '.join(f'...({part})' for part in parts)}].map(word).join(' ')); }}\n"
    (folder / "all.mjs").write_text(begin + text, encoding="utf-8")
    return executed(["node", "all.mjs"], folder).splitlines()


def _csharp(journeys: Sequence[Journey], sources: Sequence[str], folder: Path) -> list[str]:
    text = "using System;\nstatic class All {\n    static void tell(params double[] x) {\n"
    text += '        foreach (double each in x) Console.Write("{0:x} ", BitConverter.DoubleToInt64Bits(each));\n    }\n'
    text += "    static void tell(float[] x) { foreach (float each in x) tell((double)each); }\n"
    for i, (each, source) in enumerate(zip(journeys, sources, strict=True)):
        (folder / f"step_{i}.cs").write_text(source, encoding="utf-8")
        number, suffix = ("float", "f") if each.single else ("double", "")

        def array(block: Sequence[float], number: str = number, suffix: str = suffix) -> str:
            return f"new {number}[] {{ {', '.join(f'{x!r}{suffix}' for x in block)} }}"

        start = [array(block) for block in each.blocks if block]
        force = {of: [array(each.force)] * each.takes_force(source, f" {of}(") for of in ("Start", "Step")}
        text += f"    static void run_{i}() {{\n        var m = new Step{i}();\n"
        text += "".join(f"        m.{name} = {value!r}{suffix};\n" for name, value in each.changed.items())
        text += f"        m.Prepare();\n        var s = m.Start({', '.join([*start, *force['Start']])});\n"
        text += f"        for (int k = 0; k < {each.steps}; k++) m.Step({', '.join(['s', *force['Step']])});\n"
        if each.carries:
            push = [array(each.force)] * each.takes_force(source, " Finish(")
            text += f"        tell(m.Finish({', '.join(['s', *push])}));\n"
        elif each.blocks[0]:
            text += "        tell(s.v);\n"
        text += "        tell(s.y);\n" if each.blocks[1] else ""
        text += "        tell(m.Work(s));\n" if each.works else ""
        text += "        Console.WriteLine();\n    }\n"
    text += f"    static void Main() {{ {' '.join(f'run_{i}();' for i in range(len(journeys)))} }}\n}}\n"
    (folder / "all.cs").write_text(text, encoding="utf-8")
    executed(["mcs", *CSHARP_FLAGS, "-out:all.exe", "all.cs", *(f"step_{i}.cs" for i in range(len(journeys)))], folder)
    return executed(["mono", "all.exe"], folder).splitlines()


def _rust(journeys: Sequence[Journey], sources: Sequence[str], folder: Path) -> list[str]:
    text = (
        'fn tell<T: Copy + Into<f64>>(x: &[T]) { for each in x { let x: f64 = (*each).into(); print!("{:x} ", x.to_bits()); } }\n'
    )
    for i, (each, source) in enumerate(zip(journeys, sources, strict=True)):
        text += f"pub mod step_{i} {{\n{source}\n}}\n"
        arrays = [block for block in each.blocks if block]
        start = ", ".join(f"[{', '.join(_rust_number(x, each.single) for x in block)}]" for block in arrays)
        text += f"fn run_{i}() {{\n    let mut m = step_{i}::Step{i}::new();\n"
        text += "".join(f"    m.{name} = {value!r};\n" for name, value in each.changed.items())
        push = f"[{', '.join(_rust_number(x, each.single) for x in each.force)}]"
        text += f"    let f = {push};\n" * bool(each.force)
        force = {of: ", &f" * each.takes_force(source, f"pub fn {of}(") for of in ("start", "step")}
        text += f"    m.prepare();\n    let mut s = m.start({start}{force['start']});\n"
        text += f"    for _ in 0..{each.steps} {{ m.step(&mut s{force['step']}); }}\n"
        if each.carries:
            text += f"    tell(&m.finish(&s{', &f' * each.takes_force(source, 'pub fn finish(')}));\n"
        elif each.blocks[0]:
            text += "    tell(&s.v);\n"
        text += "    tell(&s.y);\n" if each.blocks[1] else ""
        text += "    tell(&[m.work(&s)]);\n" if each.works else ""
        text += "    println!();\n}\n"
    text += f"fn main() {{ {' '.join(f'run_{i}();' for i in range(len(journeys)))} }}\n"
    (folder / "all.rs").write_text(text, encoding="utf-8")
    executed(["rustc", *RUST_FLAGS, "all.rs", "-o", "all_rust"], folder)
    return executed([folder / "all_rust"], folder).splitlines()


def _rust_number(x: float, single: bool) -> str:
    return f"f32::from_bits({np.float32(x).view(np.uint32)})" if single else f"f64::from_bits({bits(x)})"


def _python(journeys: Sequence[Journey], sources: Sequence[str], folder: Path) -> list[str]:
    lines = []
    for i, (each, source) in enumerate(zip(journeys, sources, strict=True)):
        space: dict[str, Any] = {"__name__": f"step_{i}"}
        if each.options.get("fused") and not hasattr(math, "fma"):
            # A fused multiply-add as Python 3.13 has it, errors and all.
            space["math"] = SimpleNamespace(**vars(math), fma=raising_fma)
            source = source.replace("import math\n", "")
        exec(compile(source, f"step_{i}.py", "exec"), space)
        m = space[f"Step{i}"](**each.changed)
        of = {
            name: [each.force] * each.takes_force(source, f"def {name}(")
            for name in ("start", "step", "finish")[: 2 + each.carries]
        }
        s = m.start(*(block for block in each.blocks if block), *of["start"])
        for _ in range(each.steps):
            m.step(s, *of["step"])
        v = m.finish(s, *of["finish"]) if each.carries else getattr(s, "v", [])
        lines.append(" ".join(f"{bits(x):x}" for x in [*v, *getattr(s, "y", []), *([m.work(s)] if each.works else [])]))
    return lines


def raising_fma(a: float, b: float, c: float) -> float:
    """As ``math.fma``: what is no number and what overflows is an error, unless it was given."""
    result = float(fma(a, b, c))
    if result != result and not any(map(math.isnan, (a, b, c))):
        raise ValueError("invalid operation in fma")
    if math.isinf(result) and not any(map(math.isinf, (a, b, c))):
        raise OverflowError("overflow in fma")
    return result
