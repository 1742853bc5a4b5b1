"""The kernels of many bodies: what they do to each other, pair by pair, and what their energy is.

A work item has a body and a slab of distances, and meets the partners at these from both sides: what the core computes once for
both bodies of a pair is computed for each. So no work item waits for another, and every sum has the order of the specification:
see ``reference/systems/nbody.py``. The places of bodies with mass lie one after the other for two rounds, so that no index wraps
and that work items side by side read what lies side by side.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from .. import _core
from ..reference.systems.nbody import LANES, NBody
from .printer import HEAD, TYPES, Printer

#: Sums over bodies: of what becomes h times the kinetic energy, h times the potential one, and the square of the gradient.
SUMS = 3


def texts_of(dim: int, force: str, *, energies: bool, nearest: bool) -> list[str]:
    """The texts of the kernels, with those of energies and of the nearest bodies or without: what they have in common is one."""
    law = NBody(1.0, force, dim, np.ones(1), np.ones(1), np.zeros(1))
    texts = ["\n".join([PLACED, _pairs(dim, law, wells=False), _gather(dim), _pulled(dim, law), AROUND])]
    if energies:
        texts.append("\n".join([_pairs(dim, law, wells=True), _shares(dim), PARTS]))
    if nearest:
        texts.append(_nearest(dim))
    return texts


def _meets(dim: int, law: Any, partner: str, sums: str, *, forward: bool, wells: bool = False) -> list[str]:
    """The statements by which a body meets a partner, and adds the pull of it to sums, and to its well what the partner makes."""
    tape = _core.Tape()
    r2, pull, strength = (tape.state(i) for i in range(3))
    names = "r2", "pull", "strength[p]"
    of_pull, (pull_text,) = Printer(False).body(tape.operations([law.pull(r2)]), lambda _, i, __: names[i], "pull")
    lines = []
    if wells:
        made, (well,) = Printer(False).body(tape.operations([law.phi(r2, pull, strength)]), lambda _, i, __: names[i], "well")
        lines = [*made, f"well = well + {well};"]
    apart = "{x} - own{c}" if forward else "own{c} - {x}"
    return [
        f"const long p = {partner};",
        *(f"const real d{c} = {apart.format(c=c, x=f'x[{c} * 2L * n + p]')};" for c in range(dim)),
        f"const real r2 = {' + '.join(f'd{c} * d{c}' for c in range(dim))} + soft;",
        *of_pull,
        f"const real pull = {pull_text};",
        "const real w = pull * strength[p];",
        *(f"{sums}{c} = {sums}{c} + d{c} * w;" for c in range(dim)),
        *lines,
    ]


def _begun(dim: int, *names: str) -> list[str]:
    """Statements that begin sums: x + −0 is x, also where x is a zero."""
    return [f"real {name}{c} = -0.0;" for name in names for c in range(dim)]


#: Text before each of the texts: its numbers, and the function that puts one of a place where the forces read it.
BEFORE = f"""{HEAD}{TYPES[False]}
static inline void put_place(real x, long g, int all, int n, __global const int *ranks, __global real *places,
                             __global real *round) {{
const long row = g / all;
const int rank = ranks[g % all];
places[g] = x;
if (rank >= 0) {{ round[row * 2 * n + rank] = x; round[row * 2 * n + n + rank] = x; }}
}}
"""
#: Puts all places of a block there.
PLACED = """
__kernel void placed(const long count, __global const real *y, const int all, const int n, __global const int *ranks,
__global real *places, __global real *round) {
const long g = get_global_id(0);
if (g < count) put_place(y[g], g, all, n, ranks, places, round);
}
"""


def _pairs(dim: int, law: Any, *, wells: bool) -> str:
    """The kernel of bodies with mass, "pairs", or "pairs_and_wells" if it finds potentials, too."""
    axes = range(dim)
    name, more = ("pairs_and_wells", ", __global real *restrict wells") if wells else ("pairs", "")
    lines = [
        f"__kernel void {name}(const long from, const long count, const int n, const int slabs, __global const int *firsts, "
        "__global const int *groups, __global const real *restrict round, __global const real *restrict strengths, "
        f"__global const real *softs, __global real *restrict sums{more}) {{",
        "if ((long)get_global_id(0) >= count) return;",
        "const long g = from + get_global_id(0);",
        "const int j = g % n;",
        "const long slab = g / n, m = slab / slabs;",
        f"__global const real *x = round + m * {dim} * 2 * n;",
        "__global const real *strength = strengths + m * 2 * n;",
        "const real soft = softs[m];",
        *(f"const real own{c} = x[{c} * 2L * n + j];" for c in axes),
        *_begun(dim, "after", "low", "high"),
        *["real well = 0.0;"] * wells,
        "for (int q = firsts[slab % slabs]; q < firsts[slab % slabs + 1]; q++) {",
        "const int first = groups[2 * q], last = groups[2 * q + 1];",
        # Opposite bodies meet once: the first half of the bodies meets those after them.
        "const int opposite = 2 * last == n;",
        f"const int end = opposite && j >= last ? last - {LANES} : last;",
        f"for (int k = first; k <= end; k += {LANES}) {{",
        *_meets(dim, law, "j + k", "after", forward=True, wells=wells),
        "}",
        f"int k = opposite && j < last ? last - {LANES} : last;",
        f"for (; k >= first && k > j; k -= {LANES}) {{",
        *_meets(dim, law, "j + n - k", "high", forward=False),
        "}",
        f"for (; k >= first; k -= {LANES}) {{",
        *_meets(dim, law, "j + n - k", "low", forward=False),
        "}",
        "}",
        *(f"sums[(slab * {dim} + {c}) * n + j] = after{c} - (low{c} + high{c});" for c in axes),
        *["wells[slab * n + j] = well;"] * wells,
        "}",
    ]
    return "\n".join(lines)


def _gather(dim: int) -> str:
    """The kernel that adds the slabs."""
    lines = [
        "__kernel void gather(const long count, const int all, const int n, const int slabs, __global const int *massive, "
        "__global const real *restrict sums, __global real *restrict out) {",
        "const long g = get_global_id(0);",
        "if (g >= count) return;",
        "const long m = g / n;",
        "const int j = g % n;",
        *_begun(dim, "sum"),
        "for (int s = 0; s < slabs; s++) {",
        *(f"sum{c} = sum{c} + sums[((m * slabs + s) * {dim} + {c}) * n + j];" for c in range(dim)),
        "}",
        *(f"out[(m * {dim} + {c}) * all + massive[j]] = sum{c};" for c in range(dim)),
        "}",
    ]
    return "\n".join(lines)


def _pulled(dim: int, law: Any) -> str:
    """The kernel of bodies without mass."""
    lines = [
        "__kernel void pulled(const long from, const long count, const int all, const int n, const int alone, "
        "__global const int *massless, __global const real *restrict places, __global const real *restrict round, "
        "__global const real *restrict strengths, __global const real *softs, __global real *restrict out) {",
        "if ((long)get_global_id(0) >= count) return;",
        "const long g = from + get_global_id(0);",
        "const long m = g / alone;",
        "const int i = massless[g % alone];",
        f"__global const real *x = round + m * {dim} * 2 * n;",
        "__global const real *strength = strengths + m * 2 * n;",
        "const real soft = softs[m];",
        *(f"const real own{c} = places[(m * {dim} + {c}) * all + i];" for c in range(dim)),
        *_begun(dim, "sum"),
        "for (int j = 0; j < n; j++) {",
        *_meets(dim, law, "j", "sum", forward=True),
        "}",
        *(f"out[(m * {dim} + {c}) * all + i] = sum{c};" for c in range(dim)),
        "}",
    ]
    return "\n".join(lines)


def _nearest(dim: int) -> str:
    """The kernel that finds how near the nearest body with mass is to each body, squared."""
    lines = [
        "__kernel void nearest(const long from, const long count, const int all, const int n, __global const int *ranks, "
        "__global const real *restrict places, __global const real *restrict round, __global real *restrict least) {",
        "if ((long)get_global_id(0) >= count) return;",
        "const long g = from + get_global_id(0);",
        "const long m = g / all;",
        "const int i = g % all, rank = ranks[i];",
        f"__global const real *x = round + m * {dim} * 2 * n;",
        *(f"const real own{c} = places[(m * {dim} + {c}) * all + i];" for c in range(dim)),
        "real smallest = INFINITY;",
        "for (int p = 0; p < n; p++) {",
        "if (p == rank) continue;",
        *(f"const real d{c} = x[{c} * 2L * n + p] - own{c};" for c in range(dim)),
        f"const real r2 = {' + '.join(f'd{c} * d{c}' for c in range(dim))};",
        "smallest = r2 < smallest ? r2 : smallest;",
        "}",
        "least[g] = smallest;",
        "}",
    ]
    return "\n".join(lines)


#: Kernels around the steps: a force from outside, and where members have diverged.
AROUND = """
__kernel void pushed(const long count, __global const real *restrict push, __global real *restrict out) {
const long g = get_global_id(0);
if (g < count) out[g] = out[g] + push[g];
}
__kernel void doubted(const long count, const long each, __global const real *x, const real most, __global const long *bad,
__global int *doubt) {
const long g = get_global_id(0);
if (g < count && !(fabs(x[g]) < most) && bad[g / each] < 0) doubt[0] = 1;
}
__kernel void mark(const long count, const long each, __global const real *x, const long k, __global long *bad) {
const long g = get_global_id(0);
if (g < count && !(fabs(x[g]) < INFINITY) && bad[g / each] < 0) bad[g / each] = k;
}
"""


def _shares(dim: int) -> str:
    """The kernel of what each body with mass has in the sums."""

    def square(name: str) -> str:
        return " + ".join(f"{name}{c} * {name}{c}" for c in range(dim))

    lines = [
        "__kernel void shares(const long count, const int all, const int n, const int slabs, const real h, "
        "__global const int *massive, __global const real *restrict masses, __global const real *restrict wells, "
        "__global const real *restrict v, __global const real *restrict dv, __global real *restrict shares) {",
        "const long g = get_global_id(0);",
        "if (g >= count) return;",
        "const long m = g / n;",
        "const int j = g % n, i = massive[j];",
        "const real mass = masses[m * all + i];",
        "real potential = 0.0;",
        "for (int s = 0; s < slabs; s++) potential = potential + wells[(m * slabs + s) * n + j];",
        *(f"const real v{c} = v[(m * {dim} + {c}) * all + i];" for c in range(dim)),
        *(f"const real along_v{c} = mass * v{c};" for c in range(dim)),
        *(f"const real along_y{c} = -(mass * (dv[(m * {dim} + {c}) * all + i] / h));" for c in range(dim)),
        f"shares[{SUMS} * m * n + j] = ((0.5 * h) * mass) * ({square('v')});",
        f"shares[({SUMS} * m + 1) * n + j] = mass * potential;",
        f"shares[({SUMS} * m + 2) * n + j] = ({square('along_v')}) + ({square('along_y')});",
        "}",
    ]
    return "\n".join(lines)


#: The sums over bodies: body i in part i mod LANES, then part after part.
PARTS = f"""
__kernel void parts(const long count, const int n, __global const real *restrict shares, __global real *restrict parts) {{
const long g = get_global_id(0);
const int lane = g % {LANES};
if (g >= count || lane >= n) return;
__global const real *of = shares + g / {LANES} * n;
real part = of[lane];
for (long i = lane + {LANES}; i < n; i += {LANES}) part = part + of[i];
parts[g] = part;
}}
static inline real total(__global const real *parts, const long row, const int n) {{
if (n == 0) return 0.0;
real sum = parts[row * {LANES}];
for (int lane = 1; lane < min({LANES}, n); lane++) sum = sum + parts[row * {LANES} + lane];
return sum;
}}
__kernel void totals(const long count, const int n, __global const real *parts, __global real *energies) {{
const long m = get_global_id(0);
if (m >= count) return;
const real kinetic = total(parts, {SUMS} * m, n);
energies[{SUMS} * m] = kinetic;
energies[{SUMS} * m + 1] = kinetic + total(parts, {SUMS} * m + 1, n);
energies[{SUMS} * m + 2] = total(parts, {SUMS} * m + 2, n);
}}
"""
