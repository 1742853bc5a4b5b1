"""A step as C99."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

from .language import FORCE, Assignment, Language, indented, listed
from .written import Written

TYPES = {"number": "double", "truth": "int", "bits": "uint64_t", "wide": "double"}
SINGLE_TYPES = {"number": "float", "truth": "int", "bits": "uint32_t", "wide": "double"}

#: Values of FLT_EVAL_METHOD (C23, TS 18661-3) under which doubles, and floats, are computed in their own precision: 16, 32 and 64
#: widen what is narrower than _Float16, float and double, and 1 widens floats to double.
OWN_PRECISION = {"double": (0, 1, 16, 32, 64), "float": (0, 16, 32)}

BEGIN = """
#include <float.h>
#include <math.h>
#include <stdint.h>
#include <string.h>

// Options that compute other numbers.
#if defined(__FAST_MATH__) || defined(_M_FP_FAST)
#error "compile without -ffast-math, -Ofast and /fp:fast: they compute other numbers"
#elif defined(__ASSOCIATIVE_MATH__)
#error "compile without -fassociative-math and -funsafe-math-optimizations: they compute other numbers"
#elif defined(__RECIPROCAL_MATH__)
#error "compile without -freciprocal-math: it computes other numbers"
#elif defined(__NO_SIGNED_ZEROS__)
#error "compile without -fno-signed-zeros: it computes other numbers"
#elif defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__
#error "compile without -ffinite-math-only: it computes other numbers"
#endif
#if defined(FLT_EVAL_METHOD) && ALL_OTHERS
#error "compile with -msse2 -mfpmath=sse: -mfpmath=387 and -mfpmath=both compute a NUMBER in other precision than its own"
#endif
typedef char PREFIX_needs_no_fsingle_precision_constant[sizeof 0.1 == sizeof(double) ? 1 : -1];

