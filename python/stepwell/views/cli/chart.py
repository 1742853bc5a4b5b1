"""Chart the error of methods against their cost.

Prints which method is the cheapest for which error; -o writes pictures and tables of numbers.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from functools import partial
from typing import Any

from ...errors import ArgumentError
from ...model.methods import Method
from ...scenes import Scene, scene
from ...studies.measuring.data import ERRORS, TARGETS
from ..charts import Panel, WorkPrecision, work_precision
from ..charts.picture import finding, title_of
from . import options, show

#: A state of more numbers than this would take many minutes by all methods.
MOST_NUMBERS = 1000


def arguments(parser: argparse.ArgumentParser) -> None:
    options.scene(parser, "scenes", "kepler:e=0.5", nargs="+")
    options.folder(parser)
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
    _not_for_minutes(chosen, methods)
    if args.output is not None:
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
        if args.output is not None:
            written.write(args.output / f"{one.name}.png", partial(chart.plot, error=args.error))
            written.write(args.output / f"{one.name}.csv", chart.to_csv)
        done.append((chart, written.files[before:]))
    if args.panel and args.output is not None:
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
        for i, (chart, files) in enumerate(done):
            if i:
                print()
            _summary(chart, files, args.error)
    written.close()


def _not_for_minutes(chosen: Sequence[Scene], methods: Sequence[Method] | None) -> None:
    """Raise an error before any work if all methods would take many minutes."""
    for one in chosen:
        if methods is None and (numbers := one.v.size + one.y.size) > MOST_NUMBERS:
            raise ArgumentError(
                f"--methods: expected some for {one.name}, such as leapfrog,rk4: its state is {numbers} numbers, for which a "
                f"chart of all methods takes many minutes; stepwell advise {one.name} finds the cheapest sooner"
            )


def _summary(chart: WorkPrecision, files: list[str], error: str) -> None:
    rows = [
        (
            curve.title,
            "–" if curve.method.order is None else str(curve.method.order),
            *(show.number(curve.cheapest(target)) for target in TARGETS),
            show.number(row["least_error"]),
            {math.inf: "all", 0.0: "none"}.get(curve.largest_stable_step) or show.number(curve.largest_stable_step),
            show.number(float(f"{curve.step_time.median:.2g}")),
        )
        for curve, row in zip(chart.curves, chart.summary(), strict=True)
    ]
    best = chart.best(TARGETS[0])
    reasons: dict[str, list[str]] = {}
    for name, reason in chart.refused.items():
        reasons.setdefault(reason.removeprefix(f"{name} "), []).append(title_of(name))
    show.table(
        "Function evaluations per unit of time for an error",
        ("method", "order>", *(f"error {target:g}>" for target in TARGETS), "least error>", "stable to dt>", "ns a step>"),
        rows,
        ([f"stiff: {chart.stiff}"] if chart.stiff else [])
        + [f"not applicable: {', '.join(names)} ({reason})" for reason, names in reasons.items()]
        + [f"written: {', '.join(files)}" if files else show.ASK_FOR_PICTURES],
        answer=[f"{chart.scene.title}: {finding(chart, error)}.", *_best(chart)],
        least=("order", *(f"error {target:g}" for target in TARGETS[1::2]), "ns a step"),
        marked=next((i for i, curve in enumerate(chart.curves) if best is not None and curve.name == best["method"]), None),
    )


def _best(chart: WorkPrecision) -> list[str]:
    """The cheapest method for each target error, in one line."""
    rows = [(error, row) for error in TARGETS if (row := chart.best(error)) is not None]
    text = "; ".join(f"for {error:g} {row['method'].replace(', tolerance', '')} ({_step(row)})" for error, row in rows)
    return [f"Cheapest {text}."] if text else []


def _step(row: dict[str, Any]) -> str:
    return f"dt = {row['dt']:.3g}" if row["tolerance"] is None else f"tolerance {row['tolerance']:.3g}"
