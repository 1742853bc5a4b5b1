"""Advise on a scene: the cheapest method and step.

That is, of those that are accurate enough; and how far they are from blowing up.
"""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from ...errors import ArgumentError
from ...scenes import scene
from ...studies.advice import COSTS, advise
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
        help="units of time into which a whole number of steps must fit, such as 0.02 or 1/60; any for any step (default: 1/60)",
    )
    parser.add_argument("--tolerance", type=float, default=1e-2, metavar="E", help="largest state error allowed (default: 0.01)")
    parser.add_argument("--budget", type=float, metavar="S", help="seconds of computing in a frame (default: the frame)")
    options.methods(parser)
    parser.add_argument("--cost", default="time", metavar="COST", help=f"what to rank by: {' or '.join(COSTS)} (default: time)")
    parser.add_argument("--fixed", action="store_true", help="fixed steps only, none adaptive")
    parser.add_argument("--float32", action="store_true", help="also fixed steps in float32, beside float64")
    options.file(parser, "write all of it: .json")
    options.json(parser)


def command(args: argparse.Namespace) -> None:
    chosen, frame = scene(args.scene), _frame(args.frame)
    methods = options.chosen(args)
    options.check_file(args, (".json",))

    dtype: Dtypes = "both" if args.float32 else "float64"
    advice = advise(chosen, frame, args.tolerance, args.budget, methods, cost=args.cost, fixed=args.fixed, dtype=dtype)
    written = show.Written()
    written.write(args.output, advice.to_json)
    rejected = advice.rejections(REASONS)
    if args.json:
        show.print_json(advice.data())
    elif advice.ranked:
        show.table(advice.title, COLUMNS, advice.table(), [*advice.summary(), "", *rejected, *written.notes()])
    else:
        show.paragraphs([advice.title, *advice.summary(), "", *rejected, *written.notes()])
    written.close()


def _frame(text: str) -> float | None:
    """The frame from what is typed: a number, a fraction, or any."""
    if text == "any":
        return None
    numerator, slash, denominator = text.partition("/")
    try:
        return float(numerator) / float(denominator) if slash else float(numerator)
    except (ValueError, ZeroDivisionError):
        raise ArgumentError(f"--frame: expected a time such as 0.02 or 1/60, or any, got {text!r}") from None
