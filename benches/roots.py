"""1/r³ of r²: the machine's root and division, and sequences of sums and products in their place. Their errors and their costs.

    python -m benches.roots            # prints the table
    python -m benches.roots --picture  # and draws docs/images/inverse-cube.png

A sequence begins with half the bits of x = r², taken from a constant, which are those of y ≈ c/√x. The constant decides where the
straight pieces of that start lie, and c with it. A polynomial in s = x·y² corrects y, and y³·(A − x·y²) is 1/√x³ where y is near
(3/2)^(1/5)/√x: its derivative by y is zero there. The highest coefficient of a polynomial is 1, which saves a product; the start
is the one with which y comes out as that. Coefficients are those of the least relative error over the range of s (Remez).
"""

from __future__ import annotations

import argparse
import ast
import ctypes
import subprocess
import tempfile
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

#: With y = ±(3/2)^(1/5)/√x the product y³·(A − x·y²) is ±1/√x³; A = 5/3·(3/2)^(2/5).
A = "1.9601317042077893"
#: What every sequence ends with: from a y that is off by δ, 1/√x³ that is off by −7.5·δ² and four roundings.
LAST = f"q = y * y; f = (q * y) * ({A} - x * q)"
#: The same of a negative y.
LAST_OF_NEGATIVE = f"q = y * y; f = (q * y) * (x * q - {A})"


class Sequence(NamedTuple):
    """A way to compute it: statements that are Python and C at once."""

    name: str
    text: str


SEQUENCES = [
    Sequence("root and division", "f = 1.0 / (x * sqrt(x))"),
    Sequence(
        "4 × Newton, y³",
        "y = start(x, 0x5FE6EB50C7B537A9); u = 0.5 * x;" + " y = y * (1.5 - u * (y * y));" * 4 + " f = y * y * y",
    ),
    Sequence(
        "degree 2",
        f"y = start(x, 0x5FE27C3F1CA61000); s = (x * y) * y; y = y * (2.4354401377796371 + s * (s - 2.3275021375325729)); {LAST}",
    ),
    Sequence(
        "degree 3",
        "y = start(x, 0x5FE30D4E6C8EC000); s = (x * y) * y;"
        f" y = y * (((s - 3.085379806921946) * s + 3.77534337441239) * s - 2.770096451156733); {LAST_OF_NEGATIVE}",
    ),
    Sequence(
        "degree 4",
        "y = start(x, 0x5FE38058B20EE400); s = (x * y) * y; u = s * (s - 2.46422232979479153);"
        " y = y * ((u + (s + 1.40159926173542937)) * (u + 1.2891534737641687) + 1.24922085430956772);"
        f" {LAST.replace(A, '1.9601317042077897')}",
    ),
    Sequence(
        "degree 2, Newton",
        "y = start(x, 0x5FE14817BE125000); s = (x * y) * y; y = y * (1.93898519102088879 + s * (s - 2.07703224040900908));"
        f" s = (x * y) * y; y = y * (1.99486460866627526 - s); {LAST}",
    ),
    Sequence(
        "degree 5",
        "y = start(x, 0x5FE3DAB601F49400); s = (x * y) * y; u = s * s;"
        " y = y * (((u + 8.9473598635212482) * (s - 4.81009220396059078) + 36.0957951249926805) * (u + 0.784830735739541551)"
        f" + 2.13644859736149098); {LAST_OF_NEGATIVE}",
    ),
]


def start(x: Any, magic: int) -> Any:
    """A constant less half the bits of x, by three operations."""
    return ((x.view(np.uint64) >> np.uint64(1)) ^ np.uint64(2**62 - 1)) + np.uint64(magic - 2**62 + 1)


def computed(sequence: Sequence, x: Any) -> Any:
    """1/√x³ by these statements."""
    names = {"x": x, "sqrt": np.sqrt, "start": lambda x, magic: start(x, magic).view(np.float64)}
    exec(sequence.text, {}, names)
    return names["f"]


def operations(sequence: Sequence) -> tuple[int, int]:
    """How many it has, three of them in a start; and how many of these are products, roots and divisions."""
    nodes = list(ast.walk(ast.parse(sequence.text)))
    of = [node.op for node in nodes if isinstance(node, ast.BinOp)]
    starts, roots = (
        sum(isinstance(node, ast.Call) and getattr(node.func, "id", "") == name for node in nodes) for name in ("start", "sqrt")
    )
    return len(of) + 3 * starts + roots, sum(isinstance(op, (ast.Mult, ast.Div)) for op in of) + roots


def error(sequence: Sequence, x: Any) -> float:
    """The largest relative error found, against numbers of 64 bits."""
    exact = x.astype(np.longdouble)
    return float(abs(computed(sequence, x) * (exact * np.sqrt(exact)) - 1).max())


