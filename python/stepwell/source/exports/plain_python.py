"""A step as Python that needs nothing but its standard library."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

from ..explanation import formula as plain
from ..explanation.formula import CHOICE, EITHER, Formula
from .language import FORCE, Assignment, Language, indented, listed
from .names import camel
from .written import Written

QUOTIENT = '''def quotient(a, b):
    """a / b, which is an infinity or no number where Python raises an error."""
    if b != 0.0:
        return a / b
    return math.nan if a == 0.0 or a != a else math.copysign(math.inf, a) * math.copysign(1.0, b)'''

ROOT = '''def square_root(x):
    """The square root, which is no number where Python raises an error."""
    return math.sqrt(x) if x >= 0.0 else math.nan'''

FLOOR = '''def floor(x):
    """The next whole number below."""
    return float(math.floor(x)) if x != 0.0 and math.isfinite(x) else x'''

FMA = '''if not hasattr(math, "fma"):
    raise ImportError("PREFIX needs Python 3.13, which has a fused multiply-add; export it without fused=True")


def fused(a, b, c):
    """a*b + c, rounded once; an infinity or no number where Python raises an error."""
    try:
        return math.fma(a, b, c)
    except ValueError:
        return math.nan
    except OverflowError:
        return math.copysign(math.inf, a * b + c)'''

BITS_OF = """def bits_of(x):
    return struct.unpack("<Q", struct.pack("<d", x))[0]"""

NUMBER_OF = """def number_of(b):
    return struct.unpack("<d", struct.pack("<Q", b))[0]"""

TURN_SIGN = '''def turn_sign(x, y):
    """x, its sign turned if the last bit of y is set."""
    return -x if bits_of(y) & 1 else x'''

SAMPLE = '''def sample(samples, start, interval, t):
    """The sample that holds at a time: the last that is not after it; before all the first."""
    i = floor((t - start) / interval * 1.0000000000000568)  # t may miss a sample's time by rounding
    return samples[int(min(i, len(samples) - 1.0)) if i > 0.0 else 0]'''

ALL_BITS = "0xFFFFFFFFFFFFFFFF"

SINGLE = '''def single(x):
    """Numbers rounded to float32."""
    return [single(each) for each in x] if isinstance(x, (list, tuple)) else float32(x)'''


def _on_bits(name: str, arguments: str, made: str) -> str:
    return f"def {name}({arguments}):\n    return {made}"


HELPERS = {
    "turn_sign": TURN_SIGN,
    "mask_of": _on_bits("mask_of", "truth", f"{ALL_BITS} if truth else 0"),
    "choose_bits": _on_bits("choose_bits", "mask, a, b", "(mask & a) | (~mask & b)"),
    "and_bits": _on_bits("and_bits", "a, b", "a & b"),
    "or_bits": _on_bits("or_bits", "a, b", "a | b"),
    "xor_bits": _on_bits("xor_bits", "a, b", "a ^ b"),
    "add_bits": _on_bits("add_bits", "a, b", f"(a + b) & {ALL_BITS}"),
    "shift_up": _on_bits("shift_up", "a, n", f"(a << n) & {ALL_BITS}"),
    "shift_down": _on_bits("shift_down", "a, n", "a >> n"),
}


class Python(Language):
    """A class of plain floats; bits by ``struct``."""

    title = "Python"
    endings = (".py",)
    comment = "#"
    infinity, root, floor, magnitude, fma = "math.inf", "square_root", "floor", "abs", "fused"
    bits_literal = "{}"
    truths = ("False", "True")
    words = ("not ", "and", "or")
    me = "self."
    end = ""
    time = "self.t0 + s.step * self.dt"
    helpers: ClassVar[dict[str, str]] = {
        "quotient": QUOTIENT,
        "square_root": ROOT,
        "floor": FLOOR,
        "fused": FMA,
        "bits_of": BITS_OF,
        "number_of": NUMBER_OF,
        **HELPERS,
        "sample": SAMPLE,
    }
    of_single: ClassVar[dict[str, Any]] = {
        "infinity": "float32(numpy.inf)",
        "root": "numpy.sqrt",
        "floor": "numpy.floor",
        "fma": None,
        "time": "float32(self.t0 + s.step * float(self.dt))",
        "helpers": {
            "float32": "float32 = numpy.float32",
            "single": SINGLE,
            "bits_of": _on_bits("bits_of", "x", "int(x.view(numpy.uint32))"),
            "number_of": _on_bits("number_of", "b", "numpy.uint32(b).view(float32)"),
            **{name: text.replace(ALL_BITS, "0xFFFFFFFF") for name, text in HELPERS.items()},
        },
    }

    def literal(self, x: float) -> str:
        """A finite number."""
        return f"float32({float(x)!r})" if self.single else super().literal(x)

    def decorated(self, function: list[str]) -> list[str]:
        """A function that computes: NumPy tells of infinities, which are no errors here."""
        return ['@numpy.errstate(all="ignore")'] * self.single + function

    def quotient(self, a: Formula, b: Formula, divisor: int | None) -> Formula:
        """A quotient; by a constant that is not zero Python's own."""
        if self.single or (divisor is not None and divisor & (2**63 - 1)):
            return plain.formula("divide", (a, b), 0, (None, divisor))
        return Formula(self.call("quotient", a.text, b.text))

    def choice(self, truth: Formula, a: Formula, b: Formula) -> str:
        """One of two values."""
        return f"{a.within(EITHER)} if {truth.within(EITHER)} else {b.within(CHOICE)}"

    def declare(self, line: Assignment, note: str) -> str:
        """A value that gets a name."""
        return f"{line.name} = {line.text}{' ' if note else ''}{note}"

    def array(self, size: int) -> str:
        """The array in which loops compute."""
        return f"w = [{self.literal(0.0)}] * {size}"

    def loop(self, count: int, line: str) -> str:
        """A line for each i from 0 on."""
        return f"for i in range({count}): {line}"

    def table(self, name: str, places: Sequence[int]) -> list[str]:
        """A table of places in arrays."""
        return listed(f"{self.table_name(name)} = [", list(map(str, places)), "]", "")

    def variable(self, line: Assignment, note: str) -> list[str]:
        """A value that is set again in a branch; with no text if it is set in both."""
        return [self.declare(line, note)] * bool(line.text)

    def conditional(self, condition: str, then: list[str], other: list[str]) -> list[str]:
        """What is computed if something holds, and if not."""
        behind = ["else:", *indented(other)] if other else []
        return [f"if {condition}:", *indented(then), *behind]

    def given(self, text: str) -> str:
        """A number of an argument in the precision of the file."""
        return f"float32({text})" if self.single else text

    def sample(self, table: int, t: str) -> str:
        """The sample of a table that holds at a time."""
        of = self.tables[table]
        number = f"sample({of.name}_samples, self.{of.start}, self.{of.interval}, {t})"
        return of.time("self.", number)

    def function(self, name: str, lines: list[str]) -> str:
        """A function of one number x."""
        return "\n".join([f"def {name}(x):", f'    """The {name} of x."""', *indented(lines)])

    def how(self, w: Written) -> list[str]:
        """How to call it."""
        p, blocks, force = camel(self.prefix), ", ".join(of for of, _ in w.given), ", force" * w.forced("step")
        needs = (
            "Needs Python 3.13, which has a fused multiply-add." if w.traced.plan.fused else "Needs only the standard library."
        )
        needs = "Needs NumPy, which has numbers of float32." if self.single else needs
        lines = [
            needs,
            f"m = {p}(dt=...) sets the parameters that are given; call m.prepare() after a change of one.",
            f"s = m.start({blocks}) is the state at step 0, m.step(s{force}) makes one step.",
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
            f"from {self.prefix} import {p}",
            "",
            *(line for name, each in arrays for line in listed(f"{name} = [", list(map(repr, each)), "]", "")),
            f"m = {p}()",
            f"s = m.start({', '.join(start)})",
            f"for _ in range({steps}):",
            f"    m.step(s{', force' * w.forced('step')})",
            f"print(s.{w.shown}[0])",
        ]

    def file(self, w: Written, head: list[str]) -> str:
        """The whole text after the comment at the head."""
        p = camel(self.prefix)
        parts = [self._init(w), self._prepare(w), self._start(w), self._step(w)]
        if w.carries:
            parts.append(self._finish(w))
        if w.evaluations:
            parts.append(self._work(w))
        tables = [
            "\n".join([f"# The samples of {each.about}.", *self.listed(f"{each.name}_samples = [", each.values, "]")])
            for each in w.tables
        ]
        tables += ["\n".join(line for name, places in w.places.items() for line in self.table(name, places))] * bool(w.places)
        step = f'class {p}:\n    """What a step is described by, and the step."""\n\n'
        step += "\n\n".join("\n".join(indented(each)) for each in parts)
        state = [f"class {p}State:", '    """A state."""', "", *indented(self._state(w))]
        whole = "\n\n\n".join([*tables, "\n".join(state), step])
        functions = self.functions(whole)
        used = "\n".join([*functions, whole])
        imports = [f"import {name}" for name in ("math", "struct", "numpy") if f"{name}." in used]
        begin = "\n".join(head) + "\n\n" + ("\n".join(imports) + "\n\n\n" if imports else "\n")
        return begin + "\n\n\n".join([*functions, whole]) + "\n"

    # ---- parts of it

    def _state(self, w: Written) -> list[str]:
        arguments = ", ".join(name for name, _, _ in w.blocks)
        lines = ["self.step = 0  # k; the time is t0 + k*dt", *(f"self.{name} = {name}" for name, _, _ in w.blocks)]
        lines += [f"self.tally = {self.literal(0.0)}  # what the control has added up"] * bool(w.evaluations)
        return [f"def __init__(self, {arguments}):", *indented(lines)]

    def _init(self, w: Written) -> list[str]:
        lines: list[str] = []
        for each in w.parameters:
            about = f"  # {each.about}" if each.about != each.name else ""
            if each.shape:
                lines += self.nested(f"self.{each.name} = ", each.values, each.shape, "")
            else:
                lines.append(f"self.{each.name} = {self.value(each)}{about}")
        lines += [f"self.{w.array} = [{self.literal(0.0)}] * {w.made_size}"] * bool(w.made_size)
        lines += [
            "for name, value in given.items():",
            "    if name not in vars(self):",
            '        raise TypeError(f"there is no parameter {name}")',
            "    setattr(self, name, value)",
            "self.prepare()",
        ]
        return ["def __init__(self, **given):", *indented(lines)]

    def _prepare(self, w: Written) -> list[str]:
        lines = ['"""What does not change from step to step. To be called after a change of a parameter."""']
        rounded = [each.name for each in w.parameters if self.single and not each.wide]
        loops = [line for each in w.loops for line in self.statement(each)]
        lines += [f"self.{name} = single(self.{name})" for name in rounded]
        return self.decorated(
            ["def prepare(self):", *indented([*lines, *(f"{each.name} = {each.text}" for each in w.made), *loops])]
        )

    def _start(self, w: Written) -> list[str]:
        start = w.functions.get("start")
        lines = ['"""The state at step 0, of velocities and coordinates."""']
        for of, n in w.given:
            numbers = f"{n} number{'s' * (n > 1)}"
            lines += [f"if len({of}) != {n}:", f'    raise ValueError(f"{of}: expected {numbers}, got {{len({of})}}")']
            lines.append(f"{of} = [{'float32' if self.single else 'float'}(each) for each in {of}]")
        given = [f"[{self.literal(0.0)}] * {n}" if start and name == w.slot else of for name, of, n in w.blocks]
        lines.append(f"s = {camel(self.prefix)}State({', '.join(given)})")
        if start:
            lines += [
                "",
                *self.body(start, {"v": "velocities", "y": "coordinates"}, {w.slot: f"s.{w.slot}"}, "The carry, in place of v."),
            ]
        return self.decorated([f"def start(self, {', '.join(of for of, _ in w.given)}):", *indented([*lines, "return s"])])

    def _step(self, w: Written) -> list[str]:
        of = {name: f"s.{name}" for name in (w.slot, "y", "tally")}
        lines = ['"""One step."""', *self.body(w.functions["step"], of, of), "s.step += 1"]
        return self.decorated([f"def step(self, s{', force' * w.forced('step')}):", *indented(lines)])

    def _finish(self, w: Written) -> list[str]:
        lines = ['"""The velocities at a state."""', f"velocities = [{self.literal(0.0)}] * {w.n_v}"]
        lines += self.body(
            w.functions["finish"], {name: f"s.{name}" for name in (w.slot, "y")}, {"v": "velocities"}, "The velocities."
        )
        return self.decorated([f"def finish(self, s{', force' * w.forced('finish')}):", *indented([*lines, "return velocities"])])

    def _work(self, w: Written) -> list[str]:
        about = '    """The energy that the control has given since the start."""'
        if self.single:
            return ["def work(self, s):", about, f"    return float(s.tally) / ({w.evaluations} * float(self.dt))"]
        return ["def work(self, s):", about, f"    return s.tally / ({w.evaluations} * self.dt)"]
