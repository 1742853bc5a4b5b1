"""Find the cheapest method and step for a scene.

Ranks the steps of all methods that are accurate enough by their cost, and shows how far each is from instability.
"""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from ...errors import ArgumentError
from ...scenes import scene
from ...studies.advice import COSTS, Advice, advise
from ...studies.advice.result import COLUMNS, REASONS
from . import options, show

if TYPE_CHECKING:
    from ...base.literals import Dtypes


def arguments(parser: argparse.ArgumentParser) -> None:
    options.scene(parser)
    parser.add_argument(
        "--frame",
        default="1/60",
        metavar="TIME",
        help="time of a frame, into which a whole number of steps fits, such as 0.02 or 1/60; any for no frame (default: 1/60)",
    )
    parser.add_argument(
        "--tolerance", type=float, default=1e-2, metavar="E", help="the largest state error allowed (default: 0.01)"
    )
    parser.add_argument("--budget", type=float, metavar="S", help="seconds of computing time for a frame (default: the frame)")
    options.methods(parser)
    parser.add_argument("--cost", default="time", metavar="COST", help=f"rank by {' or '.join(COSTS)} (default: time)")
    parser.add_argument("--fixed", action="store_true", help="try fixed steps only")
    parser.add_argument("--float32", action="store_true", help="also try fixed steps in float32")
    options.file(parser, "write the full result: .json")
    options.json(parser)


def command(args: argparse.Namespace) -> None:
    chosen, frame = scene(args.scene), _frame(args.frame)
    methods = options.chosen(args)
    options.check_file(args, (".json",))

    dtype: Dtypes = "both" if args.float32 else "float64"
    with show.progress(chosen.title, args) as progress:
        advice = advise(
            chosen, frame, args.tolerance, args.budget, methods, cost=args.cost, fixed=args.fixed, dtype=dtype, progress=progress
        )
    written = show.Written()
    written.write(args.output, advice.to_json)
    if args.json:
        show.print_json(advice.data())
    elif advice.ranked:
        _print(advice, [*advice.rejections(REASONS), *written.notes()])
    else:
        rest = [advice.title, *advice.rejections(REASONS), *written.notes()]
        show.paragraphs([" ".join(advice.summary()), "", *rest], show.DOUBTFUL)
    written.close()


def _print(advice: Advice, notes: list[str]) -> None:
    """Print the advice, then the table with the best row marked, then why others are not in it."""
    per = "a unit of time" if advice.frame is None else "a frame"
    names = {"steps>": "steps>" if advice.frame is None else "steps a frame>", "ns>": f"ns {per}>"}
    columns = [names.get(name, name) for name in COLUMNS]
    explained = f"Evaluations: of functions (rates), for {per}; predicted: the error by theory"
    if advice.budget is not None:
        explained += f"; objects: so many fit into {advice.budget:.3g} s"
    place = COLUMNS.index("ns>")  # nanoseconds are shown without exponents
    show.table(
        advice.title,
        columns,
        [[*row[:place], show.number(float(row[place])), *row[place + 1 :]] for row in advice.table()],
        [f"{explained}.", *notes],
        answer=advice.summary(),
        least=("predicted", "objects", "dt"),
        marked=0,
    )


def _frame(text: str) -> float | None:
    """Parse a number, a fraction, or ``any``: None."""
    if text == "any":
        return None
    numerator, slash, denominator = text.partition("/")
    try:
        return float(numerator) / float(denominator) if slash else float(numerator)
    except (ValueError, ZeroDivisionError):
        raise ArgumentError(f"--frame: expected a time such as 0.02 or 1/60, or any, got {text!r}") from None
