"""1/r³ of r²: the machine's root and division, and sequences of sums and products in their place. Their errors and their costs.

    python -m benches.roots            # prints the table
    python -m benches.roots --draw     # draws docs/images/inverse-cube.png from the table of the documentation, and times nothing

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
from stepwell.reference.fma import fma

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
    # What fused=True computes (the core's bodies.rs).
    Sequence(
        "fused=True",
        "y = start(x, 0x5FE6E96BD011219C); e = fma(-x, y * y, 1.0);"
        " y = fma(y * e, fma(e, 0.3758909929326057, 0.5010993791148002), y);"
        " q = y * y; e = fma(-x, q, 1.0); f = q * y; f = fma(f * e, fma(fma(e, 2.1875, 1.875), e, 1.5), f)",
    ),
]


def start(x: Any, magic: int) -> Any:
    """A constant less half the bits of x, by three operations."""
    return ((x.view(np.uint64) >> np.uint64(1)) ^ np.uint64(2**62 - 1)) + np.uint64(magic - 2**62 + 1)


def computed(sequence: Sequence, x: Any) -> Any:
    """1/√x³ by these statements."""
    names = {"x": x, "sqrt": np.sqrt, "fma": fma, "start": lambda x, magic: start(x, magic).view(np.float64)}
    exec(sequence.text, {}, names)
    return names["f"]


def operations(sequence: Sequence) -> tuple[int, int]:
    """How many it has, three of them in a start; and how many of these are products, fused or not, roots and divisions."""
    nodes = list(ast.walk(ast.parse(sequence.text)))
    of = [node.op for node in nodes if isinstance(node, ast.BinOp)]
    starts, roots, fused = (
        sum(isinstance(node, ast.Call) and getattr(node.func, "id", "") == name for node in nodes)
        for name in ("start", "sqrt", "fma")
    )
    return len(of) + 3 * starts + roots + fused, sum(isinstance(op, (ast.Mult, ast.Div)) for op in of) + roots + fused


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


#: The table of the last careful measurement, and where in its cells the cycles alone and within a force are.
PAGE = Path(__file__).parents[1] / "docs" / "theory" / "numerics.md"
ALONE, WITHIN = 0, 2


def published() -> dict[str, dict[str, str]]:
    """The rows of the table in the documentation, by sequence and head of a column."""
    lines = PAGE.read_text(encoding="utf-8").splitlines()
    first = next(i for i, line in enumerate(lines) if line.startswith("| sequence |"))
    head = [cell.strip() for cell in lines[first].strip("|").split("|")]
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines[first + 2 : first + 2 + len(SEQUENCES)]]
    return {row[0]: dict(zip(head, row, strict=True)) for row in rows}


def draw(path: Path) -> None:
    """The cycles of the table, alone and within a force, a row for each sequence; exact ones first."""
    from matplotlib import rc_context
    from stepwell.base.pictures import new_figure, png
    from stepwell.views.charts.style import FAMILIES, FONT, GREY

    rows = sorted(published().items(), key=lambda row: float(row[1]["error"]))
    looks = {"512 bits": ("plain", FAMILIES["Runge-Kutta"], "o"), "fused, 512 bits": ("fused", FAMILIES["Heun"], "D")}
    with rc_context(FONT):
        figure: Any = new_figure(10.0, 4.6)
        for left, what, title in ((0.3, ALONE, "1/r³ alone"), (0.665, WITHIN, "within a force")):
            axes = figure.add_axes((left, 0.14, 0.33, 0.62))
            for column, (name, colour, mark) in looks.items():
                cycles = [float(row[column].split(" / ")[what]) for _, row in rows]
                axes.plot(cycles, range(len(rows)), mark, color=colour, markersize=8, label=name)
                axes.axvline(cycles[0], color=colour, linewidth=1.0, linestyle=(0, (4, 3)), zorder=0)
            axes.set(xlim=(0.0, 42.0), ylim=(len(rows) - 0.5, -0.5), xlabel="cycles for a vector of 8")
            axes.set_yticks(range(len(rows)), [f"{name}, error {row['error']}" for name, row in rows] if what == ALONE else [])
            axes.tick_params(axis="y", labelsize=12)
            axes.set_title(title, loc="left", size=13.5)
            axes.grid(color="#e6e6e6", linewidth=0.8)
            axes.set_axisbelow(True)
            axes.spines[["top", "right"]].set_visible(False)
        figure.axes[0].legend(frameon=False, loc="lower right")
        said = "Polynomials halve the cycles of root and division alone, but not within a force"
        figure.text(0.012, 0.935, said, size=16, weight="bold")
        figure.text(0.012, 0.865, "AVX-512. Dashed: root and division.", size=12.5, color=GREY)
        path.write_bytes(png(figure))


def main() -> None:
    """Prints the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--draw", action="store_true", help="draw the table of the documentation, without timing anything")
    if parser.parse_args().draw:
        draw(PAGE.parents[1] / "images" / "inverse-cube.png")
        return
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


if __name__ == "__main__":
    main()
