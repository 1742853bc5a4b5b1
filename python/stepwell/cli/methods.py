"""List the methods, or describe one."""

from __future__ import annotations

import argparse
from typing import Any

from ..methods import Method, method, methods
from . import show


def arguments(parser: argparse.ArgumentParser) -> None:
    """What the command takes."""
    parser.add_argument("name", nargs="?", help="a method, such as false_euler")
    show.json_option(parser)


def command(args: argparse.Namespace) -> None:
    """List the methods, or describe one."""
    if args.name is not None:
        one = method(args.name)
        if args.json:
            show.print_json(_record(one))
        else:
            print(one.__doc__)
        return
    if args.json:
        show.print_json([_record(m) for m in methods()])
        return
    show.table(
        "Methods",
        ("method", "title", "also called", "section", "order>", "evaluations>", "oscillator stable for"),
        [
            (
                m.name,
                m.title,
                m.other_names[0] if m.other_names else "",
                m.section,
                str(m.order),
                str(m.evaluations),
                f"Φ < {m.limit:.6g}" if m.limit else "no Φ",
            )
            for m in methods()
        ],
    )


def _record(method: Method) -> dict[str, Any]:
    return {key: value for key, value in vars(method).items() if not key.startswith("_")}
