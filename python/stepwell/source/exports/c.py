"""A step as C99."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, ClassVar

from .language import functions_on_bits
from .lines import listed
from .names import Field
from .program import FORCE
from .skeleton import Skeleton
from .written import Written

TYPES = {"number": "double", "truth": "int", "bits": "uint64_t", "wide": "double", "index": "int"}
SINGLE_TYPES = TYPES | {"number": "float", "bits": "uint32_t"}

#: Values of FLT_EVAL_METHOD (C23, TS 18661-3) for which doubles, and floats, are computed in their own precision: 16, 32 and 64
#: widen types narrower than _Float16, float and double, and 1 widens floats to double.
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


def _on_bits(name: str, arguments: str, expression: str) -> str:
    return f"static inline uint64_t PREFIX_{name}({arguments}) {{ return {expression}; }}"


TWO, SHIFT = "uint64_t a, uint64_t b", "uint64_t a, int n"

HELPERS = {
    "bits_of": BITS_OF,
    "number_of": NUMBER_OF,
    "turn_sign": TURN_SIGN,
    "mask_of": _on_bits("mask_of", "int truth", "truth ? ~UINT64_C(0) : 0"),
    "choose_bits": _on_bits("choose_bits", "uint64_t mask, uint64_t a, uint64_t b", "(mask & a) | (~mask & b)"),
    **functions_on_bits(_on_bits, TWO, SHIFT),
}


def _narrow(text: str) -> str:
    for wide, single in (("double", "float"), ("uint64_t", "uint32_t"), ("UINT64_C", "UINT32_C"), ("<< 63", "<< 31")):
        text = text.replace(wide, single)
    return text


class C(Skeleton):
    """Functions and types that begin with a prefix; bits by ``memcpy``."""

    title = "C"
    endings = (".c", ".h")
    infinity, magnitude, fma = "INFINITY", "fabs", "fma"
    writes: ClassVar[dict[str, str]] = {"square root": "sqrt({})", "floor": "floor({})"}
    bits_literal = "UINT64_C({})"
    truths = ("0", "1")
    samples = "{name}, {count}"
    me, state = "m->", "s->"
    time = "m->t0 + (double)s->step * m->dt"
    types: ClassVar[dict[str, str]] = TYPES
    helpers: ClassVar[dict[str, str]] = HELPERS | {"sample": SAMPLE}
    declaration, variable = "const $type $name = $text;", ("$type $name = $text;", "$type $name;")
    loop_of_lines = ("for (int i = 0; i < $count; i++) {", "}")
    loop, work_array = "for (int i = 0; i < $count; i++) $line", "$number w[$size];"
    table, table_end, array = "static const $of $name[$count] = {", "};", "const $number $name[$count] = {"
    force = f", const $number {FORCE}[$n]"
    heads: ClassVar[dict[str, str]] = {
        "function": "static $number PREFIX_$name($number x)",
        "prepare": "void ${prefix}_prepare($prefix *m)",
        "start": "void ${prefix}_start(const $prefix *m, ${prefix}_state *s$parameters$force)",
        "step": "void ${prefix}_step(const $prefix *m, ${prefix}_state *s$force)",
        "finish": "void ${prefix}_finish(const $prefix *m, const ${prefix}_state *s$force, $number velocities[$n])",
        "work": "double ${prefix}_work(const $prefix *m, const ${prefix}_state *s)",
    }
    work = "return s->tally / ($evaluations.0 * m->dt);"
    order = ("prepare", "create", "start", "step", "finish", "work")
    usage = (
        "Compile a program that includes it, such as the example, with: cc -O2 -ffp-contract=off example.c -lm",
        "${prefix}_defaults(&m) sets the parameters; change any of them and call ${prefix}_prepare(&m).",
        "${prefix}_start(&m, &s, $blocks$start_force) makes the state at step 0, "
        "${prefix}_step(&m, &s$step_force) makes one step.",
    )
    calls: ClassVar[dict[str, str]] = {
        "finish": "${prefix}_finish(&m, &s$finish_force, velocities)",
        "work": "${prefix}_work(&m, &s)",
    }
    program = r"""#include <stdio.h>
#include "$prefix.c"