class Timed(NamedTuple):
    """A sequence compiled for vectors of a width, with or without fused multiply-adds."""

    library: ctypes.CDLL

    @classmethod
    def compiled(cls, sequence: Sequence, width: int, fused: bool, folder: Path) -> Timed:
        """By the C compiler, which may not reorder."""
        target = folder / f"{abs(hash(sequence))}-{width}-{fused}.so"
        flags = ["-O3", "-march=native", f"-mprefer-vector-width={64 * width}", f"-ffp-contract={'fast' if fused else 'off'}"]
        given = [f"-DWIDTH={width}", f"-DSEQUENCE={sequence.text};"]
        source = str(Path(__file__).with_suffix(".c"))
        subprocess.run(["cc", *flags, *given, "-shared", "-fPIC", source, "-o", str(target)], check=True)
        library = ctypes.CDLL(str(target))
        for name in ("alone", "waiting", "force"):
            function = getattr(library, name)
            function.restype, function.argtypes = ctypes.c_double, [ctypes.c_long, ctypes.c_void_p, ctypes.c_void_p]
        library.clock_ratio.restype, library.clock_ratio.argtypes = ctypes.c_double, [ctypes.c_long]
        return cls(library)

    def once(self, a: Any, b: Any) -> Any:
        """The three times, and the ratio of the clocks."""
        b[:] = 0.0
        given = a.ctypes.data, b.ctypes.data
        lib = self.library
        return np.array([lib.alone(300, *given), lib.waiting(2000, *given), lib.force(600, *given), lib.clock_ratio(10_000)])


def aligned(n: int) -> Any:
    """Zeros from the beginning of a cache line on."""
    whole = np.zeros(n + 8)
    first = -whole.ctypes.data // 8 % 8
    return whole[first : first + n]


def timed(turns: int = 30) -> dict[tuple[str, int, bool], Any]:
    """Cycles a vector of all, the least of several turns, by name, width and whether fused."""
    a, b = aligned(512), aligned(512)
    a[:] = np.random.default_rng(0).uniform(1.0, 4.0, len(a))
    widths = [4, 8] if "avx512f" in Path("/proc/cpuinfo").read_text(encoding="utf-8") else [4]
    with tempfile.TemporaryDirectory() as folder:
        all_of_them = {
            (sequence.name, width, fused): Timed.compiled(sequence, width, fused, Path(folder))
            for sequence in SEQUENCES
            for width in widths
            for fused in (False, True)
        }
        least = {key: np.full(4, np.inf) for key in all_of_them}
        for _ in range(turns):
            for key, each in all_of_them.items():
                least[key] = np.minimum(least[key], each.once(a, b))
    clock = min(each[3] for each in least.values())
    return {key: each[:3] / clock for key, each in least.items()}


#: Where names stand beside their points, in points; these are close to others.
SHIFTS = {"degree 5": (5, -9), "degree 2, Newton": (5, 2), "root and division": (5, -12)}


def draw(errors: dict[str, float], times: dict[tuple[str, int, bool], Any], path: Path) -> None:
    """Error against cycles, alone and within a force."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 4), layout="constrained")
    width = max(width for _, width, _ in times)
    for axes, what, title in zip(figure.subplots(1, 2, sharey=True), (0, 2), ("alone", "within a force"), strict=True):
        for fused, mark in ((False, "o"), (True, "^")):
            x = [times[name, width, fused][what] for name in errors]
            axes.semilogy(x, errors.values(), mark, label="fused" if fused else "plain", ls="none")
        for name, off in errors.items():
            axes.annotate(
                name,
                (times[name, width, False][what], off),
                fontsize=7,
                xytext=SHIFTS.get(name, (5, 4)),
                textcoords="offset points",
            )
        axes.set_title(f"1/r³ of a vector of {width}, {title}", fontsize=10)
        axes.set_xlabel("cycles")
        axes.set_xlim(0.0, 1.35 * axes.get_xlim()[1])
        axes.grid(alpha=0.3, which="both")
        axes.legend()
    figure.axes[0].set_ylabel("largest relative error")
    figure.savefig(path, dpi=110)


def main() -> None:
    """Prints the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--picture", action="store_true", help="draw the chart of the documentation, too")
    asked = parser.parse_args()
    x = np.random.default_rng(1).uniform(1.0, 4.0, 1_000_000)
    errors = {sequence.name: error(sequence, x) for sequence in SEQUENCES}
    times = timed()
    kinds = sorted({(width, fused) for _, width, fused in times})
    titles = [f"{'fused, ' if fused else ''}{64 * width} bits" for width, fused in kinds]
    print("| sequence | operations | products | error | " + " | ".join(titles) + " |\n|" + "---|" * (4 + len(kinds)))
    for sequence in SEQUENCES:
        cells = [" / ".join(f"{each:.0f}" for each in times[sequence.name, *kind]) for kind in kinds]
        counts = " | ".join(str(each) for each in operations(sequence))
        print(f"| {sequence.name} | {counts} | {errors[sequence.name]:.1e} | " + " | ".join(cells) + " |")
    if asked.picture:
        draw(errors, times, Path(__file__).parents[1] / "docs" / "images" / "inverse-cube.png")


if __name__ == "__main__":
    main()
