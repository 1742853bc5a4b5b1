"""A step as Python that needs nothing but its standard library."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, ClassVar

from ..explanation import formula as plain
from ..explanation.formula import CHOICE, EITHER, Formula
from .language import functions_on_bits
from .lines import indented
from .names import camel
from .skeleton import Skeleton
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
#: Operations on bits whose results have more of them.
TOO_LONG = {"add_bits": "a + b", "sub_bits": "a - b", "shift_up": "a << n"}

SINGLE = '''def single(x):
    """Numbers rounded to float32."""
    return [single(each) for each in x] if isinstance(x, (list, tuple)) else float32(x)'''


def _on_bits(name: str, arguments: str, expression: str) -> str:
    return f"def {name}({arguments}):\n    return {expression}"


HELPERS = {
    "turn_sign": TURN_SIGN,
    "mask_of": _on_bits("mask_of", "truth", f"{ALL_BITS} if truth else 0"),
    "choose_bits": _on_bits("choose_bits", "mask, a, b", "(mask & a) | (~mask & b)"),
    **functions_on_bits(_on_bits, "a, b", "a, n", **{name: f"({way}) & {ALL_BITS}" for name, way in TOO_LONG.items()}),
}


HEADS = {
    "function": "def $name(x)",
    "prepare": "def prepare(self)",
    "start": "def start(self, $blocks$force)",
    "step": "def step(self, s$force)",
    "finish": "def finish(self, s$force)",
    "work": "def work(self, s)",
}

#: NumPy warns of infinities, but here they are no errors.
COMPUTES = {name: f'@numpy.errstate(all="ignore")\n{HEADS[name]}' for name in ("prepare", "start", "step", "finish")}


class Python(Skeleton):
    """A class of plain floats; bits by ``struct``."""

    title = "Python"
    endings = (".py",)
    comment, gap, end = "#", "  ", ""
    infinity, magnitude, fma = "math.inf", "abs", "fused"
    writes: ClassVar[dict[str, str]] = {"square root": "square_root({})", "floor": "floor({})"}
    bits_literal = "{}"
    truths = ("False", "True")
    words = ("not ", "and", "or")
    me = "self."
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
    declaration, variable = "$name = $text", ("$name = $text", "")
    branch = ("if $condition:", "else:", "")
    loop_of_lines = ("for i in range($count):", "")
    loop, work_array = "for i in range($count): $line", "w = [$zero] * $size"
    table, table_end, array = "$name = [", "]", "$name = ["
    doc = "#"
    heads: ClassVar[dict[str, str]] = HEADS
    velocities = "velocities = [0.0] * $n"
    returned: ClassVar[dict[str, str]] = {"start": "return s", "finish": "return velocities"}
    work = "return s.tally / ($evaluations * self.dt)"
    usage = (
        "$needs",
        "m = $type(dt=...) sets the parameters that are given; call m.prepare() after a change of one.",
        "s = m.start($blocks$start_force) is the state at step 0, m.step(s$step_force) makes one step.",
    )
    program = """from $prefix import $type

$arrays
m = $type()
s = m.start($blocks$start_force)
for _ in range($steps):
    m.step(s$step_force)
print(s.$shown[0])"""
    of_single: ClassVar[dict[str, Any]] = {
        "infinity": "float32(numpy.inf)",
        "writes": {"square root": "numpy.sqrt({})", "floor": "numpy.floor({})"},
        "fma": None,
        "time": "float32(self.t0 + s.step * float(self.dt))",
        "rounding": "float32($text)",
        "heads": HEADS | COMPUTES,
        "velocities": "velocities = [float32(0.0)] * $n",
        "work": "return float(s.tally) / ($evaluations * float(self.dt))",
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

    def quotient(self, a: Formula, b: Formula, divisor: int | None) -> Formula:
        """A quotient; by a constant other than zero it is Python's own."""
        if self.single or (divisor is not None and divisor & (2**63 - 1)):
            return plain.formula("divide", (a, b), 0, (None, divisor))
        return Formula(self.call("quotient", a.text, b.text))

    def choice(self, truth: Formula, a: Formula, b: Formula) -> str:
        """The expression that chooses one of two values."""
        return f"{a.within(EITHER)} if {truth.within(EITHER)} else {b.within(CHOICE)}"

    def file(self, w: Written, head: list[str]) -> str:
        """The whole text; ``head`` is the comment at its head."""
        p = camel(self.prefix)
        step = f'class {p}:\n    """The description of a step, and the step."""\n\n'
        step += "\n\n".join("\n".join(indented(each)) for each in self._functions(w))
        state = [f"class {p}State:", '    """A state."""', "", *indented(self._state(w))]
        whole = "\n\n\n".join([*self._tables(w), "\n".join(state), step])
        functions = self._helpers(whole)
        used = "\n".join([*functions, whole])
        imports = [f"import {name}" for name in ("math", "struct", "numpy") if f"{name}." in used]
        begin = "\n".join(head) + "\n\n" + ("\n".join(imports) + "\n\n\n" if imports else "\n")
        return begin + "\n\n\n".join([*functions, whole]) + "\n"

    def _words(self, w: Written) -> dict[str, object]:
        needs = "Needs only the standard library."
        if self.single:
            needs = "Needs NumPy, which has numbers of float32."
        elif w.traced.plan.fused:
            needs = "Needs Python 3.13, which has a fused multiply-add."
        return super()._words(w) | {"needs": needs}

    def _shown(self, x: float) -> str:
        return repr(x)

    def _function(self, about: str, head: str, lines: Iterable[str]) -> list[str]:
        return [*f"{head}:".splitlines(), *indented([f'"""{about}"""', *lines])]

    def _state(self, w: Written) -> list[str]:
        arguments = ", ".join(name for name, _, _ in w.blocks)
        lines = ["self.step = 0  # k; the time is t0 + k*dt", *(f"self.{name} = {name}" for name, _, _ in w.blocks)]
        lines += [f"self.tally = {self.literal(0.0)}  # what the control has added up"] * bool(w.evaluations)
        lines += [f"self.memory = [{', '.join(w.memory)}]  # {w.of_memory}"] * bool(w.memory)
        return [f"def __init__(self, {arguments}):", *indented(lines)]

    def _create(self, w: Written) -> list[str]:
        lines = self._set(w, "self.$name = ", "", remarks=True)
        lines += [f"self.{w.array} = [{self.literal(0.0)}] * {w.hoisted_size}"] * bool(w.hoisted_size)
        lines += [
            "for name, value in given.items():",
            "    if name not in vars(self):",
            '        raise TypeError(f"there is no parameter {name}")',
            "    setattr(self, name, value)",
            "self.prepare()",
        ]
        return ["def __init__(self, **given):", *indented(lines)]

    def _initial(self, w: Written) -> list[str]:
        carried, number = w.slot if w.carries else "", "float32" if self.single else "float"
        lines = []
        for of, n in w.arguments:
            numbers = f"{n} number{'s' * (n > 1)}"
            lines += [f"if len({of}) != {n}:", f'    raise ValueError(f"{of}: expected {numbers}, got {{len({of})}}")']
            lines.append(f"{of} = [{number}(each) for each in {of}]")
        blocks = [f"[{self.literal(0.0)}] * {n}" if name == carried else of for name, of, n in w.blocks]
        return [*lines, f"s = {camel(self.prefix)}State({', '.join(blocks)})"]