int main(void) {
    $prefix m;
    ${prefix}_state s;
    $arrays

    ${prefix}_defaults(&m);
    ${prefix}_start(&m, &s, $blocks$start_force);
    for (int k = 0; k < $steps; k++) ${prefix}_step(&m, &s$step_force);
    printf("%.17g\n", s.$shown[0]);
    return 0;
}"""
    of_single: ClassVar[dict[str, Any]] = {
        "writes": {"square root": "sqrtf({})", "floor": "floorf({})"},
        "magnitude": "fabsf",
        "fma": "fmaf",
        "bits_literal": "UINT32_C({})",
        "time": "(float)(m->t0 + (double)s->step * (double)m->dt)",
        "types": SINGLE_TYPES,
        "helpers": {name: _narrow(text) for name, text in HELPERS.items()},
        "work": "return (double)s->tally / ($evaluations.0 * (double)m->dt);",
    }

    def literal(self, x: float) -> str:
        """A finite number: the shortest text that is read as this number."""
        return super().literal(x) + "f" * self.single

    def helper(self, name: str) -> str:
        """The name of a function, with the prefix, so that several files may be compiled together."""
        return f"{self.prefix}_{name}"

    def file(self, w: Written, head: list[str]) -> str:
        """The whole text; ``head`` is the comment at its head."""
        number = self.types["number"]
        others = " && ".join(f"FLT_EVAL_METHOD != {each}" for each in OWN_PRECISION[number])
        begin = BEGIN.replace("ALL_OTHERS", others).replace("NUMBER", number).replace("PREFIX", self.prefix)
        parts = ["\n".join(self._structures(w)), *self._tables(w), *map("\n".join, self._functions(w))]
        return "\n".join(head) + "\n" + begin + "\n" + "\n\n".join([*self._helpers("\n".join(parts)), *parts]) + "\n" + END

    def _function(self, about: str, head: str, lines: Iterable[str]) -> list[str]:
        lines = [*lines]
        is_unused = "*m" in head and not any(self.me in line for line in lines)
        return super()._function(about, head, ["(void)m;"] * is_unused + lines)

    def _parameter(self, name: str, n: int) -> str:
        return f", const {self.types['number']} {name}[{n}]"

    def _structures(self, w: Written) -> list[str]:
        p, number = self.prefix, self.types["number"]
        lines = ["// The description of a step.", "typedef struct {"]
        lines += [f"    {self.type_of(each)} {each.name}{_size(each)};{self._about(each)}" for each in w.parameters]
        hoisted = [f"    {self.types[each.kind]} {each.name.removeprefix(self.me)};" for each in w.hoisted]
        hoisted += [f"    {number} {w.array}[{w.hoisted_size}];"] * bool(w.hoisted_size)
        lines += ["", f"    // Made of these by {p}_prepare.", *hoisted] if hoisted else []
        lines += [f"}} {p};", "", "// A state.", "typedef struct {"]
        lines += [f"    {number} {name}[{n}];" for name, _, n in w.blocks]
        lines += [f"    {number} tally; // what the control has added up"] * bool(w.evaluations)
        lines += [f"    {number} memory[{len(w.memory)}]; // {w.of_memory}"] * bool(w.memory)
        return [*lines, "    int64_t step; // k; the time is t0 + k*dt", f"}} {p}_state;"]

    def _create(self, w: Written) -> list[str]:
        tables: list[str] = []
        lines: list[str] = []
        for each in w.parameters:
            if not each.shape:
                lines.append(f"m->{each.name} = {self.value(each)};")
                continue
            begin = f"static const {self.type_of(each)} {each.name}[{len(each.values)}] = {{"
            end = f"}}; // {_size(each)}" if len(each.shape) > 1 else "};"
            tables += listed(begin, [self.signed(x) for x in each.values], end)
            lines.append(f"memcpy(m->{each.name}, {each.name}, sizeof m->{each.name});")
        inside = [*tables, *[""] * bool(tables), *lines, f"{self.prefix}_prepare(m);"]
        about, head = "The parameters with which it was exported.", f"void {self.prefix}_defaults({self.prefix} *m)"
        return self._function(about, head, inside)

    def _initial(self, w: Written) -> list[str]:
        carried = w.slot if w.carries else ""
        blocks = [(name, of) for name, of, _ in w.blocks if name != carried]
        lines = ["s->step = 0;"] + [f"s->tally = {self.literal(0.0)};"] * bool(w.evaluations)
        begun = listed(f"static const {self.types['number']} memory[{len(w.memory)}] = {{", w.memory, "};") if w.memory else []
        blocks += [("memory", "memory")] * bool(w.memory)
        return [*begun, *lines, *(f"memcpy(s->{name}, {of}, sizeof s->{name});" for name, of in blocks)]


def _size(field: Field) -> str:
    """The lengths of an array, in brackets."""
    return "".join(f"[{n}]" for n in field.shape)
