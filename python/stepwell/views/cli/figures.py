"""Draw the figures of Hoffmann (2002).

Draws the samples of each method on the undamped oscillator (§5 to §11), and the harmonic cases of §4.
"""

from __future__ import annotations

import argparse

from ...analysis.stability.criterion import signed
from ..charts import figures
from . import options, show


def arguments(parser: argparse.ArgumentParser) -> None:
    options.method_words(parser)
    options.folder(parser, here=True)
    parser.add_argument("--phi", type=float, default=0.5, metavar="RAD", help="Φ = ω₀·dt (default: 0.5)")
    parser.add_argument("--periods", type=float, default=4.0, metavar="N", help="number of periods (default: 4)")
    options.json(parser)


def command(args: argparse.Namespace) -> None:
    methods = options.chosen(args)
    options.check_folder(args)

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