// No product is fused with a sum, whatever -ffp-contract says.
#if defined(__clang__)
#pragma STDC FP_CONTRACT OFF
#elif defined(__GNUC__)
#pragma GCC push_options
#pragma GCC optimize("fp-contract=off")
#elif defined(_MSC_VER)
#pragma fp_contract(off)
#endif
"""

END = """
#if defined(__clang__)
#pragma STDC FP_CONTRACT DEFAULT
#elif defined(__GNUC__)
#pragma GCC pop_options
#endif
"""

BITS_OF = """static inline uint64_t PREFIX_bits_of(double x) {
    uint64_t b;
    memcpy(&b, &x, sizeof b);
    return b;
}"""

NUMBER_OF = """static inline double PREFIX_number_of(uint64_t b) {
    double x;
    memcpy(&x, &b, sizeof x);
    return x;
}"""

TURN_SIGN = """// x, its sign turned if the last bit of y is set.
static inline double PREFIX_turn_sign(double x, double y) {
    return PREFIX_number_of(PREFIX_bits_of(x) ^ PREFIX_bits_of(y) << 63);
}"""

SAMPLE = """// The sample that holds at a time: the last that is not after it; before all the first.
static double PREFIX_sample(const double *samples, int count, double start, double interval, double t) {
    double i = floor((t - start) / interval * 1.0000000000000568); // t may miss a sample's time by rounding
    if (!(i > 0.0)) i = 0.0;
    if (i > count - 1.0) i = count - 1.0;
    return samples[(int)i];
}"""


def _on_bits(name: str, arguments: str, made: str) -> str:
    return f"static inline uint64_t PREFIX_{name}({arguments}) {{ return {made}; }}"


TWO, SHIFT = "uint64_t a, uint64_t b", "uint64_t a, int n"

HELPERS = {
    "bits_of": BITS_OF,
    "number_of": NUMBER_OF,
    "turn_sign": TURN_SIGN,
    "mask_of": _on_bits("mask_of", "int truth", "truth ? ~UINT64_C(0) : 0"),
    "choose_bits": _on_bits("choose_bits", "uint64_t mask, uint64_t a, uint64_t b", "(mask & a) | (~mask & b)"),
    "and_bits": _on_bits("and_bits", TWO, "a & b"),
    "or_bits": _on_bits("or_bits", TWO, "a | b"),
    "xor_bits": _on_bits("xor_bits", TWO, "a ^ b"),
    "add_bits": _on_bits("add_bits", TWO, "a + b"),
    "shift_up": _on_bits("shift_up", SHIFT, "a << n"),
    "shift_down": _on_bits("shift_down", SHIFT, "a >> n"),
}


def _narrow(text: str) -> str:
    """The same function of numbers of 32 bits."""
    for wide, single in (("double", "float"), ("uint64_t", "uint32_t"), ("UINT64_C", "UINT32_C"), ("<< 63", "<< 31")):
        text = text.replace(wide, single)
    return text


class C(Language):
    """Functions and types that begin with a prefix; bits by ``memcpy``."""

    title = "C"
    endings = (".c", ".h")
    infinity, root, floor, magnitude, fma = "INFINITY", "sqrt", "floor", "fabs", "fma"
    bits_literal = "UINT64_C({})"
    truths = ("0", "1")
    me = "m->"
    time = "m->t0 + (double)s->step * m->dt"
    types: ClassVar[dict[str, str]] = TYPES
    helpers: ClassVar[dict[str, str]] = HELPERS | {"sample": SAMPLE}
    of_single: ClassVar[dict[str, Any]] = {
        "root": "sqrtf",
        "floor": "floorf",
        "magnitude": "fabsf",
        "fma": "fmaf",
        "bits_literal": "UINT32_C({})",
        "time": "(float)(m->t0 + (double)s->step * (double)m->dt)",
        "types": SINGLE_TYPES,
        "helpers": {name: _narrow(text) for name, text in HELPERS.items()},
    }

    def literal(self, x: float) -> str:
        """A finite number: the shortest text that is read as it."""
        return super().literal(x) + "f" * self.single

    def helper(self, name: str) -> str:
        """With the prefix, so that several files may be compiled together."""
        return f"{self.prefix}_{name}"

    def declare(self, line: Assignment, note: str) -> str:
        """A value that gets a name."""
        return f"const {self.types[line.kind]} {line.name} = {line.text};{note}"

    def array(self, size: int) -> str:
        """The array in which loops compute."""
        return f"{self.types['number']} w[{size}];"

    def loop(self, count: int, line: str) -> str:
        """A line for each i from 0 on."""
        return f"for (int i = 0; i < {count}; i++) {line}"

    def table(self, name: str, places: Sequence[int]) -> list[str]:
        """A table of places in arrays."""
        return listed(f"static const int {self.table_name(name)}[{len(places)}] = {{", list(map(str, places)), "};", "")

    def variable(self, line: Assignment, note: str) -> list[str]:
        """A value that is set again in a branch; with no text if it is set in both."""
        return [f"{self.types[line.kind]} {line.name}{' = ' * bool(line.text)}{line.text};{note}"]

    def sample(self, table: int, t: str) -> str:
        """The sample of a table that holds at a time."""
        of = self.tables[table]
        number = (
            f"{self.helper('sample')}({self.prefix}_{of.name}_samples, {len(of.values)}, m->{of.start}, m->{of.interval}, {t})"
        )
        return of.time("m->", number)

    def function(self, name: str, lines: list[str]) -> str:
        """A function of one number x."""
        of = self.types["number"]
        return "\n".join([f"// The {name} of x.", f"static {of} PREFIX_{name}({of} x) {{", *indented(lines), "}"])

    def how(self, w: Written) -> list[str]:
        """How to compile and call it."""
        p, blocks, force = self.prefix, "".join(f", {of}" for of, _ in w.given), ", force" * w.forced("step")
        lines = [
            "Compile a program that includes it, such as the example, with: cc -O2 -ffp-contract=off example.c -lm",
            f"{p}_defaults(&m) sets the parameters; change any of them and call {p}_prepare(&m).",
            f"{p}_start(&m, &s{blocks}) makes the state at step 0, {p}_step(&m, &s{force}) makes one step.",
        ]
        if w.carries:
            force = ", force" * w.forced("finish")
            lines.append(
                f"{p}_finish(&m, &s{force}, velocities) finds the velocities; in the state {w.slot} stands in their place."
            )
        if w.evaluations:
            lines.append(f"{p}_work(&m, &s) is the energy that the control has given since the start.")
        return lines

    def example(self, w: Written, v: list[float], y: list[float], steps: int) -> list[str]:
        """A program that makes some steps and prints a number of the state."""
        p, blocks = self.prefix, [(name, each) for name, each in (("v", v), ("y", y)) if each]
        arrays = [*blocks, (FORCE, w.traced.force)] if w.traced.force else blocks
        start = [name for name, _ in blocks] + [FORCE] * w.forced("start")
        return [
            "#include <stdio.h>",
            f'#include "{p}.c"',
            "",
            "int main(void) {",
            f"    {p} m;",
            f"    {p}_state s;",
            *(
                line
                for n, a in arrays
                for line in self.listed(f"const {self.types['number']} {n}[{len(a)}] = {{", a, "};", "    ")
            ),
            "",
            f"    {p}_defaults(&m);",
            f"    {p}_start(&m, &s{''.join(f', {name}' for name in start)});",
            f"    for (int k = 0; k < {steps}; k++) {p}_step(&m, &s{', force' * w.forced('step')});",
            f'    printf("%.17g\\n", s.{w.shown}[0]);',
            "    return 0;",
            "}",
        ]

    def file(self, w: Written, head: list[str]) -> str:
        """The whole text after the comment at the head."""
        tables = ["\n".join(line for name, places in w.places.items() for line in self.table(name, places))] if w.places else []
        parts = [
            self._structures(w),
            *self._tables(w),
            *tables,
            self._prepare(w),
            self._defaults(w),
            self._start(w),
            self._step(w),
        ]
        if w.carries:
            parts.append(self._finish(w))
        if w.evaluations:
            parts.append(self._work(w))
        functions = self.functions("\n".join(parts))
        return "\n".join(head) + "\n" + self._begin() + "\n" + "\n\n".join([*functions, *parts]) + "\n" + END

    # ---- parts of it

    def _begin(self) -> str:
        number = self.types["number"]
        others = " && ".join(f"FLT_EVAL_METHOD != {each}" for each in OWN_PRECISION[number])
        return BEGIN.replace("ALL_OTHERS", others).replace("NUMBER", number).replace("PREFIX", self.prefix)

    def _structures(self, w: Written) -> str:
        p = self.prefix
        lines = ["// What a step is described by.", "typedef struct {"]
        for each in w.parameters:
            size = "".join(f"[{n}]" for n in each.shape)
            lines.append(
                f"    {self.type_of(each)} {each.name}{size};" + (f" // {each.about}" if each.about != each.name else "")
            )
        if w.made:
            lines += ["", f"    // Made of these by {p}_prepare."]
            lines += [f"    {self.types[each.kind]} {each.name.removeprefix(self.me)};" for each in w.made]
        lines += ["", f"    // Made of these by {p}_prepare.", f"    {self.types['number']} {w.array}[{w.made_size}];"] * bool(
            w.made_size
        )
        lines += [f"}} {p};", "", "// A state.", "typedef struct {"]
        lines += [f"    {self.types['number']} {name}[{n}];" for name, _, n in w.blocks]
        lines += [f"    {self.types['number']} tally; // what the control has added up"] * bool(w.evaluations)
        return "\n".join([*lines, "    int64_t step; // k; the time is t0 + k*dt", f"}} {p}_state;"])

    def _tables(self, w: Written) -> list[str]:
        return [
            "\n".join(
                [
                    f"// The samples of {each.about}.",
                    *self.listed(
                        f"static const {self.types['number']} {self.prefix}_{each.name}_samples[{len(each.values)}] = {{",
                        each.values,
                        "};",
                    ),
                ]
            )
            for each in w.tables
        ]

    def _prepare(self, w: Written) -> str:
        lines = [f"{each.name} = {each.text};" for each in w.made]
        lines += [line for each in w.loops for line in self.statement(each)]
        lines = lines or ["(void)m;"]
        about = "// What does not change from step to step. To be called after a change of a parameter."
        return "\n".join([about, f"void {self.prefix}_prepare({self.prefix} *m) {{", *indented(lines), "}"])

    def _defaults(self, w: Written) -> str:
        p, tables, lines = self.prefix, [], []
        for each in w.parameters:
            if each.shape:
                size = "".join(f"[{n}]" for n in each.shape)
                table = f"static const {self.type_of(each)} {each.name}[{len(each.values)}] = {{"
                tables += self.listed(table, each.values, f"}}; // {size}" if len(each.shape) > 1 else "};")
                lines.append(f"memcpy(m->{each.name}, {each.name}, sizeof m->{each.name});")
            else:
                lines.append(f"m->{each.name} = {self.value(each)};")
        inside = indented([*tables, *([""] if tables else []), *lines, f"{p}_prepare(m);"])
        return "\n".join(["// The parameters with which it was exported.", f"void {p}_defaults({p} *m) {{", *inside, "}"])

    def _start(self, w: Written) -> str:
        p, start = self.prefix, w.functions.get("start")
        arguments = "".join(f", const {self.types['number']} {of}[{n}]" for of, n in w.given)
        lines = ["s->step = 0;"] + [f"s->tally = {self.literal(0.0)};"] * bool(w.evaluations)
        lines += [f"memcpy(s->{name}, {of}, sizeof s->{name});" for name, of, _ in w.blocks if name != w.slot or not start]
        if start:
            lines += [
                "",
                *self.body(start, {"v": "velocities", "y": "coordinates"}, {w.slot: f"s->{w.slot}"}, "The carry, in place of v."),
            ]
        if not (start and start.needs_fields):
            lines.insert(0, "(void)m;")
        about = "// The state at step 0, of velocities and coordinates."
        return "\n".join([about, f"void {p}_start(const {p} *m, {p}_state *s{arguments}) {{", *indented(lines), "}"])

    def _step(self, w: Written) -> str:
        p, f = self.prefix, w.functions["step"]
        of = {name: f"s->{name}" for name in (w.slot, "y", "tally")}
        lines = ["(void)m;"] * (not f.needs_fields) + [*self.body(f, of, of), "s->step += 1;"]
        force = self._force(w, "step")
        return "\n".join(["// One step.", f"void {p}_step(const {p} *m, {p}_state *s{force}) {{", *indented(lines), "}"])

    def _force(self, w: Written, function: str) -> str:
        """The argument of a function for a force from outside."""
        return f", const {self.types['number']} {FORCE}[{w.n_v}]" * w.forced(function)

    def _finish(self, w: Written) -> str:
        p, f = self.prefix, w.functions["finish"]
        lines = ["(void)m;"] * (not f.needs_fields)
        lines += self.body(f, {name: f"s->{name}" for name in (w.slot, "y")}, {"v": "velocities"}, "The velocities.")
        force = self._force(w, "finish")
        begin = f"void {p}_finish(const {p} *m, const {p}_state *s{force}, {self.types['number']} velocities[{w.n_v}]) {{"
        return "\n".join(["// The velocities at a state.", begin, *indented(lines), "}"])

    def _work(self, w: Written) -> str:
        p = self.prefix
        begin = f"double {p}_work(const {p} *m, const {p}_state *s) {{"
        about = "// The energy that the control has given since the start."
        wide = "(double)" * self.single
        return "\n".join([about, begin, f"    return {wide}s->tally / ({w.evaluations}.0 * {wide}m->dt);", "}"])
