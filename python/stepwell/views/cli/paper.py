"""Check the statements of Hoffmann (2002) one by one.

Runs each statement and prints the numbers that confirm or correct it; -o draws the figures, too.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from ...errors import StepwellError
from .. import paper
from . import options, show


def arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("section", nargs="?", metavar="SECTION", help='one section, such as 7 or "App. C" (default: all)')
    options.folder(parser, "draw the figures into this folder")
    options.json(parser)


def command(args: argparse.Namespace) -> None:
    section = args.section
    if section is not None:
        section = f"§{section}" if section.isdigit() else f"App. {section}" if len(section) == 1 else section
    chosen = paper.entries(section)
    options.check_folder(args)

    runs = [entry.run() for entry in chosen]
    written = show.Written()
    if args.output is not None and any(entry.draw for entry in chosen):
        written.files = [str(path) for path in written.write(args.output, lambda folder: paper.draw(folder, section)) or ()]
    if args.json:
        rows = [
            {name: getattr(entry, name) for name in ("section", "kind", "name", "says", "here", "corrected", "picture")}
            | run._asdict()
            for entry, run in zip(chosen, runs, strict=True)
        ]
        show.print_json({"statements": rows, "files": written.files})
    else:
        _statements(chosen, runs)
        show.paragraphs(written.notes())
    written.close()
    if failed := [entry.name for entry, run in zip(chosen, runs, strict=True) if not run.holds]:
        raise StepwellError(f"not reproduced: {', '.join(failed)}")


def _statements(chosen: Sequence[paper.Entry], runs: Sequence[paper.Finding]) -> None:
    """Print each statement with its correction and its numbers below it; how many hold comes first."""
    holding = sum(run.holds for run in runs)
    show.paragraphs([f"{holding} of {len(runs)} statements of Hoffmann (2002) are reproduced."], show.GOOD)
    for entry, run in zip(chosen, runs, strict=True):
        print()
        mark, code = ("✓", show.GOOD) if run.holds else ("✗ not reproduced", show.BAD)
        rows = [(entry.section, f"{mark} {entry.says}", show.STRONG if run.holds else code)]
        rows += [("  correction", plain(entry.corrected), "")] if entry.corrected else []
        show.facts([*rows, ("  numbers", run.numbers, "")])


def plain(text: str) -> str:
    """The text without the backticks of code."""
    return text.replace("`", "")
