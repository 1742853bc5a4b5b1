"""Draw the figures of Hoffmann (2002).

The samples of each method on the undamped oscillator (§5 to §11), and the harmonic cases of §4.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from ...analysis.stability.criterion import signed
from ...base import checks
from ...base.pictures import new_figure
from ...model.methods import method
from ..charts import figures
from . import show


def arguments(parser: argparse.ArgumentParser) -> None:
    """What the command takes."""
    parser.add_argument("methods", nargs="*", metavar="METHOD", help="a method; see stepwell methods (default: all)")
    parser.add_argument(
        "-o",
        "--output",
        type=Path,
        default=Path(),
        metavar="DIR",
        help="a folder for what is drawn and written (default: this one)",
    )
    parser.add_argument("--phi", type=float, default=0.5, metavar="RAD", help="Φ = ω₀·dt (default: 0.5)")
    parser.add_argument("--periods", type=float, default=4.0, metavar="N", help="how many periods (default: 4)")
    show.json_option(parser)


def command(args: argparse.Namespace) -> None:
    """Run, draw, write, list."""
    methods = [method(name) for name in args.methods] or None
    checks.folder("-o", args.output)
    new_figure(1.0, 1.0)  # raises if there can be no picture

    chart = figures(methods, phi=args.phi, periods=args.periods)
    written = show.Written()
    files = [str(path) for path in written.write(args.output, chart.save) or ()]
    pictures = files[1 : 1 + len(chart.samples)]
    if args.json:
        show.print_json({"phi": chart.phi, "files": files, "summary": chart.summary()})
        written.close()
        return
    show.table(
        f"The undamped oscillator with Φ = {chart.phi:g}",
        ("method", "r₁² − 1>", "Ψ/Φ − 1>", "what the samples do", "largest |y|>", "file"),
        [
            (
                s["title"],
                signed(s["r1_squared"] - 1.0),
                signed(s["ratio"] - 1.0, percent=True),
                s["kind"],
                f"{s['largest_y']:.4g}",
                file,
            )
            for s, file in zip(chart.summary(), pictures or ["–"] * len(chart.samples), strict=True)
        ],
        [f"all in one: {file}" for file in files[:1]] + [f"beside: {file}" for file in files[1 + len(chart.samples) :]],
    )
    written.close()
