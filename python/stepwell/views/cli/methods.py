"""List the methods, or describe one."""

from __future__ import annotations

import argparse
from typing import Any

from ...errors import ArgumentError
from ...model.methods import Method, method, methods, stable_for
from . import options, show
from .show import HOFFMANN, section


def arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("name", nargs="?", help="a method by any of its names, such as false_euler or RK4")
    options.file(parser, show.TABLE_TEXT)
    options.json(parser)


def command(args: argparse.Namespace) -> None:
    if args.name is not None:
        one = method(args.name)
        if args.output is not None:
            raise ArgumentError("-o: expected no METHOD beside it; the file is the table of all methods")
        if args.json:
            show.print_json(_record(one))
        else:
            show.paragraphs([one.__doc__ or ""], show.STRONG)
        return
    show.listing(
        args,
        "Methods",
        ("method", "order>", "function evaluations>", "oscillator stable for", "title", "also called", HOFFMANN),
        [
            (m.name, str(m.order), str(m.evaluations), stable_for(m.limit), m.title, "; ".join(m.other_names), section(m.section))
            for m in methods()
        ],
        [_record(m) for m in methods()],
        ["stepwell methods NAME describes one."],
        least=(HOFFMANN, "also called", "title"),
    )


def _record(method: Method) -> dict[str, Any]:
    return {key: value for key, value in vars(method).items() if not key.startswith("_")}
