"""Chart where methods are stable.

Prints the largest stable steps; -o draws the eigenvalues of a step, its growth or damping, and stability maps.
"""

from __future__ import annotations

import argparse
import math
from functools import partial
from pathlib import Path

from ...base import checks
from ...errors import ArgumentError, UnsupportedError
from ...model.methods import method
from ..charts import Stability, stability, stability_map
from ..charts.zplane import KINDS, ladder, within
from . import options, show

#: The charts: those of all methods, and the map of each.
CHARTS = (*KINDS, "map")


def arguments(parser: argparse.ArgumentParser) -> None:
    options.method_words(parser)
    options.folder(parser, "draw the charts into this folder")
    parser.add_argument(
        "--charts", metavar="A,B,…", help=f"charts to draw, separated by commas: {', '.join(CHARTS)} (default: all)"
    )
    parser.add_argument("--phi", type=float, metavar="RAD", help="the largest Φ = ω₀·dt (default: past the largest limit)")
    options.json(parser)


def command(args: argparse.Namespace) -> None:
    # Check every name and requirement before any work.
    methods = options.chosen(args)
    names = CHARTS if args.charts is None else tuple(name.strip() for name in args.charts.split(","))
    kinds = [checks.known("--charts", name, CHARTS) for name in dict.fromkeys(names)]
    if args.charts is not None and args.output is None:
        raise ArgumentError("-o: expected a folder for the charts of --charts, got none")
    top = None if args.phi is None else within("--phi", checks.number("--phi", args.phi, positive=True, unit="rad"))
    options.check_folder(args, ["stability.csv", *(f"stability-{kind}.png" for kind in kinds)])

    chart = stability(methods, phi=None if top is None else ladder(top))
    written = show.Written()
    refused = {} if args.output is None else _write(chart, args.output, kinds, top, written)
    if args.json:
        show.print_json({"files": written.files, "summary": chart.summary(), "refused": refused})
        written.close()
        return
    rows = [
        (
            row["title"],
            limit_of(row["limit"]),
            f"{row['samples_per_period']:.4g}" if row["samples_per_period"] and row["limit"] else "–",
            row["leaves_by"] or "–",
            row["r1_squared_minus_1"],
            row["frequency_deviation"],
        )
        for row in chart.summary()
    ]
    show.table(
        "Stability of the undamped oscillator, Φ = ω₀·dt",
        ("method", "stable for Φ <>", "steps a period >>", "past that", "r₁² − 1", "Ψ/Φ − 1"),
        rows,
        [f"no map of {method(name).title}: {reason}" for name, reason in refused.items()]
        + (written.notes() or [show.ASK_FOR_PICTURES]),
        least=("Ψ/Φ − 1", "r₁² − 1", "past that"),
    )
    written.close()


def limit_of(limit: float) -> str:
    """A limit of stability as tables show it."""
    return "never" if not limit else "every" if math.isinf(limit) else f"{limit:.7g}"


def _write(chart: Stability, folder: Path, kinds: list[str], top: float | None, written: show.Written) -> dict[str, str]:
    """Write the charts; return the reasons why some methods have no map."""
    folder.mkdir(parents=True, exist_ok=True)
    for kind in kinds:
        if kind in KINDS:
            written.write(folder / f"stability-{kind}.png", partial(chart.plot, kind=kind))
    written.write(folder / "stability.csv", chart.to_csv)
    refused = {}
    for locus in chart.loci if "map" in kinds else ():
        try:
            drawn = stability_map(locus.method) if top is None else stability_map(locus.method, phi=(0.0, top))
        except UnsupportedError as error:
            refused[locus.method.name] = str(error)
            continue
        written.write(folder / f"stability-map-{locus.method.name}.png", drawn.plot)
    return refused
