"""Write a step as C, JavaScript, Python or Rust.

For use in an engine.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from ...base import checks
from ...scenes import scene, scenes
from ...source.exports import LANGUAGES, export
from . import show
from .explain import system_and_control


def arguments(parser: argparse.ArgumentParser) -> None:
    """The arguments of the command."""
    parser.add_argument(
        "system",
        metavar="SYSTEM",
        help="a scene (see stepwell scenes), a Python file that makes one, or a system by its class, such as Pendulum",
    )
    parser.add_argument("--method", required=True, metavar="METHOD", help="a method; see stepwell methods")
    parser.add_argument("--language", required=True, metavar="LANGUAGE", help=f"{', '.join(LANGUAGES)}")
    parser.add_argument(
        "--dt", type=float, metavar="H", help="the step that the file begins with (default: the scene's, or 0.01)"
    )
    parser.add_argument("--start", metavar="START", help="how a method with a choice starts")
    parser.add_argument("--fused", action="store_true", help="with fused multiply-adds")
    parser.add_argument("--float32", action="store_true", help="in float32, with half the digits")
    parser.add_argument("--name", metavar="NAME", help="what functions and types are called, or begin with")
    parser.add_argument("-o", "--output", type=Path, metavar="FILE", help="write it there instead of printing it")
    show.json_option(parser)


def command(args: argparse.Namespace) -> None:
    """Export the step, write it, and report that."""
    system, control = system_and_control(args.system)
    language = LANGUAGES[checks.known("language", args.language, tuple(LANGUAGES))]
    if args.output is not None:
        checks.file("-o", args.output, language.endings)
    state: dict[str, Any] = {}
    if args.system in [each.name for each in scenes()]:
        found = scene(args.system)
        state = {"v": found.v, "y": found.y, "dt": found.dt}
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
        dtype="float32" if args.float32 else "float64",
        **state,
    )
    written = show.Written()
    if args.output is not None:
        written.write(args.output, step.save)
    if args.json:
        show.print_json(step.as_dict())
    else:
        print("\n".join(written.notes()) if written.files else step.source.removesuffix("\n"))
    written.close()
