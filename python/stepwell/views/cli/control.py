"""Chart the errors of a controlled system over the gain.

The controlled quantity is the energy of bodies or the lengths of rods. Prints the least errors; -o draws them.
"""

from __future__ import annotations

import argparse
from typing import Any

from ...errors import ArgumentError
from ...model.methods import method
from ...scenes import scene
from ..charts import ControlSweep, control
from ..charts.control import METHODS
from ..charts.picture import title_of
from . import options, show

#: The numbers of the summary that the table shows.
LEAST = ("least_state_error", "state_at_relative", "least_energy_error", "diverged_from")


def arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("scene", metavar="SCENE", help="a scene of bodies or rods, or a Python file that makes one")
    options.folder(parser)
    parser.add_argument("--methods", metavar="A,B,…", help=f"methods, separated by commas (default: {','.join(METHODS)})")
    parser.add_argument("--gains", metavar="A,B,…", help="gains, separated by commas: h·C·K at the start for bodies, c for rods")
    parser.add_argument(
        "--evaluations",
        metavar="N,M,…",
        help="function evaluations of a run, separated by commas; each number gives another step",
    )
    parser.add_argument(
        "--horizon", type=float, metavar="T", help="the duration of each run in units of time (default: the scene's)"
    )
    options.json(parser)


def command(args: argparse.Namespace) -> None:
    one = scene(args.scene)
    arguments: dict[str, Any] = {"horizon": args.horizon}
    if args.methods is not None:
        arguments["methods"] = [method(name.strip()) for name in args.methods.split(",")]
    if args.gains is not None:
        arguments["relative"] = _numbers("--gains", args.gains, float)
    if args.evaluations is not None:
        arguments["evaluations"] = _numbers("--evaluations", args.evaluations, int)
    name = f"{one.name}-control"
    options.check_folder(args, [name + ending for ending in (".png", ".csv")])
    if args.output is not None:
        args.output.mkdir(parents=True, exist_ok=True)
    with show.progress(one.title, args) as progress:
        chart = control(one, progress=progress, **arguments)
    written = show.Written()
    if args.output is not None:
        written.write(args.output / f"{name}.png", chart.plot)
        written.write(args.output / f"{name}.csv", chart.to_csv)
    if args.json:
        refused = [{"method": key, "kind": kind, "reason": why} for (key, kind), why in chart.refused.items()]
        head = {"scene": one.name, "files": written.files, "evaluations": list(chart.evaluations)}
        show.print_json(head | {"answer": chart.answer, "summary": chart.summary(), "refused": refused})
    else:
        _summary(chart, written.files)
    written.close()


def _numbers(option: str, text: str, kind: type[int] | type[float]) -> list[Any]:
    try:
        return [kind(word) for word in text.split(",")]
    except ValueError:
        raise ArgumentError(f"{option}: expected numbers with commas between them, got {text!r}") from None


def _summary(chart: ControlSweep, files: list[str]) -> None:
    rows = [
        (title_of(row["method"]), row["kind"], f"{row['dt']:.4g}", *(show.number(row[name]) for name in LEAST))
        for row in chart.summary()
    ]
    show.table(
        f"{chart.title}: the least errors over the gains",
        ("method", "control", "dt>", "state error>", "at gain>", "energy error>", "diverged from gain>"),
        rows,
        [f"{title_of(name)}, {kind}, is refused: {why}" for (name, kind), why in chart.refused.items()]
        + [f"written: {', '.join(files)}" if files else show.ASK_FOR_PICTURES],
        answer=[chart.answer] if chart.answer else [],
    )
