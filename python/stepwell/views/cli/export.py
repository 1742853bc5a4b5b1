"""Write a step as C, JavaScript, Python or Rust.

The source file needs nothing else, so that games and other programs can use it.
"""

from __future__ import annotations

import argparse
from typing import Any

from ...base import checks
from ...scenes import scene, scenes
from ...source.exports import LANGUAGES, export
from . import options, show
from .explain import system_and_control


def arguments(parser: argparse.ArgumentParser) -> None:
    options.system(parser)
    parser.add_argument("--method", required=True, metavar="METHOD", help="a method; see stepwell methods")
    parser.add_argument("--language", required=True, metavar="LANGUAGE", help=f"one of {', '.join(LANGUAGES)}")
    parser.add_argument(
        "--dt", type=float, metavar="H", help="the initial value of the step in the file (default: the scene's, or 0.01)"
    )
    options.start(parser)
    options.numbers(parser)
    parser.add_argument("--name", metavar="NAME", help="the name or prefix of functions and types")
    options.file(parser, "write the source to a file instead of printing it")
    options.json(parser)


def command(args: argparse.Namespace) -> None:
    system, control = system_and_control(args.system)
    language = LANGUAGES[checks.known("language", args.language, tuple(LANGUAGES))]
    options.check_file(args, language.endings)
    state: dict[str, Any] = {}
    if args.system in [each.name for each in scenes()]:
        one = scene(args.system)
        state = {"v": one.v, "y": one.y, "dt": one.dt}
    if args.dt is not None:
        state["dt"] = args.dt
    step = export(
        system,
        args.method,
        args.language,
        start=args.start,
        control=control,
        fused=args.fused,
        name=args.name,
        dtype=options.dtype(args),
        **state,
    )
    written = show.Written()
    written.write(args.output, step.save)
    if args.json:
        show.print_json(step.as_dict())
    else:
        print("\n".join(written.notes()) if written.files else step.source.removesuffix("\n"))
    written.close()
