"""Chart the error of methods against their cost.

Prints a summary of each scene, and writes its picture and its table of numbers.
"""

from __future__ import annotations

import argparse
import math
from functools import partial
from typing import Any

from ...scenes import scene
from ...studies.measuring.data import ERRORS, TARGETS
from ..charts import Panel, WorkPrecision, work_precision
from ..charts.picture import title_of
from . import options, show


def arguments(parser: argparse.ArgumentParser) -> None:
    options.scene(parser, "scenes", "kepler:e=0.5", nargs="+")
    options.folder(parser, here=True)
    options.methods(parser)
    parser.add_argument("--panel", action="store_true", help="write one picture and one table of all scenes")
    parser.add_argument("--fused", action="store_true", help="add a curve of each method with fused multiply-adds")
    parser.add_argument("--float32", action="store_true", help="add a curve of each method in float32")
    parser.add_argument(
        "--error", choices=ERRORS, default=ERRORS[0], help="the error that the pictures show (default: %(default)s)"
    )
    options.json(parser)


def command(args: argparse.Namespace) -> None:
    # Check every name and requirement before any work.
    chosen = [scene(name) for name in args.scenes]
    methods = options.chosen(args)
    names = ["panel"] if args.panel else [one.name for one in chosen]
    options.check_folder(args, [name + ending for name in names for ending in (".png", ".csv", ".json")])
    args.output.mkdir(parents=True, exist_ok=True)

    written = show.Written()
    done: list[tuple[WorkPrecision, list[str]]] = []
    for one in chosen:
        with show.progress(one.title, args) as progress:
            ways: Any = {"fused": "both" if args.fused else False, "dtype": "both" if args.float32 else "float64"}
            chart = work_precision(one, methods, **ways, progress=progress)
        if args.panel:
            done.append((chart, []))
            continue
        before = len(written.files)
        written.write(args.output / f"{one.name}.png", partial(chart.plot, error=args.error))
        written.write(args.output / f"{one.name}.csv", chart.to_csv)
        done.append((chart, written.files[before:]))
    if args.panel:
        whole = Panel(tuple(chart for chart, _ in done))
        written.write(args.output / "panel.png", partial(whole.plot, error=args.error))
        written.write(args.output / "panel.csv", whole.to_csv)
        written.write(args.output / "panel.json", whole.to_json)
        done = [(chart, written.files) for chart, _ in done]
    if args.json:
        show.print_json(
            [
                {"scene": c.scene.name, "files": files, "summary": c.summary(), "front": c.front(), "refused": c.refused}
                for c, files in done
            ]
        )
    else:
        for chart, files in done:
            _summary(chart, files)
    written.close()


def _summary(chart: WorkPrecision, files: list[str]) -> None:
    rows = [
        (
            curve.title,
            "–" if curve.method.order is None else str(curve.method.order),
            *(show.number(curve.cheapest(error)) for error in TARGETS),
            show.number(row["least_error"]),
            "all" if curve.largest_stable_step == math.inf else f"{curve.largest_stable_step:#.3g}",
            show.number(float(f"{curve.step_time.median:.2g}")),
        )
        for curve, row in zip(chart.curves, chart.summary(), strict=True)
    ]
    show.table(
        f"{chart.scene.title}: function evaluations per unit of time for an error",
        (
            "method",
            "order>",
            *(f"error {error:g}>" for error in TARGETS),
            "least error>",
            "stable to dt>",
            "ns a step>",
        ),
        rows,
        ([f"stiff: {chart.stiff}"] if chart.stiff else [])
        + _best(chart)
        + [f"{title_of(name)} is refused: {reason}" for name, reason in chart.refused.items()]
        + ([f"written: {', '.join(files)}"] if files else []),
    )


def _best(chart: WorkPrecision) -> list[str]:
    """The cheapest method for each target error, in one line."""
    rows = [(error, row) for error in TARGETS if (row := chart.best(error)) is not None]
    text = "; ".join(f"for {error:g} {row['method']} ({_step(row)})" for error, row in rows)
    return [f"cheapest: {text}"] if text else []


def _step(row: dict[str, Any]) -> str:
    return f"dt = {row['dt']:.3g}" if row["tolerance"] is None else f"tolerance {row['tolerance']:.3g}"
