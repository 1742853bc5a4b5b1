"""Draw the figures of Hoffmann (2002).

Runs each method on the undamped oscillator (§5 to §11) and says what its samples do; -o draws them, and the harmonic cases of §4.
"""

from __future__ import annotations

import argparse

from ...analysis.stability.criterion import signed
from ..charts import figures
from . import options, show


def arguments(parser: argparse.ArgumentParser) -> None:
    options.method_words(parser)
    options.folder(parser)
    parser.add_argument("--phi", type=float, default=0.5, metavar="RAD", help="Φ = ω₀·dt (default: 0.5)")
    parser.add_argument("--periods", type=float, default=4.0, metavar="N", help="number of periods (default: 4)")
    options.json(parser)


def command(args: argparse.Namespace) -> None:
    methods = options.chosen(args)
    options.check_folder(args)

    chart = figures(methods, phi=args.phi, periods=args.periods)
    written = show.Written()
    files = [] if args.output is None else [str(path) for path in written.write(args.output, chart.save) or ()]
    if args.json:
        show.print_json({"phi": chart.phi, "files": files, "summary": chart.summary()})
        written.close()
        return
    count = len(chart.samples)
    kinds = {"all in one picture": files[:1], "one by one": files[1 : 1 + count]}
    kinds["harmonic cases and numbers"] = files[1 + count :]
    show.table(
        f"The undamped oscillator with Φ = {chart.phi:g}",
        ("method", "r₁² − 1>", "Ψ/Φ − 1>", "what the samples do", "largest |y|>"),
        [
            (
                s["title"],
                signed(s["r1_squared"] - 1.0),
                signed(s["ratio"] - 1.0, percent=True),
                s["kind"],
                f"{s['largest_y']:.4g}",
            )
            for s in chart.summary()
        ],
        [f"{name}: {', '.join(each)}" for name, each in kinds.items() if each] or [show.ASK_FOR_PICTURES],
        least=("largest |y|",),
    )
    written.close()
