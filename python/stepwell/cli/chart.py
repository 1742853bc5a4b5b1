"""Chart error against cost: a picture and a table of numbers for each scene, and a summary."""

from __future__ import annotations

import argparse
import math
from contextlib import nullcontext
from pathlib import Path

from ..charts import WorkPrecision, work_precision
from ..charts.data import TARGETS
from ..charts.work_precision import chartable
from ..methods import method
from ..scenes import scene
from . import show


def arguments(parser: argparse.ArgumentParser) -> None:
    """What the command takes."""
    parser.add_argument("scenes", nargs="+", metavar="SCENE", help="a scene; see stepwell scenes")
    parser.add_argument("-o", "--output", type=Path, default=Path(), metavar="DIR", help="where to (default: here)")
    parser.add_argument("--methods", metavar="A,B,…", help="which methods (default: all)")
    show.json_option(parser)


def command(args: argparse.Namespace) -> None:
    """Measure, draw, write, summarise."""
    # All names are looked up, and what is needed is there, before any work.
    chosen = [chartable(scene(name)) for name in args.scenes]
    methods = None if args.methods is None else [method(name.strip()) for name in args.methods.split(",")]
    if not args.json:
        show.need_rich()
    args.output.mkdir(parents=True, exist_ok=True)

    done = []
    for one in chosen:
        with nullcontext(None) if args.json else show.progress(one.title) as told:
            chart = work_precision(one, methods, progress=told)
        files = [args.output / f"{one.name}{ending}" for ending in (".png", ".csv")]
        chart.plot(files[0])
        chart.to_csv(files[1])
        done.append((chart, [str(file) for file in files]))
    if args.json:
        show.print_json(
            [{"scene": c.scene.name, "files": files, "summary": c.summary(), "refused": c.refused} for c, files in done]
        )
        return
    for chart, files in done:
        _summary(chart, files)


def _summary(chart: WorkPrecision, files: list[str]) -> None:
    rows = [
        (
            curve.method.title,
            str(curve.method.order),
            *(_number(curve.cheapest(error)) for error in TARGETS),
            _number(row["least_error"]),
            "all" if curve.largest_stable_step == math.inf else f"{curve.largest_stable_step:#.3g}",
            f"{curve.step_time.median:.2g}",
        )
        for curve, row in zip(chart.curves, chart.summary(), strict=True)
    ]
    show.table(
        f"{chart.scene.title}: rate evaluations per unit of time that an error takes",
        (
            "method",
            "order>",
            *(f"error {error:g}>" for error in TARGETS),
            "least error>",
            "stable to dt>",
            "ns a step>",
        ),
        rows,
        [f"{method(name).title} is refused: {reason}" for name, reason in chart.refused.items()]
        + [f"written: {', '.join(files)}"],
    )


def _number(value: float) -> str:
    return f"{value:.3g}" if math.isfinite(value) else "–"
