"""Judge methods by the four criteria of Hoffmann (2002).

The criteria are stability, error of the frequency, operations per step and the largest stable step (§1).
"""

from __future__ import annotations

import argparse

from ...analysis.stability import Criteria, criteria
from ...analysis.stability.criterion import PHI
from ...errors import ArgumentError
from . import options, show


def arguments(parser: argparse.ArgumentParser) -> None:
    options.method_words(parser)
    default = ",".join(f"{phi:g}" for phi in PHI)
    parser.add_argument(
        "--phi", default=default, metavar="A,B,…", help=f"values of Φ = ω₀·dt at which errors are shown (default: {default})"
    )
    parser.add_argument("--markdown", action="store_true", help="print a single table in Markdown")
    options.file(parser, "write the result: .json or .md")
    options.json(parser)


def command(args: argparse.Namespace) -> None:
    methods = options.chosen(args)
    try:
        phi = [float(text) for text in args.phi.split(",")]
    except ValueError:
        raise ArgumentError(f"--phi: expected numbers in rad, such as 0.1,0.5, got {args.phi!r}") from None
    if args.json and args.markdown:
        raise ArgumentError("--markdown: expected either this or --json, got both")
    options.check_file(args, (".json", ".md"))

    answers = criteria(methods, phi=phi)
    written = show.Written()
    if args.output is not None and args.output.suffix == ".json":
        written.write(args.output, answers.to_json)
    elif args.output is not None:
        written.write(args.output, lambda path: path.write_text(answers.markdown(), encoding="utf-8"))
    if args.json:
        show.print_json(answers.rows())
    elif args.markdown:
        print(answers.markdown(), end="")
    else:
        _table(answers, written.notes())
    written.close()


def _table(answers: Criteria, notes: list[str]) -> None:
    """Print one table; in a narrow terminal the series, the fewer operations and the errors at further Φ are left out."""
    head, rows = answers.table()
    names = [name.removesuffix(">") for name in head]
    least = [*names[3:5], "÷", "√", "steps a period >", *reversed([name for name in names if " at " in name]), "×", "+"]
    show.table(
        "The criteria of Hoffmann (2002), with Φ = ω₀·dt",
        head,
        [[row[0], {"inf": "every"}.get(row[1], row[1]), {"0": "–"}.get(row[2], row[2]), *row[3:]] for row in rows],
        ["r₁² − 1: the energy that a step adds, as a share. Ψ/Φ − 1: the error of the frequency.", *notes],
        least=least,
    )
