"""Explain a step: every operation, by name.

Shows how often each is computed, and the machine code of the step.
"""

from __future__ import annotations

import argparse

from ...base import checks
from ...errors import ArgumentError, StepwellError, UnknownNameError
from ...model import systems
from ...model.controls import AnyControl
from ...model.systems import System
from ...scenes import FILE, scene, scenes
from ...source.explanation import explain
from . import options, show


def arguments(parser: argparse.ArgumentParser) -> None:
    options.system(parser)
    parser.add_argument("method", metavar="METHOD", help="a method; see stepwell methods")
    parser.add_argument("--members", type=int, metavar="N", help="members (trajectories) of the batch (default: 1)")
    options.numbers(parser)
    parser.add_argument("--attempt", action="store_true", help="explain a trial step of adaptive step-size control")
    parser.add_argument(
        "--form",
        default="direct",
        choices=("direct", "matrix"),
        help="step by the method's formulas (direct) or by the transition matrix",
    )
    options.start(parser)
    parser.add_argument("--record", action="append", default=[], metavar="NAME", help="also list this quantity, such as energy")
    options.file(parser, "write the explanation: .json, .html or .txt")
    options.json(parser)


def command(args: argparse.Namespace) -> None:
    system, control = system_and_control(args.system)
    options.check_file(args, (".json", ".html", ".txt"))
    explained = explain(
        system,
        args.method,
        members=args.members,
        control=control,
        fused=args.fused,
        attempt=args.attempt,
        form=args.form,
        start=args.start,
        record=args.record,
        dtype=options.dtype(args),
    )
    written = show.Written()
    if args.output is not None:
        if args.output.suffix == ".json":
            written.write(args.output, explained.to_json)
        else:
            text = explained._repr_html_() if args.output.suffix == ".html" else str(explained)
            written.write(args.output, lambda path: path.write_text(text + "\n", encoding="utf-8"))
    if args.json:
        show.print_json(explained.as_dict())
    else:
        show.paragraphs([str(explained), *written.notes()], show.STRONG)
    written.close()


def system_and_control(name: str) -> tuple[System, AnyControl | None]:
    """The system and the control of a scene, or the system of a class with its default parameters."""
    kind = getattr(systems, name, None)
    if isinstance(kind, type) and issubclass(kind, System) and kind is not System:
        try:
            return kind(), None
        except (StepwellError, TypeError):
            raise ArgumentError(f"system: {name} needs arguments; name a scene, or use stepwell.explain in Python") from None
    known = [each.name for each in scenes()]
    if name not in known and not FILE.fullmatch(name):
        classes = [each for each in systems.__all__ if isinstance(getattr(systems, each), type) and each != "System"]
        raise UnknownNameError(
            f"system: there is no {checks.short(name)}; expected a scene, {', '.join(known)}, or a system, "
            f"{', '.join(each for each in classes if issubclass(getattr(systems, each), System))}"
        )
    one = scene(name)
    return one.system.for_state_shapes(one.v, one.y), one.control
